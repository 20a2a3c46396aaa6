# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Messages of the inputs -> typed measurements, the same for node and replay.

Values are checked by the estimator core; only messages that do not fit the layout are
refused here.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.measurements import (
    InertialReading,
    InertialVariance,
    LeavingAngleReading,
    Measurement,
    ReferenceVelocity,
    SinkageReading,
    WheelOdometry,
)
from wheel_terra_estimator.messages.unpack import IMU, JOINT_STATE, ODOMETRY, Message

INPUT_TYPES = {
    'joint_states': JOINT_STATE,
    'odom': ODOMETRY,
    'imu/data': IMU,
    'sinkage': JOINT_STATE,
    'leaving_angle': JOINT_STATE,
    'reference_odom': ODOMETRY,
}
"""Input topics of the estimator (relative names) and their message types."""

_FASTEST = 30.0  # lateral speed that no rover has [m/s]
DAMAGED = 'damaged message'  # why bytes are refused that are no message of their type
_NO_WHEEL = 'contains none of the configured wheels'
_NO_RATES = 'velocity is empty -> publish the wheel rates there, or set wheel_odometry: odom'
_GONE = 1_000_000_000  # other joints alone for so long [ns] are reported
_MOST_LETTERS = 300  # of the names of joints in one line of words


def imu_mounting(configuration: Configuration) -> Rotation:
    """Return what turns the IMU into ``base_link``."""
    sensors = configuration.sensors
    angles = [getattr(sensors, f'imu_mounting_{name}') for name in ('roll', 'pitch', 'yaw')]
    return Rotation.from_euler('xyz', angles)  # about fixed x, then y, then z, as in URDF


