# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Many jobs, each a row in a file: stopped at any time, a study goes on behind its last row.

Jobs run side by side by ``wheel_terra_estimator.scheduler``, as replays of many recordings do.
"""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Hashable, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any, TypeVar

from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.scheduler import finished

Task = TypeVar('Task')
Row = dict[str, Any]


class ResultFile:
    """Rows of finished jobs: CSV where the name ends so, lines of JSON otherwise.

    Each row is in the file as soon as it is added. Half a line at the end, which a killed run may
    leave, does not count; a line that is no row raises UserError. Values from CSV are text.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.rows: list[Row] = []
        self._names: tuple[str, ...] = ()  # columns of the CSV file
        self._whole = ''
        if path.is_file():
            text = path.read_text(encoding='utf-8')
            self._whole = text[: text.rfind('\n') + 1]
            self.rows = self._of_csv() if path.suffix == '.csv' else self._of_lines()
        self._cut = path.is_file() and len(self._whole) < len(text)

    def _of_csv(self) -> list[Row]:
        reader = csv.DictReader(io.StringIO(self._whole))
        rows = list(reader)
        self._names = tuple(reader.fieldnames or ())
        return rows

    def _of_lines(self) -> list[Row]:
        rows = []
        for number, line in enumerate(self._whole.splitlines(), start=1):
            try:
                rows.append(dict(json.loads(line)))
            except (ValueError, TypeError) as error:
                raise UserError(
                    f'{self.path}: line {number} is no result ({error}); take another file'
                ) from None
        return rows

    def add(self, row: Mapping[str, Any]) -> None:
        """Add a row; a new column makes a CSV file be written anew, whole or not at all."""
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self.rows.append(dict(row))
        names = tuple(dict.fromkeys([*self._names, *row])) if self.path.suffix == '.csv' else ()
        if self._cut or names != self._names:
            self._names, self._cut = names, False
            part = self.path.with_suffix('.part')
            self._write(part, 'w', self.rows)
            part.replace(self.path)
        else:
            self._write(self.path, 'a', self.rows[-1:])

    def _write(self, path: Path, mode: str, rows: Sequence[Row]) -> None:
        with path.open(mode, encoding='utf-8', newline='') as stream:
            if not self._names:
                stream.writelines(json.dumps(row) + '\n' for row in rows)
                return
            writer = csv.DictWriter(stream, self._names, restval='')
            if mode == 'w':
                writer.writeheader()
            writer.writerows(rows)


def run_jobs(
    function: Callable[[Task], Row | Sequence[Row]],  # at the top of a module
    tasks: Mapping[Any, Task],
    results: ResultFile,  # takes the rows in the order of finishing
    key_of: Callable[[Row], Hashable],
    *,
    jobs: int = 1,
    scheduler: str = '',
    tell: Callable[[int, int, Row], object] = lambda number, count, row: None,
) -> None:
    """Run the tasks whose key is in no row of the file, and add what they give.

    `jobs` and `scheduler` are those of `scheduler.finished`; `tell` gets number, count and last row
    of each finished task. What a task raises is raised: those that run end, the others do not
    start.
    """
    done = {key_of(row) for row in results.rows}
    waiting = [task for key, task in tasks.items() if key not in done]
    with closing(finished(function, waiting, jobs, scheduler)) as outcomes:
        for number, (_, outcome) in enumerate(outcomes, start=1):
            if isinstance(outcome, Exception):
                raise outcome
            rows = [outcome] if isinstance(outcome, dict) else outcome
            for row in rows:
                results.add(row)
            tell(number, len(waiting), rows[-1])
