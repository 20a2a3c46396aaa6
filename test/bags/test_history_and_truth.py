# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Figures of a whole drive, and the truth beside it."""

import csv

import numpy as np
import pytest
from estimate_sets import STAMP, some_estimates

from wheel_terra_estimator.bags.history import WHEEL_FIELDS, HistoryRecorder, read_estimates
from wheel_terra_estimator.bags.storage import open_bag
from wheel_terra_estimator.bags.truth import read_truth
from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.estimation.estimates import SlipClass
from wheel_terra_estimator.frames import unit_of

SECOND = 1_000_000_000


def test_time_in_class_counts_no_pauses():
    recorder = HistoryRecorder(('left', 'right'))
    stamps = [0.0, 0.5, 1.0, 1.5, 60.0, 60.5, 20.0]  # a pause of a minute, a step back
    classes = [0, 0, 3, 3, 2, 2, 2]
    for time, value in zip(stamps, classes, strict=True):
        recorder.add(
            some_estimates(
                stamp=STAMP + round(time * SECOND),
                slip_class=np.array([value, 255], dtype=np.uint8),
            )
        )
    times = recorder.history().figures().seconds_in_class
    assert [times[c][0] for c in SlipClass] == pytest.approx([1.0, 0.0, 0.5, 0.5, 0.0])
    assert times[SlipClass.UNKNOWN][1] == pytest.approx(2.0)


def test_history_of_nothing():
    history = HistoryRecorder(('left',)).history()
    assert history.seconds.size == 0
    assert history.values['slip'].shape == (0, 1)


def test_bag_without_estimates_is_refused(make_bag):
    with open_bag(make_bag()) as bag, pytest.raises(UserError, match='no estimates'):
        read_estimates(bag)


TOPICS = {
    '/joint_states': 'sensor_msgs/msg/JointState',
    '/imu/data': 'sensor_msgs/msg/Imu',
    '/truth/odometry': 'nav_msgs/msg/Odometry',
}


def test_true_slip_from_a_true_velocity(make_bag, rover, drive):
    """Rim speed 2 rad/s x 0.21 m = 0.42 m/s, velocity 0.36 m/s: slip 1/7."""
    moved = [(t.replace('/reference_odom', '/truth/odometry'), m, time) for t, m, time in drive]
    bag = make_bag(messages=moved, topics=TOPICS)
    with open_bag(bag) as opened:
        truth = read_truth(opened, {}, rover)
    assert truth is not None and truth.slip is not None
    assert truth.velocity.value.shape == (4, 1)
    np.testing.assert_allclose(truth.slip.value, np.full((40, 2), 1 / 7), atol=1e-12)


def test_true_slip_of_steered_wheels_is_along_their_headings(make_bag, rover, drive, factory):
    """Both wheels head 0.3 rad to the left: the rover moves along them with 0.36 / cos 0.3."""
    moved = []
    for topic, message, time in drive:
        if topic == '/joint_states':
            message = factory.joint_state(
                message.header,
                (*message.name, 'steer'),
                position=[*[np.nan] * len(message.name), 0.3],
                velocity=[*message.velocity, 0.0],
            )
        moved.append((topic.replace('/reference_odom', '/truth/odometry'), message, time))
    bag = make_bag(messages=moved, topics=TOPICS)
    steered = rover.replace({'wheels.steering_joints': ['steer', 'steer']})
    with open_bag(bag) as opened:
        truth = read_truth(opened, {}, steered)
    assert truth is not None and truth.slip is not None
    expected = 1.0 - 0.36 / np.cos(0.3) / 0.42
    np.testing.assert_allclose(truth.slip.value, np.full((40, 2), expected), atol=1e-12)


def test_no_truth_in_a_bag_without(make_bag, rover):
    with open_bag(make_bag()) as bag:
        assert read_truth(bag, {}, rover) is None


@pytest.mark.shared
def test_true_slip_of_a_measured_drive_is_that_of_its_table(shared):
    """The table has wheel speeds and the speed of each side, of the author's own making."""
    configuration = reader.load(['frostyboy'])
    with open_bag(shared / 'bags' / 'frostyboy_event_1_6_mcap') as bag:
        truth = read_truth(bag, {}, configuration)
    assert truth is not None and truth.slip is not None
    with (shared / 'frostyboy_snow' / 'event_1_6.csv').open() as file:
        rows = list(csv.DictReader(file))
    speed = np.array([[float(r['v_X'])] for r in rows])
    yaw = -np.array([[float(r['angAccel_Z'])] for r in rows])  # z counts clockwise
    rim = 0.265 * np.array([[float(r[f'w{w}']) for w in ('fl', 'fr', 'rl', 'rr')] for r in rows])
    ground = speed - yaw * np.array([0.571, -0.571, 0.571, -0.571])
    driving = (rim > 0.3) & (ground > 0.0) & (ground < rim)
    assert driving.sum() > 1000
    expected = 1.0 - ground / np.where(driving, rim, 1.0)
    found = truth.slip.value
    assert found.shape == expected.shape
    np.testing.assert_allclose(found[driving], expected[driving], atol=2e-6)


def test_every_column_of_a_wheel_has_its_unit_or_is_a_ratio():
    assert {name for name in WHEEL_FIELDS if unit_of(name) == '-'} == {'slip', 'slip_std'}
