# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What all commands share: complaints, exit status, examples, generated page."""

import errno
import io
import shlex
import signal
import subprocess
import sys
import types

import document_commands
import pytest
from complete_shells import FILES, scripts
from hypothesis import given
from hypothesis import strategies as st

from wheel_terra_estimator import __version__
from wheel_terra_estimator.cli import main
from wheel_terra_estimator.cli.terminal import PrintableStream, termination_as_interrupt
from wheel_terra_estimator.errors import UserError, outside_cause
from wheel_terra_estimator.scheduler import worker_pool


def test_version(capsys):
    with pytest.raises(SystemExit) as end:
        main.main(['--version'])
    assert end.value.code == 0
    assert capsys.readouterr().out.split()[-1] == __version__


def test_a_mistyped_command_or_option_gets_the_nearest(refused):
    refused(['repaly'], "did you mean 'replay'?")
    refused(['replay', 'bag', '--confg', 'rover'], "no option '--confg'; did you mean '--config'?")


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


def test_every_command_has_a_debug_option_and_examples_that_parse():
    parser, parsers = main._parsers(main.COMMANDS)[0], main.sub_parsers()
    for name in main.COMMANDS:
        assert 'examples:' in (parsers[name].epilog or ''), name
        assert any('--debug' in action.option_strings for action in parsers[name]._actions), name
        for line in main.command_module(name).EXAMPLES:
            program, *arguments = shlex.split(line.partition(' > ')[0])  # the rest is the shell's
            assert program == 'wheel-terra'
            if '--help' not in arguments:
                parser.parse_args(arguments)


def test_the_shipped_completion_is_that_of_the_parsers():
    for shell, text in scripts().items():
        assert FILES[shell].read_text() == text, 'run python tools/complete_shells.py'


@pytest.mark.parametrize(
    ('line', 'wanted'),
    [
        ('repl', ['replay']),
        ('replay --rem', ['--remap']),
        ('replay bag --config fros', ['frostyboy']),
        ('predict --method q', ['quadrature']),
        ('config sh', ['show']),
        ('replay no_such_file', []),
    ],
)
def test_completion_in_bash(line, wanted):
    words = ['wheel-terra', *line.split(' ')]
    script = f"""source {FILES['bash']}
        COMP_WORDS=({' '.join(shlex.quote(word) for word in words)}) COMP_CWORD={len(words) - 1}
        _wheel_terra; echo "${{COMPREPLY[@]}}" """
    done = subprocess.run(['bash', '-c', script], capture_output=True, text=True, check=True)
    assert done.stdout.split() == wanted
    assert not done.stderr


def test_the_page_of_commands_is_that_of_the_parsers():
    page = document_commands.PAGE.read_text(encoding='utf-8')
    assert page == document_commands.page(), 'run python tools/document_commands.py'


@pytest.mark.parametrize('usual', [signal.SIG_DFL, signal.SIG_IGN])
def test_a_lost_terminal_is_an_interrupt_unless_nohup_has_it_ignored(usual):
    before = signal.signal(signal.SIGHUP, usual)
    try:
        with termination_as_interrupt():
            if usual == signal.SIG_DFL:
                with pytest.raises(KeyboardInterrupt):
                    signal.raise_signal(signal.SIGHUP)
            else:
                signal.raise_signal(signal.SIGHUP)
        assert signal.getsignal(signal.SIGHUP) == usual
    finally:
        signal.signal(signal.SIGHUP, before)


def test_ctrl_c_while_the_commands_are_loaded_is_an_interrupt(monkeypatch, capsys):
    def interrupted(needed):
        raise KeyboardInterrupt

    monkeypatch.setattr(main, '_parsers', interrupted)
    assert main.main(['effects']) == 130
    assert capsys.readouterr().err == 'wheel-terra: interrupted\n'


class Failing(io.StringIO):
    """A stream that fails after some characters, or only when it is flushed."""

    encoding = 'ascii'

    def __init__(self, error, room):
        super().__init__()
        self.error, self.room = error, room

    def write(self, text):
        text.encode(self.encoding)
        if self.room is not None and self.tell() + len(text) > self.room:
            raise self.error
        return super().write(text)

    def flush(self):
        if self.room is None:
            raise self.error


