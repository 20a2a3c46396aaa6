# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Figures of Nakashima et al. 2010 from the rows of the reproduction: curves and statements.

The paper's own curves are pictures; what its text says of them is judged here, figure by figure.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from wheel_terra_estimator.reporting.style import LINE_COLOURS, picture_style
from wheel_terra_estimator.soilbin import metrics
from wheel_terra_estimator.soilbin.metrics import Row

PICTURE = 'figures.svg'
FULL_LOAD = 19.6  # [N]
LIGHTER = 14.7  # [N]
EARTH = 5.0  # [m/s^2] below it a row is one of the Moon
STEEPEST = 25.0  # [deg]
POWER, SLIP = 'power_number', 'slip'
ALIKE = 0.1
"""Relative difference of power numbers within which the paper's "almost the same" holds."""


@dataclass(frozen=True)
class Curve:
    """A line of a figure: over which rows, and how it is called."""

    label: str
    wheel: int
    load: float = FULL_LOAD
    moon: bool = False

    def rows(self, rows: Sequence[Row]) -> list[Row]:
        """Return the rows of this curve on slopes, without a pull at the hitch."""
        return [
            row
            for row in rows
            if row['wheel'] == str(self.wheel)
            and row['part'] != 'paper_speed'
            and float(row['load']) == self.load
            and (float(row['gravity']) < EARTH) == self.moon
            and not metrics.number(row, 'pull_ratio')
            and row.get(SLIP)
        ]

    def points(self, rows: Sequence[Row], name: str) -> tuple[np.ndarray, np.ndarray]:
        """Return slopes [deg] and means over the beds of a figure."""
        return metrics.by_slope(self.rows(rows), name)


@dataclass(frozen=True)
class Figure:
    """A figure of the paper: its curves, what the text says of it, and whether ours do so."""

    name: str
    quantity: str
    curves: tuple[Curve, ...]
    statement: str
    holds: Callable[[Figure, Sequence[Row]], bool | None]

    def at(self, rows: Sequence[Row], slope: float, name: str = '') -> list[float]:
        """Return the value of each curve at a slope [deg]; nan where it was not run."""
        found = []
        for curve in self.curves:
            slopes, values = curve.points(rows, name or self.quantity)
            there = slopes == slope
            found.append(float(values[there][0]) if there.any() else math.nan)
        return found


def _order_at(slope: float) -> Callable[[Figure, Sequence[Row]], bool | None]:
    """The first curve is the lowest at a slope, the last the highest."""

    def holds(figure: Figure, rows: Sequence[Row]) -> bool | None:
        values = figure.at(rows, slope)
        return None if np.isnan(values).any() else all(a < b for a, b in pairwise(values))

    return holds


def _load_lowers(figure: Figure, rows: Sequence[Row]) -> bool | None:
    steep, level = figure.at(rows, STEEPEST), figure.at(rows, 0.0)
    if np.isnan([*steep, *level]).any():
        return None
    return steep[0] < steep[-1] and np.ptp(level) < steep[-1] - steep[0]


def _width_saturates(figure: Figure, rows: Sequence[Row]) -> bool | None:
    widest, middle, narrow = figure.at(rows, STEEPEST)
    if math.isnan(widest + middle + narrow):
        return None
    return widest < middle < narrow and middle - widest < narrow - middle


def _high_lugs_cost_on_the_level(figure: Figure, rows: Sequence[Row]) -> bool | None:
    level, steep = figure.at(rows, 0.0), figure.at(rows, STEEPEST)
    if np.isnan([*steep, *level]).any():
        return None
    return max(level) == level[0] and max(steep) == steep[-1]


def _thickness_late(figure: Figure, rows: Sequence[Row]) -> bool | None:
    gentle = [figure.at(rows, slope) for slope in (0.0, 5.0, 10.0)]
    steep = [figure.at(rows, slope) for slope in (15.0, STEEPEST)]
    if np.isnan([*gentle, *steep]).any():
        return None
    return all(abs(b / a - 1.0) < ALIKE for a, b in gentle) and all(a < b for a, b in steep)


def _torque_rises_linearly(figure: Figure, rows: Sequence[Row]) -> bool | None:
    slopes, values = figure.curves[0].points(rows, figure.quantity)
    if slopes.size < 4:
        return None
    return bool(np.corrcoef(slopes, values)[0, 1] > 0.98 and (np.diff(values) > 0.0).all())


