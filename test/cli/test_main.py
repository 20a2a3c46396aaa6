# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What all commands share: complaints, exit status, examples, generated page."""

from __future__ import annotations

import shlex
import types

import pytest

from wheel_terra_estimator import __version__
from wheel_terra_estimator.cli import documentation, main
from wheel_terra_estimator.errors import UserError


def complaint(capsys, *arguments):
    """Return exit status and the complaint of a command line that argparse refuses."""
    with pytest.raises(SystemExit) as end:
        main.main(list(arguments))
    said = capsys.readouterr().err
    assert said.count('\n') == 1
    return end.value.code, said


def test_version(capsys):
    with pytest.raises(SystemExit) as end:
        main.main(['--version'])
    assert end.value.code == 0
    assert capsys.readouterr().out.split()[-1] == __version__


def test_a_mistyped_command_gets_the_nearest(capsys):
    status, said = complaint(capsys, 'repaly')
    assert status == 2
    assert "did you mean 'replay'?" in said


def test_a_mistyped_option_gets_the_nearest(capsys):
    status, said = complaint(capsys, 'replay', 'bag', '--confg', 'rover')
    assert status == 2
    assert "no option '--confg'; did you mean '--config'?" in said


def test_a_mistyped_choice_gets_the_nearest(capsys):
    _, said = complaint(capsys, 'predict', '--method', 'quadratur')
    assert "did you mean 'quadrature'?" in said


def test_one_argument_too_many(capsys):
    _, said = complaint(capsys, 'replay', 'bag', 'other', 'third', '--nonsense')
    assert 'wheel-terra replay' in said


@pytest.fixture
def broken(monkeypatch):
    """A command that fails as told."""

    def make(error):
        module = types.ModuleType('wheel_terra_estimator.cli.broken')
        module.add_arguments = lambda parser: None

        def run(arguments):
            raise error

        module.run = run
        monkeypatch.setitem(main.sys.modules, module.__name__, module)
        monkeypatch.setattr(main, 'COMMANDS', {'broken': 'fails'})

    return make


@pytest.mark.parametrize(
    ('error', 'status', 'words'),
    [
        (UserError('rows.csv: row 3: empty; fill it'), 2, 'rows.csv: row 3'),
        (ZeroDivisionError('oh'), 3, 'ZeroDivisionError: oh'),
        (KeyboardInterrupt(), 130, 'interrupted'),
    ],
)
def test_errors_are_one_line(broken, capsys, error, status, words):
    broken(error)
    assert main.main(['broken']) == status
    said = capsys.readouterr().err
    assert words in said
    assert said.count('\n') == 1
    assert '\033' not in said


@pytest.mark.parametrize('arguments', [['broken', '--debug'], ['--debug', 'broken']])
def test_debug_shows_the_traceback(broken, arguments):
    broken(ZeroDivisionError('oh'))
    with pytest.raises(ZeroDivisionError):
        main.main(arguments)


def test_red_on_a_terminal_only(broken, monkeypatch, capsys):
    broken(UserError('no'))
    monkeypatch.setattr(main.sys.stderr, 'isatty', lambda: True, raising=False)
    monkeypatch.delenv('NO_COLOR', raising=False)
    main.main(['broken'])
    assert capsys.readouterr().err.startswith('\033[31m')
    monkeypatch.setenv('NO_COLOR', '1')
    main.main(['broken'])
    assert '\033' not in capsys.readouterr().err


def examples():
    for name in main.COMMANDS:
        module = main.command_module(name)
        for line in getattr(module, 'EXAMPLES', ()):
            yield pytest.param(line, id=line[:40])


@pytest.mark.parametrize('line', list(examples()))
def test_examples_of_the_help_parse(line):
    own, _, _ = line.partition(' > ')  # what follows is the shell's
    program, *arguments = shlex.split(own)
    assert program == 'wheel-terra'
    if '--help' not in arguments:
        main.build_parser().parse_args(arguments)


def test_every_command_has_examples_and_a_debug_option():
    for name, parser in main.sub_parsers().items():
        assert 'examples:' in (parser.epilog or ''), name
        assert '--debug' in parser.format_help(), name


def test_completion():
    pytest.importorskip('shtab')
    with pytest.raises(SystemExit) as end:
        main.main(['--print-completion', 'bash'])
    assert end.value.code == 0


def test_the_page_of_commands_is_that_of_the_parsers():
    assert documentation.path().read_text(encoding='utf-8') == documentation.page(), (
        'run python -m wheel_terra_estimator.cli.documentation'
    )


def test_ctrl_c_while_the_commands_are_loaded_is_an_interrupt(monkeypatch, capsys):
    def interrupted(needed):
        raise KeyboardInterrupt

    monkeypatch.setattr(main, '_parsers', interrupted)
    assert main.main(['effects']) == 130
    assert capsys.readouterr().err == 'wheel-terra: interrupted\n'
