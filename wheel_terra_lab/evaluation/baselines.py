# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What a rover without a wheel-soil filter would know of its slip and pull."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from wheel_terra_estimator.arrays import FloatArray, IntArray
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.measurements import (
    InertialReading,
    Measurement,
    ReferenceVelocity,
    WheelOdometry,
)


def held_speed(
    configuration: Configuration, measurements: Iterable[Measurement], stamps: IntArray
) -> FloatArray:
    """Return the last reference velocity that had arrived at each stamp (k,) [m/s].

    Before the first one, and without any, the rim speed. Measurements come in the order of
    arrival; when one arrives is taken from the wheel odometry before it.
    """
    return _run(configuration, measurements, stamps, inertial=False)


def dead_reckoned_speed(
    configuration: Configuration, measurements: Iterable[Measurement], stamps: IntArray
) -> FloatArray:
    """Return the speed from the accelerometer (k,) [m/s].

    Gravity comes off by the orientation; each reference velocity sets the speed anew, wheels at
    rest set it to zero and give the bias.
    """
    return _run(configuration, measurements, stamps, inertial=True)


def _run(
    configuration: Configuration,
    measurements: Iterable[Measurement],
    stamps: IntArray,
    *,
    inertial: bool,
) -> FloatArray:
    radius = configuration.wheels.slip_radius
    gravity, rest = configuration.rover.gravity, configuration.rest_speed
    times: list[int] = []
    speeds: list[float] = []
    speed = bias = 0.0
    still, known = True, False
    last: int | None = None
    for m in measurements:
        if m.stamp <= 0:
            continue
        if isinstance(m, ReferenceVelocity):
            speed, known = m.forward, True
        elif isinstance(m, WheelOdometry):
            rim = m.rate * radius
            still = bool(np.nanmax(np.abs(rim), initial=0.0) < rest)
            if still and inertial:
                speed = 0.0
            elif not known and not inertial:
                speed = float(np.nanmedian(rim))
            times.append(m.stamp)
            speeds.append(speed)
        elif inertial and isinstance(m, InertialReading) and m.orientation is not None:
            x, y, z, w = m.orientation
            acceleration = float(m.specific_force[0] - gravity * 2.0 * (x * z - w * y))
            dt = 0.0 if last is None else min(max((m.stamp - last) * 1e-9, 0.0), 0.2)
            last = m.stamp
            if still:
                bias += 0.05 * (acceleration - bias)
            else:
                speed += (acceleration - bias) * dt
    if not times:
        return np.zeros(len(stamps))
    position = np.searchsorted(np.array(times), stamps, side='right') - 1
    return np.array(speeds)[np.maximum(position, 0)]


def slip_of(speed: FloatArray, yaw_rate: FloatArray, rim: FloatArray, y: FloatArray) -> FloatArray:
    """Return the slip ratio (k, n) of a speed (k,), yaw rate (k,) and rim speeds (k, n)."""
    from wheel_terra_estimator.terramechanics.kinematics import slip_ratio

    slip = slip_ratio(speed[:, None] - yaw_rate[:, None] * y, rim)
    return np.asarray(np.nan_to_num(slip), dtype=np.float64)
