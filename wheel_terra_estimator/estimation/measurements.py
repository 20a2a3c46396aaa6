# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Typed measurements: the inputs of the estimator, whatever their source (topic, bag, test).

All stamps are integer nanoseconds, of the time of measurement; all vectors are in ``base_link``
(REP 103: x forward, y left, z up) in SI units. ``nan`` marks a wheel that the message did not hold
or could not measure.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from wheel_terra_estimator.arrays import FloatArray


@dataclass(frozen=True)
class WheelOdometry:
    """Wheel rates and drive torques, (n,) in the order of ``wheels.names``."""

    stamp: int
    # Positive forward after the wheel's direction was applied [rad/s]; nan: not in the message
    rate: FloatArray
    torque: FloatArray  # positive when it drives the wheel forward [N m]; nan where unknown
    # Positive left [rad]; nan where the message did not hold it or the wheel is not steered; None
    # where it held none
    steering: FloatArray | None = None


class InertialVariance(NamedTuple):
    """Variances that the message of an IMU states; 0 = not stated."""

    specific_force: float = 0.0  # along x of base_link [(m/s^2)^2]
    angular_rate: float = 0.0  # about z [(rad/s)^2]
    orientation: float = 0.0  # of roll or pitch, the larger [rad^2]


NO_VARIANCE = InertialVariance()


@dataclass(frozen=True)
class InertialReading:
    """One IMU message, already turned into ``base_link``; a vector that is unknown is nan."""

    stamp: int
    specific_force: FloatArray  # (3,) +g on z at rest [m/s^2] (REP 145)
    angular_rate: FloatArray  # (3,) [rad/s]
    # (4,) unit quaternion x, y, z, w of ``base_link`` in the world; None when not reported
    orientation: FloatArray | None
    variance: InertialVariance = NO_VARIANCE  # as the message states it


def heading_of(orientation: FloatArray) -> Any:
    """Return the heading [rad] of quaternions x, y, z, w ((4,) or (k, 4)), from world x to y."""
    x, y, z, w = orientation.T
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
    """Body velocity from a slip-free source (visual odometry, GNSS)."""

    stamp: int
    forward: float  # velocity of ``base_link`` along its x axis [m/s]
    variance: float  # of ``forward`` [(m/s)^2]; 0 or less = not stated
    lateral: float = math.nan  # velocity along its y axis [m/s]; nan = unknown
    lateral_variance: float = 0.0  # of ``lateral`` [(m/s)^2]; 0 or less = not stated


Measurement: TypeAlias = (
    WheelOdometry | InertialReading | SinkageReading | LeavingAngleReading | ReferenceVelocity
)


@dataclass(frozen=True)
class StepInputs:
    """Merged measurements of one step of the estimator; None where there was none.

    Where several messages have the same stamp, the later arrival counts wheel by wheel, so that
    messages with some of the wheels complete one another.
    """

    wheel_odometry: WheelOdometry | None = None
    inertial: InertialReading | None = None
    sinkage: SinkageReading | None = None
    leaving_angle: LeavingAngleReading | None = None
    reference: ReferenceVelocity | None = None
