# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Run a list of cases in parallel, one engine process each; resume where it was cut."""

from __future__ import annotations

import csv
import hashlib
import json
import shutil
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from wheel_terra_estimator.scheduler import finished
from wheel_terra_lab.soilbin.case import Case, to_dict
from wheel_terra_lab.soilbin.launch import CaseFailedError, run_case

# Fields that were added after rows had been published: at these values a case is the old one.
ADDED_LATER = {'operation': {'free_sinkage': 'held', 'drop_height': 0.0}}


@dataclass(frozen=True)
class Job:
    """One case of a study with the labels that its row carries."""

    case: Case
    labels: Mapping[str, object]

    @property
    def key(self) -> str:
        """Hash of the case: a row is valid for exactly this case."""
        data = to_dict(self.case) | {'name': ''}
        if data['operation']['slope'] == 0:  # nothing pulls along the bin: one and the same
            data['operation']['free_sinkage'] = 'held'
        for group, defaults in ADDED_LATER.items():
            for name, default in defaults.items():
                if data[group][name] == default:
                    del data[group][name]
        return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()[:12]


def run_job(job: Job, work: str, cache: str) -> dict[str, object]:
    """Run one job; a case that cannot give a result gives a row that says why."""
    folder = Path(work) / job.key
    try:
        row = run_case(job.case, folder, Path(cache) if cache else None)
        _keep_series(folder / 'series.npy', Path(work).parent / 'series' / f'{job.key}.npy')
    except CaseFailedError as error:
        row = {'stopped': str(error)}
    shutil.rmtree(folder, ignore_errors=True)
    return dict(job.labels) | {'key': job.key} | row


def _keep_series(series: Path, kept: Path) -> None:
    """Keep the time series (columns: `bookkeeping.SERIES`) beside the table of the study."""
    if series.exists():
        kept.parent.mkdir(exist_ok=True)
        shutil.move(series, kept)


def read_rows(table: Path) -> list[dict[str, str]]:
    """Return the finished rows of a study's table."""
    if not table.exists():
        return []
    with table.open(newline='') as file:
        return list(csv.DictReader(file))


def run_study(
    jobs: Sequence[Job],
    table: Path,
    work: Path,
    cache: Path | None,
    workers: int,
    scheduler: str = '',
    tell: Callable[[str], None] = print,
) -> list[dict[str, str]]:
    """Run the jobs that the table does not hold yet; return the rows of all jobs.

    ``workers``: engine processes at a time; 0 runs nothing and returns the finished rows.
    ``scheduler``: address of a Dask scheduler whose workers take the cases. Interrupted, or after
    an error, the running cases keep their state, the others do not start.
    """
    done = {row['key'] for row in read_rows(table)}
    unique = {job.key: job for job in jobs}
    waiting = [job for key, job in unique.items() if key not in done]
    if waiting and workers:
        tell(f'{len(waiting)} of {len(unique)} cases to run, {workers} at a time')
        table.parent.mkdir(parents=True, exist_ok=True)
        task = partial(run_job, work=str(work.absolute()), cache=str(cache or ''))
        with closing(finished(task, waiting, workers, scheduler)) as outcomes:
            for number, (_, row) in enumerate(outcomes, start=1):
                if isinstance(row, Exception):
                    raise row
                _append(table, row)
                slip = row.get('slip')
                told = f'slip {float(str(slip)):.3f}' if slip is not None else str(row['stopped'])
                tell(f'{number}/{len(waiting)} {row.get("name", row["key"])}: {told}')
    wanted = set(unique)
    return [row for row in read_rows(table) if row['key'] in wanted]


def _append(table: Path, row: Mapping[str, object]) -> None:
    """Add one row; a new column makes the table be written anew, whole or not at all."""
    rows = read_rows(table)
    names = list(dict.fromkeys([*(rows[0] if rows else ()), *row]))
    part = table.with_suffix('.part')
    with part.open('w', newline='') as file:
        writer = csv.DictWriter(file, names, restval='')
        writer.writeheader()
        writer.writerows([*rows, {k: _text(v) for k, v in row.items()}])
    part.replace(table)


def _text(value: object) -> object:
    return f'{value:.6g}' if isinstance(value, float) else value
