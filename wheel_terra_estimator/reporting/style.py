# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""How all pictures look: colours that the colour-blind can tell apart, light frames, thin lines."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.bags.history import EstimateHistory
from wheel_terra_estimator.estimation.estimates import SlipClass

FloatArray = NDArray[np.float64]

# Okabe and Ito 2008, without the yellow that vanishes on white.
LINE_COLOURS = (
    '#0072B2',
    '#D55E00',
    '#009E73',
    '#CC79A7',
    '#56B4E9',
    '#E69F00',
    '#7B4FA3',
    '#6B6B6B',
)
CLASS_COLOURS = {
    SlipClass.LOW: '#efe3a8',
    SlipClass.MODERATE: '#e9a94b',
    SlipClass.HIGH: '#c4552d',
    SlipClass.STUCK: '#6b1238',
    SlipClass.UNKNOWN: '#9aa5b0',
}
"""Darker is worse: they differ in grey and for every eye; unknown is drawn thinner."""
BAND = 2.0
"""Half width of the drawn bands in standard deviations."""
NEVER_KNOWN = 1.0
"""Standard deviation of a slip of which nothing is known [-]."""
TRUTH_COLOUR = '#111111'
WARNING_COLOUR = '#b3261e'

_SETTINGS: dict[Any, Any] = {
    'svg.fonttype': 'none',
    'svg.hashsalt': 'wheel_terra_estimator',  # the same picture is the same file
    'font.family': 'sans-serif',
    'font.size': 9.5,
    'axes.edgecolor': '#8a949e',
    'axes.labelcolor': '#1f2933',
    'axes.spines.top': False,
    'axes.spines.right': False,
    'axes.grid': True,
    'axes.axisbelow': True,
    'axes.titlesize': 10,
    'axes.titlelocation': 'left',
    'grid.color': '#e6eaee',
    'grid.linewidth': 0.7,
    'xtick.color': '#5b6875',
    'ytick.color': '#5b6875',
    'legend.frameon': False,
    'legend.fontsize': 8.5,
    'lines.linewidth': 1.3,
    'figure.constrained_layout.use': True,
}


@contextmanager
def picture_style() -> Iterator[None]:
    """Draw within this context; no window is needed and no global setting stays changed."""
    import matplotlib as mpl

    with mpl.rc_context(_SETTINGS):
        yield


def drawn_slip(history: EstimateHistory) -> FloatArray:
    """Return the slip to draw, (k, n): nan where nothing is known of it."""
    unknown = history.slip_class == SlipClass.UNKNOWN
    unknown &= history.values['slip_std'] >= NEVER_KNOWN
    return np.where(unknown, np.nan, history.values['slip'])


def thin(x: FloatArray, y: FloatArray, points: int = 1200) -> tuple[FloatArray, FloatArray]:
    """Return a line of at most about ``points`` points with the same extremes.

    Of each stretch only the lowest and the highest point are kept, so that a peak in a long drive
    is drawn as high as it was.
    """
    if x.size <= points:
        return x, y
    chosen = [0]
    for stretch in np.array_split(np.arange(x.size), points // 2):
        values = y[stretch]
        if np.isnan(values).all():
            chosen.append(int(stretch[0]))
        else:
            chosen += sorted(int(stretch[f(values)]) for f in (np.nanargmin, np.nanargmax))
    chosen.append(x.size - 1)
    kept = np.unique(chosen)
    return x[kept], y[kept]
