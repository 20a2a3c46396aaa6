# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Ground truth in a recording, if it has any, for comparison in pictures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from wheel_terra_estimator.arrays import FloatArray, IntArray
from wheel_terra_estimator.bags.history import ThinnedRows
from wheel_terra_estimator.bags.reader import MeasurementReader
from wheel_terra_estimator.bags.series_reader import credible
from wheel_terra_estimator.bags.storage import Bag, messages_of
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.contacts.steering import headings
from wheel_terra_estimator.estimation.estimates import SlipClass
from wheel_terra_estimator.estimation.measurements import InertialReading, WheelOdometry
from wheel_terra_estimator.estimation.rover import Rover
from wheel_terra_estimator.messages.pack import OUTPUT_TYPES
from wheel_terra_estimator.messages.unpack import JOINT_STATE, ODOMETRY, TWIST
from wheel_terra_estimator.terramechanics.kinematics import slip_ratio

BODY_VELOCITY = '/truth/odometry'
_SIMULATED_VELOCITY = '/ground_truth/twist'
_CLASSES = '/ground_truth/slip_class'
_OF_WHEELS = {
    'slip': ('/ground_truth/slip', 0),
    'drawbar_pull': ('/ground_truth/slip', 2),
    'sinkage': ('/ground_truth/sinkage', 0),
    'slip_angle': ('/ground_truth/slip_angle', 0),
    'lateral_force': ('/ground_truth/slip_angle', 2),
}
"""Field of a `Truth` -> topic, and which of its lists of numbers it is."""
_SIMULATED = {
    **{topic: JOINT_STATE for topic, _ in _OF_WHEELS.values()},
    _CLASSES: OUTPUT_TYPES['slip_class'],
    _SIMULATED_VELOCITY: TWIST,
}
"""Topics of a simulator and their types."""


@dataclass(frozen=True)
class WheelTruth:
    """A true quantity per wheel: stamps (k,) [ns], values (k, n), nan where unknown."""

    stamp: IntArray
    value: FloatArray

    def known(self) -> WheelTruth:
        """Return the rows in which something is known."""
        some = ~np.isnan(self.value).all(axis=1)
        return WheelTruth(self.stamp[some], self.value[some])


@dataclass(frozen=True)
class Truth:
    """Ground truth in a recording; None where it holds none."""

    source: str
    velocity: WheelTruth  # one column: body velocity along x [m/s]
    slip: WheelTruth | None
    sinkage: WheelTruth | None
    drawbar_pull: WheelTruth | None
    slip_angle: WheelTruth | None = None
    lateral_force: WheelTruth | None = None


def read_truth(bag: Bag, remaps: Mapping[str, str], configuration: Configuration) -> Truth | None:
    """Return the truth in a bag: a simulator's ``/ground_truth/*``, or a true body velocity.

    From a body velocity (``/truth/odometry``) the true slip of each wheel follows with the wheel
    rates and the yaw rate of the IMU.
    """
    truth = read_simulated_truth(bag, configuration.wheels.names)
    if truth is None or truth.source != BODY_VELOCITY:
        return truth
    reader = MeasurementReader(bag, remaps, configuration)
    return replace(truth, slip=_slip_from_velocity(truth.velocity, reader, configuration))


