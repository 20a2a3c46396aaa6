# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Run a list of cases in parallel, one engine process each; resume where it was cut."""

from __future__ import annotations

import csv
import hashlib
import json
import shutil
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path

from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.soilbin.case import Case, to_dict
from wheel_terra_estimator.soilbin.launch import CaseFailedError, run_case

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


def run_job(
    job: Job, work: str, cache: str, stop: Callable[[], bool] = lambda: False
) -> dict[str, object]:
    """Run one job; a case that cannot give a result gives a row that says why."""
    folder = Path(work) / job.key
    try:
        row = run_case(job.case, folder, Path(cache) if cache else None, stop=stop)
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
    dask: str = '',
    tell: Callable[[str], None] = print,
) -> list[dict[str, str]]:
    """Run the jobs that the table does not hold yet; return the rows of all jobs.

    ``workers``: engine processes at a time; 0 runs nothing and returns the finished rows.
    ``dask``: address of a scheduler, or 'local' for a cluster of processes on this machine.
    """
    done = {row['key'] for row in read_rows(table)}
    unique = {job.key: job for job in jobs}
    waiting = [job for key, job in unique.items() if key not in done]
    if waiting and workers:
        tell(f'{len(waiting)} of {len(unique)} cases to run, {workers} at a time')
        table.parent.mkdir(parents=True, exist_ok=True)
        runner = _on_dask if dask else _on_this_machine
        for number, row in enumerate(
            runner(waiting, str(work), str(cache or ''), workers, dask), start=1
        ):
            _append(table, row)
            slip = row.get('slip')
            told = f'slip {float(str(slip)):.3f}' if slip is not None else str(row['stopped'])
            tell(f'{number}/{len(waiting)} {row.get("name", row["key"])}: {told}')
    wanted = set(unique)
    return [row for row in read_rows(table) if row['key'] in wanted]


def _on_this_machine(
    jobs: Sequence[Job], work: str, cache: str, workers: int, _: str
) -> Iterable[dict[str, object]]:
    stop = threading.Event()
    with ThreadPoolExecutor(workers) as pool:
        running: list[Future] = [
            pool.submit(run_job, job, work, cache, stop.is_set) for job in jobs
        ]
        try:
            for future in as_completed(running):
                yield future.result()
        finally:
            # Interrupted or failed: the running cases keep their state, the others do not start.
            stop.set()
            for future in running:
                future.cancel()


def _on_dask(
    jobs: Sequence[Job], work: str, cache: str, workers: int, address: str
) -> Iterable[dict[str, object]]:
    try:
        from dask.distributed import Client, LocalCluster
        from dask.distributed import as_completed as completed
    except ImportError as error:
        raise UserError(
            f"Dask is not installed: pip install 'wheel_terra_estimator[cluster]' ({error})"
        ) from error
    cluster = None
    if address == 'local':
        cluster = LocalCluster(n_workers=workers, threads_per_worker=1)
    with Client(cluster or address) as client:
        futures = client.map(run_job, jobs, work=work, cache=cache, pure=False)
        for future in completed(futures):
            yield future.result()
    if cluster:
        cluster.close()


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
