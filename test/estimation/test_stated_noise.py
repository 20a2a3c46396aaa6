# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Noise of the IMU as its messages state it: the same as in a file, and no placeholder."""

from dataclasses import replace
from math import nan, radians

import numpy as np
import pytest
from fake_estimator import play

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.estimation.core import EstimatorCore
from wheel_terra_estimator.estimation.inputs.noise import StatedNoise
from wheel_terra_estimator.estimation.measurements import (
    InertialReading,
    InertialVariance,
    ReferenceVelocity,
    WheelOdometry,
)

SECOND = 1_000_000_000
FIGURES = {
    'sensors.specific_force_std': 0.4,
    'sensors.angular_rate_std': 0.02,
    'sensors.orientation_std_deg': 1.5,
}
STATED = InertialVariance(0.4**2, 0.02**2, radians(1.5) ** 2)
SILENT = {
    'rover.mass': 50.0,
    'wheels.names': ['front_left', 'front_right', 'rear_left', 'rear_right'],
    'wheels.radius': [0.17] * 4,
    'wheels.width': [0.12] * 4,
    'wheels.x': [0.26, 0.26, -0.26, -0.26],
    'wheels.y': [0.29, -0.29, 0.29, -0.29],
}
ROVER = reader.from_parameters(SILENT)


def drive(variances, backwards=False):
    """A start, an arc and a stop; `variances` go to the messages of the IMU in turn."""
    rng = np.random.default_rng(4)
    stream = []
    for i in range(260):
        stamp, moving = 100 * SECOND + i * SECOND // 100, 40 < i < 220
        if backwards and i >= 130:
            stamp -= 30 * SECOND
        turn = 0.1 * (100 < i < 180)
        variance = variances[min(i // 2, len(variances) - 1)]
        force = np.array([0.3, 0.0, 9.8]) + 0.3 * rng.normal(size=3)
        rate = np.array([0.0, 0.0, turn]) + 0.02 * rng.normal(size=3)
        if not i % 2:
            upright = np.array([0.0, -0.015, 0.0, 1.0])
            stream.append(InertialReading(stamp, force, rate, upright, variance))
        if not i % 10:
            sides = np.array([-turn, turn, -turn, turn]) * 1.8 + 3.0 * moving
            stream.append(WheelOdometry(stamp, sides, np.full(4, 6.0 * moving)))
        if i % 100 == 99:
            speed = 0.45 * moving + 0.02 * rng.normal()
            stream.append(ReferenceVelocity(stamp, speed, 4e-4))
    return stream


def run(configuration, stream):
    """Return speed, slip and their deviations of all sets, and what diagnostics tell."""
    core = EstimatorCore(configuration)
    sets = play(core, stream)
    rows = [[s.forward_velocity, s.forward_velocity_variance, *s.slip, *s.slip_std] for s in sets]
    return np.array(rows), core.health()


@pytest.fixture(scope='module')
def default():
    return run(ROVER, drive([InertialVariance()]))


@pytest.fixture(scope='module')
def by_message():
    return run(ROVER, drive([STATED]))[0]


def test_a_message_states_what_a_file_can_state(default, by_message):
    by_file, _ = run(ROVER.replace(FIGURES), drive([InertialVariance()]))
    np.testing.assert_array_equal(by_message, by_file)
    assert np.abs(by_message - default[0]).max() > 0.01


def test_a_file_comes_before_the_message_key_by_key(by_message):
    sharp = InertialVariance(1e-4, STATED.angular_rate, 1e-6)
    file = {k: v for k, v in FIGURES.items() if k != 'sensors.angular_rate_std'}
    both, _ = run(ROVER.replace(file), drive([sharp]))
    np.testing.assert_array_equal(both, by_message)


@pytest.mark.parametrize('variances', [(1e-12, 99999.0, nan), (-1.0, 1e-12, 99999.0)])
def test_placeholders_leave_the_defaults(variances, default):
    found, told = run(ROVER, drive([InertialVariance(*variances)]))
    np.testing.assert_array_equal(found, default[0])
    assert told == default[1]


def test_the_first_message_that_states_something_counts():
    later = InertialVariance(4.0, 0.1, 0.05**2)
    placeholder = InertialVariance(1e6, 0.0, nan)
    found, _ = run(ROVER, drive([placeholder, STATED, later]))
    np.testing.assert_array_equal(found, run(ROVER, drive([placeholder, STATED]))[0])
    # Each field by itself: one that comes later completes those before.
    known = StatedNoise().completed(InertialVariance(0.0, 1e-4, 0.0), ())
    known = known.completed(InertialVariance(0.04, 4e-4, 0.0), ())
    assert known == pytest.approx((0.2, 0.01, 0.0))


def test_late_messages_and_a_clock_set_back_change_nothing_of_it():
    stream = drive([STATED])
    imu = [m for m in stream if isinstance(m, InertialReading)]
    late = [m for m in stream if m is not imu[0]]
    late.insert(30, imu[0])
    end = [replace(stream[-1], stamp=stream[-1].stamp + SECOND)]
    np.testing.assert_array_equal(run(ROVER, late + end)[0][-1], run(ROVER, stream + end)[0][-1])
    by_message, health = run(ROVER, drive([STATED], backwards=True))
    assert health['clock_steps_back'] == 1
    np.testing.assert_array_equal(
        by_message, run(ROVER.replace(FIGURES), drive([STATED], backwards=True))[0]
    )
