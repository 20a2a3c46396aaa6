# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Within half a minute of driving: an IMU turned about z, two exchanged wheels, a dead sensor."""

from dataclasses import replace

import numpy as np
import pytest
import rolling_rover as rolling
from scipy.spatial.transform import Rotation

from wheel_terra_estimator.checks.online import OnlineChecks
from wheel_terra_estimator.estimation.measurements import (
    InertialReading,
    ReferenceVelocity,
    StepInputs,
    WheelOdometry,
)

DRIVING = 30.0  # [s]


motion = rolling.starts_and_curves


def told(recording, since=0.0, until=70.0):
    """Return {fault: seconds after a time at which it was told first} over a drive."""
    joints, imu, reference = recording.joints, recording.imu, recording.reference
    inputs = {int(s): {} for s in np.union1d(joints.stamp, imu.stamp)}
    for stamp, velocity in zip(reference.stamp, reference.velocity, strict=True):
        inputs[int(stamp)]['reference'] = ReferenceVelocity(int(stamp), velocity[0], 1e-4)
    for stamp, rate, torque in zip(joints.stamp, joints.rate, joints.torque, strict=True):
        inputs[int(stamp)]['wheel_odometry'] = WheelOdometry(int(stamp), rate, torque)
    for stamp, force, rate in zip(imu.stamp, imu.force, imu.rate, strict=True):
        inputs[int(stamp)]['inertial'] = InertialReading(int(stamp), force, rate, None)
    checks, first = OnlineChecks(rolling.rover()), {}
    for stamp, what in inputs.items():
        if stamp > rolling.START + until * 1e9:
            break
        checks.step(stamp, StepInputs(**what))
        for finding in (*checks.standing('slip'), *checks.standing('beside')):
            seconds = (stamp - rolling.START) * 1e-9 - since
            first.setdefault(finding.fault, (seconds, finding))
    return first


def test_a_sound_drive_is_silent():
    assert not told(rolling.recording(motion()))


@pytest.mark.parametrize('degrees', [-90.0, pytest.param(180.0, marks=pytest.mark.slow)])
def test_an_imu_turned_about_z(degrees):
    whole = rolling.recording(motion())
    turn = Rotation.from_euler('z', degrees, degrees=True).as_matrix()
    imu = replace(whole.imu, force=whole.imu.force @ turn, rate=whole.imu.rate @ turn)
    ((fault, (seconds, finding)),) = told(replace(whole, imu=imu), until=DRIVING + 5.0).items()
    assert fault == 'imu_yaw' and finding.kind == 'mounting' and seconds < DRIVING
    assert finding.parameter == 'sensors.imu_mounting_yaw_deg'


def test_two_exchanged_wheels():
    whole = rolling.recording(motion())
    order = [1, 0, 2, 3]
    joints = replace(whole.joints, rate=whole.joints.rate[:, order])
    first = told(replace(whole, joints=joints), since=35.0)
    seconds, finding = first['exchanged']
    assert seconds < DRIVING and finding.wheel == 'front_left, front_right'
    assert 'wheels.names: [front_right, front_left, rear_left, rear_right]' in finding.cure


def test_a_dead_imu():
    whole = rolling.recording(motion())
    at = int(np.argmax(whole.imu.seconds > 24.0))
    force, turning = whole.imu.force.copy(), whole.imu.rate.copy()
    force[at:], turning[at:] = force[at], turning[at]
    first = told(replace(whole, imu=replace(whole.imu, force=force, rate=turning)), 24.0, 60.0)
    assert set(first) == {'sensor_frozen'} and first['sensor_frozen'][0] < DRIVING
