# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What the simulated rover is told to do."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wheel_terra_estimator.arrays import FloatArray


@dataclass(frozen=True)
class Command:
    """Velocity command of the body, as a ``cmd_vel`` message holds it.

    Attributes
    ----------
    forward : float
        Forward speed [m/s].
    turn_rate : float
        Yaw rate, positive to the left [rad/s].
    """

    forward: float
    turn_rate: float = 0.0


@dataclass(frozen=True)
class DriveProfile:
    """Command over time, linear between knots.

    Attributes
    ----------
    time : numpy.ndarray
        (k,) knots [s], increasing; two equal ones make a step.
    forward, turn_rate : numpy.ndarray
        (k,) forward speed [m/s] and yaw rate [rad/s] there.
    """

    time: FloatArray
    forward: FloatArray
    turn_rate: FloatArray

    def at(self, time: float) -> Command:
        """Return the command at ``time`` [s]."""
        return Command(
            float(np.interp(time, self.time, self.forward)),
            float(np.interp(time, self.time, self.turn_rate)),
        )
