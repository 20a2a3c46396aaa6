# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""IMU readings between two cycles of the filter: their sums, and the body's slope."""

from __future__ import annotations

import math
from collections.abc import Container
from math import isnan
from typing import NamedTuple

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.inputs.noise import KEYS, NOTHING_STATED, StatedNoise
from wheel_terra_estimator.estimation.measurements import InertialReading
from wheel_terra_estimator.estimation.scalars import NAN, clipped, gain_of

_LONGEST_GAP = 0.25
"""Longest time between two readings that is integrated over [s]."""
_NOISE_TIME = 2.0
"""Time constant of the observed noise of the accelerometer [s]."""
_MOST_CHANGE = 4.0
"""Deviations of the observed noise by which a component of the specific force may change from one
reading to the next [-]: a stone shakes the IMU, but hardly changes the speed of the rover."""
_LEAST_JERK = 8.0
"""Rate of change of the specific force that counts without noise [m/s^3]: starts and stops."""
_LEVELLING_TIME = 5.0
"""Time constant with which an attitude without orientation follows the specific force [s]: over
longer than a start or a stop the mean acceleration of a rover vanishes."""


class GyroZero(NamedTuple):
    """Zeros of the gyro, learned at rest [rad/s]."""

    yaw: float = 0.0
    pitch: float = 0.0


class InertialWindow(NamedTuple):
    """Sums over the IMU readings since the last filter cycle."""

    readings: int = 0  # of the accelerometer
    force_x: float = 0.0  # sum of specific force [m/s^2]
    force_y: float = 0.0
    force_z: float = 0.0
    yaw_rate: float = 0.0  # sum, zero taken off [rad/s]
    pitch_rate: float = 0.0
    rate_readings: int = 0  # readings of the gyro in these two sums
    speed_change: float = 0.0  # integral of f_x - g_x [m/s]
    duration: float = 0.0  # [s] covered by that integral
    noise_density: float = 0.0
    """Observed power spectral density of f_x - g_x, with vibration and noise of the attitude
    [(m/s^2)^2 s]."""
    stated: StatedNoise = NOTHING_STATED
    """Noise that the messages state, where no file does."""
    gravity: tuple[float, float, float] | None = None
    """Specific force at rest by the reported orientation [m/s^2]; None unless there is an
    orientation and no accelerometer."""

    def mean_force(self) -> tuple[float, float, float]:
        """Return the mean specific force [m/s^2]; only where `has_force` holds."""
        n = self.readings
        if not n and self.gravity is not None:
            return self.gravity
        return self.force_x / n, self.force_y / n, self.force_z / n

    @property
    def has_force(self) -> bool:
        """Whether the specific force is known."""
        return self.readings > 0 or self.gravity is not None


class Attitude(NamedTuple):
    """Gravity's x component in the body."""

    sine_up: float = 0.0  # g_x / g: sine of the body's slope, nose up positive
    known: bool = False
    reported: bool = False  # by the IMU; else from gyro and specific force


class InertialState(NamedTuple):
    """Memory of the IMU readings."""

    time: float = -math.inf  # of the last message [s]
    force_time: float = -math.inf  # of the last specific force
    rate_time: float = -math.inf  # of the last angular rate
    window: InertialWindow = InertialWindow()
    attitude: Attitude = Attitude()
    acceleration: float = NAN  # f_x - g_x of the last reading [m/s^2]
    force: tuple[float, ...] = (NAN,) * 3  # the last specific force, as it counts [m/s^2]


