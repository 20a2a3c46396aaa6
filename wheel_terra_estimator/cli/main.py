# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Entry point of ``wheel-terra``: parse, run the sub-command, turn errors into one line.

Exit status: 0 done, 1 as the sub-command defines it, 2 input that cannot be used, 3 an
error of the program itself, 130 interrupted.
"""

from __future__ import annotations

import argparse
import importlib
import logging
import os
import sys
import warnings
from collections.abc import Callable, Container, Sequence
from contextlib import redirect_stdout
from functools import cache, partial
from typing import Any, NoReturn

from wheel_terra_estimator import __version__
from wheel_terra_estimator.cli import outputs
from wheel_terra_estimator.cli.terminal import (
    UNUSABLE_INPUT,
    Parser,
    PrintableStream,
    discard_output,
    open_closed_streams,
    print_error,
    suggestion,
    termination_as_interrupt,
)
from wheel_terra_estimator.errors import ConfigurationWarning, UserError, outside_cause

COMMANDS = {
    'simulate': 'drive a simulated rover and write a rosbag2 with ground truth',
    'check': 'say what is wrong with a recording or a rover file, and how to correct it',
    'calibrate': 'write a rover file with what a recording shows: radius, mounting, zeros, noise',
    'init': 'write a new rover file from a URDF, from a recording, or from measures',
    'config': 'list, show or find the shipped rover, soil and scenario files',
    'compare': 'put two bags of estimates side by side, against the truth where there is one',
    'convert': 'write a table of logged values (CSV) as a rosbag2',
    'replay': 'run the estimator over a rosbag2, without ROS',
    'predict': 'print or draw the curves of the wheel-soil model',
    'diagnose': 'find where model and measurement disagree and name the missing effect',
    'trial': 'hide an effect in a synthetic table, diagnose it blind, reveal the truth',
    'effects': 'list the physical and instrument effects that can be named',
    'soilbin': 'run the virtual soil bin (discrete elements)',
    'reproduce': 'compare figures, tables and numbers of three papers with ours, with a verdict',
    'evaluate': 'score the estimator against ground truth and baselines',
    'bench': 'processor time of the estimator, beside other programs',
    'demo': 'run the estimator over two shipped drives, and a blind trial of the diagnosis',
}
"""Sub-commands in the order of the help, and what each is for.

The module of that name, here or in the laboratory, has add_arguments(parser) and run(arguments) ->
exit status, and may have EXAMPLES (command lines for its help). Only that of the command that is
asked for is imported, and it imports heavy libraries inside run.
"""
LABORATORY = frozenset({'trial', 'soilbin', 'reproduce', 'evaluate', 'bench'})
"""Sub-commands of the package wheel_terra_lab, which a robot does without."""
ENTRY_POINTS = 'wheel_terra_estimator.commands'
"""Group of entry points that names the modules of these."""

PROGRAM_ERROR = 3
INTERRUPTED = 130
DEBUG_HELP = 'show the traceback of an error'


def sub_parsers() -> dict[str, Parser]:
    """Return sub-command -> its parser."""
    return _parsers(COMMANDS)[1]


def _parsers(needed: Container[str]) -> tuple[Parser, dict[str, Parser]]:
    """Return the parser and those of the sub-commands; arguments of the `needed` ones alone."""
    parser = Parser(
        prog='wheel-terra',
        description='Slip, sinkage and drawbar pull of rover wheels in loose soil.',
        epilog='Help of a command, with examples: wheel-terra COMMAND --help',
    )
    parser.add_argument('--version', action='version', version=__version__)
    parser.add_argument('--debug', action='store_true', help=DEBUG_HELP)
    commands = parser.add_subparsers(
        dest='command', required=True, metavar='COMMAND', parser_class=Parser
    )
    for name, summary in COMMANDS.items():
        sub = commands.add_parser(
            name,
            help=summary,
            description=summary,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        if name in needed:
            module = command_module(name)
            if examples := getattr(module, 'EXAMPLES', ()):
                sub.epilog = '\n'.join(('examples:', *(f'  {line}' for line in examples)))
            module.add_arguments(sub)
            sub.add_argument(
                '--debug', action='store_true', default=argparse.SUPPRESS, help=DEBUG_HELP
            )
            sub.set_defaults(run=module.run)
    return parser, dict(commands.choices)


def command_module(name: str) -> Any:
    """Return the module of a sub-command.

    Raises UserError if it belongs to the laboratory, and that is not installed.
    """
    if name not in LABORATORY:
        return importlib.import_module(f'wheel_terra_estimator.cli.{name}')
    try:
        return _laboratory()[name].load()
    except (KeyError, ModuleNotFoundError) as error:
        if not (getattr(error, 'name', None) or 'wheel_terra_lab').startswith('wheel_terra_lab'):
            raise
        raise UserError(
            'the laboratory (package wheel_terra_lab) is not installed here; it comes with '
            'wheel_terra_estimator from pip or colcon, unless it was left out'
        ) from None


@cache
def _laboratory() -> dict[str, Any]:
    """Return the installed entry points of the laboratory's commands by their names."""
    from importlib.metadata import entry_points  # 30 ms that most commands do without

    return {entry.name: entry for entry in entry_points(group=ENTRY_POINTS)}


