# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Ground truth in a recording, if it has any, for comparison in pictures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.bags.reader import MeasurementReader
from wheel_terra_estimator.bags.storage import Bag
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.measurements import InertialReading, WheelOdometry
from wheel_terra_estimator.messages.convert import JOINT_STATE, ODOMETRY, stamp_of
from wheel_terra_estimator.terramechanics.kinematics import slip_ratio

FloatArray = NDArray[np.float64]

TWIST = 'geometry_msgs/msg/TwistWithCovarianceStamped'
BODY_VELOCITY = '/truth/odometry'
_TYPES = {
    '/ground_truth/slip': JOINT_STATE,
    '/ground_truth/sinkage': JOINT_STATE,
    '/ground_truth/twist': TWIST,
    BODY_VELOCITY: ODOMETRY,
}


@dataclass(frozen=True)
class WheelTruth:
    """A true quantity per wheel: stamps (k,) [ns], values (k, n), nan where unknown."""

    stamp: NDArray[np.int64]
    value: FloatArray


@dataclass(frozen=True)
class Truth:
    """What a recording knows of the truth; None where it says nothing."""

    source: str
    velocity: WheelTruth  # one column: body velocity along x [m/s]
    slip: WheelTruth | None
    sinkage: WheelTruth | None
    drawbar_pull: WheelTruth | None


def read_truth(bag: Bag, remaps: Mapping[str, str], configuration: Configuration) -> Truth | None:
    """Return the truth in a bag: a simulator's ``/ground_truth/*``, or a true body velocity.

    From a body velocity (``/truth/odometry``) the true slip of each wheel follows with the wheel
    rates and the yaw rate of the IMU.
    """
    simulated = read_simulated_truth(bag, configuration.wheels.names)
    if simulated is not None and simulated.source != BODY_VELOCITY:
        return simulated
    if BODY_VELOCITY in bag.topics:
        odometry = list(_messages(bag, BODY_VELOCITY))
        velocity = _column([(stamp_of(m), [m.twist.twist.linear.x]) for m in odometry])
        if velocity.stamp.size:
            slip_truth = _slip_from_velocity(
                velocity, MeasurementReader(bag, remaps, configuration), configuration
            )
            return Truth(BODY_VELOCITY, velocity, slip_truth, None, None)
    return None


def read_simulated_truth(bag: Bag, names: tuple[str, ...]) -> Truth | None:
    """Return the truth that needs no rover file: a simulator's, or a true body velocity alone."""
    if '/ground_truth/twist' in bag.topics:
        slips = list(_messages(bag, '/ground_truth/slip'))
        sinkages = list(_messages(bag, '/ground_truth/sinkage'))
        twists = list(_messages(bag, '/ground_truth/twist'))
        return Truth(
            source='/ground_truth',
            velocity=_column([(stamp_of(m), [m.twist.twist.linear.x]) for m in twists]),
            slip=_column([(stamp_of(m), _ordered(m, m.position, names)) for m in slips]),
            sinkage=_column([(stamp_of(m), _ordered(m, m.position, names)) for m in sinkages]),
            drawbar_pull=_column([(stamp_of(m), _ordered(m, m.effort, names)) for m in slips]),
        )
    if BODY_VELOCITY in bag.topics:
        odometry = list(_messages(bag, BODY_VELOCITY))
        velocity = _column([(stamp_of(m), [m.twist.twist.linear.x]) for m in odometry])
        return Truth(BODY_VELOCITY, velocity, None, None, None) if velocity.stamp.size else None
    return None


def _slip_from_velocity(
    velocity: WheelTruth, reader: MeasurementReader, configuration: Configuration
) -> WheelTruth:
    wheels = configuration.wheels
    rates: list[tuple[int, FloatArray]] = []
    yaw: list[tuple[int, float]] = []
    for _, measurement in reader.measurements():
        if isinstance(measurement, WheelOdometry):
            rates.append((measurement.stamp, measurement.rate))
        elif isinstance(measurement, InertialReading):
            yaw.append((measurement.stamp, float(measurement.angular_rate[2])))
    rate = _column(rates)
    body = np.interp(rate.stamp, velocity.stamp, velocity.value[:, 0])
    yaw_truth = _column([(stamp, [value]) for stamp, value in yaw])
    turning = (
        np.interp(rate.stamp, yaw_truth.stamp, yaw_truth.value[:, 0])
        if yaw
        else np.zeros(rate.stamp.size)
    )
    speed = body[:, None] - turning[:, None] * wheels.y
    slip = slip_ratio(speed, rate.value * wheels.slip_radius, configuration.rest_speed)
    return WheelTruth(rate.stamp, slip)


def _messages(bag: Bag, topic: str) -> Iterator[Any]:
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    if topic in bag.topics and bag.topics[topic].type == _TYPES[topic]:
        for _, _, data in bag.messages((topic,)):
            yield store.deserialize_cdr(data, _TYPES[topic])


def _ordered(message: Any, values: Any, names: tuple[str, ...]) -> list[float]:
    """Return values in the order of the wheels, nan where the message has none."""
    found = dict(zip(message.name, values, strict=False))
    return [float(found.get(name, np.nan)) for name in names]


def _column(rows: list[tuple[int, Any]]) -> WheelTruth:
    """Sort rows by stamp, drop those that are not finite at all."""
    rows = sorted(rows, key=lambda row: row[0])
    stamp = np.array([row[0] for row in rows], dtype=np.int64)
    value = np.array([row[1] for row in rows], dtype=np.float64).reshape(len(rows), -1)
    known = ~np.isnan(value).all(axis=1)
    return WheelTruth(stamp[known], value[known])