class InertialInput(Component[InertialState]):
    """Sums IMU readings; tracks the body's slope, with or without a reported orientation.

    `given` are the configuration keys that a file states (not defaults); by default all of them.
    """

    def __init__(self, gravity: float, given: Container[str] = frozenset(KEYS)) -> None:
        super().__init__(InertialState())
        self._gravity = gravity
        self._given = given

    @property
    def stated(self) -> StatedNoise:
        """Noise that the messages state, where no file does."""
        return self.state.window.stated

    def keep_stated(self, stated: StatedNoise) -> None:
        """Begin with the noise that messages stated in an earlier run."""
        self.state = InertialState(window=InertialWindow(stated=stated))

    def update(self, time: float, reading: InertialReading, zero: GyroZero) -> None:
        """Take a reading at a time [s]."""
        before, force_time, rate_time, window, attitude, last, force = self.state
        dt = time - before if before > -math.inf else 0.0
        if any(reading.variance) and not all(window.stated):
            stated = window.stated.completed(reading.variance, self._given)
            if stated != window.stated:
                window = window._replace(stated=stated)
        since = time - force_time if force_time > -math.inf else 0.0
        followed = _followed(force, reading.specific_force.tolist(), since, window.noise_density)
        force_x, force_y, force_z = followed
        attitude = self.attitude_after(attitude, reading, force_x, dt, zero.pitch)
        _, pitch_rate, yaw_rate = reading.angular_rate.tolist()
        if not isnan(yaw_rate):
            rate_time = time
            window = window._replace(
                yaw_rate=window.yaw_rate + (yaw_rate - zero.yaw),
                pitch_rate=window.pitch_rate + (pitch_rate - zero.pitch),
                rate_readings=window.rate_readings + 1,
            )
        if not isnan(force_x):
            force_time, force = time, followed
            acceleration = force_x - self._gravity * attitude.sine_up
            change, last = acceleration - last, acceleration
            speed_change, duration = window.speed_change, window.duration
            noise = window.noise_density
            if 0.0 < since <= _LONGEST_GAP:
                # The difference of two readings has twice the variance of white noise; times dt it
                # is a density, the same for raw readings and for means of several.
                density = 0.5 * change**2 * since
                noise += gain_of(since, _NOISE_TIME) * (density - noise)
                speed_change += acceleration * since
                duration += since
            window = window._replace(
                readings=window.readings + 1,
                force_x=window.force_x + force_x,
                force_y=window.force_y + force_y,
                force_z=window.force_z + force_z,
                speed_change=speed_change,
                duration=duration,
                noise_density=noise,
            )
        elif reading.orientation is not None:
            window = window._replace(gravity=self._gravity_in_body(reading.orientation))
        self.state = InertialState(time, force_time, rate_time, window, attitude, last, force)

    def _gravity_in_body(self, orientation: FloatArray) -> tuple[float, float, float]:
        """Return the specific force of a rover at rest with this orientation [m/s^2]."""
        x, y, z, w = orientation.tolist()
        g = self._gravity
        return 2.0 * (x * z - w * y) * g, 2.0 * (y * z + w * x) * g, (1 - 2 * (x * x + y * y)) * g

    def take(self) -> InertialWindow:
        """Return the sums since the last call, and begin new ones."""
        window = self.state.window
        empty = InertialWindow(noise_density=window.noise_density, stated=window.stated)
        self.state = self.state._replace(window=empty)
        return window

    def attitude_after(
        self, attitude: Attitude, reading: InertialReading, force_x: float, dt: float, zero: float
    ) -> Attitude:
        """Return the attitude after a reading that came `dt` [s] after the last one.

        Without an orientation: complementary filter of the gyro, less its `zero` [rad/s], and the
        specific force.
        """
        if reading.orientation is not None:
            x, y, z, w = reading.orientation.tolist()
            # The third row of the rotation matrix is the vertical in the body.
            return Attitude(2.0 * (x * z - w * y), known=True, reported=True)
        force = force_x / self._gravity
        if not attitude.known:
            return attitude if isnan(force) else Attitude(clipped(force, -1.0, 1.0), known=True)
        # Nose up is a negative rotation about y.
        rate = float(reading.angular_rate[1]) - zero
        turned = attitude.sine_up - (0.0 if isnan(rate) else rate * dt)
        if isnan(force):
            return Attitude(clipped(turned, -1.0, 1.0), known=True)
        share = dt / (_LEVELLING_TIME + dt)
        return Attitude(clipped(turned + share * (force - turned), -1.0, 1.0), known=True)


def _followed(
    before: tuple[float, ...], reading: list[float], since: float, noise_density: float
) -> tuple[float, ...]:
    """Return a specific force [m/s^2] that follows a reading `since` [s] after the one before it.

    Each component changes by no more than a rover and the observed noise make it.
    """
    if not 0.0 < since <= _LONGEST_GAP:
        return tuple(reading)
    most = max(_LEAST_JERK * since, _MOST_CHANGE * math.sqrt(2.0 * noise_density / since))
    return tuple(
        now if isnan(old + now) else clipped(now, old - most, old + most)
        for old, now in zip(before, reading, strict=True)
    )