def read_simulated_truth(bag: Bag, names: tuple[str, ...]) -> Truth | None:
    """Return the truth that needs no rover file: a simulator's, or a true body velocity alone."""
    simulated = _SIMULATED_VELOCITY in bag.topics
    types = _SIMULATED if simulated else {BODY_VELOCITY: ODOMETRY}
    there = {t: k for t, k in types.items() if t in bag.topics and bag.topics[t].type == k}
    rows = {name: ThinnedRows() for name in (*_OF_WHEELS, 'slip_class', 'velocity')}
    for time, topic, message in messages_of(bag, there):
        if topic in (_SIMULATED_VELOCITY, BODY_VELOCITY):
            rows['velocity'].add(message.stamp, message.numbers[0][:1])
        elif topic == _CLASSES:  # it has no header, and was logged at the stamp that it belongs to
            rows['slip_class'].add(time, list(message.data))
        for name, (of, field) in _OF_WHEELS.items():
            if topic == of:
                values = dict(zip(message.names, message.numbers[field], strict=False))
                rows[name].add(message.stamp, [values.get(wheel, np.nan) for wheel in names])
    velocity = _sorted(rows['velocity'], 1).known()
    if not velocity.stamp.size:
        return None
    found = {name: _sorted(rows[name], len(names)) for name in (*_OF_WHEELS, 'slip_class')}
    found['slip'] = _of_turning_wheels(found['slip'], found.pop('slip_class'))
    angle = found['slip_angle']  # to be interpolated
    found['slip_angle'] = replace(angle, value=np.unwrap(angle.value, axis=0))
    source = '/ground_truth' if simulated else BODY_VELOCITY
    known = {name: series.known() for name, series in found.items()}
    return Truth(source, velocity, **{n: k if k.stamp.size else None for n, k in known.items()})


def _of_turning_wheels(slip: WheelTruth, classes: WheelTruth) -> WheelTruth:
    """Return slips without those that a wheel at rest holds: its class is unknown then."""
    row = {stamp: i for i, stamp in enumerate(classes.stamp.tolist())}
    value = slip.value.copy()
    for i, stamp in enumerate(slip.stamp.tolist()):
        if stamp in row:
            value[i, classes.value[row[stamp]] == SlipClass.UNKNOWN] = np.nan
    return WheelTruth(slip.stamp, value)


def _slip_from_velocity(
    velocity: WheelTruth, reader: MeasurementReader, configuration: Configuration
) -> WheelTruth:
    wheels = configuration.wheels
    rates, yaw_rates, angles = ThinnedRows(), ThinnedRows(), ThinnedRows()
    for measurement in reader.measurements():
        if isinstance(measurement, WheelOdometry):
            rates.add(measurement.stamp, measurement.rate)
            if measurement.steering is not None:
                angles.add(measurement.stamp, np.nan_to_num(measurement.steering))
        elif isinstance(measurement, InertialReading):
            yaw_rates.add(measurement.stamp, measurement.angular_rate[2:])
    rate, yaw = _sorted(rates, wheels.count).known(), _sorted(yaw_rates, 1).known()
    body = np.interp(rate.stamp, velocity.stamp, velocity.value[:, 0])
    turning = (
        np.interp(rate.stamp, yaw.stamp, yaw.value[:, 0])
        if yaw.stamp.size
        else np.zeros(rate.stamp.size)
    )
    steering = _sorted(angles, wheels.count).known()
    if steering.stamp.size:
        speed = _along_wheels(body, turning, rate.stamp, steering, configuration)
    else:
        speed = body[:, None] - turning[:, None] * wheels.y
    slip = slip_ratio(speed, rate.value * wheels.slip_radius, configuration.rest_speed)
    return WheelTruth(rate.stamp, slip)


def _along_wheels(
    body: FloatArray,
    turning: FloatArray,
    stamp: IntArray,
    steering: WheelTruth,
    configuration: Configuration,
) -> FloatArray:
    """Return the (k, n) ground speeds of the wheels of a steered rover along their headings."""
    rover = Rover.from_configuration(configuration)
    columns = [np.interp(stamp, steering.stamp, column) for column in steering.value.T]
    rows = []
    for speed, yaw_rate, angles in zip(body, turning, np.transpose(columns), strict=True):
        found = headings(rover, angles.tolist())
        rows.append(found.speeds(speed, yaw_rate))
    return np.array(rows).reshape(len(stamp), rover.wheel_count)


def _sorted(rows: ThinnedRows, width: int) -> WheelTruth:
    stamps, values = rows.stamps(), rows.values(width)
    order = np.argsort(stamps, kind='stable')
    return WheelTruth(stamps[order], credible(values[order]))
