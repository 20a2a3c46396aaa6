# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The parser of all commands: complaints of one line, help in groups, short or whole."""

from __future__ import annotations

import argparse
import difflib
import os
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, NoReturn

from wheel_terra_estimator.cli.outputs import Output
from wheel_terra_estimator.cli.terminal import one_line

UNUSABLE_INPUT = 2
SHORT = 14
"""Options of a command up to which its short help has all."""
MORE = 'more'
_GROUPS = {
    'inputs': 'reference truth remap columns ignore_columns points urdf bag wheels example figure '
    'compute',
    'model': 'config parameters soil effects only smooth method scenario seed seeds duration '
    'slip load slope climb wheel radius width track wheelbase mass name gravity rate friction pull '
    'simulator kinds rover modes noise',
    'output': 'output json format overwrite no_pictures list report',
}
"""Group in the help -> destinations of its options; also arguments and outputs by their kind."""
_OF = {name: group for group, names in _GROUPS.items() for name in names.split()}


class Parser(argparse.ArgumentParser):
    """A parser whose complaints are one line, with the nearest name that it knows."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self.add_argument(
            '--help-all',
            action=Printing,
            text=_whole_help,
            nargs=0,
            default=argparse.SUPPRESS,
            help='show all options and exit',
        )

    def error(self, message: str) -> NoReturn:
        """Say what is wrong in one line and end with status 2."""
        if 'invalid choice: ' in message:
            message = self._nearest_choice(message)
        complain(f'{self.prog}: {message} (help: {self.prog} --help)')
        self.exit(UNUSABLE_INPUT)

    def _nearest_choice(self, message: str) -> str:
        wrong = message.partition("invalid choice: '")[2].partition("'")[0]
        for action in self._actions:
            named = action.metavar or '/'.join(action.option_strings) or action.dest
            if action.choices and message.startswith(f'argument {named}:'):
                known = [str(choice) for choice in action.choices]
                what = 'no command' if action.dest == 'command' else f'{named}: no choice'
                return f"{what} '{wrong}'; {suggestion(wrong, known)}"
        return message

    def groups(self) -> dict[str, list[argparse.Action]]:
        """Return title -> arguments and options in the order of the help, but for those of help."""
        found: dict[str, list[argparse.Action]] = {name: [] for name in (*_GROUPS, MORE)}
        for action in self._actions:
            if action.dest not in ('help', 'help_all') and action.help != argparse.SUPPRESS:
                found[_group_of(action)].append(action)
        found['model'].sort(key=lambda action: action.dest not in ('config', 'parameters'))
        return {title: actions for title, actions in found.items() if actions}

    def format_help(self, whole: bool = False) -> str:
        """Return the help: what most runs need, or everything."""
        if any(isinstance(action, argparse._SubParsersAction) for action in self._actions):
            return super().format_help()
        groups = self.groups()
        hidden = [] if whole or sum(map(len, groups.values())) <= SHORT else groups.pop(MORE, [])
        given = [a for part in groups.values() for a in part if a.required or not a.option_strings]
        formatter = self._get_formatter()
        formatter.add_usage(f'{self.prog} [options] {_usage(given)}', [], [])
        formatter.add_text(self.description)
        for title, actions in groups.items():
            formatter.start_section(title)
            formatter.add_arguments(actions)
            formatter.end_section()
        if hidden:
            names = ', '.join(a.option_strings[-1] for a in hidden if a.option_strings)
            formatter.add_text(f'{len(hidden)} more with --help-all: {names}')
        formatter.add_text(self.epilog)
        return formatter.format_help()


class Printing(argparse.Action):
    """An option that prints what ``text(parser, value)`` gives, and ends the program."""

    def __init__(
        self, *names: Any, text: Callable[[argparse.ArgumentParser, Any], str], **settings: Any
    ) -> None:
        super().__init__(*names, **settings)
        self._text = text

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: Any,
        option_string: str | None = None,
    ) -> None:
        """Print, and end."""
        print(self._text(parser, values), end='')
        parser.exit()


def _whole_help(parser: argparse.ArgumentParser, _: Any) -> str:
    return parser.format_help(whole=True) if isinstance(parser, Parser) else ''


def _group_of(action: argparse.Action) -> str:
    if isinstance(action, Output):
        return 'output'
    return _OF.get(action.dest, MORE) if action.option_strings else 'inputs'


def _usage(actions: Sequence[argparse.Action]) -> str:
    words = []
    for action in sorted(actions, key=lambda a: not a.option_strings):
        value = action.metavar if isinstance(action.metavar, str) else action.dest.upper()
        value += {'+': ' ...', '*': ' ...'}.get(str(action.nargs), '')
        words.append(f'{action.option_strings[0]} {value}' if action.option_strings else value)
    return ' '.join(words)


def suggestion(wrong: str, known: Sequence[str]) -> str:
    """Return the nearest of the known names in words, all of them where none is near."""
    close = difflib.get_close_matches(wrong, known, n=1)
    return f"did you mean '{close[0]}'?" if close else f'there are {", ".join(known)}'


def complain(line: str) -> None:
    """Print a line on standard error, red on a terminal that wants colours (NO_COLOR: none)."""
    line = one_line(line)
    if sys.stderr.isatty() and not os.environ.get('NO_COLOR'):
        line = f'\033[31m{line}\033[0m'
    with suppress(OSError):  # nobody hears it
        print(line, file=sys.stderr)
