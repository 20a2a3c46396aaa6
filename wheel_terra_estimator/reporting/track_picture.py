# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The map of a drive as a picture: where the ground is bad."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from wheel_terra_estimator.bags.track import Track
from wheel_terra_estimator.estimation.estimates import SlipClass
from wheel_terra_estimator.reporting.drive_style import CLASS_COLOURS
from wheel_terra_estimator.reporting.style import INK, WARNING_COLOUR, picture_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LEAST_EXTENT = 0.5
"""Way below which a drive has no map [m]."""
MOST_DRAWN = 600  # points of a picture
STRENGTHS = (0.5, 1.5)
"""Learned strength over the stated one at the ends of the colours [-]."""


def has_map(track: Track) -> bool:
    """Whether a drive went anywhere."""
    return bool(track.stamp.size > 1 and track.values['distance'][-1] > LEAST_EXTENT)


def map_of(track: Track) -> Figure:
    """Draw the way twice: by the worst slip class of a wheel, and by the learned strength."""
    from matplotlib.figure import Figure

    with picture_style():
        figure = Figure(figsize=(10.5, 4.6))
        by_class, by_soil = figure.subplots(1, 2)
        rows = np.unique(np.linspace(0, track.stamp.size - 1, MOST_DRAWN).astype(int))
        points = np.column_stack([track.values['x'], track.values['y']])[rows]
        classes = track.values['slip_class'][rows]
        for slip_class, colour in CLASS_COLOURS.items():
            mine = classes == slip_class
            if mine.any():
                name = 'at rest' if slip_class == SlipClass.UNKNOWN else slip_class.name.lower()
                by_class.scatter(*points[mine].T, s=9, color=colour, linewidth=0, label=name)
        by_class.set_title('worst slip class of a wheel')
        drawn = by_soil.scatter(
            *points.T,
            s=9,
            c=track.values['soil_strength'][rows],
            cmap='RdYlGn',
            vmin=STRENGTHS[0],
            vmax=STRENGTHS[1],
            linewidth=0,
        )
        figure.colorbar(drawn, ax=by_soil, label='shear strength learned / stated [-]')
        by_soil.set_title('soil')
        for axis in (by_class, by_soil):
            _mark_ends(axis, track)
            axis.set_aspect('equal', adjustable='datalim')
            axis.set_xlabel('x [m]')
        by_class.set_ylabel('y [m]')
        by_class.legend(loc='best', markerscale=2.0)
    return figure


def _mark_ends(axis: Axes, track: Track) -> None:
    """Mark the start, and where stuck warnings were raised."""
    x, y, stuck = (track.values[name] for name in ('x', 'y', 'stuck'))
    axis.plot(x[0], y[0], 'o', color=INK, markersize=6, fillstyle='none', label='start')
    raised = np.flatnonzero(np.diff(np.concatenate([[0.0], stuck])) > 0.0)
    if raised.size:
        axis.plot(
            x[raised], y[raised], 'X', color=WARNING_COLOUR, markersize=9, label='stuck warning'
        )
