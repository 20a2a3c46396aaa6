# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Wheel odometry between two cycles of the filter: newest rim speeds, mean torques."""

from __future__ import annotations

import math
from math import isnan
from typing import NamedTuple

from wheel_terra_estimator.arrays import Floats
from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.measurements import WheelOdometry
from wheel_terra_estimator.estimation.rover import Rover, SensorFigures
from wheel_terra_estimator.estimation.scalars import NAN, TINY, clipped

_SMOOTHING_TIME = 0.05
"""Time constant of the rim speeds [s], since fast odometry is noisy or quantised."""
_LONGEST_SMOOTHED = 0.06
"""Time between messages from which on rim speeds are not smoothed, unless they are noisy [s]."""
_NOISE_SHARE = 0.02
"""Noise over the rim speed down to which a noisy one is smoothed [-]: an error of the slip."""
_MEAN_TIME = 1.0  # longest mean for that [s]
_JUMP = 3.0  # deviations from that mean by which a reading begins a new one
_SLOPE_GAIN = 0.5  # smoothing of the rim speeds' rate of change, per message [-]
_LONGEST_EXTRAPOLATED = 0.15
"""Longest extrapolation of a rim speed [s]: over the lag of its smoothing, and to a stamp between
two messages."""
_LONGEST_GAP = 0.3  # between messages from which a rate of change is taken [s]
_SLOPE_NOISE = 3.0  # deviations of the rates within which a rim speed counts as constant
_TORQUE_AGE = 2.0  # up to which a torque counts as known [s]


class Rim(NamedTuple):
    """Memory of the speed of a rim."""

    speed: float = NAN  # smoothed [m/s], nan = never known
    time: float = -math.inf  # of the last reading [s]
    reading: float = NAN  # the last one [m/s]
    slope: float = 0.0  # rate of change of the speed, smoothed [m/s^2]
    lag: float = 0.0  # of the smoothed speed behind the readings [s]
    readings: float = 0.0  # in the mean of a noisy one
    std: float = 0.0  # noise of the smoothed speed [m/s]

    def after(self, time: float, reading: float, noise: float) -> Rim:
        """Return the memory after a reading [m/s] of such a noise [m/s] at a time [s]."""
        gap = time - self.time
        share = 1.0 - math.exp(-gap / _SMOOTHING_TIME) if gap < _LONGEST_SMOOTHED else 1.0
        readings = self._readings(gap, reading, noise)
        share = min(share, 1.0 / readings)
        lag = gap * (1.0 / share - 1.0) if 0.0 < share < 1.0 else 0.0
        speed = reading if isnan(self.speed) else self.speed + share * (reading - self.speed)
        slope = 0.0
        if 0.0 < gap < _LONGEST_GAP:
            slope = self.slope + _SLOPE_GAIN * ((speed - self.speed) / gap - self.slope)
        return Rim(speed, time, reading, slope, lag, readings, noise / math.sqrt(readings))

    def _readings(self, gap: float, reading: float, noise: float) -> float:
        """Return the readings in the mean, `gap` after the last one [s]: until the noise is small.

        A reading that differs by more than its noise is a mean of its own, as is the first one, and
        one of 0 or after it: encoders show exactly whether a wheel stands.
        """
        if not (reading and self.speed and abs(reading - self.speed) <= _JUMP * noise):
            return 1.0
        enough = (noise / max(_NOISE_SHARE * abs(self.speed), TINY)) ** 2
        longest = _MEAN_TIME / max(gap, TINY)
        return clipped(min(enough, longest), 1.0, self.readings + 1.0)


class WheelOdometryState(NamedTuple):
    """Memory of the wheel odometry; tuples have one entry per wheel."""

    rims: tuple[Rim, ...]
    torque_sum: Floats  # since the last cycle [N m]
    torque_count: tuple[int, ...]
    torque: Floats  # mean of the last cycle that had one [N m], nan = never known
    time: float = -math.inf  # of the last message [s], -inf = none yet
    torque_time: float = -math.inf  # of the last torque [s]