def main(argv: Sequence[str] | None = None) -> int:
    """Run ``wheel-terra`` and return the exit status."""
    # Our matrices are small: threads of the linear algebra only get into each other's way. It has
    # to be said before numpy is imported; what the user has set stays.
    for library in ('OMP', 'OPENBLAS'):
        os.environ.setdefault(f'{library}_NUM_THREADS', '1')
    open_closed_streams()
    words = sys.argv[1:] if argv is None else argv
    try:
        parser, subs = _parsers([word for word in words if word in COMMANDS][:1])
        arguments, unknown = parser.parse_known_args(words)
    except KeyboardInterrupt:
        print_error('wheel-terra: interrupted')
        return INTERRUPTED
    except UserError as error:
        print_error(f'wheel-terra {next(word for word in words if word in COMMANDS)}: {error}')
        return UNUSABLE_INPUT
    if unknown:
        _refuse(unknown[0], subs[arguments.command])
    try:
        if arguments.debug:  # silent corrections are reported, too
            logging.basicConfig()
            logging.getLogger('wheel_terra_estimator').setLevel(logging.DEBUG)
        shown: Any = PrintableStream(sys.stdout)
        with redirect_stdout(shown), termination_as_interrupt(), warnings.catch_warnings():
            warnings.simplefilter('always', ConfigurationWarning)
            warnings.showwarning = partial(_show_warning, arguments.command, warnings.showwarning)
            outputs.check(arguments)
            status = int(arguments.run(arguments) or 0)
            sys.stdout.flush()
            return status
    except KeyboardInterrupt as interrupt:
        print_error(f'wheel-terra {arguments.command}: interrupted{interrupt}')
        return INTERRUPTED
    except BrokenPipeError:
        # The reader of our output (head, less) has gone: not an error of ours.
        discard_output()
        return 0
    except (Exception, SystemExit) as error:
        if arguments.debug:
            raise
        discard_output()
        return _ended_by(error, arguments.command)


def _show_warning(
    command: str, others: Callable[..., None], message: Any, category: type[Warning], *where: Any
) -> None:
    """Print a warning on a configuration in one line, other warnings as Python does."""
    if issubclass(category, ConfigurationWarning):
        print_error(f'wheel-terra {command}: warning: {message}')
    else:
        others(message, category, *where)


def _ended_by(error: BaseException, command: str) -> int:
    """Print the error that ended a command; return the exit status."""
    outside = outside_cause(error)
    if outside is not None:
        print_error(f'wheel-terra {command}: {outside}')
        return UNUSABLE_INPUT
    print_error(
        f'wheel-terra {command}: error of the program '
        f'({type(error).__name__}: {error}); add --debug for the traceback to report'
    )
    return PROGRAM_ERROR


def _refuse(word: str, parser: argparse.ArgumentParser) -> NoReturn:
    """Exit with an error on an argument that a sub-command does not know."""
    if not word.startswith('-'):
        parser.error(f"one argument too many: '{word}'")
    options = [option for action in parser._actions for option in action.option_strings]
    name = word.partition('=')[0]
    parser.error(f"no option '{name}'; {suggestion(name, options)}")


if __name__ == '__main__':
    sys.exit(main())
