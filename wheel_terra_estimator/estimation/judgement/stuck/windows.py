# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Sliding windows of samples as immutable tuples, and their slope."""

from __future__ import annotations

import math

Window = tuple[tuple[float, float], ...]
"""Samples (abscissa, value), oldest first."""

_FEWEST = 5  # samples that make a slope
_LEAST_SPREAD = 1e-12  # of the abscissa


def appended(window: Window, abscissa: float, value: float, span: float) -> Window:
    """Return the window with a new sample and without those older than `span`."""
    return trimmed((*window, (abscissa, value)), abscissa, span)


def trimmed(window: Window, abscissa: float, span: float) -> Window:
    """Return the window without the samples farther back than `span`."""
    first = 0
    while first < len(window) and abscissa - window[first][0] > span:
        first += 1
    return window[first:] if first else window


def slope(window: Window) -> float:
    """Return the least-squares slope of the values, 0 for too few samples."""
    n = len(window)
    if n < _FEWEST:
        return 0.0
    middle = math.fsum([t for t, _ in window]) / n
    mean = math.fsum([v for _, v in window]) / n
    spread = math.fsum([(t - middle) ** 2 for t, _ in window])
    together = math.fsum([(t - middle) * (v - mean) for t, v in window])
    return together / max(spread, _LEAST_SPREAD)
