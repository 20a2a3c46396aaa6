# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Run a list of cases in parallel, one engine process each; resume where it was cut."""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.output_folder import working_folder
from wheel_terra_lab.jobs import ResultFile, run_jobs
from wheel_terra_lab.soilbin import snapshots
from wheel_terra_lab.soilbin.bookkeeping import STATE
from wheel_terra_lab.soilbin.case import Case, to_dict
from wheel_terra_lab.soilbin.launch import CaseFailedError, run_case
from wheel_terra_lab.soilbin.output import WORK

SERIES_FOLDER = 'series'
"""Beside the table of a study: ``KEY.npy``, columns as in `bookkeeping.SERIES`."""

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
        if (series := folder / 'series.npy').exists():
            kept = Path(work).parent / SERIES_FOLDER / f'{job.key}.npy'
            kept.parent.mkdir(exist_ok=True)
            shutil.move(series, kept)
    except CaseFailedError as error:
        row = {'stopped': str(error)}
    except UserError:
        if not any(folder.rglob(STATE)):  # nothing for --resume
            shutil.rmtree(folder, ignore_errors=True)
        raise
    shutil.rmtree(folder, ignore_errors=True)
    row = dict(job.labels) | {'key': job.key} | row
    return {name: _text(value) for name, value in row.items()}


def run_in_folder(
    arguments: argparse.Namespace,
    jobs: Sequence[Job],
    table: str,
    pages: Sequence[str],
    report: Callable[[Sequence[Mapping[str, str]], Path], None],
) -> None:
    """Run (or go on with) a study in an output folder: its table as rows come, then its pages.

    ``arguments`` are those of ``cli.soilbin.add_study_arguments`` with output and overwrite.
    """
    folder: Path = arguments.output
    cache = None if arguments.no_cache else arguments.cache or snapshots.default_cache()
    entries = (table, *pages, f'{SERIES_FOLDER}/', WORK)
    workers = arguments.jobs or os.cpu_count() or 1
    with working_folder(folder, arguments.overwrite, arguments.resume, entries):
        rows = run_study(
            jobs, folder / table, folder / '.work', cache, workers, arguments.scheduler or ''
        )
        report(rows, folder)


def run_study(
    jobs: Sequence[Job],
    table: Path,
    work: Path,
    cache: Path | None,
    workers: int,
    scheduler: str = '',
    tell: Callable[[str], None] = print,
) -> list[dict[str, str]]:
    """Run the jobs that the table does not hold yet; return the rows of all jobs, as text.

    ``workers``: engine processes at a time; 0 runs nothing and returns the finished rows.
    ``scheduler``: address of a Dask scheduler whose workers take the cases. Interrupted, or after
    an error, the running cases keep their state, the others do not start.
    """
    unique = {job.key: job for job in jobs}

    def said(number: int, count: int, row: Mapping[str, Any]) -> None:
        slip = row.get('slip')
        told = f'slip {float(slip):.3f}' if slip is not None else str(row['stopped'])
        tell(f'{number}/{count} {row.get("name", row["key"])}: {told}')

    if workers:
        task = partial(run_job, work=str(work.absolute()), cache=str(cache or ''))
        results = ResultFile(table)
        run_jobs(task, unique, results, _key, jobs=workers, scheduler=scheduler, tell=said)
    return [row for row in ResultFile(table).rows if row['key'] in unique]


def _key(row: Mapping[str, Any]) -> str:
    return str(row['key'])


def _text(value: object) -> object:
    return f'{value:.6g}' if isinstance(value, float) else value
