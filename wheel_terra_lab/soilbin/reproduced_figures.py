# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Figures of Nakashima et al. 2010, the paper's and ours side by side, and what its text says.

The paper's own curves are pictures. What its tables and its text state of them in numbers is drawn
beside ours, and what the text says of them in words is judged, figure by figure.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.reporting.style import LINE_COLOURS, picture_style
from wheel_terra_lab.soilbin import bookkeeping, metrics
from wheel_terra_lab.soilbin.metrics import Row
from wheel_terra_lab.soilbin.study import SERIES_FOLDER, Job

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FULL_LOAD = 19.6  # [N]
LIGHTER = 14.7  # [N]
EARTH = 5.0  # [m/s^2] below it a row is one of the Moon
STEEPEST = 25.0  # [deg]
POWER, SLIP, PULL = 'power_number', 'slip', 'pull_ratio'
TORQUE = 'torque_coefficient'
DEPTH = 'sinkage'
PATH_FIGURE = '8'
ALIKE = 0.1
"""Relative difference of power numbers within which the paper's "almost the same" holds."""


@dataclass(frozen=True)
class Curve:
    """A line of a figure: over which rows, and how it is called."""

    label: str
    wheel: int | str
    load: float = FULL_LOAD
    moon: bool = False
    grain_scale: float = 1.0
    stated: tuple[tuple[float, float], ...] = ()
    """Points that the paper's text states, beside those of its tables 6 and 7."""

    def rows(self, rows: Sequence[Row]) -> list[Row]:
        """Return the rows of this curve on slopes, without a pull at the hitch."""
        return [
            row
            for row in rows
            if row['wheel'] == str(self.wheel)
            and row['part'] != 'paper_speed'
            and float(row['load']) == self.load
            and float(row['grain_scale']) == self.grain_scale
            and (float(row['gravity']) < EARTH) == self.moon
            and not metrics.number(row, 'pull_ratio')
            and row.get(SLIP)
        ]

    def points(self, rows: Sequence[Row], name: str) -> tuple[np.ndarray, np.ndarray]:
        """Return slopes [deg] and means over the beds of a figure."""
        return metrics.by_slope(self.rows(rows), name)

    def paper(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """Return slopes [deg] and values of a figure that the paper states in numbers."""
        points = dict(self.stated)
        if self.load == FULL_LOAD and not self.moon and isinstance(self.wheel, int):
            points |= _tabled(self.wheel, name)
        slopes = sorted(points)
        return np.array(slopes), np.array([points[slope] for slope in slopes])


@dataclass(frozen=True)
class PullCurve(Curve):
    """A line over the slip on level ground, under a pull at the hitch."""

    def rows(self, rows: Sequence[Row]) -> list[Row]:
        """Return the rows of this curve on level ground."""
        return [
            row
            for row in rows
            if row['part'] == 'moon'
            and metrics.number(row, 'slope_deg') == 0.0
            and (float(row['gravity']) < EARTH) == self.moon
            and row.get(SLIP)
        ]

    def points(self, rows: Sequence[Row], name: str) -> tuple[np.ndarray, np.ndarray]:
        """Return slip, mean over the beds, and pull over load."""
        groups: dict[float, list[float]] = {}
        for row in self.rows(rows):
            groups.setdefault(metrics.number(row, PULL), []).append(metrics.number(row, SLIP))
        pulls = sorted(groups)
        return np.array([np.mean(groups[pull]) for pull in pulls]), np.array(pulls)

    def paper(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """Return slip and pull over load as the text states them."""
        slips, pulls = zip(*self.stated, strict=True) if self.stated else ((), ())
        return np.array(slips), np.array(pulls)


def _tabled(wheel: int, name: str) -> dict[float, float]:
    """Return slope [deg] -> value of a figure from tables 6 and 7; on 25 deg PN = (H/W)/(1 - s)."""
    if name == DEPTH:  # the paper states z_a, which counts from the start of rotation
        return {}
    low, steep = metrics.published('table6')[wheel], metrics.published('table7')[wheel]
    at_20 = low['slope_at_20_percent_deg']
    slip, torque = steep[SLIP], steep['gross_traction'] / FULL_LOAD
    if name == SLIP:
        return {at_20: 0.2, STEEPEST: slip}
    if name == TORQUE:
        return {STEEPEST: torque}
    return {
        0.0: low['power_number_self_propelled'],
        at_20: low['power_number_20_percent'],
        15.0: low['power_number_15_deg'],
        STEEPEST: torque / (1.0 - slip),
    }


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


def _moon_pulls_less(figure: Figure, rows: Sequence[Row]) -> bool | None:
    moon, earth = (
        {pull: slip for slip, pull in zip(*c.points(rows, PULL), strict=True)}
        for c in figure.curves
    )
    both = moon.keys() & earth.keys()
    return all(moon[pull] > earth[pull] for pull in both) if len(both) > 1 else None


def _moon_costs_more(figure: Figure, rows: Sequence[Row]) -> bool | None:
    moon, earth = (dict(zip(*c.points(rows, POWER), strict=True)) for c in figure.curves)
    both = moon.keys() & earth.keys()
    return all(moon[slope] > earth[slope] for slope in both) if len(both) > 1 else None


def _coarse(label: str, wheel: int | str, load: float = FULL_LOAD) -> Curve:
    return Curve(label, wheel, load, grain_scale=2.0)


FIGURES = (
    Figure(
        '10', DEPTH, (Curve('150 mm', 3), Curve('100 mm', 2), Curve('50 mm', 1)),
        'the wider the wheel, the less it sinks', _order_at(STEEPEST),
    ),
    Figure(
        '10', DEPTH, (Curve('250 mm', 5), Curve('200 mm', 2), Curve('150 mm', 4)),
        'the larger the diameter, the less it sinks', _order_at(STEEPEST),
    ),
    Figure(
        '6', SLIP, (_coarse('20 mm, 14.7 N (grains x2)', 8, LIGHTER), Curve('10 mm', 2, LIGHTER)),
        'under 14.7 N lugs of 20 mm slip less on 25 degrees than those of 10 mm',
        _order_at(STEEPEST),
    ),
    Figure(
        '7', SLIP,
        (Curve('20 mm, 19.6 N', 8), Curve('10 mm', 2), Curve('10 mm, 36 lugs', 7)),
        'under 19.6 N as well', _order_at(STEEPEST),
    ),
    Figure(
        '9', TORQUE, (Curve('20 mm, 19.6 N', 8),),
        'the torque coefficient rises linearly with the slope', _torque_rises_linearly,
    ),
    Figure(
        '11', POWER, (Curve('250 mm', 5), Curve('200 mm', 2), Curve('150 mm', 4)),
        'the larger the diameter, the smaller the power number', _order_at(STEEPEST),
    ),
    Figure(
        '12(a)', POWER, (Curve('9.8 N', 2, 9.8), Curve('14.7 N', 2, LIGHTER), Curve('19.6 N', 2)),
        'a lower load lowers it on 25 degrees, less on the level', _load_lowers,
    ),
    Figure(
        '12(b)', POWER,
        (_coarse('9.8 N, 20 mm lugs', 8, 9.8), _coarse('14.7 N', 8, LIGHTER),
         _coarse('19.6 N', 8)),
        'the same with lugs of 20 mm (grains x2)', _load_lowers,
    ),
    Figure(
        '13(a)', POWER, (Curve('150 mm', 3), Curve('100 mm', 2), Curve('50 mm', 1)),
        'width lowers it, more from 50 to 100 mm than from 100 to 150 mm', _width_saturates,
    ),
    Figure(
        '13(b)', POWER,
        (_coarse('150 mm, 20 mm lugs', '8 of 150 mm'), _coarse('100 mm', 8),
         _coarse('50 mm', '8 of 50 mm')),
        'the same with lugs of 20 mm (grains x2)', _width_saturates,
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
        '17', PULL,
        (PullCurve('1/6 g', 5, LIGHTER, moon=True, stated=((0.263, 0.0),)),
         PullCurve('1 g', 5, LIGHTER)),
        'on the level less gravity gives less pull at the same slip', _moon_pulls_less,
    ),
    Figure(
        '18', POWER, (Curve('1/6 g', 5, LIGHTER, moon=True), Curve('1 g', 5, LIGHTER)),
        'less gravity needs more power on all slopes', _moon_costs_more,
    ),
)  # fmt: skip


PATH = _coarse('20 mm, 14.7 N (grains x2)', 8, LIGHTER)
"""Of figure 8, whose load the paper does not state."""


def jobs_of(figure: str, jobs: Sequence[Job]) -> list[Job]:
    """Return those of the jobs that a figure of the paper draws, ``12`` including ``12(a)``."""
    curves = [c for f in FIGURES if figure in (f.name, f.name.partition('(')[0]) for c in f.curves]
    curves += [PATH] * (figure == PATH_FIGURE)
    if not curves:
        raise UserError(f'--figure {figure}: no discrete elements belong to it; leave --run')
    rows = [{**{k: str(v) for k, v in job.labels.items()}, SLIP: '0'} for job in jobs]
    drawn = [row for curve in curves for row in curve.rows(rows)]
    return [job for job, row in zip(jobs, rows, strict=True) if row in drawn]


def paths(rows: Sequence[Row], folder: Path) -> dict[float, np.ndarray]:
    """Return by slope [deg] how far the axle went up and down into the slope [m], (2, N).

    Of the rows whose series the folder keeps, one bed each.
    """
    found = {}
    columns = [bookkeeping.SERIES.index(name) for name in ('position', 'height')]
    for row in PATH.rows(rows):
        kept = folder / SERIES_FOLDER / f'{row["key"]}.npy'
        slope = metrics.number(row, 'slope_deg')
        if slope and slope not in found and kept.exists():
            along, height = np.load(kept)[:, columns].T.astype(float)
            found[slope] = np.stack([along - along[0], height[0] - height])
    return found


def equivalent_slope(slope: float, path: np.ndarray) -> float:
    """Return the slope [deg] of the straight line from the start of a path to its end."""
    along, down = path[:, -1]
    return slope - math.degrees(math.atan2(down, along))


def _draw_paths(axis: Axes, found: Mapping[float, np.ndarray]) -> None:
    for (slope, (along, down)), colour in zip(sorted(found.items()), LINE_COLOURS, strict=False):
        angle = math.radians(slope)
        across = along * math.cos(angle) + down * math.sin(angle)
        up = along * math.sin(angle) - down * math.cos(angle)
        axis.plot(across, up, color=colour, label=f'{slope:g} deg')
        axis.plot(across, across * math.tan(angle), ':', color=colour)
    axis.set_title('figure 8: path of the axle, ours (dotted: the slope)')
    axis.set_xlabel('across [m]')
    axis.set_ylabel('up [m]')
    if found:
        axis.legend()


def draw(rows: Sequence[Row], folder: Path, path: Path) -> None:
    """Draw each figure twice, what the paper states of it and ours, and the paths of figure 8.

    `folder` is that of the table of the rows.
    """
    from matplotlib.figure import Figure as Canvas

    names = {POWER: 'power number [-]', SLIP: 'slip [-]', TORQUE: 'T/(W r) [-]', PULL: 'P/W [-]'}
    names[DEPTH] = 'sinkage [m]'
    with picture_style():
        canvas = Canvas(figsize=(9.6, 2.5 * (len(FIGURES) + 1)), layout='constrained')
        halves: Any = canvas.subfigures(2, 1, height_ratios=(1, len(FIGURES)))
        top, below = halves
        _draw_paths(top.subplots(), paths(rows, folder))
        grid = below.subplots(len(FIGURES), 2, sharex='row', sharey='row')
        for (paper, ours), figure in zip(grid, FIGURES, strict=True):
            for curve, colour in zip(figure.curves, LINE_COLOURS, strict=False):
                paper.plot(*curve.paper(figure.quantity), '--s', ms=3.5, color=colour)
                points = curve.points(rows, figure.quantity)
                ours.plot(*points, '-o', ms=3, color=colour, label=curve.label)
            paper.set_title(f'figure {figure.name}: paper')
            ours.set_title(f'figure {figure.name}: ours')
            paper.set_ylabel(names[figure.quantity])
            for axis in (paper, ours):
                axis.set_xlabel('slip [-]' if figure.quantity == PULL else 'slope [deg]')
            ours.legend()
        canvas.savefig(path, metadata={'Date': None})
