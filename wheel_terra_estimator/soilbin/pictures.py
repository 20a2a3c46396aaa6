# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Pictures and film of a run: grains coloured by displacement, as in the paper's figures."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from wheel_terra_estimator.soilbin import geometry
from wheel_terra_estimator.soilbin.bookkeeping import SERIES
from wheel_terra_estimator.soilbin.case import Case

MOVED = 0.001  # [m] in 0.1 s of the paper's time: the red region of its figure 10
INTERVAL = 0.1  # [s]


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
    axes.add_patch(Circle(tuple(axle), wheel.rim_radius, facecolor='#c8d5f0', edgecolor='#41598a'))
    lugs = frame['lugs'] @ turn.T
    _discs(axes, lugs, np.full(len(lugs), geometry.LUG_DISC), facecolors='#41598a')
    walls, _ = geometry.wall_discs(case)
    walls = walls[walls[:, 1] < 0.15] @ turn.T
    axes.plot(walls[:, 0], walls[:, 1], ',', color='0.3')
    axes.set_aspect('equal')
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
    figure, axes = _figure(10, 5)
    grains = _bed(axes, frame, moved, case)
    grains.set_clim(0, max(1.0, float(np.percentile(moved, 98))))
    figure.colorbar(grains, ax=axes, label='displacement in the travel [mm]', shrink=0.7)
    axes.set_title(_title(case, summary))
    figure.savefig(target, dpi=130)


def film(files: Sequence[Path], case: Case, summary: Mapping[str, object], target: Path) -> None:
    """Write a GIF, grains coloured by displacement in 0.1 s, red from 1 mm on (fig. 10)."""
    import imageio.v3 as imageio

    pictures = []
    for path in files:
        frame = _load(path)
        # Speeds grow with the speed factor; the paper's interval shrinks with it.
        interval = INTERVAL / case.operation.speed_factor
        moved = 1000 * interval * np.linalg.norm(frame['velocity'], axis=1)
        figure, axes = _figure(8, 4)
        grains = _bed(axes, frame, moved, case)
        grains.set_clim(0, 1000 * MOVED)
        figure.colorbar(grains, ax=axes, label='displacement in 0.1 s [mm]', shrink=0.7)
        axes.set_title(
            f'{_title(case, summary)}, {case.operation.speed_factor * float(frame["time"]):.1f} s'
        )
        figure.set_dpi(80)
        figure.canvas.draw()
        pictures.append(np.asarray(figure.canvas.buffer_rgba())[..., :3].copy())
    # Encoded in memory: a full disk is then an error of our own write and leaves no half film.
    encoded = imageio.imwrite('<bytes>', np.stack(pictures), extension='.gif', duration=120, loop=0)
    part = target.with_suffix('.part')
    part.write_bytes(encoded)
    part.replace(target)


def draw_series(series: np.ndarray, case: Case, target: Path) -> None:
    """Draw H, R_r and the height of the axle over the travel."""
    figure, axes = _figure(8, 4)
    time = series[:, SERIES.index('time')]
    for name, label in (('gross_traction', 'H'), ('motion_resistance', 'R_r')):
        axes.plot(time, series[:, SERIES.index(name)], lw=0.8, label=label)
    axes.set_xlabel('time [s]')
    axes.set_ylabel('force [N]')
    right = axes.twinx()
    start = series[0, SERIES.index('height')]
    right.plot(time, 1000 * (start - series[:, SERIES.index('height')]), 'k', lw=1)
    right.set_ylabel('sinkage since the start of rotation [mm]')
    axes.legend(loc='upper left')
    figure.savefig(target, dpi=110)


def _title(case: Case, summary: Mapping[str, object]) -> str:
    slip = float(str(summary['slip']))
    return (
        f'{case.name}: W {case.operation.vertical_load:g} N, '
        f'slope {math.degrees(case.operation.slope):.0f} deg, slip {100 * slip:.0f} %'
    )
