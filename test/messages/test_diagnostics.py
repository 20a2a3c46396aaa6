# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""When /diagnostics is due, and what it says."""

import math
from typing import Any

import numpy as np
from estimate_sets import STAMP, some_estimates

from wheel_terra_estimator.messages.diagnostics import ERROR, OK, STALE, WARN, Diagnostics
from wheel_terra_estimator.messages.pipeline import Pipeline
from wheel_terra_estimator.messages.unpack import Message

NAMES = ('left', 'right')


def at(seconds: float, **changes: Any) -> Any:
    changes.setdefault('slip_class', np.array([0, 0], dtype=np.uint8))
    return some_estimates(stamp=STAMP + round(seconds * 1e9), **changes)


def levels(statuses: Any) -> list[int]:
    return [status.level for status in statuses]


def test_one_status_for_the_node_and_one_per_wheel_with_units_in_the_keys():
    counters = {'imu/data_received': 7, 'below_N': -7.25, 'dust_s': -1e-14}
    found = Diagnostics(NAMES, lambda: counters).due(at(0.0))
    assert [status.name.rpartition(': ')[2] for status in found] == ['estimator', 'left', 'right']
    assert all(status.hardware_id for status in found)
    told = dict(found[0].values)
    assert [told[key] for key in counters] == ['7', '-7.25', '0']
    wheel = dict(found[1].values)
    assert {'stuck_probability', 'time_to_stuck_s', 'reason', 'drawbar_pull_N'} <= wheel.keys()
    assert wheel['reason'] == 'slip 0.10 +- 0.05'
    assert found[1].message == 'low slip'


def test_due_every_second_of_stamps_and_at_once_on_a_change_of_level():
    diagnostics = Diagnostics(NAMES)
    high = np.array([2, 0], dtype=np.uint8)
    sent = [
        round(i * 0.1, 1)
        for i in range(35)
        if diagnostics.due(at(0.1 * i, **({'slip_class': high} if i >= 14 else {})))
    ]
    assert sent == [0.0, 1.0, 1.4, 2.4, 3.4]


def test_a_step_back_of_the_clock_does_not_silence_it():
    diagnostics = Diagnostics(NAMES)
    assert diagnostics.due(at(100.0))
    assert diagnostics.due(at(3.0))
    assert not diagnostics.due(at(3.5))


def test_levels_follow_class_and_warning():
    classes = np.array([2, 3], dtype=np.uint8)
    found = Diagnostics(NAMES).due(at(0.0, slip_class=classes, stuck=True))
    assert levels(found) == [ERROR, WARN, ERROR]
    assert found[0].message == 'stuck: entrapment under way or close ahead'
    why = ('slip; rover: digging in', 'at rest; rover: digging in')
    assert (
        Diagnostics(NAMES).due(at(0.0, stuck=True, reasons=why))[0].message == 'stuck: digging in'
    )
    unknown = np.array([255, 255], dtype=np.uint8)
    resting = Diagnostics(NAMES).due(at(0.0, slip_class=unknown, reasons=('at rest', 'no rate')))
    assert levels(resting) == [OK, OK, WARN]
    silent = {'wheel_odometry': 'silent'}
    diagnostics = Diagnostics(NAMES)
    diagnostics.follow(at(0.0))
    found = diagnostics.due(at(1.0, slip_class=unknown, faults=silent))
    assert levels(found) == [WARN, STALE, STALE]


UNKNOWN = np.array([255, 0], dtype=np.uint8)


def test_an_unknown_class_is_called_so_with_the_slip_that_is_in_doubt():
    reasons = ('slip 0.42 +- 0.35; rover: digging in', 'slip 0.10 +- 0.05')
    told = Diagnostics(NAMES).due(at(0.0, slip_class=UNKNOWN, reasons=reasons))[1]
    assert (told.level, told.message) == (WARN, f'unknown: {reasons[0]}')
    silent = {'wheel_odometry': 'silent'}
    told = Diagnostics(NAMES).due(at(0.0, slip_class=UNKNOWN, reasons=reasons, faults=silent))[1]
    assert (told.level, told.message) == (STALE, 'no wheel rate')


def test_a_stalled_wheel_that_is_dragged_is_called_so():
    reasons = ('stalled: torque near its limit, hardly turning', 'slip 0.10 +- 0.05')
    dragged = at(0.0, slip_class=np.array([3, 0], dtype=np.uint8), reasons=reasons)
    told = Diagnostics(NAMES).due(dragged)[1]
    assert (told.level, told.message) == (ERROR, reasons[0])


def test_one_wheel_without_a_rate_is_a_fault_of_the_node():
    lacking = {'slip_class': UNKNOWN, 'reasons': ('no wheel rate', 'slip 0.10 +- 0.05')}
    diagnostics = Diagnostics(NAMES)
    assert levels(diagnostics.due(at(0.0, **lacking))) == [OK, STALE, OK], 'it may be on its way'
    found = diagnostics.due(at(1.0, **lacking))
    assert levels(found) == [WARN, STALE, OK]
    assert found[0].message == 'left: no wheel rate'
    assert diagnostics.due(at(4.0))[0].message == 'left: no wheel rate (3 s ago)'


