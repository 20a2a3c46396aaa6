# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The last half minute of motion while driving, for the comparisons that a recording is judged by.

Rim speeds, horizontal specific force and yaw rate are kept as means over tenths of a second; every
six seconds the yaw of the IMU and the places of the wheels are judged by them, with the same
functions and the same trial on halves as in a recording.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from wheel_terra_estimator.checks.felt_motion import LEAST_YAW, YAW_SIGMAS, felt, yaw_of_motion
from wheel_terra_estimator.checks.turning import LEAST_TURNING_ROWS, Fix, Turning, compare, pairs_of

BIN = 100_000_000
"""Means are over this [ns of stamps]."""
KEPT = 300
"""Bins that are kept: 30 s."""
LEAST = 120
"""Bins that are judged at least."""
EVERY = 60
"""Bins between two judgements: 6 s."""


class Row(NamedTuple):
    """Means of a bin: rim speeds (n,) [m/s], force along x and y [m/s^2], yaw rate [rad/s]."""

    rims: tuple[float, ...]
    force: tuple[float, float]
    yaw: float


@dataclass
class MotionHistory:
    """Rows since ``begin``; ``rows`` is replaced, never changed, so that a copy is cheap."""

    begin: int | None = None  # [ns]
    rows: tuple[Row, ...] = ()
    closed: int = 0
    rims: tuple[float, ...] = ()
    inertial: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    count: int = 0

    def copy(self) -> MotionHistory:
        """Return a history that later steps leave alone."""
        return replace(self, inertial=list(self.inertial))

    def advance(self, stamp: int) -> bool:
        """Close the bins before a stamp [ns]; return whether it is time to judge."""
        if self.begin is None or stamp - self.begin > KEPT * BIN:  # the first one, or a pause
            self.begin, self.rows, self.count = stamp, (), 0
            self.inertial = [0.0, 0.0, 0.0]
        due = False
        while stamp - self.begin >= BIN:
            self.begin += BIN
            if self.rims and (self.count or self.rows):
                last = self.rows[-1] if self.rows else None
                x, y, yaw = (value / max(self.count, 1) for value in self.inertial)
                if not self.count and last is not None:
                    (x, y), yaw = last.force, last.yaw
                self.rows = (*self.rows[1 - KEPT :], Row(self.rims, (x, y), yaw))
                self.closed += 1
                due |= self.closed % EVERY == 0 and len(self.rows) >= LEAST
            self.inertial, self.count = [0.0, 0.0, 0.0], 0
        return due

    def add_rims(self, rims: tuple[float, ...]) -> None:
        """Take the rim speeds of a message [m/s]."""
        self.rims = rims

    def add_inertial(self, x: float, y: float, yaw_rate: float) -> None:
        """Take specific force [m/s^2] and yaw rate [rad/s]."""
        for index, value in enumerate((x, y, yaw_rate)):
            self.inertial[index] += value
        self.count += 1

    def yaw_of_imu(self) -> float | None:
        """Return the yaw of the IMU [rad], 0 where it points forward; None where it is not told."""
        rims, force, yaw = self._arrays()
        told = yaw_of_motion(*felt(rims.mean(axis=1), yaw, force, BIN * 1e-9))
        if told is None or told.sigmas_from(0.0) < YAW_SIGMAS < told.sigmas_from(LEAST_YAW):
            return None if told is None else 0.0
        if told.sigmas_from(0.0) < YAW_SIGMAS:
            return None
        return told.value if abs(told.value) > LEAST_YAW else 0.0

    def exchanged(self, lateral: tuple[float, ...]) -> Iterator[tuple[tuple[int, int], bool]]:
        """Yield a pair of wheels that go by each other's name, or that none does ((-1, -1))."""
        rims, _, yaw = self._arrays()
        stretch = Turning(rims, yaw, np.array(lateral))
        turns = stretch.turns()
        count = rims.shape[1]
        if count < 3 or turns.sum() < 2 * LEAST_TURNING_ROWS:
            return
        nothing = Fix((1,) * count)
        fixes = [nothing, *(Fix(nothing.signs, pair) for pair in pairs_of(stretch.lateral))]
        best = compare(stretch.rows(turns), fixes)
        wrong = best.trial.passes and best.fit.track > 0.0 and best.fix.exchanged is not None
        yield (best.fix.exchanged or (-1, -1)) if wrong else (-1, -1), wrong

    def _arrays(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        rims = np.nan_to_num(np.array([row.rims for row in self.rows]))
        force = np.array([row.force for row in self.rows])
        return rims, force, np.array([row.yaw for row in self.rows])
