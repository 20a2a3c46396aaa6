# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Joints that steer are not passed over where the rover file knows of none."""

import numpy as np
import pytest

from wheel_terra_estimator.checks.names import _pairs, check_wheel_names
from wheel_terra_estimator.checks.rover_facts import from_configuration
from wheel_terra_estimator.checks.series import JointSeries, Recording
from wheel_terra_estimator.configuration import reader

STEERED = "['', '', '', '', rear_left_steering_joint, rear_right_steering_joint]"


@pytest.mark.parametrize('stated', [False, True])
def test_joints_that_steer(stated):
    parameters = [f'wheels.steering_joints:={STEERED}'] if stated else []
    rover = reader.load(['generic_six_wheel'], parameters)
    names = (*rover.wheels.names, 'rear_left_steering_joint', 'rear_right_steering_joint')
    stamp = np.arange(10) * 100_000_000
    rate = np.ones((10, len(names)))
    joints = JointSeries('/joint_states', stamp, stamp, names, rate, np.full_like(rate, np.nan))
    outcomes, _ = check_wheel_names(
        Recording('drive', (), joints, None, None, None, None), from_configuration(rover)
    )
    cures = [str(outcome.cure) for outcome in outcomes]
    told = f'wheels.steering_joints: {STEERED}'
    assert cures == ([] if stated else [told])


def test_names_that_are_like_none_are_taken_in_the_usual_order():
    assert _pairs(['fore', 'hind'], ['m1', 'm2']) == {'fore': 'm1', 'hind': 'm2'}
    assert _pairs(['fore', 'hind'], ['m1', 'm2', 'm3']) == {}
