# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Drives of some kinds, seed after seed, until so many hours are driven.

One drive at a time is held, each mode of it is one line of JSON, and an interrupted run goes on
behind its last line.
"""

from __future__ import annotations

import itertools
import json
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.output_folder import working_folder
from wheel_terra_lab.evaluation import scores
from wheel_terra_lab.evaluation.runner import Record, inputs_of_mode, record, run_estimator
from wheel_terra_lab.evaluation.simulators import SIMULATORS, FloatArray, Truth
from wheel_terra_lab.jobs import ResultFile

HOUR = 3600.0
FIGURES = 'drives.jsonl'
CONFIDENCE = 0.95
"""Of the upper limit of false warnings per hour."""


@dataclass(frozen=True)
class DriveFigures:
    """One drive in one mode."""

    simulator: str
    kind: str
    seed: int
    mode: str
    hours: float
    metres: float  # of rim travel
    slip_samples: int  # wheels and stamps that are scored
    slip_squared_error: float  # sum
    slip_within: int  # of their 95 % intervals
    entrapped: float | None  # when [s]
    lead: float | None  # of the warning in force then [s]
    warnings: int
    false_warnings: int
    filter_restarts: int
    processor_time: float  # of the estimator [s]


def drive_kinds_for_hours(
    folder: Path,
    hours: float,
    chosen: Sequence[tuple[str, str]],
    modes: Sequence[str],
    first_seed: int,
    *,
    resume: bool = False,
    overwrite: bool = False,
    progress: Callable[[str], object] = print,
) -> list[dict[str, Any]]:
    """Run drives until `hours` are driven in each mode; return the figures of all.

    Parameters
    ----------
    folder : Path
        Where the lines are kept.
    hours : float
        Length of the drives together, each mode by itself; the last drive is run whole.
    chosen : sequence of (str, str)
        Simulators and kinds, all with one seed before any with the next.
    modes : sequence of str
        What the estimator gets, see `runner.MODES`.
    first_seed : int
        Decides all random quantities with those that follow.
    resume, overwrite : bool
        As in `output_folder.working_folder`.
    progress : callable
        Is told each new line.

    Raises
    ------
    UserError
        The folder cannot be written, or it holds other drives.
    """
    with working_folder(folder, overwrite, resume, (FIGURES,)):
        results = ResultFile(folder / FIGURES)
        _check_same(results, chosen, modes, first_seed)
        done = {
            tuple(row[key] for key in ('simulator', 'kind', 'seed', 'mode')) for row in results.rows
        }
        driven = sum(row['hours'] for row in results.rows if row['mode'] == modes[-1])
        for simulator, kind, seed in _drives(chosen, first_seed):
            if driven >= hours:
                break
            missing = [mode for mode in modes if (simulator, kind, seed, mode) not in done]
            if not missing:
                continue
            for figures in _figures(simulator, kind, seed, missing):
                results.add(asdict(figures))
                progress(json.dumps(results.rows[-1]))
                driven += figures.hours if figures.mode == modes[-1] else 0.0
    return results.rows


def _drives(chosen: Sequence[tuple[str, str]], first_seed: int) -> Iterator[tuple[str, str, int]]:
    for seed in itertools.count(first_seed):
        for simulator, kind in chosen:
            yield simulator, kind, seed


def _check_same(
    results: ResultFile, chosen: Sequence[tuple[str, str]], modes: Sequence[str], first_seed: int
) -> None:
    """Refuse rows of an earlier run of other drives."""
    path, rows = results.path, results.rows
    try:
        same = all(
            (row['simulator'], row['kind']) in chosen and row['mode'] in modes for row in rows
        ) and (not rows or rows[0]['seed'] == first_seed)
    except KeyError as error:
        raise UserError(f'{path}: cannot be gone on with ({error}); give --overwrite') from None
    if not same:
        raise UserError(
            f'{path}: of other kinds, modes or seeds; give those it was begun with, or --overwrite'
        )


def _figures(simulator: str, kind: str, seed: int, modes: Sequence[str]) -> Iterator[DriveFigures]:
    """Simulate one drive and yield the figures of each mode."""
    drive = SIMULATORS[simulator].simulate(kind, seed, None, None)
    radius = drive.configuration.wheels.slip_radius
    for mode in modes:
        begun = time.process_time()
        sets, health = run_estimator(drive.configuration, inputs_of_mode(drive.arrivals, mode))
        kept = record(sets, health)
        spent = time.process_time() - begun
        found = scores.warnings(drive.truth, kept, radius)
        error, std = _slip_errors(drive.truth, kept, radius)
        yield DriveFigures(
            simulator=simulator,
            kind=kind,
            seed=seed,
            mode=mode,
            hours=found.duration / HOUR,
            metres=found.distance,
            slip_samples=error.size,
            slip_squared_error=float(error @ error),
            slip_within=int((np.abs(error) <= scores.WITHIN * std).sum()),
            entrapped=found.entrapped,
            lead=found.lead_time,
            warnings=len(found.raised),
            false_warnings=found.false_alarms,
            filter_restarts=health.get('filter_restarts', 0),
            processor_time=spent,
        )


def _slip_errors(truth: Truth, kept: Record, radius: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return error and stated deviation of the scored slips."""
    position, scored = scores.scored_rows(truth, kept, radius)
    error = (kept.slip[position] - truth.slip)[scored]
    return error, kept.slip_std[position][scored]