def _moon_costs_more(figure: Figure, rows: Sequence[Row]) -> bool | None:
    moon, earth = (dict(zip(*c.points(rows, POWER), strict=True)) for c in figure.curves)
    both = moon.keys() & earth.keys()
    return all(moon[slope] > earth[slope] for slope in both) if len(both) > 1 else None


FIGURES = (
    Figure(
        '6, 7', SLIP, (Curve('20 mm, 18 lugs', 8), Curve('10 mm, 18', 2), Curve('10 mm, 36', 7)),
        'lugs of 20 mm slip least on 25 degrees', _order_at(STEEPEST),
    ),
    Figure(
        '9', 'torque_coefficient', (Curve('20 mm, 18 lugs', 8),),
        'the torque coefficient rises linearly with the slope', _torque_rises_linearly,
    ),
    Figure(
        '11', POWER, (Curve('250 mm', 5), Curve('200 mm', 2), Curve('150 mm', 4)),
        'the larger the diameter, the smaller the power number', _order_at(STEEPEST),
    ),
    Figure(
        '12', POWER, (Curve('9.8 N', 2, 9.8), Curve('14.7 N', 2, LIGHTER), Curve('19.6 N', 2)),
        'a lower load lowers it on 25 degrees, less on the level', _load_lowers,
    ),
    Figure(
        '13', POWER, (Curve('150 mm', 3), Curve('100 mm', 2), Curve('50 mm', 1)),
        'width lowers it, more from 50 to 100 mm than from 100 to 150 mm', _width_saturates,
    ),
    Figure(
        '14', POWER, (Curve('20 mm', 8), Curve('10 mm', 2), Curve('5 mm', 6)),
        'lugs of 20 mm cost most where little is slipped, those of 5 mm on 25 degrees',
        _high_lugs_cost_on_the_level,
    ),
    Figure(
        '15', POWER, (Curve('18 lugs', 2), Curve('36 lugs', 7)),
        '18 lugs need less power than 36', _order_at(STEEPEST),
    ),
    Figure(
        '16', POWER, (Curve('5 mm thick', 2), Curve('10 mm thick', 9)),
        'thickness hardly matters up to 10 degrees; above, thin lugs need less', _thickness_late,
    ),
    Figure(
        '18', POWER, (Curve('1/6 g', 5, LIGHTER, moon=True), Curve('1 g', 5, LIGHTER)),
        'less gravity needs more power on all slopes', _moon_costs_more,
    ),
)  # fmt: skip


def lines(rows: Sequence[Row]) -> list[str]:
    """Return the table of statements, and the picture's place."""
    from wheel_terra_estimator.soilbin.tables import table

    words = {True: 'yes', False: '**no**', None: 'not run'}
    body = []
    for figure in FIGURES:
        values = figure.at(rows, STEEPEST)
        told = ', '.join(
            f'{curve.label}: {value:.2f}'
            for curve, value in zip(figure.curves, values, strict=True)
            if math.isfinite(value)
        )
        body.append([figure.name, figure.statement, words[figure.holds(figure, rows)], told])
    head = ['figure', 'what the text says', 'ours do so', 'ours on 25 degrees']
    return ['## Figures 6 to 18', '', *table(head, body), '', f'![ours]({PICTURE})']


def draw(rows: Sequence[Row], path: Path) -> None:
    """Draw our curves of each figure over the slope."""
    from matplotlib.figure import Figure as Canvas

    names = {POWER: 'power number [-]', SLIP: 'slip [-]', 'torque_coefficient': 'T/(W r) [-]'}
    with picture_style():
        canvas = Canvas(figsize=(9.6, 8.4))
        for axis, figure in zip(np.ravel(canvas.subplots(3, 3)), FIGURES, strict=True):
            for curve, colour in zip(figure.curves, LINE_COLOURS, strict=False):
                slopes, values = curve.points(rows, figure.quantity)
                axis.plot(slopes, values, '-o', ms=3, color=colour, label=curve.label)
            axis.set_title(f'figure {figure.name}')
            axis.set_ylabel(names[figure.quantity])
            axis.set_xlabel('slope [deg]')
            axis.legend()
        canvas.savefig(path, metadata={'Date': None})
