# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What cannot be true is left out and counted, the rest of the message is used."""

import math

import numpy as np
import pytest
from fake_estimator import configuration, imu, odometry, reference, sinkage, stamp_at

from wheel_terra_estimator.estimation.measurements import (
    InertialReading,
    LeavingAngleReading,
    SinkageReading,
    WheelOdometry,
)
from wheel_terra_estimator.estimation.timing.input_checks import CHANNELS, InputChecks

NAN, INF = math.nan, math.inf


@pytest.fixture
def checks():
    return InputChecks(configuration())


def check(checks, measurement):
    return checks.check(CHANNELS[type(measurement)], measurement)


def reasons(checks):
    return [reason for counter in checks.rejected for reason in counter]


@pytest.mark.parametrize('stamp', [0, -5, 2**31 * 10**9, 2**63])
@pytest.mark.parametrize('kind', [odometry, imu, sinkage, reference])
def test_impossible_stamps(checks, stamp, kind):
    measurement = kind(0.0)
    object.__setattr__(measurement, 'stamp', stamp)
    assert check(checks, measurement) is None
    assert len(reasons(checks)) == 1 and 'stamp' in reasons(checks)[0]
    assert sum(checks.refused) == 1


@pytest.mark.parametrize('bad', [INF, -INF, 1e9])
def test_one_bad_wheel_leaves_the_other(checks, bad):
    m = check(checks, WheelOdometry(stamp_at(0.0), np.array([bad, 2.0]), np.array([1.0, bad])))
    np.testing.assert_array_equal(m.rate, [NAN, 2.0])
    np.testing.assert_array_equal(m.torque, [1.0, NAN])
    assert reasons(checks) == [
        'wheel rate infinite or implausible',
        'torque infinite or implausible',
    ]
    assert sum(checks.refused) == 0


@pytest.mark.parametrize(
    ('depth', 'passes'),
    [(0.1, True), (0.1001, False), (INF, False), (-0.01, True), (-0.06, False), (-INF, False)],
)
def test_sinkage_larger_than_the_wheel(checks, depth, passes):
    m = check(checks, SinkageReading(stamp_at(0.0), np.array([depth, 0.02])))
    assert m.sinkage[1] == 0.02
    assert np.isnan(m.sinkage[0]) != passes
    assert bool(reasons(checks)) != passes


def test_leaving_angle(checks):
    m = check(checks, LeavingAngleReading(stamp_at(0.0), np.array([-0.4, 2.0])))
    np.testing.assert_array_equal(m.leaving_angle, [-0.4, NAN])
    assert len(reasons(checks)) == 1


@pytest.mark.parametrize('bad', [NAN, INF, -INF, 1e4, 120.0])
@pytest.mark.parametrize('axis', [0, 1, 2])
def test_imu_that_is_not_a_number_or_impossible(checks, bad, axis):
    force, rate = np.array([0.0, 0.0, 9.8]), np.zeros(3)
    force[axis] = bad
    turning, good = np.array([0.0, 0.1, 0.2]), np.array([0.0, 0.0, 9.8])
    kept = check(checks, InertialReading(stamp_at(0.0), force, turning, None))
    assert np.isnan(kept.specific_force).all()
    assert kept.angular_rate.tolist() == turning.tolist()
    rate[axis] = bad
    kept = check(checks, InertialReading(stamp_at(0.0), good, rate, None))
    assert np.isnan(kept.angular_rate).all()
    assert kept.specific_force.tolist() == good.tolist()
    assert [n for counter in checks.rejected for n in counter.values()] == [1, 1]
    assert check(checks, InertialReading(stamp_at(0.0), force, rate, None)) is None
    level = np.array([0.0, 0.0, 0.0, 1.0])
    kept = check(checks, InertialReading(stamp_at(0.0), force, rate, level))
    assert kept.orientation.tolist() == level.tolist()


def test_an_imu_without_an_accelerometer_keeps_its_gyro(checks):
    """Drivers without one send zeros, or nan where the covariance says that there is none."""
    turning = np.array([0.0, 0.0, 0.2])
    for force in (np.zeros(3), np.full(3, NAN)):
        kept = check(checks, InertialReading(stamp_at(0.0), force, turning, None))
        assert np.isnan(kept.specific_force).all()
        assert kept.angular_rate[2] == 0.2


@pytest.mark.parametrize(
    ('quaternion', 'kept'),
    [
        ([0.0, 0.0, 0.0, 1.0], True),
        ([0.0, 0.0, 0.0, 1.05], True),
        ([0.0, 0.0, 0.0, 0.0], False),
        ([0.0, 0.0, 0.0, 2.0], False),
        ([NAN, 0.0, 0.0, 1.0], False),
        ([INF, 0.0, 0.0, 1.0], False),
    ],
)
def test_orientation(checks, quaternion, kept):
    m = InertialReading(stamp_at(0.0), np.array([0.0, 0.0, 9.8]), np.zeros(3), np.array(quaternion))
    result = check(checks, m)
    assert result is not None  # specific force and angular rate are used all the same
    assert (result.orientation is not None) == kept
    if kept:
        np.testing.assert_allclose(np.linalg.norm(result.orientation), 1.0, rtol=1e-12)
    assert bool(reasons(checks)) != kept


IMU_AT_ZERO = InertialReading(stamp_at(0.0), np.zeros(3), np.zeros(3), None)


@pytest.mark.parametrize(
    ('measurement', 'reason'),
    [
        (WheelOdometry(stamp_at(0.0), np.zeros(3), np.zeros(3)), 'wrong number of wheels'),
        (SinkageReading(stamp_at(0.0), np.zeros(1)), 'wrong number of wheels'),
        (IMU_AT_ZERO, 'exactly zero'),
        *((reference(0.0, variance=v), 'variance') for v in (INF, 1e308, 1e6)),
        *((reference(0.0, forward=v), 'velocity not finite') for v in (NAN, INF, -INF, 1e3)),
    ],
)
def test_what_tells_nothing_is_refused(checks, measurement, reason):
    assert check(checks, measurement) is None
    assert [reason in told for told in reasons(checks)] == [True]


@pytest.mark.parametrize(('variance', 'used'), [(-1.0, 0.0), (NAN, 0.0), (0.0, 0.0), (1e-4, 1e-4)])
def test_variance_that_is_none(checks, variance, used):
    assert check(checks, reference(0.0, variance=variance)).variance == used


def test_a_single_sample_that_no_body_makes_is_dropped_and_counted(checks):
    inertial = CHANNELS[InertialReading]

    def passes(k, x, turn=0.0):
        force, rate = np.array([x, 0.0, 9.8]), np.array([0.0, 0.0, turn])
        reading = InertialReading(10**9 + k * 20_000_000, force, rate, None)
        return checks.check(inertial, reading) is not None

    assert all(passes(k, 0.1 * (k % 3)) for k in range(10))
    assert not passes(10, 80.0) and passes(11, 0.2)
    assert not passes(12, 0.2, turn=20.0) and passes(13, 0.2)
    assert checks.refused[inertial] == 2
    assert checks.rejected[inertial] == {'a single outlier, impossible motion of a rover': 2}
    assert not passes(14, 90.0) and passes(15, 88.0), 'two alike are no single sample'
