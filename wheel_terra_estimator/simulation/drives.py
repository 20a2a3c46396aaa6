# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Drives of the wheels: speed control whose torque is limited, so that a wheel can stall."""

from __future__ import annotations

import numpy as np

from wheel_terra_estimator.arrays import FloatArray

CONTROL_BAND = 0.2
"""Rate error, as a share of the working rate, at which the full torque is applied."""
INTEGRAL_TIME = 0.3  # [s]
SETTLING_TIME = 0.003
"""Inertia of rotor and wheel over the gain of the control [s]."""


class Drives:
    """Speed control of n wheels: proportional and integral, with limits of torque and change."""

    def __init__(
        self,
        torque_limit: FloatArray,  # (n,) greatest torque at the wheel [N m]
        working_rate: FloatArray,  # (n,) wheel rate for which the control is made [rad/s]
        acceleration: FloatArray,  # greatest change of the commanded rate [rad/s^2]
    ) -> None:
        self._limit = torque_limit
        self._gain = torque_limit / (CONTROL_BAND * working_rate)
        self._acceleration = acceleration
        self._integral = np.zeros_like(torque_limit)
        self._target = np.zeros_like(torque_limit)
        self._strength = np.ones_like(torque_limit)
        self.inertia = SETTLING_TIME * self._gain  # [kg m^2]

    def command(self, rate: FloatArray, strength: FloatArray, dt: float) -> None:
        """Move the target towards a commanded rate [rad/s]; ``strength`` scales the limit."""
        change = self._acceleration * dt
        self._target = self._target + np.clip(rate - self._target, -change, change)
        self._strength = strength

    def torque(self, rate: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return torque [N m] and its derivative by the rate, at a wheel rate [rad/s]."""
        limit = self._limit * self._strength
        wanted = self._gain * (self._target - rate) + self._integral
        torque = np.clip(wanted, -limit, limit)
        return torque, np.where(np.abs(wanted) < limit, -self._gain, 0.0)

    def next_trial(self, rate: FloatArray, proposed: FloatArray) -> FloatArray:
        """Return where Newton's method is to go on from ``rate``: not past a border of the limits.

        The torque has a kink there; a step across it was computed with the wrong slope.
        """
        limit = self._limit * self._strength
        for border in (-limit, limit):
            kink = self._target + (self._integral - border) / self._gain
            beyond = np.sign(proposed - kink)
            crossing = (rate - kink) * beyond < 0.0
            proposed = np.where(crossing, kink + 1e-9 * beyond, proposed)
        return proposed

    def finish(self, rate: FloatArray, dt: float) -> None:
        """Take the integral part over a step that ended at ``rate``; it stops at the limit."""
        limit = self._limit * self._strength
        step = self._gain * (self._target - rate) * dt / INTEGRAL_TIME
        self._integral = np.clip(self._integral + step, -limit, limit)
