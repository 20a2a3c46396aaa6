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
from wheel_terra_estimator.estimation.scalars import NAN

_SMOOTHING_TIME = 0.05
"""Time constant of the rim speeds [s], since fast odometry is noisy or quantised."""
_LONGEST_SMOOTHED = 0.06
"""Time between messages from which on rim speeds are not smoothed [s]."""
_SLOPE_GAIN = 0.5  # smoothing of the rim speeds' rate of change, per message [-]
_LONGEST_EXTRAPOLATED = 0.15
"""Longest extrapolation of a rim speed [s]: over the lag of its smoothing, and to a stamp between
two messages."""
_LONGEST_GAP = 0.3  # between messages from which a rate of change is taken [s]
_SLOPE_NOISE = 3.0  # deviations of the rates within which a rim speed counts as constant
_TORQUE_AGE = 2.0  # up to which a torque counts as known [s]


class WheelOdometryState(NamedTuple):
    """Memory of the wheel odometry; tuples have one entry per wheel."""

    time: float  # of the last message [s], -inf = none yet
    rim_speed: Floats  # [m/s], nan = never known
    rate_time: Floats  # [s]
    rim_slope: Floats  # rate of change of the rim speeds, smoothed [m/s^2]
    lag: Floats  # of the smoothed rim speeds behind the readings [s]
    torque_time: float  # of the last torque [s]
    torque_sum: Floats  # since the last cycle [N m]
    torque_count: tuple[int, ...]
    torque: Floats  # mean of the last cycle that had one [N m], nan = never known


class WheelOdometryInput(Component[WheelOdometryState]):
    """Keeps the newest rim speeds, sums torques."""

    def __init__(self, rover: Rover, sensors: SensorFigures) -> None:
        n = rover.wheel_count
        never = -math.inf
        start = WheelOdometryState(
            never,
            (NAN,) * n,
            (never,) * n,
            (0.0,) * n,
            (0.0,) * n,
            never,
            (0.0,) * n,
            (0,) * n,
            (NAN,) * n,
        )
        super().__init__(start)
        self._radius = rover.slip_radius
        self._silence = rover.silence
        # Apparent rate of change of a constant rim speed by the scatter of its readings.
        noise = _SLOPE_NOISE * sensors.wheel_rate_std * max(rover.slip_radius)
        self._least_slope = noise / _SMOOTHING_TIME

    def update(self, time: float, odometry: WheelOdometry) -> None:
        """Take a message at a time [s]."""
        state = self.state
        if odometry.steering is not None and all(isnan(rate) for rate in odometry.rate.tolist()):
            return  # steering angles alone
        rim_speed, rate_time = list(state.rim_speed), list(state.rate_time)
        rim_slope, lag = list(state.rim_slope), list(state.lag)
        for i, rate in enumerate(odometry.rate.tolist()):
            if not isnan(rate):
                rim, old = rate * self._radius[i], rim_speed[i]
                gap = time - rate_time[i]
                keep = 0.0 if gap >= _LONGEST_SMOOTHED else math.exp(-gap / _SMOOTHING_TIME)
                lag[i] = keep * gap / (1.0 - keep) if 0.0 < keep < 1.0 else 0.0
                rim_speed[i] = rim if isnan(old) else keep * old + (1.0 - keep) * rim
                if 0.0 < gap < _LONGEST_GAP:
                    slope = (rim_speed[i] - old) / gap
                    rim_slope[i] += _SLOPE_GAIN * (slope - rim_slope[i])
                else:
                    rim_slope[i] = 0.0
                rate_time[i] = time
        torque_time = state.torque_time
        torque_sum, torque_count = list(state.torque_sum), list(state.torque_count)
        for i, torque in enumerate(odometry.torque.tolist()):
            if not isnan(torque):
                torque_sum[i] += torque
                torque_count[i] += 1
                torque_time = time
        self.state = WheelOdometryState(
            time=time,
            rim_speed=tuple(rim_speed),
            rate_time=tuple(rate_time),
            rim_slope=tuple(rim_slope),
            lag=tuple(lag),
            torque_time=torque_time,
            torque_sum=tuple(torque_sum),
            torque_count=tuple(torque_count),
            torque=state.torque,
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

        A change is extrapolated over the age and the lag of smoothing.
        """
        state, rims = self.state, []
        for rim, slope, when, lag in zip(
            state.rim_speed, state.rim_slope, state.rate_time, state.lag, strict=True
        ):
            age = time - when
            extrapolated = abs(slope) > self._least_slope and age + lag <= _LONGEST_EXTRAPOLATED
            now = rim + slope * (age + lag) if extrapolated else rim
            rims.append(now if age <= self._silence else NAN)
        return tuple(rims)

    def fastest(self) -> float:
        """Return the greatest known rim speed, whatever its direction or age [m/s]; 0 = none."""
        return max((abs(rim) for rim in self.state.rim_speed if not isnan(rim)), default=0.0)

    def silent(self, time: float) -> bool:
        """Return whether no message came for longer than ``filter.silence``."""
        return time - self.state.time > self._silence

    def torque_known(self, time: float) -> bool:
        """Return whether a torque was read within `_TORQUE_AGE`."""
        return time - self.state.torque_time < _TORQUE_AGE
