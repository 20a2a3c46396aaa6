# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Checks of single measurements: implausible values are rejected and counted, the rest is used.

After these checks a number is finite, or nan where the measurement types allow it.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.configuration import Configuration
from wheel_terra_estimator.estimation.inputs.noise import credible
from wheel_terra_estimator.estimation.measurements import (
    InertialReading,
    LeavingAngleReading,
    Measurement,
    ReferenceVelocity,
    SinkageReading,
    WheelOdometry,
)
from wheel_terra_estimator.estimation.scalars import SECOND

GREATEST_SPEED = 50.0  # rim or body [m/s]; far above any rover
GREATEST_STEERING = math.pi  # [rad]
GREATEST_TORQUE = 1.0e5  # [N m]
GREATEST_FORCE = 100.0  # specific force [m/s^2], 10 g; a drive has less, stones apart
GREATEST_RATE = 50.0  # angular rate [rad/s]
OUTLIER_FORCE = 30.0  # change of the specific force from one message to the next [m/s^2], 3 g
OUTLIER_RATE = 5.0  # change of the angular rate from one message to the next [rad/s]
OUTLIER_TIME = 500_000_000  # messages further apart are not compared [ns]
GREATEST_VARIANCE = GREATEST_SPEED**2  # of a reference [(m/s)^2]; above, it means unknown
LATEST_STAMP = 2**31 * SECOND  # builtin_interfaces/Time ends in 2038 [ns]

CHANNELS: dict[type, int] = {
    WheelOdometry: 0,
    InertialReading: 1,
    SinkageReading: 2,
    LeavingAngleReading: 3,
    ReferenceVelocity: 4,
}
"""Kind of measurement -> its place in ``StepInputs``."""

WHEEL_ODOMETRY, INERTIAL, SINKAGE, LEAVING_ANGLE, REFERENCE = range(5)

_TOO_DEEP = 'sinkage infinite or larger than the wheel radius'
_VOID = 'variance states that the value is unknown'
REMEDIES = {
    _TOO_DEEP: 'buried, or millimetres? multiply position by 0.001 in the driver (m)',
    _VOID: 'a placeholder? send the variance, or 0 and state sensors.reference_std',
}
"""Reason for leaving something out -> what corrects it."""


_Range = tuple[float, float]
_UNKNOWN = np.full(3, math.nan)
_UNKNOWN.setflags(write=False)


def _differs(one: InertialReading, other: InertialReading) -> bool:
    """Return whether no rover could get from one reading to the other in the time between."""
    if abs(one.stamp - other.stamp) > OUTLIER_TIME:
        return False
    force = max(map(abs, (one.specific_force - other.specific_force).tolist()))
    rate = max(map(abs, (one.angular_rate - other.angular_rate).tolist()))
    return force > OUTLIER_FORCE or rate > OUTLIER_RATE  # nan is not far


