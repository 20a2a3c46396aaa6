# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Commands to the simulated rover; drives of limited torque, and steering, that follow them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.configuration.configuration import Configuration


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
        """Return the next iterate of Newton's method from ``rate``, not beyond a limit.

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
