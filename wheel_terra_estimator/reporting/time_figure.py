# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A figure over one axis: panels under one another, drawn once as SVG and laid out by the page.

Curves are paths in the data's x and in thousandths of the panel's height; the page stretches them
to any width, so that screen, phone and paper show the same drawing. All words are HTML beside the
drawing: none covers a curve. The script of the template only zooms and reads values.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from wheel_terra_estimator.arrays import BoolArray, FloatArray
from wheel_terra_estimator.reporting.style import thin

LINE_POINTS, BAND_POINTS, TRUTH_POINTS = 2000, 300, 600
"""Points of a line in the page: what a wide screen shows, and a file below 4 MB."""
HEIGHT = 1000
"""Height of a panel in its drawing; paths are rounded to a tenth of it."""
TICKS = 4
"""Numbers beside a panel, about."""
MARGIN = 0.08  # room above and below a line, as a share of its range
STRIP, THIN_STRIP = 0.7, 0.16  # heights of a strip, as a share of its row
NEAREST_MARKS = 0.08
"""Numbers of shaded stretches stand at least this share of the axis apart."""


@dataclass(frozen=True)
class Panel:
    """One panel: title with unit, height over 800 px, fixed range or None, names of strips."""

    title: str
    share: float = 0.2
    limits: tuple[float, float] | None = None
    strips: tuple[str, ...] = ()


@dataclass(frozen=True)
class Switch:
    """A box of the page that shows or hides the curves that name it."""

    key: str
    text: str
    on: bool = True
    colour: str = ''


@dataclass(frozen=True)
class Mark:
    """A number, or a text, at a share of an axis."""

    text: str
    share: float


@dataclass(frozen=True)
class Curve:
    """A path of a panel: its CSS classes, name, colour on a light page."""

    path: str
    classes: str
    name: str = ''
    light: str = ''
    width: float = 1.4


@dataclass(frozen=True)
class Drawn:
    """A panel as the template lays it out: ``low`` and ``high`` are its limits."""

    title: str
    share: float
    low: float
    high: float
    curves: tuple[Curve, ...]
    ticks: tuple[Mark, ...]
    strips: bool


@dataclass
class _Line:
    panel: int
    x: FloatArray
    y: FloatArray  # (k,), or (2, k): lower and upper edge of a band
    curve: Curve  # without its path, which the limits of the panel decide


