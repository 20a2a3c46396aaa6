# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Slip ratio and rest of each wheel at the present stamp."""

from __future__ import annotations

import math
from math import isnan
from typing import NamedTuple

from wheel_terra_estimator.arrays import Floats
from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.contacts.steering import Headings
from wheel_terra_estimator.estimation.rover import Rover
from wheel_terra_estimator.estimation.scalars import NAN, TIME_ROUNDING

# Deviations of the slip beyond those of the filter.
_DRIFT = 0.05
"""Unmeasured lateral over forward speed of a steered rover [-]: 3 degrees."""
_FORGETTING = 0.02  # growth of the deviation per stamp where no rate is known
_LEAST_STD = 1e-3
_UNKNOWN_VELOCITY_STD = 1.0  # of a slip velocity [m/s]


class BodyMotion(NamedTuple):
    """Motion of the body at a stamp."""

    speed: float  # [m/s]
    speed_std: float
    yaw_rate: float  # [rad/s]
    yaw_rate_std: float
    headings: Headings  # of the wheels
    lateral_motion: float  # of the outer wheels over the fastest rim speed [-]
    stopped: bool
    """All wheels stand, and no reference velocity shows a slide on them."""
    rim_stds: Floats  # noise of the rim speeds [m/s]


class WheelSlip(NamedTuple):
    """Slip of one wheel."""

    slip: float = 0.0
    std: float = 1.0
    rest_since: float = NAN  # [s], nan = not at rest
    resting: bool = False
    judged: bool = False  # its rate is known and it is not at rest: it has a class
    velocity: float = 0.0  # rim less ground speed [m/s], held where no rate is known
    velocity_std: float = _UNKNOWN_VELOCITY_STD


class SlipJudge(Component[tuple[WheelSlip, ...]]):
    """Computes slip, its deviation and rest of all wheels."""

    def __init__(self, rover: Rover) -> None:
        super().__init__((WheelSlip(),) * rover.wheel_count)
        self._rover = rover

    def update(self, time: float, rims: Floats, body: BodyMotion) -> tuple[WheelSlip, ...]:
        """Judge all wheels at a time [s]; `rims` are their rim speeds [m/s], nan = unknown."""
        speeds = body.headings.speeds(body.speed, body.yaw_rate).tolist()
        self.state = tuple(
            [
                self._judged(i, before, time, rim, v, body)
                for i, (before, rim, v) in enumerate(zip(self.state, rims, speeds, strict=True))
            ]
        )
        return self.state

    def _judged(
        self, i: int, before: WheelSlip, time: float, rim: float, v: float, body: BodyMotion
    ) -> WheelSlip:
        if isnan(rim):
            std = min(before.std + _FORGETTING, 1.0)
            return before._replace(
                std=std, resting=False, judged=False, velocity_std=_UNKNOWN_VELOCITY_STD
            )
        rest = self._rover.rest_speed
        if body.stopped and abs(body.speed) < rest and abs(rim) < rest:
            # All wheels stand: the yaw rate of the gyro is noise.
            v, v_std = 0.0, body.speed_std
        else:
            headings = body.headings
            v_std = math.hypot(
                headings.by_speed[i] * body.speed_std,
                headings.by_yaw_rate[i] * body.yaw_rate_std,
                _DRIFT * headings.across[i] * body.speed,
            )
        velocity, velocity_std = rim - v, math.hypot(v_std, body.rim_stds[i])
        if abs(rim) < rest and abs(v) < max(rest, 2.0 * v_std):
            # It stands: its slip holds its last value.
            since = time if isnan(before.rest_since) else before.rest_since
            resting = time - since >= self._rover.rest_time - TIME_ROUNDING
            judged = before.judged and not resting
            return WheelSlip(
                before.slip, before.std, since, resting, judged, velocity, velocity_std
            )
        slip, std = slip_and_deviation(rim, v, v_std, body.rim_stds[i], rest)
        std = min(max(std, _LEAST_STD), 1.0)
        return WheelSlip(slip, std, NAN, False, True, velocity, velocity_std)


def slip_and_deviation(
    rim: float, v: float, v_std: float, rim_std: float, rest_speed: float
) -> tuple[float, float]:
    """Return the slip ratio and its standard deviation, where rim and ground are not both at rest.

    Rim speed, ground speed `v` and their deviations in [m/s]; below `rest_speed` a rim stands.
    """
    both = math.hypot(v_std, rim_std)
    if abs(rim) <= rest_speed:
        return -1.0, both / max(abs(v), rest_speed)
    if v * rim < 0.0:
        return 1.0, both / abs(rim)
    if abs(v) <= abs(rim):
        slip = 1.0 - v / rim
        # On a rover at rest the rim speed may be noise alone.
        stands = abs(v) < max(rest_speed, 2.0 * v_std)
        std = both if stands else math.hypot(v_std, (1.0 - slip) * rim_std)
        return slip, std / abs(rim)
    return rim / v - 1.0, math.hypot(v_std * rim / (v * v), rim_std / v)
