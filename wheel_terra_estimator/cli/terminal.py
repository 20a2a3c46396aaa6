# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Output on the terminal: errors of one line, no control characters from files."""

from __future__ import annotations

import argparse
import difflib
import os
import re
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from types import FrameType
from typing import IO, Any, NoReturn

from wheel_terra_estimator.end_signals import handled, terminations

LONGEST_LINE = 2000
"""Characters of an error line that are shown; the middle of a longer one is left out."""

# Control characters but tabulator and line feed, marks that reverse the direction of writing, and
# halves of characters that stand for bytes that are no UTF-8.
_HARMFUL = re.compile(
    '[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069\ud800-\udfff]'
)


def printable(text: str) -> str:
    r"""Return a text whose control characters are written out (``\x1b``)."""
    return _HARMFUL.sub(lambda found: ascii(found[0])[1:-1], text)


def open_closed_streams() -> None:
    """Put what drops everything in the place of output streams that the caller has closed."""
    for name in ('stdout', 'stderr'):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, 'w', encoding='utf-8'))  # noqa: SIM115, PTH123


def discard_output() -> None:
    """Discard buffered standard output that can no longer be written."""
    try:
        sys.stdout.flush()
    except (OSError, ValueError):
        with suppress(OSError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


class PrintableStream:
    """A text stream that writes out control characters and what its encoding does not have."""

    def __init__(self, stream: IO[str]) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        """Write a text without characters that the terminal cannot show."""
        shown = printable(text)
        if not shown.isascii():
            encoding = getattr(self._stream, 'encoding', None) or 'utf-8'
            shown = shown.encode(encoding, 'backslashreplace').decode(encoding)
        self._stream.write(shown)
        return len(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


@contextmanager
def termination_as_interrupt() -> Iterator[None]:
    """Treat terminations within the block as Ctrl-C: what was begun is cleaned up or kept."""

    def on_signal(number: int, frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    with handled(terminations(), on_signal):
        yield


UNUSABLE_INPUT = 2


class Parser(argparse.ArgumentParser):
    """A parser with errors of one line that suggest the nearest known name."""

    def error(self, message: str) -> NoReturn:
        """Print an error in one line and exit with status 2."""
        if 'invalid choice: ' in message:
            message = self._nearest_choice(message)
        print_error(f'{self.prog}: {message} (help: {self.prog} --help)')
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


def suggestion(wrong: str, known: Sequence[str]) -> str:
    """Return the nearest of the known names in words, all of them where none is near."""
    close = difflib.get_close_matches(wrong, known, n=1)
    return f"did you mean '{close[0]}'?" if close else f'there are {", ".join(known)}'


def print_error(line: str) -> None:
    """Print a line on standard error, red on a terminal that wants colours (NO_COLOR: none)."""
    line = printable(line.replace('\n', ' '))
    if len(line) > LONGEST_LINE:
        half = LONGEST_LINE // 2
        line = f'{line[:half]} ... {line[-half:]}'
    if sys.stderr.isatty() and not os.environ.get('NO_COLOR'):
        line = f'\033[31m{line}\033[0m'
    with suppress(OSError):  # nobody receives it
        print(line, file=sys.stderr)
