# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The last half minute of motion while driving, for the comparisons that a recording is judged by.

Rim speeds, horizontal specific force, yaw rate and reference velocity are kept as means over tenths
of a second; every six seconds the yaw of the IMU, the places of the wheels and the stamps of the
reference are judged by them, with the same functions as in a recording.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.checks.clocks import as_smooth, unlike
from wheel_terra_estimator.checks.felt_motion import LEAST_YAW, YAW_SIGMAS, felt, yaw_of_motion
from wheel_terra_estimator.checks.statistics import lag
from wheel_terra_estimator.checks.turning import Turning, compare_exchanges

FloatArray = NDArray[np.float64]

BIN = 100_000_000
"""Means are over this [ns of stamps]."""
KEPT = 300
"""Bins that are kept: 30 s."""
LEAST = 120
"""Bins that are judged at least."""
EVERY = 60
"""Bins between two judgements: 6 s."""


LATEST = 2.0
"""Greatest lag of a reference that is looked for [s]."""
LEAST_LATE = 0.3
"""Lag [s] below which it is chassis, soil or a filter."""
LEAST_REFERENCES = 10
CHANGE = 0.4
"""Change of the rim speed, as a share of it, that shows a lag."""
LEAST_RIM_SPEED = 0.02
"""Rim speed [m/s] that shows one."""
FOLLOWS = 0.9
"""Correlation of rims and reference, the lag taken off, below which it does not follow them [-]."""
CLEAR, HONEST = 4.0, 2.0
"""Times that both are more unlike without the lag than with it: late above, right below [-]."""


class Row(NamedTuple):
    """Means of a bin: rim speeds (n,) [m/s], force along x and y [m/s^2], yaw rate [rad/s].

    ``reference`` is its velocity [m/s], nan for none.
    """

    rims: tuple[float, ...]
    force: tuple[float, float]
    yaw: float
    reference: float


@dataclass
class MotionHistory:
    """Rows since ``begin``; ``rows`` is replaced, never changed, so that a copy is cheap."""

    begin: int | None = None  # [ns]
    rows: tuple[Row, ...] = ()
    closed: int = 0
    rims: tuple[float, ...] = ()
    reference: float = math.nan
    inertial: tuple[float, float, float] = (0.0, 0.0, 0.0)
    count: int = 0

    def copy(self) -> MotionHistory:
        """Return a history that later steps leave alone."""
        return replace(self)

    def advance(self, stamp: int) -> bool:
        """Close the bins before a stamp [ns]; return whether it is time to judge."""
        if self.begin is None or stamp - self.begin > KEPT * BIN:  # the first one, or a pause
            self.begin, self.rows = stamp, ()
            self._forget()
        due = False
        while stamp - self.begin >= BIN:
            self.begin += BIN
            if self.rims:
                x, y, yaw = (value / max(self.count, 1) for value in self.inertial)
                if not self.count and self.rows:
                    (x, y), yaw = self.rows[-1].force, self.rows[-1].yaw
                self.rows = (*self.rows[1 - KEPT :], Row(self.rims, (x, y), yaw, self.reference))
                self.closed += 1
                due |= self.closed % EVERY == 0 and len(self.rows) >= LEAST
            self._forget()
        return due

    def _forget(self) -> None:
        """Begin a bin."""
        self.inertial, self.count, self.reference = (0.0, 0.0, 0.0), 0, math.nan

    def add_inertial(self, x: float, y: float, yaw_rate: float) -> None:
        """Take specific force [m/s^2] and yaw rate [rad/s]."""
        a, b, c = self.inertial
        self.inertial = a + x, b + y, c + yaw_rate
        self.count += 1

    def yaw_of_imu(self) -> float | None:
        """Return the yaw of the IMU [rad], 0 where it points forward; None where it is not told."""
        force = np.array([row.force for row in self.rows])
        told = yaw_of_motion(*felt(self._rims().mean(axis=1), self._yaw(), force, BIN * 1e-9))
        if told is None or told.sigmas_from(0.0) < YAW_SIGMAS < told.sigmas_from(LEAST_YAW):
            return None if told is None else 0.0
        if told.sigmas_from(0.0) < YAW_SIGMAS:
            return None
        return told.value if abs(told.value) > LEAST_YAW else 0.0

    def exchanged(self, lateral: tuple[float, ...]) -> tuple[int, int] | None:
        """Return wheels that go by each other's name, (-1, -1) for none; None: not told."""
        best = compare_exchanges(Turning(self._rims(), self._yaw(), np.array(lateral)))
        if best is None:
            return None
        wrong = best.trial.passes and best.fit.track > 0.0
        return (best.fix.exchanged if wrong else None) or (-1, -1)

    def late_reference(self) -> float | None:
        """Return how late the reference's stamps are [s], 0 where they are right; None: not told.

        With honest stamps no lag makes it fit the rims much better than none.
        """
        time = np.linspace(0.0, (len(self.rows) - 1) * BIN * 1e-9, len(self.rows))
        rim, speed = self._rims().mean(axis=1), np.array([row.reference for row in self.rows])
        known = np.isfinite(speed)
        top = float(np.abs(rim).max())
        if known.sum() < LEAST_REFERENCES or top < LEAST_RIM_SPEED or np.ptp(rim) < CHANGE * top:
            return None
        rim, speed = as_smooth(time, rim, time[known], speed[known])
        told = lag(time, rim, speed, LATEST)
        if told is None or told.fit < FOLLOWS:
            return None
        apart = unlike(rim, speed) / max(1.0 - told.fit, 1e-9)
        late = told.value > LEAST_LATE and apart > CLEAR
        return told.value if late else 0.0 if apart < HONEST else None

    def _rims(self) -> FloatArray:
        return np.nan_to_num(np.array([row.rims for row in self.rows]))

    def _yaw(self) -> FloatArray:
        return np.array([row.yaw for row in self.rows])
