# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""How the rover turns, and how the ground curves along its path."""

from __future__ import annotations

import math
from typing import NamedTuple

from wheel_terra_estimator.arrays import Floats
from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.contacts.steering import Headings
from wheel_terra_estimator.estimation.inputs.inertial import InertialWindow
from wheel_terra_estimator.estimation.rover import Rover, SensorFigures
from wheel_terra_estimator.estimation.scalars import clipped, known, median

# Tuned on simulated drives, seeds 1000 to 1019, where no other source is given.
_LEAST_GAIN = 0.25
"""Weight of the gyro per cycle while it agrees with the wheels [-]; it rises with what exceeds the
noise."""
_LEAST_NOISE = 1e-6  # of the yaw rate [rad/s]
_LEAST_CURVATURE_LENGTH = 0.1  # [m], for rovers with one axle
_LEAST_TRAVEL_SHARE = 0.1
"""Travel, as a share of the curvature length, below which no curvature is known."""
_STEEPEST = 0.3  # curvature of the ground [rad/m]
_COMMON_CURVATURE = 0.1
"""Curvature of common ground [rad/m], against which the gyro's zero is weighed."""
_LEAST_SPEED = 1e-4  # [m/s]
_LEAST_YAW_NOISE_SHARE = 0.4
"""Of the gyro's noise that the smoothing leaves: sqrt(g / (2 - g)) for the least gain."""
_SKID_YAW_SHARE = 0.6
"""Yaw rate of a skid-steered rover over that of rolling wheels [-]: it turns as one with 1.3 to 3
times its track (docs/own_rover.md)."""
_SKID_YAW_STD = 0.4  # deviation of that yaw rate, relative
_ROLL_YAW_STD = 0.15  # the same of a rover that does not skid
_LEAST_WHEEL_YAW_STD = 0.005  # [rad/s]

_OPPOSED = 0.5
"""Slower side over the faster one from which rims of opposite signs are a spin on the spot [-]."""


def sides_oppose(rims: Floats, by_yaw_rate: Floats) -> bool:
    """Return whether the wheels are driven for a turn on the spot, however little the body turns.

    `rims` [m/s], nan = unknown; the sign of `by_yaw_rate` [m] (see `Headings`) gives the side.
    """
    if not (any(rim > 0.0 for rim in rims) and any(rim < 0.0 for rim in rims)):
        return False  # most of the time
    pairs = [(rim, y) for rim, y in zip(rims, by_yaw_rate, strict=True) if not math.isnan(rim)]
    left, right = [rim for rim, y in pairs if y < 0.0], [rim for rim, y in pairs if y > 0.0]
    if not left or not right:
        return False
    sides = median(left), median(right)
    slower, faster = sorted(map(abs, sides))
    return sides[0] * sides[1] < 0.0 and slower >= _OPPOSED * faster


class TurningState(NamedTuple):
    """Turning of the rover, curvature of its path."""

    yaw_rate: float = 0.0  # smoothed [rad/s]
    yaw_rate_std: float = 1.0  # nothing was received yet
    by_wheels: float = 0.0
    """Yaw rate to expect of the rim speeds alone [rad/s]; a rover that skids turns less."""
    lateral_motion: float = 0.0
    """Lateral motion of the outer wheels over the fastest rim speed, 0 to 1 [-]."""
    rotation: float = 0.0  # nose-up, over the last curvature length [rad]
    travel: float = 0.0  # and the travel that it took [m]


class Turning(Component[TurningState]):
    """Follows yaw rate, lateral motion and the curvature of the ground."""

    def __init__(self, rover: Rover, sensors: SensorFigures) -> None:
        self._per_cycle = max(sensors.imu_rate * rover.period, 1.0)
        super().__init__(TurningState())
        self._rover, self._sensors = rover, sensors
        skids = rover.skids
        self._skid_share = _SKID_YAW_SHARE if skids else 1.0
        self._wheel_yaw_std = _SKID_YAW_STD if skids else _ROLL_YAW_STD
        self._curvature_length = max(rover.curvature_length, _LEAST_CURVATURE_LENGTH)

    def update(
        self,
        window: InertialWindow,
        dt: float,
        speed: float,
        fastest_rim: float,
        headings: Headings,
        rims: Floats,
        *,
        gyro_silent: bool = False,
    ) -> TurningState:
        """Take the IMU readings of a cycle of length `dt` [s] and the rim speeds at its end.

        Speeds are in [m/s]; a rim speed that is unknown is nan.
        """
        state = self.state
        by_wheels = state.by_wheels
        if known(rims):
            by_wheels = self._skid_share * headings.yaw_rate(rims)
        if window.rate_readings:
            # Of a message of the gyro [rad/s].
            noise = window.stated.angular_rate_std or self._sensors.angular_rate_std
            yaw_rate = self._yaw_rate(window, by_wheels - state.by_wheels, noise)
            left = _LEAST_YAW_NOISE_SHARE * (noise / math.sqrt(self._per_cycle))
            std = math.hypot(left, self._sensors.angular_rate_bias_std)
        elif gyro_silent and known(rims):
            yaw_rate = by_wheels
            std = math.hypot(self._wheel_yaw_std * yaw_rate, _LEAST_WHEEL_YAW_STD)
        else:
            return state
        # Nose-up rotation over travel, both forgotten over the length of the rover.
        travel = speed * dt
        keep = math.exp(-abs(travel) / self._curvature_length)
        state = state._replace(
            yaw_rate=yaw_rate,
            yaw_rate_std=std,
            by_wheels=by_wheels,
            rotation=keep * state.rotation - window.pitch_rate / max(window.rate_readings, 1) * dt,
            travel=keep * state.travel + travel,
        )
        turning = fastest_rim > self._rover.low_rim
        side = max(abs(side) for side in headings.side_speeds(speed, yaw_rate))
        motion = min(side / fastest_rim, 1.0) if turning else 0.0
        self.state = state = state._replace(lateral_motion=motion)
        return state

    def curvature(self, speed: float) -> float:
        """Return slope gained per travel [rad/m]: front wheels may climb steeper ground."""
        state = self.state
        if abs(state.travel) < _LEAST_TRAVEL_SHARE * self._curvature_length:
            return 0.0
        curvature = clipped(state.rotation / state.travel, -_STEEPEST, _STEEPEST)
        # Shrunk by the variance that the gyro's zero adds, against that of common ground.
        error = self._sensors.angular_rate_bias_std / max(abs(speed), _LEAST_SPEED)
        return curvature / (1.0 + (error / _COMMON_CURVATURE) ** 2)

    def _yaw_rate(self, window: InertialWindow, change: float, noise: float) -> float:
        """Return the yaw rate [rad/s]: predicted by its `change` by the wheels, then corrected.

        The weight of the gyro grows with its residual over its noise, so that noise is smoothed and
        a real change is followed at once.
        """
        expected = self.state.yaw_rate + change
        now = window.yaw_rate / window.rate_readings
        noise = max(noise / math.sqrt(window.rate_readings), _LEAST_NOISE)
        gain = clipped(_LEAST_GAIN * abs(now - expected) / noise, _LEAST_GAIN, 1.0)
        return expected + gain * (now - expected)
