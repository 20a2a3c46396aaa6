# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Rate, silence and loss of the inputs."""

import pytest

from wheel_terra_estimator.ros.input_watch import InputWatch


def test_rate_age_and_silence_after_three_periods():
    watch = InputWatch()
    for i in range(50):
        watch.received('imu/data', 0.01 * i, 0.002, None)
        watch.received('reference_odom', 2.0 * i, 0.5, None)
    values = watch.values(98.1)
    assert values['reference_odom_rate_Hz'] == pytest.approx(0.5)
    assert values['reference_odom_age_s'] == pytest.approx(0.1)
    assert values['reference_odom_delay_s'] == pytest.approx(0.5)
    assert watch.faults(0.5) == []
    assert [topic for topic, _ in watch.faults(103.9)] == ['imu/data']
    assert ('reference_odom', 'no message for 6.1 s') in watch.faults(104.1)


def test_the_rate_of_the_first_messages_is_that_of_their_mean_gap():
    watch = InputWatch()
    for now in (0.0, 0.1, 0.4, 0.6):
        watch.received('sinkage', now, 0.0, None)
    assert watch.values(0.6)['sinkage_rate_Hz'] == pytest.approx(3 / 0.6)


def test_loss_by_the_publishers_own_count_is_told_whatever_comes_next():
    watch = InputWatch()
    for number in (1, 2, 5, 6):  # three to four are missing
        watch.received('joint_states', 0.01 * number, 0.0, number)
    watch.believe_gaps({'joint_states'})
    for number in (1, 2):  # the publisher restarts
        watch.received('joint_states', 0.06 + 0.01 * number, 0.0, number)
    watch.believe_gaps({'joint_states'})
    assert watch.values(0.1)['joint_states_lost'] == 2
    for i in range(1000):
        watch.received('joint_states', 0.1 + 0.01 * i, 0.0, None)
    assert watch.faults(10.1) == [('joint_states', '2 messages lost in transport so far')]
    assert watch.faults(10.1) == [], 'told: whoever asked keeps it'


def test_two_publishers_between_two_looks_are_no_loss():
    watch = InputWatch()
    for number in (500, 1, 501, 2, 502, 503):
        watch.received('joint_states', 0.01 * number, 0.0, number)
    watch.believe_gaps({'joint_states'})  # the first of them has ended
    watch.received('joint_states', 6.0, 0.0, 600)
    watch.believe_gaps(())
    assert watch.values(6.0)['joint_states_lost'] == 0


@pytest.mark.parametrize(
    ('sources', 'told'),
    [
        ({'a': ['left', 'right'], 'b': ['left', 'right']}, True),  # a driver and a simulation
        ({'a': ['left', 'right'], 'b': ['right']}, True),
        ({'a': ['left'], 'b': ['right'], 'c': []}, False),  # a controller per wheel, and an arm
    ],
)
def test_two_publishers_of_one_wheel_are_told_and_those_of_other_wheels_are_not(sources, told):
    watch = InputWatch()
    first = {'a': 900, 'b': 1, 'c': 50}
    for second in range(3):
        for i in range(20):
            now = second + 0.05 * i
            watch.received('joint_states', now, 0.0, None)
            for source, wheels in sources.items():
                watch.mixed('joint_states', wheels, first[source] + 20 * second + i)
        watch.believe_gaps(())
        found = watch.faults(now)
        assert any('two publishers' in words for _, words in found) is told
    for number in (*range(1990, 2020), *range(1, 20)):  # one is left, and begins anew
        watch.mixed('joint_states', ['left', 'right'], number)
        if number in (1990, 2010):
            watch.believe_gaps(())
    watch.believe_gaps(())
    assert watch.faults(now) == []


def test_a_process_that_is_late_calls_no_topic_silent_and_says_by_how_much():
    watch = InputWatch()
    for number in range(41):
        watch.received('joint_states', 0.05 * number, 0.0, number)
        watch.looked(0.05 * number, 0.05)
    assert watch.faults(2.1) == []
    assert watch.faults(4.0) == [], 'messages may wait'
    watch.looked(4.0, 0.05)
    late = ('inputs', 'read 1.9 s late: this process lacks processor time')
    assert watch.faults(4.0) == [late], 'the middleware hands over what it has a little later'
    for now in (4.25, 4.5, 4.75):
        assert watch.faults(now) == []
        watch.looked(now, 0.25)
    assert watch.faults(5.0) == [('joint_states', 'no message for 3.0 s')]


def test_a_process_that_is_always_late_still_tells_a_silent_topic():
    watch, told = InputWatch(), set()
    for look in range(30):
        now = 0.9 * look
        for number in range(18):
            watch.received('imu/data', now + 0.05 * (number - 18), 0.0, None)
            if now < 10.0:
                watch.received('joint_states', now + 0.05 * (number - 18), 0.0, None)
        watch.looked(now, 0.25)
        told |= {topic for topic, words in watch.faults(now) if 'no message' in words}
    assert told == {'joint_states'}


def test_stamps_ahead_of_the_clock_are_told_of_the_topic_that_has_them():
    """A message that came late says nothing; one that is ahead among others neither."""
    watch = InputWatch()

    def told(joints, imu):
        for k in range(20):
            watch.received('joint_states', 0.05 * k, joints[k % len(joints)], None)
            watch.received('imu/data', 0.05 * k, imu, None)
        return [(topic, words[:14]) for topic, words in watch.faults(1.0)]

    assert told([0.0], 0.0) == []
    assert told([-2.0], 0.0) == [('joint_states', 'stamps 2 s ahe')]
    assert told([-2.0, 0.0], 3.0) == []
    assert told([-3600.0], -3599.0) == [('inputs', 'stamps 3600 s ')]
    watch.received('imu/data', 1.0, -3599.0, None)
    assert [topic for topic, _ in watch.faults(1.0)] == ['inputs']