def test_a_sensor_that_was_never_there_is_no_fault_one_that_fell_silent_is():
    diagnostics = Diagnostics(NAMES)
    lacking = {'sinkage': 'no sinkage reading: sinkage from its model'}
    assert levels(diagnostics.due(at(0.0, faults=lacking)))[0] == OK
    assert diagnostics.now(at(0.0, faults=lacking))[0].message == 'waiting for sinkage'
    found = diagnostics.due(at(1.0, faults=lacking))
    assert levels(found)[0] == OK
    assert found[0].message == 'sinkage: no sinkage reading: sinkage from its model'
    assert not diagnostics.due(at(1.1))  # the sensor is heard
    assert levels(diagnostics.due(at(1.2, faults=lacking)))[0] == WARN


def test_the_first_second_waits_for_inputs_and_for_nothing_else():
    missing = {'imu': 'no IMU', 'wheel_odometry': 'joint_states silent', 'filter': 'started anew'}
    for faults in (missing, {'imu': 'no IMU'}):
        diagnostics = Diagnostics(NAMES)
        found = diagnostics.due(at(0.0, faults=faults))
        assert levels(found)[0] == (WARN if 'filter' in faults else OK)
        assert 'waiting for imu' in found[0].message
        assert 'no IMU' not in found[0].message
    assert not diagnostics.due(at(0.9, faults=faults))
    assert diagnostics.due(at(1.0, faults=faults))[0].message == 'imu: no IMU'


def test_after_a_reset_inputs_are_waited_for_as_at_a_start():
    diagnostics = Diagnostics(NAMES)
    assert levels(diagnostics.due(at(0.0)) + diagnostics.due(at(5.0)))[::3] == [OK, OK]
    diagnostics.begin_anew()
    assert not diagnostics.due(at(5.1, faults={'imu': 'no IMU', 'sinkage': 'no sinkage'}))
    assert diagnostics.due(at(6.0))[0].message == 'running'
    assert levels(diagnostics.due(at(6.2, faults={'sinkage': 'no sinkage'})))[0] == WARN


LOST = 'messages lost in transport so far'


def once(faults: Any) -> Any:
    """Return what gives faults when it is first asked, and none later."""
    left = iter([faults])
    return lambda: next(left, [])


def test_a_fault_is_told_until_it_was_published_and_for_ten_seconds():
    """Whatever comes between: sets that tell nothing, messages of the topic, other faults."""
    lost = [('imu/data', f'299 {LOST}'), ('joint_states', f'300 {LOST}')]
    diagnostics = Diagnostics(NAMES, faults=once(lost))
    diagnostics.follow(at(0.0))
    said = [diagnostics.due(at(0.1 * i)) for i in range(1, 130)]
    told = [(i, s[0]) for i, s in enumerate(said, 1) if s]
    for i, status in told:
        assert (status.level == WARN) is (i < 100)
        ago = f' ({i // 10} s ago)' if i >= 10 else ''
        both = '; '.join(f'{topic}: {words}{ago}' for topic, words in lost)
        assert status.message == (both if i < 100 else 'running')
    assert said[0], 'at once'
    assert any(i > 100 for i, _ in told)


def test_a_fault_that_nobody_could_be_told_of_waits_for_who_can():
    diagnostics = Diagnostics(NAMES, faults=once([('joint_states', f'3 {LOST}')]))
    for i in range(100):
        diagnostics.follow(at(float(i)))  # inactive: nothing is published
    assert f'joint_states: 3 {LOST}' in diagnostics.stale('inactive')[0].message
    diagnostics.due(at(100.0))
    assert diagnostics.now(at(111.0))[0].message == 'running'


def test_a_fault_seen_again_is_one_fault_with_its_latest_count():
    counts = iter(range(30))
    diagnostics = Diagnostics(NAMES, faults=lambda: [('joint_states', f'{next(counts)} {LOST}')])
    for i in range(30):
        message = diagnostics.due(at(float(i)))[0].message
        assert message == f'joint_states: {i} {LOST}'
        assert bool(diagnostics.new_faults) is (i == 0)


TOPIC = 'joint_states'


def test_what_is_left_out_of_the_inputs_is_counted_once_whoever_left_it_out_and_told(rover):
    """By the pipeline of node and replay alike, each reason apart, with its count."""

    def joints(milliseconds: int, velocity: tuple[float, ...]) -> Message:
        none = np.zeros(0)
        return Message(STAMP + milliseconds * 1_000_000, NAMES, (none, np.array(velocity), none))

    pipeline = Pipeline(rover)
    assert not pipeline.rejected
    pipeline.refuse(TOPIC, 'damaged')  # transport
    pipeline.hear(TOPIC, joints(0, (1.0,)))  # converter
    pipeline.hear(TOPIC, joints(20, (1.0, -1.0)))
    pipeline.hear(TOPIC, joints(20, (1.0, -1.0)))  # core, merged
    pipeline.hear(TOPIC, joints(20, (1.0, -1.0)))
    pipeline.hear(TOPIC, joints(40, (math.inf, math.inf)))  # core, refused
    message = pipeline.diagnostics.stale('no estimates')[0].message
    assert f'{TOPIC}: damaged (1 so far)' in message
    assert 'wheel rate infinite or implausible (1 so far)' in message
    reasons = {reason: n for (topic, reason), n in pipeline.rejected.items() if topic == TOPIC}
    assert reasons.pop('damaged') == 1
    assert reasons.pop('velocity and name differ in length') == 1
    assert reasons.pop('stamp repeated, merged') == 2
    assert sum(reasons.values()) == 1, reasons
    assert sum(pipeline.rejected.values()) == 5
    assert pipeline.received[TOPIC] == 6
