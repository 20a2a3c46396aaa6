# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Two runs of the estimator over the same drive: differences, errors of both."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wheel_terra_estimator.arrays import IndexArray
from wheel_terra_estimator.bags.history import EstimateHistory
from wheel_terra_estimator.bags.truth import Truth
from wheel_terra_estimator.configuration.parameters import declared
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.frames import unit_of
from wheel_terra_estimator.reporting import truth_scores

COMPARED = ('slip', 'sinkage', 'drawbar_pull', 'normal_load', 'rim_travel_left', 'pull_margin')


@dataclass(frozen=True)
class Difference:
    """B minus A of one quantity, over all wheels and common stamps."""

    name: str
    unit: str
    mean: float
    rms: float
    greatest: float
    where: str  # wheel and time of the greatest


@dataclass(frozen=True)
class Comparison:
    """Differences of two runs, and the errors of each where the truth is known."""

    names: tuple[str, str]
    common: int
    sets: tuple[int, int]
    differences: tuple[Difference, ...]
    same_class: float
    warnings: tuple[tuple[float, ...], ...]  # starts [s], of A and of B
    errors: tuple[truth_scores.TruthErrors | None, ...]


def compare(
    first: EstimateHistory, second: EstimateHistory, names: Sequence[str], truth: Truth | None
) -> Comparison:
    """Compare two runs over the same drive.

    Raises UserError for other wheels, or without common stamps.
    """
    if first.names != second.names:
        raise UserError(
            f'{names[1]}: its wheels ({", ".join(second.names)}) are not those of {names[0]} '
            f'({", ".join(first.names)}); compare estimates of one drive'
        )
    _, a, b = np.intersect1d(first.stamp, second.stamp, return_indices=True)
    if not a.size:
        raise UserError(
            f'{names[1]}: no stamp in common with {names[0]}; compare estimates of one drive'
        )
    thresholds = np.array(declared()['filter.class_thresholds'].default, dtype=float)
    runs = first, second
    differences = tuple(
        _difference(name, first, second, a, b)
        for name in COMPARED
        if not any(np.isnan(run.values[name]).all() for run in runs)
    )
    return Comparison(
        names=(names[0], names[1]),
        common=int(a.size),
        sets=(first.stamp.size, second.stamp.size),
        differences=differences,
        same_class=float(np.mean(first.slip_class[a] == second.slip_class[b])),
        warnings=tuple(tuple(round(start, 3) for start, _ in r.warning_times) for r in runs),
        errors=tuple(
            truth_scores.truth_errors(run, truth, thresholds) if truth else None for run in runs
        ),
    )


def _difference(
    name: str, first: EstimateHistory, second: EstimateHistory, a: IndexArray, b: IndexArray
) -> Difference:
    change = second.values[name][b] - first.values[name][a]
    row, wheel = np.unravel_index(int(np.argmax(np.abs(change))), change.shape)
    return Difference(
        name=name,
        unit=unit_of(name),
        mean=float(change.mean().round(12)),  # equal sums have no difference, not 1e-16
        rms=float(np.sqrt(np.mean(change**2))),
        greatest=float(change[row, wheel]),
        where=f'{first.names[int(wheel)]} at {first.seconds[a[int(row)]]:.1f} s',
    )


def as_text(comparison: Comparison) -> str:
    """Return what the terminal shows."""
    c = comparison
    lines = [
        f'A: {c.names[0]} ({c.sets[0]} estimates)',
        f'B: {c.names[1]} ({c.sets[1]} estimates), {c.common} in common',
        f'same slip class in {100 * c.same_class:.1f} % of the wheel time',
    ]
    for letter, starts in zip('AB', c.warnings, strict=True):
        listed = ', '.join(f'{start:.1f} s' for start in starts) or 'none'
        lines.append(f'stuck warnings of {letter}: {listed}')
    lines += ['', f'  {"B minus A":24}{"mean":>11}{"rms":>11}{"greatest":>11}   where']
    for d in c.differences:
        label = f'{d.name} [{d.unit}]'
        lines.append(f'  {label:24}{d.mean:11.3g}{d.rms:11.3g}{d.greatest:11.3g}   {d.where}')
    for letter, errors in zip('AB', c.errors, strict=True):
        if errors:
            lines += ['', f'{letter}:', *truth_scores.as_lines(errors)]
    return '\n'.join(lines)


def as_dict(comparison: Comparison) -> dict[str, Any]:
    """Return the comparison for JSON."""
    c = comparison
    return {
        'a': c.names[0],
        'b': c.names[1],
        'sets': list(c.sets),
        'common': c.common,
        'same_class': c.same_class,
        'stuck_warnings': {'a': list(c.warnings[0]), 'b': list(c.warnings[1])},
        'differences': {
            d.name: {k: v for k, v in vars(d).items() if k != 'name'} for d in c.differences
        },
        'errors': {
            letter: None if errors is None else truth_scores.as_dict(errors)
            for letter, errors in zip('ab', c.errors, strict=True)
        },
    }