class WheelOdometryInput(Component[WheelOdometryState]):
    """Keeps the newest rim speeds, sums torques."""

    def __init__(self, rover: Rover, sensors: SensorFigures) -> None:
        n = rover.wheel_count
        super().__init__(WheelOdometryState((Rim(),) * n, (0.0,) * n, (0,) * n, (NAN,) * n))
        self._radius = rover.slip_radius
        self._silence = rover.silence
        # Apparent rate of change of a constant rim speed by the scatter of its readings.
        noise = _SLOPE_NOISE * sensors.wheel_rate_std * max(rover.slip_radius)
        self._least_slope = noise / _SMOOTHING_TIME

    def update(self, time: float, odometry: WheelOdometry, rate_std: float) -> None:
        """Take a message at a time [s], its rates with a noise of `rate_std` [rad/s]."""
        state, rates, torques = self.state, odometry.rate.tolist(), odometry.torque.tolist()
        if odometry.steering is not None and all(map(isnan, rates)):
            return  # steering angles alone
        rims = [
            rim if isnan(rate) else rim.after(time, rate * radius, rate_std * radius)
            for rim, rate, radius in zip(state.rims, rates, self._radius, strict=True)
        ]
        read = [not isnan(torque) for torque in torques]
        sums = zip(state.torque_sum, torques, read, strict=True)
        self.state = WheelOdometryState(
            tuple(rims),
            tuple([total + torque if new else total for total, torque, new in sums]),
            tuple([n + new for n, new in zip(state.torque_count, read, strict=True)]),
            state.torque,
            time,
            time if any(read) else state.torque_time,
        )

    def take_torque(self) -> Floats:
        """Return the mean torque of each wheel since the last call [N m], nan = none came."""
        state = self.state
        n = len(state.torque)
        mean = tuple(
            total / count if count else NAN
            for total, count in zip(state.torque_sum, state.torque_count, strict=True)
        )
        self.state = state._replace(
            torque_sum=(0.0,) * n,
            torque_count=(0,) * n,
            torque=tuple(
                old if isnan(new) else new for new, old in zip(mean, state.torque, strict=True)
            ),
        )
        return mean

    def rim_speeds(self, time: float) -> Floats:
        """Return the rim speeds [m/s], nan where the rate is unknown or too old.

        A change is extrapolated over the age and the lag of smoothing, but not to a reversal that
        the last reading does not show: a wheel that stops at once does not turn back.
        """
        rims = []
        for rim in self.state.rims:
            age = time - rim.time
            lasts = abs(rim.slope) > self._least_slope and age + rim.lag <= _LONGEST_EXTRAPOLATED
            now = rim.speed + rim.slope * (age + rim.lag) if lasts else rim.speed
            if now * rim.speed <= 0.0 and now * rim.reading <= 0.0:
                now = 0.0
            rims.append(now if age <= self._silence else NAN)
        return tuple(rims)

    def white_noise(self, dt: float) -> Floats:
        """Return the deviations of the rim speeds as white noise in cycles `dt` [s] apart [m/s].

        The error of a mean lasts for as many cycles as it is long.
        """
        return tuple(rim.std * math.sqrt(1.0 + rim.lag / max(dt, TINY)) for rim in self.state.rims)

    def stds(self) -> Floats:
        """Return the deviations of the rim speeds by the noise of their readings [m/s]."""
        return tuple(rim.std for rim in self.state.rims)

    def fastest(self) -> float:
        """Return the greatest known rim speed, whatever its direction or age [m/s]; 0 = none."""
        return max((abs(rim.speed) for rim in self.state.rims if not isnan(rim.speed)), default=0.0)

    def silent(self, time: float) -> bool:
        """Return whether no message came for longer than ``filter.silence``."""
        return time - self.state.time > self._silence

    def torque_known(self, time: float) -> bool:
        """Return whether a torque was read within `_TORQUE_AGE`."""
        return time - self.state.torque_time < _TORQUE_AGE
