# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Steering of the simulated rover: which wheels turn to where for a command, and how fast."""

from __future__ import annotations

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.simulation.commands import Command

STEERING_RATE = 0.5
"""How fast a wheel is steered [rad/s]: half a minute for a full circle of a wheel, as of rovers."""
MOST_STEERING = 1.2
"""Greatest steering angle [rad]."""
LEAST_COMMAND = 1e-6
"""Commanded speed of a hub below which the angle is held [m/s]."""


class SteeringDrives:
    """Steering angles of a rover; without steered wheels they stay 0."""

    def __init__(self, configuration: Configuration) -> None:
        wheels = configuration.wheels
        self._x, self._y = wheels.x, wheels.y
        self._steered = np.array(wheels.steered)
        # Wheels that do not steer decide about which point the rover can turn without scrubbing.
        self._pivot = 0.0 if self._steered.all() else float(wheels.x[~self._steered].mean())
        self.angle: FloatArray = np.zeros(wheels.count)  # (n,) positive left [rad]

    @property
    def any(self) -> bool:
        """Whether a wheel steers."""
        return bool(self._steered.any())

    def commanded_hubs(self, command: Command) -> FloatArray:
        """Return the (2, n) speeds along and across the body at which the hubs are to move."""
        turn = command.turn_rate
        return np.stack([command.forward - turn * self._y, turn * (self._x - self._pivot)])

    def follow(self, command: Command, dt: float) -> None:
        """Steer towards the directions in which the hubs are to move, over ``dt`` [s]."""
        if not self.any:
            return
        along, across = self.commanded_hubs(command)
        # Backwards the wheel turns backwards: an angle is no more than a quarter turn.
        angle = np.arctan(across / np.where(np.abs(along) > LEAST_COMMAND, along, LEAST_COMMAND))
        moving = np.hypot(along, across) > LEAST_COMMAND
        aim = np.where(self._steered & moving, np.clip(angle, -MOST_STEERING, MOST_STEERING), 0.0)
        aim = np.where(self._steered & ~moving, self.angle, aim)
        most = STEERING_RATE * dt
        self.angle = self.angle + np.clip(aim - self.angle, -most, most)

    def along_wheels(self, vectors: FloatArray) -> FloatArray:
        """Turn vectors (2, ..., n) along and across the body into those along and across wheels."""
        c, s = np.cos(self.angle), np.sin(self.angle)
        return np.stack([c * vectors[0] + s * vectors[1], c * vectors[1] - s * vectors[0]])