def report(rows: Sequence[dict[str, Any]]) -> str:
    """Return the figures of each simulator, kind and mode as a table, and what they come to."""
    from wheel_terra_lab.evaluation.tables import table

    head = (
        'drives',
        'with',
        'number',
        'hours',
        'rim travel [m]',
        'slip RMSE',
        'coverage',
        'entrapped',
        'warned before',
        'warnings',
        'false',
        f'per hour, below ({CONFIDENCE:.0%})',
    )
    groups: dict[tuple[str, str, str], list[dict[str, Any]]] = {}
    for row in rows:
        for key in ((row['simulator'], row['kind'], row['mode']), ('all', '', row['mode'])):
            groups.setdefault(key, []).append(row)
    single = len(groups) == 2 * len({mode for _, _, mode in groups})
    cells = [
        (f'{simulator} {kind}'.strip(), mode, *_cells(group))
        for (simulator, kind, mode), group in sorted(
            groups.items(), key=lambda item: (item[0][2], item[0][0] == 'all', item[0])
        )
        if not (single and simulator == 'all')
    ]
    restarts = sum(row['filter_restarts'] for row in rows)
    return (
        f'{table(head, cells)}\n\n{restarts} restarts of the filter, '
        f'{sum(row["processor_time"] for row in rows):.0f} s of processor time of the estimator.'
    )


def _cells(group: Sequence[dict[str, Any]]) -> tuple[str, ...]:
    hours = sum(row['hours'] for row in group)
    samples = max(sum(row['slip_samples'] for row in group), 1)
    false = sum(row['false_warnings'] for row in group)
    entrapped = [row for row in group if row['entrapped'] is not None]
    return (
        str(len(group)),
        f'{hours:.2f}',
        f'{sum(row["metres"] for row in group):.0f}',
        f'{(sum(row["slip_squared_error"] for row in group) / samples) ** 0.5:.4f}',
        f'{sum(row["slip_within"] for row in group) / samples:.1%}',
        str(len(entrapped)),
        str(sum(row['lead'] is not None for row in entrapped)) if entrapped else '-',
        str(sum(row['warnings'] for row in group)),
        str(false),
        f'{most_per_hour(false, hours):.2f}',
    )


def most_per_hour(count: int, hours: float) -> float:
    """Return the upper limit of the rate of rare events, from how many came in so many hours.

    Exact limit of a Poisson count (Garwood 1936): where none came, 3.0 over the hours.
    """
    from scipy.stats import chi2

    return float(chi2.ppf(CONFIDENCE, 2 * (count + 1)) / 2.0 / hours)
