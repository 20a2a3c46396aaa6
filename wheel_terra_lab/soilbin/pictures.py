# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Pictures and film of a run: grains coloured by displacement, as in the paper's figures.

All run on one clock, the time that the travel takes at the stated tip speed. A run with a speed
factor k turns the wheel k times faster and is simulated in a k-th of that time.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wheel_terra_estimator.reporting.style import INK, LINE_COLOURS, SOFT, picture_style
from wheel_terra_lab.soilbin import geometry
from wheel_terra_lab.soilbin.bookkeeping import SERIES
from wheel_terra_lab.soilbin.case import Case

MOVED = 0.001  # [m] in 0.1 s of the paper's time: the red region of its figure 10
INTERVAL = 0.1  # [s]
WHEEL, WHEEL_EDGE = '#c8d5f0', '#41598a'
TIME = 'time at the stated tip speed [s]'
FRAME = 120  # [ms] that the film shows each picture


@dataclass(frozen=True)
class Quantity:
    """A line of the time series: panel, name, colour, and how it comes from the samples."""

    panel: str
    name: str
    colour: str
    of: Callable[[Callable[[str], np.ndarray]], np.ndarray]


QUANTITIES = (
    Quantity('force [N]', 'gross traction H', LINE_COLOURS[0], lambda s: s('gross_traction')),
    Quantity(
        'force [N]', 'motion resistance R_r', LINE_COLOURS[1], lambda s: s('motion_resistance')
    ),
    Quantity(
        'force [N]',
        'net traction H - R_r',
        LINE_COLOURS[2],
        lambda s: s('gross_traction') - s('motion_resistance'),
    ),
    Quantity('torque [N m]', 'driving torque', LINE_COLOURS[0], lambda s: s('torque')),
    Quantity(
        'sinkage since the start [mm]',
        'sinkage since the wheel began to turn',
        LINE_COLOURS[0],
        lambda s: 1e3 * (s('height')[0] - s('height')),
    ),
    Quantity('travel [m]', 'travel of the axle', LINE_COLOURS[0], lambda s: s('position')),
)


def clock(case: Case, simulated: np.ndarray) -> np.ndarray:
    """Return the time at the stated tip speed [s] of simulated times since the start [s]."""
    return case.operation.speed_factor * simulated


def lines(series: np.ndarray, case: Case) -> Iterator[tuple[Quantity, np.ndarray, np.ndarray]]:
    """Yield each quantity of the time series with its times and values."""

    def column(name: str) -> np.ndarray:
        return series[:, SERIES.index(name)]

    time = clock(case, column('time'))
    for quantity in QUANTITIES:
        yield quantity, time, quantity.of(column)


def _figure(width: float, height: float) -> tuple[Any, Any]:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout='constrained')
    FigureCanvasAgg(figure)
    return figure, figure.add_subplot()


def _discs(axes: Any, centres: np.ndarray, diameters: np.ndarray, **style: Any) -> Any:
    from matplotlib.collections import EllipseCollection

    discs = EllipseCollection(
        diameters,
        diameters,
        np.zeros_like(diameters),
        units='xy',
        offsets=centres,
        transOffset=axes.transData,
        cmap='YlOrRd',
        linewidths=0,
        **style,
    )
    axes.add_collection(discs)
    return discs


def _bed(axes: Any, frame: Mapping[str, np.ndarray], colours: np.ndarray, case: Case) -> Any:
    """Draw grains and wheel, turned so that gravity points down the picture."""
    from matplotlib.patches import Circle

    slope = case.operation.slope
    turn = np.array([[math.cos(slope), -math.sin(slope)], [math.sin(slope), math.cos(slope)]])
    grains = _discs(axes, frame['centres'] @ turn.T, 2 * frame['radii'], array=colours)
    axle = turn @ frame['axle']
    wheel = case.wheel
    axes.add_patch(Circle(tuple(axle), wheel.rim_radius, facecolor=WHEEL, edgecolor=WHEEL_EDGE))
    lugs = frame['lugs'] @ turn.T
    _discs(axes, lugs, np.full(len(lugs), geometry.LUG_DISC), facecolors=WHEEL_EDGE)
    walls, _ = geometry.wall_discs(case)
    walls = walls[walls[:, 1] < 0.15] @ turn.T
    axes.plot(walls[:, 0], walls[:, 1], ',', color=SOFT)
    axes.set_aspect('equal')
    axes.grid(visible=False)
    axes.set_xlabel('horizontal [m]')
    axes.set_ylabel('vertical [m]')
    top = max(float((frame['centres'] @ turn.T)[:, 1].max()), axle[1] + wheel.tip_radius)
    axes.set_ylim(-0.02, top + 0.02)
    axes.set_xlim(walls[:, 0].min() - 0.01, walls[:, 0].max() + 0.01)
    return grains


