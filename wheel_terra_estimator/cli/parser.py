# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The parser of all commands, whose complaints are one line."""

from __future__ import annotations

import argparse
import difflib
import os
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, NoReturn

from wheel_terra_estimator.cli.terminal import one_line

UNUSABLE_INPUT = 2


class Parser(argparse.ArgumentParser):
    """A parser whose complaints are one line, with the nearest name that it knows."""

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
