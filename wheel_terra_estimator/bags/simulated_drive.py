# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A simulated drive as a rosbag2 folder: what the sensors sent, and the ground truth."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.bags.bag_file import BagFile
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.measurements import (
    InertialReading,
    LeavingAngleReading,
    Measurement,
    ReferenceVelocity,
    SinkageReading,
    WheelOdometry,
)
from wheel_terra_estimator.messages import pack
from wheel_terra_estimator.messages.convert import INPUT_TYPES, imu_mounting
from wheel_terra_estimator.messages.pack import BASE_FRAME, OUTPUT_TYPES
from wheel_terra_estimator.simulation.drive import SimulatedDrive

TRUTH = '/ground_truth'
TRUTH_TOPICS = {
    f'{TRUTH}/{name}': OUTPUT_TYPES[name]
    for name in ('slip', 'sinkage', 'slip_angle', 'slip_class', 'stuck', 'twist')
}


def write_simulated_drive(drive: SimulatedDrive, path: Path, overwrite: bool = False) -> BagFile:
    """Write a drive; messages are logged when they arrive, the truth at its own stamps.

    Raises UserError where the path is taken or cannot be written. Returns the closed bag, for its
    counts.
    """
    inputs = {f'/{name}': kind for name, kind in INPUT_TYPES.items()}
    if not drive.scenario.sensors.leaving_angle:
        del inputs['/leaving_angle']
    topics = {**inputs, **TRUTH_TOPICS}
    with BagFile(path, topics, latched=(f'{TRUTH}/stuck',), overwrite=overwrite) as bag:
        sender = _Sender(bag, drive.configuration)
        truth = _TruthSender(bag, drive)
        for arrival, measurement in drive.arrivals:
            truth.write_until(arrival)
            sender.write(measurement, arrival)
        truth.write_until(None)
    return bag


class _Sender:
    """Measurements as messages, in the frames and signs of the rover's own sensors."""

    def __init__(self, bag: BagFile, configuration: Configuration) -> None:
        self._bag = bag
        self._wheels = configuration.wheels
        self._figures = configuration.sensors
        self._mounting = imu_mounting(configuration)
        self._into_sensor = self._mounting.inv().as_matrix()
        self._mounted = self._mounting.magnitude() > 0.0

    def write(self, measurement: Measurement, log_time: int) -> None:
        if isinstance(measurement, WheelOdometry):
            self._wheel_odometry(measurement, log_time)
        elif isinstance(measurement, InertialReading):
            self._bag.write('/imu/data', self._imu(measurement), log_time)
        elif isinstance(measurement, SinkageReading):
            message = self._joints(measurement.stamp, measurement.sinkage)
            self._bag.write('/sinkage', message, log_time)
        elif isinstance(measurement, LeavingAngleReading):
            message = self._joints(measurement.stamp, measurement.leaving_angle)
            self._bag.write('/leaving_angle', message, log_time)
        elif isinstance(measurement, ReferenceVelocity):
            self._reference(measurement, log_time)

    def _joints(self, stamp: int, values: FloatArray) -> bytes:
        return pack.joint_state(stamp, self._wheels.names, values.tolist())

    def _wheel_odometry(self, odometry: WheelOdometry, log_time: int) -> None:
        wheels, names = self._wheels, self._wheels.names
        rate, torque = odometry.rate * wheels.direction, odometry.torque * wheels.direction
        position = np.zeros(0)
        if odometry.steering is not None:
            # Joints of drives and of steering in one message, as joint_state_broadcaster sends it.
            angles = {
                joint: odometry.steering[i]
                for i, joint in enumerate(wheels.steering_joints)
                if joint
            }
            none = np.full(len(angles), np.nan)
            names = (*names, *angles)
            position = np.concatenate([np.full(wheels.count, np.nan), list(angles.values())])
            rate, torque = np.concatenate([rate, none]), np.concatenate([torque, none])
        message = pack.joint_state(
            odometry.stamp, names, position.tolist(), rate.tolist(), torque.tolist()
        )
        self._bag.write('/joint_states', message, log_time)
        rim = odometry.rate * wheels.slip_radius
        known = ~np.isnan(rim)
        if known.any():
            # Body motion that rolling wheels would give: v - turn y = rim speed.
            layout = np.stack([np.ones(wheels.count), -wheels.y], axis=1)[known]
            forward, turn = np.linalg.lstsq(layout, rim[known], rcond=None)[0]
            covariance = (1e-4 * np.eye(6)).ravel().tolist()
            message = pack.odometry(odometry.stamp, forward, turn, covariance)
            self._bag.write('/odom', message, log_time)

    def _imu(self, reading: InertialReading) -> bytes:
        figures = self._figures
        force, rate = reading.specific_force, reading.angular_rate
        orientation = reading.orientation
        if self._mounted:
            force, rate = self._into_sensor @ force, self._into_sensor @ rate
            if orientation is not None:
                orientation = (Rotation.from_quat(orientation) * self._mounting).as_quat()
        return pack.imu(
            reading.stamp,
            force.tolist(),
            rate.tolist(),
            None if orientation is None else orientation.tolist(),
            (
                figures.orientation_std**2,
                figures.angular_rate_std**2,
                figures.specific_force_std**2,
            ),
            'imu_link' if self._mounted else BASE_FRAME,
        )

    def _reference(self, reference: ReferenceVelocity, log_time: int) -> None:
        covariance = (reference.variance * np.eye(6)).ravel().tolist()
        message = pack.odometry(reference.stamp, reference.forward, 0.0, covariance)
        self._bag.write('/reference_odom', message, log_time)


class _TruthSender:
    """The truth as messages; slip at rest holds its last value, as the outputs do."""

    def __init__(self, bag: BagFile, drive: SimulatedDrive) -> None:
        self._bag = bag
        self._truth = drive.truth
        self._names = drive.configuration.wheels.names
        self._row = 0
        self._slip = np.zeros(len(self._names))
        self._stuck: bool | None = None

    def write_until(self, time: int | None) -> None:
        """Write the rows before ``time`` [ns]; None: all that are left."""
        stamps = self._truth.stamp
        while self._row < len(stamps) and (time is None or stamps[self._row] <= time):
            self._write(self._row)
            self._row += 1

    def _write(self, row: int) -> None:
        truth = self._truth
        stamp = int(truth.stamp[row])
        self._slip = np.where(np.isnan(truth.slip[row]), self._slip, truth.slip[row])
        columns = {
            'slip': (self._slip, truth.slip_velocity[row], truth.drawbar_pull[row]),
            'sinkage': (truth.sinkage[row], truth.sinkage_rate[row], truth.normal_load[row]),
            'slip_angle': (truth.slip_angle[row], (), truth.lateral_force[row]),
        }
        for name, fields in columns.items():
            values = (np.asarray(field).tolist() for field in fields)
            message = pack.joint_state(stamp, self._names, *values)
            self._bag.write(f'{TRUTH}/{name}', message, stamp)
        classes = pack.slip_classes(truth.slip_class[row].tolist())
        self._bag.write(f'{TRUTH}/slip_class', classes, stamp)
        velocity = float(truth.forward_velocity[row]), float(truth.lateral_velocity[row])
        twist = pack.twist_stamped(stamp, velocity, float(truth.yaw_rate[row]), [0.0] * 36)
        self._bag.write(f'{TRUTH}/twist', twist, stamp)
        stuck = bool(truth.stuck[row])
        if stuck != self._stuck:
            self._stuck = stuck
            self._bag.write(f'{TRUTH}/stuck', pack.flag(stuck), stamp)
