# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What the simulated rover is told to do."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wheel_terra_estimator.arrays import FloatArray


@dataclass(frozen=True)
class Command:
    """Velocity command of the body, as a ``cmd_vel`` message holds it."""

    forward: float  # forward speed [m/s]
    turn_rate: float = 0.0  # yaw rate, positive to the left [rad/s]


@dataclass(frozen=True)
class DriveProfile:
    """Command over time, linear between knots."""

    time: FloatArray  # (k,) knots [s], increasing; two equal ones make a step
    # ``forward``, ``turn_rate``: (k,) forward speed [m/s] and yaw rate [rad/s] there
    forward: FloatArray
    turn_rate: FloatArray

    def at(self, time: float) -> Command:
        """Return the command at ``time`` [s]."""
        return Command(
            float(np.interp(time, self.time, self.forward)),
            float(np.interp(time, self.time, self.turn_rate)),
        )