def _load(path: Path) -> dict[str, np.ndarray]:
    with np.load(path) as file:
        return {name: file[name] for name in file.files}


def draw(
    frame_file: Path, first_file: Path, case: Case, summary: Mapping[str, object], target: Path
) -> None:
    """Draw the end of the run, grains coloured by their displacement (figures 19, 20)."""
    frame, first = _load(frame_file), _load(first_file)
    moved = 1000 * np.linalg.norm(frame['centres'] - first['centres'], axis=1)
    with picture_style():
        figure, axes = _figure(10, 5)
        grains = _bed(axes, frame, moved, case)
        grains.set_clim(0, max(1.0, float(np.percentile(moved, 98))))
        figure.colorbar(grains, ax=axes, label='displacement in the travel [mm]', shrink=0.7)
        axes.set_title(title(case, summary))
        figure.savefig(target, dpi=130)


def film(files: Sequence[Path], case: Case, summary: Mapping[str, object], target: Path) -> None:
    """Write a GIF, grains coloured by displacement in 0.1 s, red from 1 mm on (fig. 10).

    The seconds in its title are those of the clock of all pictures; so are the 0.1 s.
    """
    import imageio.v3 as imageio

    pictures = []
    # Speeds grow with the speed factor; the paper's interval shrinks with it.
    interval = INTERVAL / case.operation.speed_factor
    for path in files:
        frame = _load(path)
        moved = 1000 * interval * np.linalg.norm(frame['velocity'], axis=1)
        now = float(clock(case, frame['time']))
        with picture_style():
            figure, axes = _figure(8, 4)
            grains = _bed(axes, frame, moved, case)
            grains.set_clim(0, 1000 * MOVED)
            figure.colorbar(grains, ax=axes, label='displacement in 0.1 s [mm]', shrink=0.7)
            axes.set_title(f'{title(case, summary)}, {now:.1f} s')
            figure.set_dpi(80)
            figure.canvas.draw()
        pictures.append(np.asarray(figure.canvas.buffer_rgba())[..., :3].copy())
    # Encoded in memory: a full disk is then an error of our own write and leaves no half film.
    encoded = imageio.imwrite(
        '<bytes>', np.stack(pictures), extension='.gif', duration=FRAME, loop=0
    )
    part = target.with_suffix('.part')
    part.write_bytes(encoded)
    part.replace(target)


def draw_series(series: np.ndarray, case: Case, target: Path) -> None:
    """Draw forces, torque, sinkage and travel under one another."""
    from matplotlib.figure import Figure

    panels = list(dict.fromkeys(quantity.panel for quantity in QUANTITIES))
    with picture_style():
        figure = Figure(figsize=(8, 1.5 * len(panels) + 0.8))
        axes = dict(zip(panels, figure.subplots(len(panels), 1, sharex=True).tolist(), strict=True))
        for quantity, time, values in lines(series, case):
            axes[quantity.panel].plot(
                time, values, color=quantity.colour, linewidth=0.9, label=quantity.name
            )
        for panel, axis in axes.items():
            axis.set_title(panel)
            axis.axhline(0.0, color=INK, linewidth=0.6)
        axes[panels[0]].legend(loc='lower right', bbox_to_anchor=(1.0, 1.0), ncols=3)
        axes[panels[-1]].set_xlabel(TIME)
        figure.savefig(target, dpi=110)


def title(case: Case, summary: Mapping[str, object]) -> str:
    """Return the case in a line."""
    slip = float(str(summary['slip']))
    return (
        f'{case.name}: W {case.operation.vertical_load:g} N, '
        f'slope {math.degrees(case.operation.slope):.0f} deg, slip {100 * slip:.0f} %'
    )