@dataclass
class TimeFigure:
    """Collects lines, bands, strips and shaded stretches of panels under one another."""

    panels: Sequence[Panel]  # from top to bottom; other methods count them from 0
    # Boxes above the figure. A curve is drawn while all switches that it names are on.
    switches: Sequence[Switch]
    end: float  # last value on the axis, which begins at 0
    axis: str  # title of the axis, with unit
    shaded: list[tuple[float, float]] = field(default_factory=list)
    _lines: list[_Line] = field(default_factory=list)
    _strips: list[tuple[int, Curve]] = field(default_factory=list)  # with their panels

    def line(
        self,
        panel: int,
        x: FloatArray,
        values: FloatArray,
        name: str,
        colour: str,
        *switches: str,
        width: float = 1.4,
    ) -> None:
        """Add a line; nan is a gap."""
        points = thin(x, values, LINE_POINTS)
        classes = f'line {self._classes(switches)}'
        self._lines.append(_Line(panel, *points, Curve('', classes, name, colour, width)))

    def truth(
        self, panel: int, x: FloatArray, values: FloatArray, name: str, *switches: str
    ) -> None:
        """Add a dashed line in the page's ink."""
        points = thin(x, values, TRUTH_POINTS)
        classes = f'truth {self._classes(switches)}'
        self._lines.append(_Line(panel, *points, Curve('', classes, name)))

    def band(
        self,
        panel: int,
        x: FloatArray,
        values: FloatArray,
        half: FloatArray,
        colour: str,
        *switches: str,
    ) -> None:
        """Add a band of plus and minus ``half``; only while the switch ``band`` is on."""
        few, low = thin(x, values - half, BAND_POINTS)
        edges = np.vstack([low, np.interp(few, x, values + half)])
        classes = f'band {self._classes(("band", *switches))}'
        self._lines.append(_Line(panel, few, edges, Curve('', classes, light=colour)))

    def strips(
        self, panel: int, x: FloatArray, member: BoolArray, name: str, colour: str,
        *, slender: bool = False,
    ) -> None:  # fmt: skip
        """Add the stretches (k, n) of n strips that belong to one class, first strip on top."""
        rows, share = len(self.panels[panel].strips), THIN_STRIP if slender else STRIP
        height = share * HEIGHT / rows
        parts = []
        for row in range(member.shape[1]):
            top = HEIGHT * (row + 0.5 * (1.0 - share)) / rows
            edges = np.flatnonzero(np.diff(np.concatenate(([0], member[:, row], [0]))))
            for start, end in edges.reshape(-1, 2):
                left, right = float(x[start]), float(x[min(end, x.size - 1)])
                parts.append(f'M{left:.6g} {top:.1f}H{right:.6g}v{height:.1f}H{left:.6g}z')
        self._strips.append((panel, Curve(''.join(parts), 'strip', name, colour)))

    def shade(self, start: float, end: float) -> None:
        """Shade a stretch of all panels; it gets the next number, from 1."""
        self.shaded.append((start, end))

    def marks(self) -> list[Mark]:
        """Return the numbers of the shaded stretches; of those that crowd, the first."""
        marks: list[Mark] = []
        for number, (start, _) in enumerate(self.shaded, start=1):
            share = min(start / self.end, 1.0 - 0.5 * NEAREST_MARKS) if self.end > 0.0 else 0.0
            if not marks or share - marks[-1].share >= NEAREST_MARKS:
                marks.append(Mark(str(number), share))
        return marks

    def left(self) -> int:
        """Return the longest text beside a panel, in characters."""
        return max(len(tick.text) for panel in self.drawn() for tick in panel.ticks)

    def drawn(self) -> list[Drawn]:
        """Return the panels for the template."""
        return [
            self._strip_panel(number, panel) if panel.strips else self._line_panel(number, panel)
            for number, panel in enumerate(self.panels)
        ]

    def _classes(self, switches: Sequence[str]) -> str:
        keys = [switch.key for switch in self.switches]
        return ' '.join(f's{keys.index(key)}' for key in switches if key in keys)

    def _line_panel(self, number: int, panel: Panel) -> Drawn:
        mine = [line for line in self._lines if line.panel == number]
        low, high = panel.limits or limits(*(line.y for line in mine if line.y.ndim == 1))
        curves = tuple(replace(line.curve, path=_path(line, low, high)) for line in mine)
        ticks = tuple(Mark(text, (high - value) / (high - low)) for value, text in nice(low, high))
        return Drawn(panel.title, panel.share, low, high, curves, ticks, strips=False)

    def _strip_panel(self, number: int, panel: Panel) -> Drawn:
        rows = len(panel.strips)
        curves = tuple(curve for place, curve in self._strips if place == number)
        ticks = tuple(Mark(name, (row + 0.5) / rows) for row, name in enumerate(panel.strips))
        return Drawn(panel.title, panel.share, 0.0, 1.0, curves, ticks, strips=True)


def _path(line: _Line, low: float, high: float) -> str:
    """Return the path of a line, broken where it is nan, or of a band."""
    y = HEIGHT * (high - line.y) / (high - low)
    if y.ndim == 2:
        known = np.isfinite(y).all(axis=0)
        x = np.concatenate([line.x[known], line.x[known][::-1]])
        return _pieces(x, np.concatenate([y[0, known], y[1, known][::-1]]))
    return _pieces(line.x, y)


def _pieces(x: FloatArray, y: FloatArray) -> str:
    parts, pen = [], 'M'
    for px, py in zip(x.tolist(), np.clip(y, -9e4, 9e4).tolist(), strict=True):
        if math.isnan(py):
            pen = 'M'
            continue
        parts.append(f'{pen}{px:.6g} {py:.1f}')
        pen = 'L'
    return ''.join(parts)


def nice(low: float, high: float, count: int = TICKS) -> list[tuple[float, str]]:
    """Return about ``count`` round numbers within limits, each with its text."""
    if not high > low:
        return []
    raw = (high - low) / count
    unit = 10.0 ** math.floor(math.log10(raw))
    step = unit * next(factor for factor in (1.0, 2.0, 5.0, 10.0) if factor * unit >= raw)
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    digits = max(-math.floor(math.log10(step) + 1e-9), 0)
    return [(n * step, f'{n * step:.{digits}f}'.replace('-', '−')) for n in range(first, last + 1)]


def limits(*lines: FloatArray, within: tuple[float, float] | None = None) -> tuple[float, float]:
    """Return a range that holds the lines with a margin, and at least ``within``."""
    ends = [] if within is None else list(within)
    for values in lines:
        known = values[np.isfinite(values)]
        if known.size:
            ends += [float(known.min()), float(known.max())]
    low, high = (min(ends), max(ends)) if ends else (0.0, 1.0)
    margin = MARGIN * (high - low) or 1.0
    return low - margin, high + margin