@given(
    st.sampled_from([errno.ENOSPC, errno.EIO, errno.EDQUOT, errno.EFBIG, errno.EPIPE]),
    st.one_of(st.none(), st.integers(0, 3000)),
    st.sampled_from(
        [['effects'], ['effects', 'soil_mound'], ['effects', '--json'], ['config', 'list']]
    ),
)
def test_output_that_fails_is_no_error_of_the_program(number, room, arguments):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, 'stdout', Failing(OSError(number, 'as told'), room))
        patch.setattr(sys, 'stderr', heard := io.StringIO())
        status = main.main(arguments)
    failed = bool(heard.getvalue())
    assert status == (2 if failed else 0)
    assert 'error of the program' not in heard.getvalue()
    assert heard.getvalue().count('\n') == int(failed)
    if failed:
        assert number != errno.EPIPE and 'as told' in heard.getvalue()
    elif number != errno.EPIPE:
        assert room is not None, 'all was written'


def test_a_terminal_that_knows_ascii_alone():
    plain = io.TextIOWrapper(io.BytesIO(), encoding='ascii')
    print('3 \xb1 1 \x1b[2J', file=PrintableStream(plain), flush=True)
    assert plain.buffer.getvalue() == rb'3 \xb1 1 \x1b[2J' + b'\n'


EFFECTS = """
import sys
from wheel_terra_estimator.terramechanics.effects.base import Effect, EffectParameter

def term(contact, p):
    {body}

{top}
EFFECT = Effect(
    name='own', claim='own', symbol='own', validity='-', source='-',
    touches=frozenset({{'sinkage'}}),
    parameters=(EffectParameter('a', '-', 1.0, 0.0, 2.0, 1.0, 'half_normal', 'own'),),
    on_contact=term,
)
"""


@pytest.mark.parametrize('words', ['sys.exit(0)', '1 / 0'])
@pytest.mark.parametrize('where', ['top', 'body'])
def test_a_file_of_effects_that_fails_or_ends_the_program(
    tmp_path, capsys, monkeypatch, words, where
):
    monkeypatch.setattr('wheel_terra_estimator.terramechanics.effects._registered', {})
    file = tmp_path / 'own.py'
    file.write_text(EFFECTS.format(**{'top': '', 'body': 'pass', where: words}))
    rows = tmp_path / 'rows.csv'
    model = ['--config', 'hit_wh3', '--config', 'hit_fit']
    assert main.main(['predict', *model, '--slip', '0:0.8:9', '-o', str(rows)]) == 0
    assert main.main(['effects', '--load', str(file)]) == (2 if where == 'top' else 0)
    capsys.readouterr()
    only = ['--effects', str(file), '--only', 'own']
    status = main.main(['diagnose', str(rows), *model, *only, '-o', str(tmp_path / 'found')])
    said = capsys.readouterr().err
    assert status == 2 and said.count('\n') == 1
    assert 'own.py' in said and 'error of the program' not in said


def test_shared_memory_that_is_full_is_said(monkeypatch):
    def full(*arguments, **others):
        raise OSError(errno.ENOSPC, 'No space left on device')

    monkeypatch.setattr('wheel_terra_estimator.scheduler.ProcessPoolExecutor', full)
    with pytest.raises(UserError, match='/dev/shm'), worker_pool(2):
        pass


@pytest.mark.parametrize(('words', 'status'), [('effects', 0), ('effects nowhere', 2)])
def test_exit_status_with_closed_streams(words, status):
    code = 'import sys; from wheel_terra_estimator.cli.main import main; sys.exit(main())'
    script = f'"{sys.executable}" -c "{code}" {words} >&- 2>&-'
    assert subprocess.run(['bash', '-c', script], check=False).returncode == status


@pytest.mark.parametrize(
    ('number', 'cure'), [(errno.EACCES, 'change its permissions'), (errno.ENOSPC, 'make room')]
)
def test_what_the_machine_refuses_is_told_with_its_cure(number, cure):
    said = outside_cause(OSError(number, 'no', 'rows.csv'))
    assert said == f'rows.csv: no; {cure} or use another place'
