# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What an entrapment is, and whether a stuck warning was right: the one definition.

A rover is entrapped once the median driving slip has been above 0.9 for a second. A warning was
right if that begins within 20 s or while it stands, a near miss if the median |slip| passes 0.75
within 20 s, else false.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.arrays import BoolArray, FloatArray
from wheel_terra_estimator.estimation.scalars import TIME_ROUNDING

ENTRAPPED_SLIP = 0.9
"""Median driving slip above which a rover hardly moves: class *stuck* [-]."""
HELD = 1.0
"""Time for which the slip stays above it in an entrapment [s]."""
NEAR_MISS_SLIP = 0.75
"""Median |slip| above which a warning without an entrapment was a near miss [-]."""
FORESIGHT = 20.0
"""Time after a warning within which its outcome is judged [s]."""


class Entrapments(NamedTuple):
    """Entrapments of a drive of k rows, as row numbers (m,) and a mask (k,)."""

    begins: NDArray[np.int64]  # the slip exceeds 0.9
    entrapped: NDArray[np.int64]  # it has done so for a second
    under_way: BoolArray  # from the beginning until the slip falls below 0.9


class Outcome(Enum):
    """What came of a warning."""

    ENTRAPPED = 'entrapped'
    NEAR_MISS = 'near miss'
    FALSE = 'false'


class Verdict(NamedTuple):
    """Outcome of a warning, and its time before the entrapment [s] (negative: late)."""

    outcome: Outcome
    lead: float | None = None


class Span(NamedTuple):
    """Start and end of a warning [s]; inf: it lasts to the end of the drive."""

    start: float
    end: float = np.inf


def entrapments(time: FloatArray, slip: FloatArray) -> Entrapments:
    """Return the entrapments of a drive: times (k,) [s], slip ratios (k, n), nan at rest.

    Skidding is no entrapment, nor is rest.
    """
    above = np.concatenate([[False], _median(slip) > ENTRAPPED_SLIP, [False]]).astype(int)
    starts, ends = np.flatnonzero(np.diff(above) == 1), np.flatnonzero(np.diff(above) == -1)
    begins, entrapped = [], []
    under_way = np.zeros(len(time), dtype=bool)
    for start, end in zip(starts, ends, strict=True):
        full = int(np.searchsorted(time, time[start] + HELD - TIME_ROUNDING))
        if full < end:
            begins.append(start)
            entrapped.append(full)
            under_way[start:end] = True
    return Entrapments(np.array(begins, dtype=int), np.array(entrapped, dtype=int), under_way)


def verdicts(time: FloatArray, slip: FloatArray, warnings: Sequence[Span]) -> tuple[Verdict, ...]:
    """Return the outcomes of warnings; time and slip as in `entrapments`."""
    found = entrapments(time, slip)
    over = np.append(~found.under_way, True)
    ends = [row + int(np.argmax(over[row:])) for row in found.entrapped]
    high = _median(np.abs(slip)) > NEAR_MISS_SLIP
    verdicts = []
    for start, taken_back in warnings:
        first, soon, last = np.searchsorted(
            time, [start, start + FORESIGHT, max(start + FORESIGHT, taken_back)]
        ).tolist()
        ahead = [
            row
            for begin, row, end in zip(found.begins, found.entrapped, ends, strict=True)
            if end > first and begin < last
        ]
        if ahead:
            verdicts.append(Verdict(Outcome.ENTRAPPED, float(time[ahead[0]] - start)))
        else:
            near = bool(high[first:soon].any())
            verdicts.append(Verdict(Outcome.NEAR_MISS if near else Outcome.FALSE))
    return tuple(verdicts)


def lead_of(entrapped: float, warnings: Sequence[Span]) -> float | None:
    """Return for how long a warning had stood when the rover was entrapped [s]; None: none did."""
    standing = [w.start for w in warnings if w.start <= entrapped < w.end]
    return entrapped - standing[-1] if standing else None


def _median(slip: FloatArray) -> FloatArray:
    """Return (k,) the median of the wheels that turn, 0 where none does."""
    known = ~np.isnan(slip).all(axis=1)
    median = np.zeros(len(slip))
    median[known] = np.nanmedian(slip[known], axis=1)
    return median
