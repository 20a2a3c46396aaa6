# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Style of all pictures: colours that the colour-blind can distinguish, light frames, thin lines.

Pictures are drawn for a light page; ``DARK`` says which of their colours follow a dark one.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from wheel_terra_estimator.arrays import FloatArray

LINE_COLOURS = (
    '#0083d3',
    '#a93a00',
    '#069e73',
    '#ab4d8e',
    '#3a286e',
    '#c58801',
    '#7b4fa3',
    '#6b6b6b',
)
"""On white at least 3:1 (WCAG 2.2, 1.4.11); the first six, as those of `DARK`, also differ by 24
in CIE L*a*b* for red-blind and green-blind eyes (Machado et al. 2009, doi 10.1109/TVCG.2009.113).
"""
CLASS_LIGHT = ('#efe3a8', '#e9a94b', '#c4552d', '#6b1238')
"""Low, moderate, high, stuck: the worse the further from the page, in both modes."""
_LINES_DARK = (
    '#41a4dd',
    '#e06a20',
    '#30c090',
    '#ffbee4',
    '#7a5ae0',
    '#ffe070',
    '#b08ad0',
    '#a9a9a9',
)
_CLASSES_DARK = ('#6f6a4a', '#b98122', '#f59a70', '#ffdbe9')
INK, SOFT, EDGE, RIM_COLOUR = '#1f2933', '#5b6875', '#8a949e', '#9aa5b0'
TRUTH_COLOUR = '#111111'
WARNING_COLOUR = '#b3261e'
NOISE_COLOUR, GRID_COLOUR = '#e3e8ee', '#e6eaee'

DARK = {
    INK: '#e3e8ed',
    TRUTH_COLOUR: '#f4f6f8',
    SOFT: '#a3afba',
    GRID_COLOUR: '#2d3741',
    NOISE_COLOUR: '#2a333c',
    **dict(zip(LINE_COLOURS, _LINES_DARK, strict=True)),
    **dict(zip(CLASS_LIGHT, _CLASSES_DARK, strict=True)),
    WARNING_COLOUR: '#f0776c',
    '#ffffff': 'none',
}
"""Colour of a picture on a light page -> on a dark one; all others stay."""

_SETTINGS: dict[Any, Any] = {
    'svg.fonttype': 'none',
    'svg.hashsalt': 'wheel_terra_estimator',  # the same picture is the same file
    'font.family': 'sans-serif',
    'font.sans-serif': ['DejaVu Sans', 'Verdana'],
    'font.size': 9.5,
    'axes.edgecolor': EDGE,
    'axes.labelcolor': INK,
    'axes.titlecolor': INK,
    'text.color': INK,
    'axes.spines.top': False,
    'axes.spines.right': False,
    'axes.grid': True,
    'axes.axisbelow': True,
    'axes.titlesize': 10,
    'axes.titlelocation': 'left',
    'grid.color': GRID_COLOUR,
    'grid.linewidth': 0.7,
    'xtick.color': SOFT,
    'ytick.color': SOFT,
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


def for_dark_pages(svg: str) -> str:
    """Return a picture (SVG) whose colours follow the light or dark mode of its reader."""
    rules = []
    for light, dark in DARK.items():  # matplotlib writes them in lower case
        for key in ('fill', 'stroke'):
            rules.append(f'[style*="{key}: {light.lower()}"]{{{key}:{dark}!important}}')
    sheet = '@media screen and (prefers-color-scheme:dark){' + ''.join(rules) + '}'
    return svg.replace('<defs>', f'<style>{sheet}</style><defs>', 1)


def thin(x: FloatArray, y: FloatArray, points: int = 1200) -> tuple[FloatArray, FloatArray]:
    """Return a line of at most about ``points`` points with the same extremes.

    Of each stretch only the lowest and the highest point are kept, so that a peak in a long drive
    is drawn as high as it was.
    """
    if x.size <= points:
        return x, y
    chosen = [np.array([0, x.size - 1])]
    length, longer = divmod(x.size, points // 2)
    # The first stretches are one point longer, so that all points are in one.
    for begin, end, size in (
        (0, longer * (length + 1), length + 1),
        (longer * (length + 1), x.size, length),
    ):
        stretches = y[begin:end].reshape(-1, size)
        first = begin + size * np.arange(len(stretches))
        for extreme, missing in ((np.argmin, np.inf), (np.argmax, -np.inf)):
            known = np.where(np.isnan(stretches), missing, stretches)
            chosen.append(first + extreme(known, axis=1))
    kept = np.unique(np.concatenate(chosen))
    return x[kept], y[kept]
