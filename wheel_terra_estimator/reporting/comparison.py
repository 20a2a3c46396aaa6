# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Two runs of the estimator over the same drive: differences, errors of both, overlaid plots."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.bags.history import EstimateHistory
from wheel_terra_estimator.bags.truth import Truth
from wheel_terra_estimator.configuration.parameters import declared
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.output_folder import new_file
from wheel_terra_estimator.reporting import truth_scores
from wheel_terra_estimator.reporting.estimates_table import UNITS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]

COMPARED = ('slip', 'sinkage', 'drawbar_pull', 'normal_load', 'rim_travel_left', 'pull_margin')
NEAREST = 30_000_000
"""Sets of the two runs that lie this close together [ns] belong together."""


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
    warnings: tuple[tuple[float, ...], tuple[float, ...]]
    errors: tuple[truth_scores.TruthErrors | None, truth_scores.TruthErrors | None]


def compare(
    first: EstimateHistory, second: EstimateHistory, names: Sequence[str], truth: Truth | None
) -> Comparison:
    """Compare two runs over the same drive.

    Raises
    ------
    UserError
        Other wheels, or no common stamps.
    """
    if first.names != second.names:
        raise UserError(
            f'{names[1]}: its wheels ({", ".join(second.names)}) are not those of {names[0]} '
            f'({", ".join(first.names)}); compare estimates of one drive'
        )
    a, b = common_rows(first.stamp, second.stamp)
    if not a.size:
        raise UserError(
            f'{names[1]}: no stamp in common with {names[0]}; compare estimates of one drive'
        )
    thresholds = np.array(declared()['filter.class_thresholds'].default, dtype=float)
    differences = tuple(_difference(name, first, second, a, b) for name in COMPARED)
    return Comparison(
        names=(names[0], names[1]),
        common=int(a.size),
        sets=(first.stamp.size, second.stamp.size),
        differences=differences,
        same_class=float(np.mean(first.slip_class[a] == second.slip_class[b])),
        warnings=(_starts(first), _starts(second)),
        errors=(
            truth_scores.truth_errors(first, truth, thresholds) if truth else None,
            truth_scores.truth_errors(second, truth, thresholds) if truth else None,
        ),
    )


def common_rows(
    first: NDArray[np.int64], second: NDArray[np.int64]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return rows of both that belong together: each of the first, the nearest of the second."""
    if not first.size or not second.size:
        return np.empty(0, dtype=np.intp), np.empty(0, dtype=np.intp)
    right = np.clip(np.searchsorted(second, first), 1, max(second.size - 1, 1))
    left = np.minimum(right, second.size) - 1
    right = np.minimum(right, second.size - 1)
    nearer = np.abs(second[left] - first) <= np.abs(second[right] - first)
    match = np.where(nearer, left, right)
    close = np.abs(second[match] - first) <= NEAREST
    return np.flatnonzero(close), match[close]


def _difference(
    name: str,
    first: EstimateHistory,
    second: EstimateHistory,
    a: NDArray[np.intp],
    b: NDArray[np.intp],
) -> Difference:
    change = second.values[name][b] - first.values[name][a]
    row, wheel = np.unravel_index(int(np.argmax(np.abs(change))), change.shape)
    return Difference(
        name=name,
        unit=UNITS[name],
        mean=float(change.mean()),
        rms=float(np.sqrt(np.mean(change**2))),
        greatest=float(change[row, wheel]),
        where=f'{first.names[int(wheel)]} at {first.seconds[a[int(row)]]:.1f} s',
    )


def _starts(history: EstimateHistory) -> tuple[float, ...]:
    begin = int(history.stamp[0]) if history.stamp.size else 0
    return tuple(round((w.start - begin) * 1e-9, 3) for w in history.warnings)


def as_text(comparison: Comparison) -> str:
    """Return what the terminal shows."""
    c = comparison
    lines = [
        f'A: {c.names[0]} ({c.sets[0]} sets)',
        f'B: {c.names[1]} ({c.sets[1]} sets), {c.common} in common',
        f'same slip class in {100 * c.same_class:.1f} % of the wheel time',
    ]
    for letter, starts in zip('AB', c.warnings, strict=True):
        told = ', '.join(f'{start:.1f} s' for start in starts) or 'none'
        lines.append(f'stuck warnings of {letter}: {told}')
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


def write_comparison(
    path: Path,
    comparison: Comparison,
    histories: Sequence[EstimateHistory],
    truth: Truth | None,
    overwrite: bool,
) -> None:
    """Write a page with both runs overlaid."""
    from wheel_terra_estimator.reporting.html import picture, render, write_page

    quantities = (('slip', 'slip'), ('sinkage', 'sinkage'), ('drawbar_pull', 'drawbar_pull'))
    pictures = []
    for name, attribute in quantities:
        true = getattr(truth, attribute) if truth else None
        pictures.append(
            {
                'title': f'{name} [{UNITS[name]}]',
                'source': picture(_overlaid(name, histories, true)),
            }
        )
    page = render('comparison.html', text=as_text(comparison), pictures=pictures)
    with new_file(path, overwrite) as target:
        write_page(target, page)


def _overlaid(name: str, histories: Sequence[EstimateHistory], true: Any) -> Figure:
    from matplotlib.figure import Figure

    from wheel_terra_estimator.reporting.style import LINE_COLOURS, TRUTH_COLOUR, thin

    wheels = histories[0].names
    figure = Figure(figsize=(9.0, 1.6 * len(wheels) + 0.6), layout='constrained')
    axes = figure.subplots(len(wheels), 1, sharex=True, squeeze=False)[:, 0]
    begin = int(histories[0].stamp[0])
    for index, (axis, wheel) in enumerate(zip(axes, wheels, strict=True)):
        for letter, history, colour in zip('AB', histories, LINE_COLOURS, strict=False):
            seconds = np.asarray((history.stamp - begin) * 1e-9, dtype=np.float64)
            axis.plot(
                *thin(seconds, history.values[name][:, index]),
                color=colour, linewidth=1.0, label=letter,
            )  # fmt: skip
        if true is not None:
            seconds = np.asarray((true.stamp - begin) * 1e-9, dtype=np.float64)
            axis.plot(
                *thin(seconds, true.value[:, index]),
                color=TRUTH_COLOUR, linewidth=0.8, linestyle='--', label='truth',
            )  # fmt: skip
        axis.set_ylabel(wheel)
    axes[0].legend(loc='upper right', ncols=3)
    axes[-1].set_xlabel('time [s]')
    return figure
