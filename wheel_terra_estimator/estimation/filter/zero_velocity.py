# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Zero-velocity update while all wheels stand; zero-rate offset of the gyro."""

from __future__ import annotations

from math import isnan
from typing import NamedTuple

import numpy as np

from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.contacts.cycle import Cycle
from wheel_terra_estimator.estimation.filter.ekf import GatedFilter, Row
from wheel_terra_estimator.estimation.filter.state import SPEED
from wheel_terra_estimator.estimation.inputs.inertial import GyroZero
from wheel_terra_estimator.estimation.rover import Rover
from wheel_terra_estimator.estimation.scalars import NAN

# Tuned on simulated drives, seeds 1000 to 1019.
_SETTLING_TIME = 0.15  # [s] of standing wheels before the rover counts as standing
_STD = 0.0005  # of a rover that stands [m/s]
_MOST_YAW_RATE = 0.05  # of a rover at rest, by the zero of the gyro [rad/s]
_MOST_CYCLES = 200.0  # in the running mean of the zero
_KEPT_SHARE = 0.5  # weight of a zero kept in a new run, over that in the old one [-]


class ZeroVelocityState(NamedTuple):
    """Since when the wheels stand [s], nan = they do not; zeros of the gyro and their weight."""

    since: float = NAN
    zero: GyroZero = GyroZero()
    weight: float = 0.0  # cycles in the mean


class ZeroVelocityUpdate(Component[ZeroVelocityState]):
    """Fuses zero velocity at rest, and learns the zero of the gyro meanwhile."""

    def __init__(self, rover: Rover) -> None:
        super().__init__(ZeroVelocityState())
        self._rest_time = rover.rest_time

    def keep_zero_of(self, old: ZeroVelocityState) -> None:
        """Begin a run with the gyro's zero of an old one, at a lower weight."""
        weight = _KEPT_SHARE * old.weight
        self.state = ZeroVelocityState(zero=old.zero, weight=weight)

    def standing(self) -> bool:
        """Return whether all wheels stand."""
        return not isnan(self.state.since)

    def update(self, ekf: GatedFilter, cycle: Cycle, *, sliding: bool) -> None:
        """Fuse zero velocity where all wheels stand; not while the rover is `sliding` on them."""
        time, window, yaw_rate = cycle.time, cycle.window, cycle.yaw_rate
        if not cycle.still:
            if self.standing():
                self.state = self.state._replace(since=NAN)
            return
        if not self.standing():
            self.state = self.state._replace(since=time)
        if sliding:
            return
        settled = time - self.state.since
        if settled < _SETTLING_TIME:
            return
        row = np.zeros(len(ekf.x))
        row[SPEED] = 1.0
        ekf.fuse([Row(-float(ekf.x[SPEED]), row, _STD**2)])
        turning = abs(yaw_rate) >= _MOST_YAW_RATE
        if settled > self._rest_time and window.rate_readings and not turning:
            self._learn_zero(yaw_rate, window.pitch_rate / window.rate_readings)

    def _learn_zero(self, yaw_rate: float, pitch_rate: float) -> None:
        state = self.state
        weight = min(state.weight + 1.0, _MOST_CYCLES)
        zero = GyroZero(state.zero.yaw + yaw_rate / weight, state.zero.pitch + pitch_rate / weight)
        self.state = state._replace(zero=zero, weight=weight)
