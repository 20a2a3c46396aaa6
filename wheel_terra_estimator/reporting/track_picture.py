# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The map of a drive: where the ground is bad."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from wheel_terra_estimator.arrays import BoolArray
from wheel_terra_estimator.bags.track import Track
from wheel_terra_estimator.estimation.estimates import SlipClass
from wheel_terra_estimator.reporting.drive_style import CLASS_COLOURS
from wheel_terra_estimator.reporting.style import RIM_COLOUR
from wheel_terra_estimator.reporting.time_figure import Curve, nice

LEAST_EXTENT = 0.5
"""Way below which a drive has no map [m]."""
STRAIGHT = 0.15
"""Breadth over length of a way below which it is drawn as a strip over the way [-]."""
MOST_DRAWN = 600  # points of a map
ROOM = 0.06  # around the way, as a share of its extent
STRENGTHS = (
    ('below 0.7', -math.inf, 0.7, '#9b59b6'),
    ('0.7 to 0.9', 0.7, 0.9, '#c9a3d9'),
    ('0.9 to 1.1, as stated', 0.9, 1.1, RIM_COLOUR),
    ('1.1 to 1.3', 1.1, 1.3, '#8cc9a1'),
    ('above 1.3', 1.3, math.inf, '#2e8b57'),
)
"""Words, bounds and colour of the learned shear strength over the stated one: purple is weaker."""


@dataclass(frozen=True)
class Map:
    """A map for the template: places in metres from its upper left corner."""

    width: float
    height: float
    grid: str
    step: str  # of the grid [m]
    curves: tuple[Curve, ...]
    start: tuple[float, float]
    warnings: tuple[tuple[float, float], ...]


def has_map(track: Track) -> bool:
    """Whether a drive went anywhere."""
    return bool(track.stamp.size > 1 and track.values['distance'][-1] > LEAST_EXTENT)


def is_straight(track: Track) -> bool:
    """Whether a way is so straight that a map of it would be a line."""
    points = np.column_stack([track.values['x'], track.values['y']])
    main_axes = np.linalg.eigh(np.cov(points.T))[1]
    spans = np.ptp((points - points.mean(axis=0)) @ main_axes, axis=0)
    return bool(spans.min() < STRAIGHT * spans.max())


def maps(track: Track) -> tuple[Map, Map]:
    """Return the way by the worst slip class of a wheel, and by the learned strength."""
    classes, strength = track.values['slip_class'], track.values['soil_strength']
    by_class = [
        (kind.name.lower(), classes == kind, colour) for kind, colour in CLASS_COLOURS.items()
    ]
    by_soil = [
        (words, (strength >= low) & (strength < high), colour)
        for words, low, high, colour in STRENGTHS
    ]
    return _map(track, by_class), _map(track, by_soil)


def _map(track: Track, kinds: list[tuple[str, BoolArray, str]]) -> Map:
    x, y = track.values['x'], track.values['y']
    extent = max(np.ptp(x), np.ptp(y))
    left, top = x.min() - ROOM * extent, y.max() + ROOM * extent
    width, height = x.max() + ROOM * extent - left, top - (y.min() - ROOM * extent)
    places = np.column_stack([x - left, top - y])
    rows = np.unique(np.linspace(0, x.size - 1, MOST_DRAWN).astype(int))
    curves = []
    for name, member, colour in kinds:
        path = ''.join(
            f'M{places[a][0]:.4g} {places[a][1]:.4g}L{places[b][0]:.4g} {places[b][1]:.4g}'
            for a, b in pairwise(rows.tolist())
            if member[a]
        )
        unknown = name == SlipClass.UNKNOWN.name.lower()
        if path:
            curves.append(Curve(path, 'way', name, colour, 1.5 if unknown else 4.0))
    across = [value for value, _ in nice(left, left + width)]
    down = np.arange(
        math.ceil((top - height) / (across[1] - across[0])) * (across[1] - across[0]),
        top,
        across[1] - across[0],
    )
    grid = ''.join(f'M{v - left:.4g} 0V{height:.4g}' for v in across)
    grid += ''.join(f'M0 {top - v:.4g}H{width:.4g}' for v in down.tolist())
    raised = np.flatnonzero(np.diff(np.concatenate([[0.0], track.values['stuck']])) > 0.0)
    return Map(
        width=float(width),
        height=float(height),
        grid=grid,
        step=f'{across[1] - across[0]:g}',
        curves=tuple(curves),
        start=(float(places[0, 0]), float(places[0, 1])),
        warnings=tuple((float(px), float(py)) for px, py in places[raised]),
    )