class InputChecks:
    """Judges measurements of one rover, and counts per channel what it leaves out."""

    def __init__(self, configuration: Configuration) -> None:
        wheels = configuration.wheels
        self.names = (  # topics of the channels
            configuration.wheel_odometry,
            'imu/data',
            'sinkage',
            'leaving_angle',
            'reference_odom',
        )
        self.rejected: list[Counter[str]] = [Counter() for _ in self.names]  # by reason in words
        self.refused = [0] * len(self.names)  # messages of which nothing was left to use
        self._inertial_before: InertialReading | None = None
        self._outlier: InertialReading | None = None
        self._count = wheels.count
        self._rates = _symmetric((GREATEST_SPEED / wheels.slip_radius).tolist())
        self._torques = _symmetric([GREATEST_TORQUE] * self._count)
        self._steering = _symmetric([GREATEST_STEERING] * self._count)
        self._angles = _symmetric([0.5 * math.pi] * self._count)
        self._deepest = [(-math.inf, radius) for radius in wheels.radius.tolist()]
        self._highest = [(-0.5 * radius, math.inf) for radius in wheels.radius.tolist()]
        self._checks: tuple[Callable[[Any], Any], ...] = (
            self._wheel_odometry,
            self._inertial,
            self._sinkage,
            self._leaving_angle,
            self._reference,
        )

    def check(self, channel: int, measurement: Measurement) -> Measurement | None:
        """Return the measurement without implausible values; None where nothing is left."""
        stamp = measurement.stamp
        if stamp <= 0:
            self.refuse(channel, 'stamp is zero or negative')
            return None
        if stamp >= LATEST_STAMP:
            self.refuse(channel, 'stamp is beyond the range of ROS time')
            return None
        checked: Measurement | None = self._checks[channel](measurement)
        return checked

    def reject(self, channel: int, reason: str) -> None:
        """Count a part of a message that is not used."""
        self.rejected[channel][reason] += 1

    def refuse(self, channel: int, reason: str) -> None:
        """Count a message that is not used."""
        self.refused[channel] += 1
        self.reject(channel, reason)

    def _wheel_odometry(self, m: WheelOdometry) -> WheelOdometry | None:
        if len(m.rate) != self._count or len(m.torque) != self._count:
            self.refuse(WHEEL_ODOMETRY, 'wrong number of wheels')
            return None
        rate = self._within(
            WHEEL_ODOMETRY, m.rate, self._rates, 'wheel rate infinite or implausible'
        )
        torque = self._within(
            WHEEL_ODOMETRY, m.torque, self._torques, 'torque infinite or implausible'
        )
        if rate is not m.rate or torque is not m.torque:
            m = replace(m, rate=rate, torque=torque)
        return m if m.steering is None else self._steered(m, m.steering)

    def _steered(self, m: WheelOdometry, steering: FloatArray) -> WheelOdometry:
        if len(steering) != self._count:
            self.reject(WHEEL_ODOMETRY, 'wrong number of steering angles')
            return replace(m, steering=None)
        reason = 'steering angle beyond half a turn'
        kept = self._within(WHEEL_ODOMETRY, steering, self._steering, reason)
        return m if kept is steering else replace(m, steering=kept)

    def _inertial(self, m: InertialReading) -> InertialReading | None:
        """Return the message with implausible vectors replaced by nan; None where none is left."""
        if any(m.variance) and (variance := credible(m.variance)) != m.variance:
            m = replace(m, variance=variance)
        x, y, z = m.specific_force.tolist()
        force = math.sqrt(x * x + y * y + z * z)
        x, y, z = m.angular_rate.tolist()
        rate = math.sqrt(x * x + y * y + z * z)
        bad_force = force == 0.0 or not force <= GREATEST_FORCE
        bad_rate = not rate <= GREATEST_RATE
        if bad_force or bad_rate:
            self._count_inertial(m, bad_force, bad_rate, silent=force == 0.0)
            if (bad_force and bad_rate and m.orientation is None) or (force == rate == 0.0):
                self.refused[INERTIAL] += 1
                return None
            m = replace(
                m,
                specific_force=_UNKNOWN if bad_force else m.specific_force,
                angular_rate=_UNKNOWN if bad_rate else m.angular_rate,
            )
        if self._is_outlier(m):
            self.refuse(INERTIAL, 'a single outlier, impossible motion of a rover')
            return None
        return m if m.orientation is None else self._oriented(m, m.orientation)

    def _is_outlier(self, m: InertialReading) -> bool:
        """Return whether a message differs too much from the last good one and the last outlier."""
        before, outlier = self._inertial_before, self._outlier
        if before is not None and _differs(m, before) and (outlier is None or _differs(m, outlier)):
            self._outlier = m
            return True
        self._inertial_before, self._outlier = m, None
        return False

    def _count_inertial(
        self, m: InertialReading, bad_force: bool, bad_rate: bool, *, silent: bool
    ) -> None:
        """Count the implausible vectors of an IMU message; those it does not hold are no fault."""
        if silent:
            self.reject(INERTIAL, 'specific force exactly zero (sensor not running)')
        elif bad_force and not np.isnan(m.specific_force).all():
            self.reject(INERTIAL, 'specific force not finite or implausible')
        if bad_rate and not np.isnan(m.angular_rate).all():
            self.reject(INERTIAL, 'angular rate not finite or implausible')

    def _oriented(self, m: InertialReading, orientation: FloatArray) -> InertialReading:
        """Return the message with a unit quaternion, or without orientation."""
        x, y, z, w = orientation.tolist()
        norm = math.sqrt(x * x + y * y + z * z + w * w)
        if abs(norm - 1.0) < 1e-6:
            return m
        if not 0.9 < norm < 1.1:
            self.reject(INERTIAL, 'orientation is not a unit quaternion (left out)')
            return replace(m, orientation=None)
        return replace(m, orientation=orientation / norm)

    def _sinkage(self, m: SinkageReading) -> SinkageReading | None:
        if len(m.sinkage) != self._count:
            self.refuse(SINKAGE, 'wrong number of wheels')
            return None
        kept = self._within(SINKAGE, m.sinkage, self._deepest, _TOO_DEEP)
        kept = self._within(SINKAGE, kept, self._highest, 'sinkage far above the surface')
        return m if kept is m.sinkage else SinkageReading(m.stamp, kept)

    def _leaving_angle(self, m: LeavingAngleReading) -> LeavingAngleReading | None:
        if len(m.leaving_angle) != self._count:
            self.refuse(LEAVING_ANGLE, 'wrong number of wheels')
            return None
        reason = 'leaving angle not within a quarter turn'
        kept = self._within(LEAVING_ANGLE, m.leaving_angle, self._angles, reason)
        return m if kept is m.leaving_angle else LeavingAngleReading(m.stamp, kept)

    def _reference(self, m: ReferenceVelocity) -> ReferenceVelocity | None:
        if not abs(m.forward) <= GREATEST_SPEED:
            self.refuse(REFERENCE, 'velocity not finite or implausible')
            return None
        if m.variance > GREATEST_VARIANCE:
            self.refuse(REFERENCE, _VOID)
            return None
        if not m.variance >= 0.0:
            self.reject(REFERENCE, 'variance negative or NaN (treated as not stated)')
            return replace(m, variance=0.0)
        return m

    def _within(
        self, channel: int, values: FloatArray, bounds: list[_Range], reason: str
    ) -> FloatArray:
        """Return the values of the wheels, those out of their bounds marked as unknown.

        Infinite values are out of bounds; nan passes, it marks an unknown already.
        """
        bad = [
            i
            for i, (value, (low, high)) in enumerate(zip(values.tolist(), bounds, strict=True))
            if value < low or value > high
        ]
        if not bad:
            return values
        self.reject(channel, reason)
        kept = np.array(values, dtype=float)
        kept[bad] = math.nan
        return kept


def _symmetric(bounds: Iterable[float]) -> list[_Range]:
    return [(-bound, bound) for bound in bounds]
