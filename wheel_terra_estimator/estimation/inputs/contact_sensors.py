# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Readings of sinkage and leaving angle between two cycles of the filter."""

from __future__ import annotations

import math
from math import isnan
from typing import NamedTuple

import numpy as np

from wheel_terra_estimator.arrays import FloatArray, Floats
from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.measurements import LeavingAngleReading, SinkageReading
from wheel_terra_estimator.estimation.scalars import NAN


class SinkageSums(NamedTuple):
    """Sum [m] and number of the readings of each wheel since the last cycle."""

    total: Floats
    readings: tuple[int, ...]


class SinkageInput(Component[SinkageSums]):
    """Sums the sinkage readings of each wheel."""

    def __init__(self, wheel_count: int) -> None:
        super().__init__(SinkageSums((0.0,) * wheel_count, (0,) * wheel_count))

    def update(self, reading: SinkageReading) -> None:
        """Take a message; wheels that are nan were not read."""
        total, count = list(self.state.total), list(self.state.readings)
        for i, value in enumerate(reading.sinkage.tolist()):
            if not isnan(value):
                total[i] += value
                count[i] += 1
        self.state = SinkageSums(tuple(total), tuple(count))

    def take(self) -> SinkageSums:
        """Return the sums since the last call, and begin new ones."""
        sums = self.state
        self.reset()
        return sums


_GAIN = 0.3  # of the smoothed leaving angle, per reading [-]
SMOOTHED_NOISE = math.sqrt(_GAIN / (2.0 - _GAIN))
"""Deviation of a smoothed leaving angle over that of one reading [-]."""
_LONGEST_AGE = 1.0
"""Age up to which an angle is used [s]: half a turn of a slow rover's wheel."""


class LeavingAngleState(NamedTuple):
    """Smoothed angle [rad] and time [s] of each wheel."""

    angle: Floats
    time: Floats


class LeavingAngleInput(Component[LeavingAngleState]):
    """Smooths the measured leaving angles."""

    def __init__(self, wheel_count: int) -> None:
        super().__init__(LeavingAngleState((NAN,) * wheel_count, (-math.inf,) * wheel_count))

    def update(self, time: float, reading: LeavingAngleReading) -> None:
        """Take a message at a time [s]; wheels that are nan were not read."""
        angle, when = list(self.state.angle), list(self.state.time)
        for i, value in enumerate(reading.leaving_angle.tolist()):
            if not isnan(value):
                old = value if time - when[i] > _LONGEST_AGE else angle[i]
                angle[i] = old + _GAIN * (value - old)
                when[i] = time
        self.state = LeavingAngleState(tuple(angle), tuple(when))

    def angles(self, time: float) -> FloatArray | None:
        """Return the leaving angles (n,) [rad], nan where none is recent; None = none is."""
        recent = [time - when < _LONGEST_AGE for when in self.state.time]
        return np.where(recent, self.state.angle, NAN) if any(recent) else None
