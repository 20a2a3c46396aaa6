# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The order in which a live node received its inputs, for ``wheel-terra replay --arrival``."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from typing import TextIO

from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.messages.convert import INPUT_TYPES
from wheel_terra_estimator.messages.pipeline import RESET, TUNE
from wheel_terra_estimator.output_folder import check_target

LONGEST_LINE = 100  # [byte]


def why_no_arrival_log(path: Path) -> str:
    """Return why a file is no arrival log of a node; empty where it is one."""
    with path.open('rb') as file:
        topic, _, stamp = file.readline(LONGEST_LINE).decode(errors='replace').partition(' ')
    if topic in INPUT_TYPES and stamp.strip().lstrip('-').isdigit():
        return ''
    return '' if topic.strip() in (RESET, TUNE) else 'is no arrival log of this program'


class ArrivalLog:
    """Line after line, ``TOPIC STAMP``, `RESET` or `TUNE`, to a file.

    ``inputs``: files that the node reads. ``warn``: called once with the reason why
    the log ends early: a disk that is full ends the log, not the node. Raises UserError where it
    may not, or cannot, be written.
    """

    def __init__(self, name: str, inputs: Iterable[Path], warn: Callable[[str], object]) -> None:
        self._file: TextIO | None = None
        self._warn = warn
        if not name:
            return
        path = Path(name).expanduser()
        try:
            check_target(path, True, inputs, foreign=why_no_arrival_log)
            self._file = path.open('w', encoding='utf-8', buffering=1)
        except (OSError, UserError) as error:
            reason = getattr(error, 'strerror', None)
            words = f'{path} cannot be written ({reason})' if reason else str(error)
            raise UserError(f'record_arrival: {words}') from None

    def write(self, line: str) -> None:
        """Write a line."""
        if self._file is None:
            return
        try:
            self._file.write(f'{line}\n')
        except OSError as error:
            self._warn(f'record_arrival: the log ends here ({error.strerror})')
            self.close()

    def close(self) -> None:
        """End the log."""
        if self._file is not None:
            with suppress(OSError):
                self._file.close()
            self._file = None