class InputConverter:
    """Messages to measurements."""

    def __init__(self, configuration: Configuration) -> None:
        self.wheels = wheels = configuration.wheels
        self.wheel_odometry = configuration.wheel_odometry  # 'joint_states' or 'odom'
        other = 'odom' if self.wheel_odometry == 'joint_states' else 'joint_states'
        # Input topics that are listened to
        self.topics = tuple(name for name in INPUT_TYPES if name != other)
        self._steered_by: dict[str, list[int]] = {}  # joint -> wheels that it steers
        for i, joint in enumerate(wheels.steering_joints):
            if joint:
                self._steered_by.setdefault(joint, []).append(i)
        # Messages that did not fit, by (topic, reason in words)
        self.rejected: Counter[tuple[str, str]] = Counter()
        self._unknown_names: dict[str, Sequence[str]] = {}  # topic -> names in a message
        # topic -> stamp of its last message with a wheel: other joints beside it are no fault
        self._with_wheels: dict[str, int] = {}
        self._columns: dict[tuple[str, ...], tuple[list[int], list[int]]] = {}
        self._index = {name: i for i, name in enumerate(wheels.names)}
        self._all = list(range(wheels.count))
        self._reversed = bool(np.any(wheels.direction != 1.0))
        self._place: list[float] | None = None  # of the last reference velocity [m]
        self._mounting = imu_mounting(configuration)
        self._mounted = self._mounting.magnitude() > 0.0
        self._rotation = self._mounting.as_matrix()
        squares = np.square(self._rotation)
        self._shares = squares[0].tolist(), squares[2].tolist()
        """Of the variances along the sensor's axes in those along x and z of ``base_link``."""
        self._readers: dict[str, Callable[[Message], Any]] = {
            'joint_states': self._joint_states,
            'odom': self._odom,
            'imu/data': self._imu,
            'sinkage': partial(self._per_wheel, SinkageReading, 'sinkage'),
            'leaving_angle': partial(self._per_wheel, LeavingAngleReading, 'leaving_angle'),
            'reference_odom': self._reference_odom,
        }

    def convert(self, topic: str, message: Message) -> Measurement | None:
        """Return the measurement in a message of an input topic; None when it does not fit."""
        return self._readers[topic](message)

    def in_words(self, topic: str, reason: str) -> str:
        """Return a reason for a rejection, with the names where these are the reason."""
        if reason != _NO_WHEEL:
            return reason
        there = names_in_words(self._unknown_names[topic])
        return f'{reason}, but {there}; wheels.names: {", ".join(self.wheels.names)}'

    def _joint_states(self, message: Message) -> WheelOdometry | None:
        """Wheel rates, torques and steering angles; what the message does not hold is nan."""
        _, velocity, effort = message.numbers
        steering = self._steering(message) if self._steered_by else None
        if steering is not None and not self._columns_of(message.names)[0]:
            blank = np.full(self.wheels.count, math.nan)
            return WheelOdometry(message.stamp, blank, blank, steering)
        values = self._wheel_values('joint_states', message, velocity, 'velocity')
        if values is None:
            return None
        given = len(effort) > 0
        torque = self._wheel_values('joint_states', message, effort, 'effort') if given else None
        if torque is None:
            torque = np.full(self.wheels.count, math.nan)
        unknown = np.count_nonzero(np.isnan(values))
        if unknown and unknown > len(values) - len(set(self._columns_of(message.names)[1])):
            self.rejected['joint_states', 'velocity of a wheel is NaN (treated as unknown)'] += 1
        if self._reversed:
            with np.errstate(invalid='ignore'):  # a damaged nan may be a signalling one
                values, torque = values * self.wheels.direction, torque * self.wheels.direction
        return WheelOdometry(message.stamp, values, torque, steering)

    def _steering(self, message: Message) -> FloatArray | None:
        """Return the steering angles of the wheels [rad], nan where there is none; None: none."""
        joints, position = self._steered_by, message.numbers[0]
        there = [k for k, name in enumerate(message.names) if name in joints]
        if not there:
            return None
        if len(position) != len(message.names):
            self.rejected['joint_states', 'position of steering joints missing'] += 1
            return None
        angles = np.full(self.wheels.count, math.nan)
        for k in there:
            angles[joints[message.names[k]]] = position[k]
        return angles

    def _odom(self, message: Message) -> WheelOdometry:
        """Wheel rates of a rover that publishes no joint states, from its wheel odometry."""
        forward, _, _, _, _, turn = message.numbers[0][:6].tolist()
        with np.errstate(all='ignore'):  # implausible values are rejected later, one by one
            rim_speed = forward - turn * self.wheels.y
            rate = rim_speed / self.wheels.slip_radius
        if np.isnan(rim_speed).any():
            self.rejected['odom', 'velocity is NaN (treated as unknown)'] += 1
        return WheelOdometry(message.stamp, rate, np.full_like(rim_speed, math.nan))

    def _imu(self, message: Message) -> InertialReading | None:
        """Specific force, angular rate and attitude in ``base_link``; nan where not given."""
        values = message.numbers[0].tolist()
        attitude, rates, forces = values[:4], values[13:16], values[25:28]
        of_attitude, of_rate, of_force = values[4:13], values[16:25], values[28:]
        given = of_force[0] != -1.0, of_rate[0] != -1.0  # REP 145
        for words, there in zip(('linear acceleration', 'angular velocity'), given, strict=True):
            if not there:
                self.rejected['imu/data', f'states that it has no {words} (covariance -1)'] += 1
        force, rate = (
            np.array(vector) if there else np.full(3, math.nan)
            for vector, there in zip((forces, rates), given, strict=True)
        )
        orientation = None
        if of_attitude[0] != -1.0:  # REP 145: -1 is "no orientation"
            orientation = self._orientation(attitude)
        if orientation is None and not any(given):
            return None
        if self._mounted:
            with np.errstate(all='ignore'):
                force, rate = self._rotation @ force, self._rotation @ rate
        variance = self._inertial_variance(of_force, of_rate, of_attitude)
        return InertialReading(message.stamp, force, rate, orientation, variance)

    def _inertial_variance(
        self, of_force: list[float], of_rate: list[float], of_attitude: list[float]
    ) -> InertialVariance:
        """Return the variances in an Imu along the axes that count; 0 where it states none.

        A sensor that measures along other axes than x and z has its own there; its orientation is
        about level axes, however it is mounted.
        """
        force, rate = _diagonal(of_force), _diagonal(of_rate)
        x, y, _ = _diagonal(of_attitude)
        if not self._mounted:
            return InertialVariance(force[0], rate[2], max(x, y))
        along, about = self._shares
        return InertialVariance(_weighted(along, force), _weighted(about, rate), max(x, y))

    def _per_wheel(self, kind: Any, topic: str, message: Message) -> Any:
        """Return what a sensor at each wheel measured, a reading of a kind."""
        values = self._wheel_values(topic, message, message.numbers[0], 'position')
        return None if values is None else kind(message.stamp, values)

    def _reference_odom(self, message: Message) -> ReferenceVelocity | None:
        """Body velocity from a slip-free source; none where it moves and holds no velocity."""
        values, place = message.numbers[0].tolist(), message.numbers[1].tolist()
        before, self._place = self._place, place
        if place != before and before is not None and not any(values):
            self.rejected[
                'reference_odom', 'holds a pose only: twist and its covariance are 0'
            ] += 1
            return None
        forward, lateral, covariance = values[0], values[1], values[6:]
        variance = covariance[7]
        # A source that measures no lateral speed sends 0, with a variance of 1e6 or 0.
        given = lateral != 0.0 and abs(lateral) < _FASTEST and not variance >= _FASTEST**2
        return ReferenceVelocity(
            message.stamp,
            forward,
            covariance[0],
            lateral if given else math.nan,
            variance if variance > 0.0 else 0.0,
        )

    def _wheel_values(
        self, topic: str, message: Message, values: Any, label: str
    ) -> FloatArray | None:
        """Sort the values of a JointState into the order of the wheels, nan where there is none."""
        names = message.names
        source, target = self._columns_of(names)
        if not source:
            last = self._with_wheels.get(topic)
            if last is None or message.stamp - last > _GONE:
                self.rejected[topic, _NO_WHEEL] += 1
                self._unknown_names[topic] = names
            return None
        if topic not in self._with_wheels:
            del self.rejected[topic, _NO_WHEEL]
        self._with_wheels[topic] = message.stamp
        if len(values) != len(names):
            empty = label == 'velocity' and not len(values)
            self.rejected[topic, _NO_RATES if empty else f'{label} and name differ in length'] += 1
            return None
        given = np.array(values, dtype=np.float64)
        if target == self._all and len(given) == len(target):
            return given
        result = np.full(len(self._all), math.nan)
        result[target] = given[source]
        return result

    def _columns_of(self, names: Sequence[str]) -> tuple[list[int], list[int]]:
        """Return where the wheels stand in a message, and where they belong."""
        key = tuple(names)
        columns = self._columns.get(key)
        if columns is None:
            source = [i for i, name in enumerate(key) if name in self._index]
            columns = source, [self._index[key[i]] for i in source]
            if len(self._columns) < 100:  # a publisher that invents names must not fill the memory
                self._columns[key] = columns
        return columns

    def _orientation(self, quaternion: list[float]) -> FloatArray | None:
        norm = math.hypot(*quaternion)
        if not 0.5 < norm < 2.0:  # all zero is what many drivers send when there is none
            self.rejected['imu/data', 'orientation is not a unit quaternion (left out)'] += 1
            return None
        sensor = np.array(quaternion) / norm
        if not self._mounted:
            return sensor
        return (Rotation.from_quat(sensor) * self._mounting.inv()).as_quat()


def names_in_words(names: Iterable[str]) -> str:
    """Return the names of joints in one line of bounded length, whatever they hold."""
    words = ', '.join(name if name and name.isprintable() else repr(name) for name in names)
    return f'{words[:_MOST_LETTERS]} ...' if len(words) > _MOST_LETTERS else words or 'no names'


def stamp_of(message: Any) -> int:
    """Return the stamp of a message with a header [ns]."""
    stamp = message.header.stamp
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def _diagonal(covariance: Sequence[float]) -> tuple[float, float, float]:
    """Return the three variances of a covariance, zeros where it states none.

    All zeros mean that it is unknown, -1 that there is no such quantity (sensor_msgs/Imu); an
    identity matrix is a placeholder, and so is what no variance can be.
    """
    x, y, z = covariance[::4]
    if min(x, y, z) > 0.0 and max(x, y, z) < math.inf and not x == y == z == 1.0:
        return x, y, z
    return 0.0, 0.0, 0.0


def _weighted(shares: Sequence[float], variances: Sequence[float]) -> float:
    return sum(share * variance for share, variance in zip(shares, variances, strict=True))
