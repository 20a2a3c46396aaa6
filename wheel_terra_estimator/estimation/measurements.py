# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Typed measurements: what the estimator hears, whatever brought it (a topic, a bag row, a test).

All stamps are integer nanoseconds; all vectors are in ``base_link`` (REP 103: x forward, y left,
z up) in SI units. ``nan`` marks a wheel that the message did not hold or could not measure.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from wheel_terra_estimator.arrays import FloatArray


@dataclass(frozen=True)
class WheelOdometry:
    """Wheel rates and drive torques, one entry per wheel in the order of ``wheels.names``.

    Attributes
    ----------
    stamp : int
        Time of the measurement [ns].
    rate : numpy.ndarray
        (n,) wheel rate, positive forward after the wheel's direction was applied [rad/s]; nan
        where the message did not hold the wheel.
    torque : numpy.ndarray
        (n,) drive torque, positive when it drives the wheel forward [N m]; nan where unknown.
    steering : numpy.ndarray or None
        (n,) steering angle, positive left [rad]; nan where the message did not hold it or the wheel
        is not steered; None where it held none.
    """

    stamp: int
    rate: FloatArray
    torque: FloatArray
    steering: FloatArray | None = None


class InertialVariance(NamedTuple):
    """Variances that the message of an IMU states; 0 = not stated."""

    specific_force: float = 0.0  # along x of base_link [(m/s^2)^2]
    angular_rate: float = 0.0  # about z [(rad/s)^2]
    orientation: float = 0.0  # of roll or pitch, the larger [rad^2]


NO_VARIANCE = InertialVariance()


@dataclass(frozen=True)
class InertialReading:
    """One IMU message, already turned into ``base_link``; a vector that is unknown is nan.

    Attributes
    ----------
    stamp : int
        Time of the measurement [ns].
    specific_force : numpy.ndarray
        (3,) specific force, +g on z at rest [m/s^2] (REP 145).
    angular_rate : numpy.ndarray
        (3,) angular rate [rad/s].
    orientation : numpy.ndarray or None
        (4,) unit quaternion x, y, z, w of ``base_link`` in the world; None when not reported.
    variance : InertialVariance
        As the message states it.
    """

    stamp: int
    specific_force: FloatArray
    angular_rate: FloatArray
    orientation: FloatArray | None
    variance: InertialVariance = NO_VARIANCE


def heading_of(orientation: FloatArray) -> Any:
    """Return the heading [rad] of quaternions x, y, z, w (..., 4), from x of the world to y."""
    x, y, z, w = np.moveaxis(orientation, -1, 0)
    return np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


@dataclass(frozen=True)
class SinkageReading:
    """Measured sinkage of the wheels: (n,) depth of the rim below the surface [m], nan = none."""

    stamp: int
    sinkage: FloatArray


@dataclass(frozen=True)
class LeavingAngleReading:
    """Measured leaving angle of the wheels: (n,) [rad], negative behind the hub, nan = none."""

    stamp: int
    leaving_angle: FloatArray


@dataclass(frozen=True)
class ReferenceVelocity:
    """Body velocity from a slip-free source (visual odometry, GNSS).

    Attributes
    ----------
    stamp : int
        Time of the measurement [ns].
    forward : float
        Velocity of ``base_link`` along its x axis [m/s].
    variance : float
        Variance of ``forward`` [(m/s)^2]; 0 or less = not stated.
    lateral : float
        Velocity along its y axis [m/s]; nan = not told.
    lateral_variance : float
        Variance of ``lateral`` [(m/s)^2]; 0 or less = not stated.
    """

    stamp: int
    forward: float
    variance: float
    lateral: float = math.nan
    lateral_variance: float = 0.0


Measurement: TypeAlias = (
    WheelOdometry | InertialReading | SinkageReading | LeavingAngleReading | ReferenceVelocity
)


@dataclass(frozen=True)
class StepInputs:
    """All measurements of one stamp, merged: what one step of the estimator gets.

    None where the stamp brought no such measurement. Within a channel the later arrival wins wheel
    by wheel, so that messages which hold some of the wheels only complete one another.
    """

    wheel_odometry: WheelOdometry | None = None
    inertial: InertialReading | None = None
    sinkage: SinkageReading | None = None
    leaving_angle: LeavingAngleReading | None = None
    reference: ReferenceVelocity | None = None
