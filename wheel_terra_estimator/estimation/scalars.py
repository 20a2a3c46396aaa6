# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Small helpers for plain floats and short tuples of them (faster than numpy for six wheels)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

NAN = math.nan
TINY = 1e-12
"""Least divisor: what is below it is nothing, in any unit here."""
SECOND = 1_000_000_000  # [ns]
NANOSECOND = 1e-9  # [s]
TIME_ROUNDING = 1e-6
"""By which times that should be the same may differ [s]."""


def median(values: Sequence[float]) -> float:
    """Return the median of a list that is not empty."""
    ordered = sorted(values)
    middle = len(ordered) // 2
    return ordered[middle] if len(ordered) % 2 else 0.5 * (ordered[middle - 1] + ordered[middle])


def known(values: Iterable[float]) -> list[float]:
    """Return the values that are not nan."""
    return [value for value in values if not math.isnan(value)]


def clipped(value: float, low: float, high: float) -> float:
    """Return the value, or the bound beyond which it lies."""
    if value < low:
        return low
    return high if value > high else value


def gain_of(dt: float, time_constant: float) -> float:
    """Return the gain of a first-order low-pass over a step `dt`; both in the same unit."""
    return -math.expm1(-dt / time_constant)
