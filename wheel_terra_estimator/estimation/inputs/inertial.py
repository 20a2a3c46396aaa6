# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""IMU readings between two cycles of the filter: their sums, and the body's slope."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.measurements import InertialReading
from wheel_terra_estimator.estimation.scalars import NAN, clipped, gain_of


@dataclass(frozen=True)
class InertialTuning:
    """Times of the IMU."""

    longest_gap: float = 0.25
    """Time over which one reading is held [s]; a longer gap is not integrated over."""
    noise_time: float = 2.0
    """Time constant with which the seen noise of the accelerometer is smoothed [s]."""
    lean_time: float = 5.0
    """Time constant with which an attitude without orientation follows the specific force [s]: a
    rover's mean acceleration over longer than a start or a stop is nothing."""


class GyroZero(NamedTuple):
    """Zeros of the gyro, learned at rest [rad/s]."""

    yaw: float = 0.0
    pitch: float = 0.0


class InertialWindow(NamedTuple):
    """Sums over the IMU readings since the last filter cycle."""

    readings: int = 0
    force_x: float = 0.0  # sum of specific force [m/s^2]
    force_y: float = 0.0
    force_z: float = 0.0
    yaw_rate: float = 0.0  # sum, zero taken off [rad/s]
    pitch_rate: float = 0.0
    speed_change: float = 0.0  # integral of f_x - g_x [m/s]
    duration: float = 0.0  # [s] covered by that integral
    noise_density: float = 0.0
    """Square of the white noise density that the specific force along the body is seen to have,
    vibration included [(m/s^2)^2 s]."""

    def mean_force(self) -> tuple[float, float, float]:
        """Return the mean specific force [m/s^2]; the window is not empty."""
        n = self.readings
        return self.force_x / n, self.force_y / n, self.force_z / n


class Attitude(NamedTuple):
    """Gravity's x component in the body."""

    sine_up: float = 0.0  # g_x / g: sine of the body's slope, nose up positive
    known: bool = False
    reported: bool = False  # by the IMU, else from gyro and specific force


class InertialState(NamedTuple):
    """What is kept of the IMU."""

    time: float = -math.inf  # of the last reading [s]
    window: InertialWindow = InertialWindow()
    attitude: Attitude = Attitude()
    force_x: float = NAN  # of the last reading [m/s^2]


class InertialInput(Component[InertialState]):
    """Sums IMU readings; knows the body's slope, with or without a reported orientation.

    Parameters
    ----------
    gravity : float
        [m/s^2].
    """

    def __init__(self, gravity: float, tuning: InertialTuning = InertialTuning()) -> None:
        super().__init__(InertialState())
        self._gravity = gravity
        self._tuning = tuning

    def update(self, time: float, reading: InertialReading, zero: GyroZero) -> None:
        """Take a reading at a time [s]."""
        before, window, attitude, last_force = self.state
        dt = time - before if before > -math.inf else 0.0
        attitude = self.attitude_after(attitude, reading, dt)
        force_x, force_y, force_z = reading.specific_force.tolist()
        _, pitch_rate, yaw_rate = reading.angular_rate.tolist()
        speed_change, duration = window.speed_change, window.duration
        noise = window.noise_density
        if 0.0 < dt <= self._tuning.longest_gap:
            # Readings of a white noise differ by twice its variance; times dt it is a density, the
            # same for raw readings and for means of several.
            seen = 0.5 * (force_x - last_force) ** 2 * dt
            noise += gain_of(dt, self._tuning.noise_time) * (seen - noise)
            speed_change += (force_x - self._gravity * attitude.sine_up) * dt
            duration += dt
        window = InertialWindow(
            readings=window.readings + 1,
            force_x=window.force_x + force_x,
            force_y=window.force_y + force_y,
            force_z=window.force_z + force_z,
            yaw_rate=window.yaw_rate + (yaw_rate - zero.yaw),
            pitch_rate=window.pitch_rate + (pitch_rate - zero.pitch),
            speed_change=speed_change,
            duration=duration,
            noise_density=noise,
        )
        self.state = InertialState(time, window, attitude, force_x)

    def take(self) -> InertialWindow:
        """Return the sums since the last call, and begin new ones."""
        window = self.state.window
        empty = InertialWindow(noise_density=window.noise_density)
        self.state = self.state._replace(window=empty)
        return window

    def attitude_after(self, attitude: Attitude, reading: InertialReading, dt: float) -> Attitude:
        """Return the attitude after a reading that came `dt` [s] after the last one.

        Without an orientation it follows the gyro and leans to the specific force: right on
        average.
        """
        if reading.orientation is not None:
            x, y, z, w = reading.orientation.tolist()
            # The third row of the rotation matrix is the vertical in the body.
            return Attitude(2.0 * (x * z - w * y), known=True, reported=True)
        force = float(reading.specific_force[0]) / self._gravity
        if not attitude.known:
            return Attitude(clipped(force, -1.0, 1.0), known=True)
        # Nose up is a negative rotation about y.
        turned = attitude.sine_up - float(reading.angular_rate[1]) * dt
        lean = dt / (self._tuning.lean_time + dt)
        return Attitude(clipped(turned + lean * (force - turned), -1.0, 1.0), known=True)
