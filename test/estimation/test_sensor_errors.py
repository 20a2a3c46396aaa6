# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Stated zeros, gains and biases are taken off once, wherever readings enter."""

from dataclasses import replace

import numpy as np
import pytest
from fake_estimator import play
from test_core_with_filter import START, drive

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.estimation.core import EstimatorCore
from wheel_terra_estimator.estimation.measurements import (
    InertialReading,
    ReferenceVelocity,
    SinkageReading,
    WheelOdometry,
)
from wheel_terra_estimator.estimation.sensor_errors import SensorErrors
from wheel_terra_estimator.simulation.drive import simulate
from wheel_terra_estimator.simulation.scenario import load

FORCE_BIAS, RATE_BIAS = np.array([0.05, -0.02, 0.1]), np.array([0.001, -0.002, 0.003])
STATED = {
    'sensors.torque_gain': [1.2] * 4,
    'sensors.torque_zero': [2.0, -1.0, 0.0, 3.0],
    'sensors.sinkage_gain': [0.9] * 4,
    'sensors.sinkage_zero': [0.004] * 4,
    'sensors.specific_force_bias': FORCE_BIAS,
    'sensors.angular_rate_bias': RATE_BIAS,
}


@pytest.fixture(scope='module')
def rover():
    return reader.load(['frostyboy', 'dry_sand_ding2015'], ['sensors.torque_gain_std:=0.05'])


def misread(measurement):
    """Return a reading of sensors with these errors, written out."""
    if isinstance(measurement, WheelOdometry):
        torque = 1.2 * measurement.torque + np.array([2.0, -1.0, 0.0, 3.0])
        return replace(measurement, torque=torque)
    if isinstance(measurement, SinkageReading):
        return replace(measurement, sinkage=0.9 * measurement.sinkage + 0.004)
    if isinstance(measurement, InertialReading):
        return replace(
            measurement,
            specific_force=measurement.specific_force + FORCE_BIAS,
            angular_rate=measurement.angular_rate + RATE_BIAS,
        )
    return measurement


def estimates(configuration, stream):
    sets = play(EstimatorCore(configuration), stream)
    return {
        name: np.array([getattr(s, name) for s in sets], dtype=float)
        for name in ('slip', 'slip_std', 'drawbar_pull', 'sinkage', 'normal_load', 'soil')
    }


def test_a_drive_with_stated_errors_gives_the_estimates_of_the_clean_one(rover):
    clean = drive(1, duration=2.0)
    wrong = [misread(measurement) for measurement in clean]
    expected = estimates(rover, clean)
    corrected = estimates(rover.replace(STATED), wrong)
    left = estimates(rover, wrong)
    for name, values in expected.items():
        np.testing.assert_allclose(corrected[name], values, rtol=1e-6, atol=1e-9, err_msg=name)
    for name in ('drawbar_pull', 'sinkage'):
        assert np.abs(left[name] - expected[name]).max() > 1e-3, name


def test_an_imu_off_the_middle_feels_what_the_middle_does(rover):
    """A rover turns on the spot at 0.5 rad/s: half a metre ahead 0.125 m/s^2 pull towards it."""
    placed = SensorErrors(rover.replace({**STATED, 'sensors.imu_position': [0.5, 0.0, 0.3]}))
    true = InertialReading(START, np.array([0.0, 0.0, 9.81]), np.array([0.0, 0.0, 0.5]), None)
    felt = replace(true, specific_force=np.array([-0.125, 0.0, 9.81]))
    back = placed.corrected(misread(felt))
    np.testing.assert_allclose(back.specific_force, true.specific_force, atol=1e-12)
    np.testing.assert_allclose(back.angular_rate, true.angular_rate, atol=1e-12)
    read = placed.as_read(true)
    np.testing.assert_allclose(read.specific_force, misread(felt).specific_force, atol=1e-12)


def test_what_the_checks_are_to_refuse_is_left_to_them(rover):
    configuration = rover.replace(STATED)
    core = EstimatorCore(configuration)
    core.add(WheelOdometry(START, np.zeros(2), np.zeros(2)))
    core.add(InertialReading(START, np.zeros(3), np.zeros(3), None))
    health = core.health()
    assert health['joint_states_rejected: wrong number of wheels'] == 1
    assert health['imu/data_rejected: specific force exactly zero (sensor not running)'] == 1


def test_simulated_sensors_have_the_stated_errors():
    level = {'configuration': ['generic_six_wheel', 'test_sand'], 'duration': 1.5}
    stated = {
        'torque_gain': [1.2] * 6,
        'torque_zero': [2.0] * 6,
        'sinkage_zero': [0.003] * 6,
        'angular_rate_bias': [0.0, 0.0, 0.01],
    }
    keys = [f'sensors.{name}:={values}' for name, values in stated.items()]
    true, read = (simulate(load(level, parameters=given), 4) for given in ([], keys))
    errors = SensorErrors(read.configuration)
    for clean, wrong in zip(true.arrivals, read.arrivals, strict=True):
        expected, found = clean.measurement, errors.corrected(wrong.measurement)
        assert wrong.arrival == clean.arrival
        for name in ('torque', 'sinkage', 'angular_rate', 'specific_force'):
            if hasattr(expected, name):
                np.testing.assert_allclose(
                    getattr(found, name), getattr(expected, name), atol=1e-12, err_msg=name
                )


OFFSETS = {
    InertialReading: ('imu', 0.3),
    WheelOdometry: ('wheel_odometry', -0.2),
    ReferenceVelocity: ('reference', 0.5),
    SinkageReading: ('sinkage', -0.1),
}


def test_stamp_offsets_are_taken_off_before_anything_else(rover):
    """Estimates of late stamps with the offset stated are those of honest ones, to the bit."""
    honest = drive(3, duration=2.0)
    late = {kind: round(offset * 1e9) for kind, (_, offset) in OFFSETS.items()}
    off = [replace(m, stamp=m.stamp + late[type(m)]) if type(m) in late else m for m in honest]
    stated = {f'sensors.{name}_stamp_offset': offset for name, offset in OFFSETS.values()}
    expected, mended, left = [], [], []
    for configuration, measurements, sets in (
        (rover, honest, expected),
        (rover.replace(stated), off, mended),
        (rover, off, left),
    ):
        sets += play(EstimatorCore(configuration), measurements)
    assert [s.stamp for s in mended] == [s.stamp for s in expected]
    for a, b in zip(mended, expected, strict=True):
        np.testing.assert_array_equal(a.slip, b.slip)
    assert [s.stamp for s in left] != [s.stamp for s in expected]


def test_no_stamp_stays_none(rover):
    errors = SensorErrors(rover.replace({'sensors.imu_stamp_offset': -1.0}))
    assert errors.corrected(InertialReading(0, np.ones(3), np.zeros(3), None)).stamp == 0
