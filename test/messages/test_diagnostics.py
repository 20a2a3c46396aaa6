# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""When /diagnostics is due, and what it says."""

from __future__ import annotations

from typing import Any

import numpy as np
from estimate_sets import STAMP, some_estimates

from wheel_terra_estimator.messages.diagnostics import (
    ERROR,
    OK,
    STALE,
    WARN,
    Diagnostics,
    stale_statuses,
)

NAMES = ('left', 'right')


def at(seconds: float, **changes: Any) -> Any:
    changes.setdefault('slip_class', np.array([0, 0], dtype=np.uint8))
    return some_estimates(stamp=STAMP + round(seconds * 1e9), **changes)


def levels(statuses: Any) -> list[int]:
    return [status.level for status in statuses]


def test_one_status_for_the_node_and_one_per_wheel_with_units_in_the_keys() -> None:
    found = Diagnostics(NAMES, lambda: {'imu/data_received': 7}).due(at(0.0))
    assert [status.name.rpartition(': ')[2] for status in found] == ['estimator', 'left', 'right']
    assert all(status.hardware_id for status in found)
    assert dict(found[0].values)['imu/data_received'] == '7'
    wheel = dict(found[1].values)
    assert {'stuck_probability', 'time_to_stuck_s', 'reason', 'drawbar_pull_N'} <= wheel.keys()
    assert wheel['reason'] == 'slip 0.10 +- 0.05'
    assert found[1].message == 'low slip'


def test_due_every_second_of_stamps_and_at_once_on_a_change_of_level() -> None:
    diagnostics = Diagnostics(NAMES)
    high = np.array([2, 0], dtype=np.uint8)
    sent = [
        round(i * 0.1, 1)
        for i in range(35)
        if diagnostics.due(at(0.1 * i, **({'slip_class': high} if i >= 14 else {})))
    ]
    assert sent == [0.0, 1.0, 1.4, 2.4, 3.4]


def test_a_step_back_of_the_clock_does_not_silence_it() -> None:
    diagnostics = Diagnostics(NAMES)
    assert diagnostics.due(at(100.0))
    assert diagnostics.due(at(3.0))
    assert not diagnostics.due(at(3.5))


def test_levels_follow_class_and_warning() -> None:
    classes = np.array([2, 3], dtype=np.uint8)
    found = Diagnostics(NAMES).due(at(0.0, slip_class=classes, stuck=True))
    assert levels(found) == [ERROR, WARN, ERROR]
    assert 'stuck' in found[0].message
    unknown = np.array([255, 255], dtype=np.uint8)
    resting = Diagnostics(NAMES).due(at(0.0, slip_class=unknown, reasons=('at rest', 'no rate')))
    assert levels(resting) == [OK, OK, WARN]
    silent = {'wheel_odometry': 'silent'}
    assert levels(Diagnostics(NAMES).due(at(0.0, slip_class=unknown, faults=silent))) == [
        WARN,
        STALE,
        STALE,
    ]


def test_a_sensor_that_was_never_there_is_no_fault_one_that_fell_silent_is() -> None:
    diagnostics = Diagnostics(NAMES)
    lacking = {'sinkage': 'no sinkage: held by its model'}
    assert levels(diagnostics.due(at(0.0, faults=lacking)))[0] == OK
    assert 'no sinkage' in diagnostics.now(at(0.0, faults=lacking))[0].message
    assert not diagnostics.due(at(0.1))  # the sensor is heard
    assert levels(diagnostics.due(at(0.2, faults=lacking)))[0] == WARN


def test_faults_of_the_transport_are_shown() -> None:
    found = Diagnostics(NAMES, faults=lambda stamp: {'odom': 'wrong QoS'}).due(at(0.0))
    assert found[0].level == WARN
    assert 'odom: wrong QoS' in found[0].message


def test_silence_is_stale_for_all() -> None:
    found = stale_statuses(NAMES, 'nothing heard', {'resets': 0})
    assert levels(found) == [STALE] * 3
    assert found[0].message == 'nothing heard'


def test_silence_holds_the_values_but_not_the_class() -> None:
    for latest in (None, at(0.0)):
        for status in stale_statuses(NAMES, 'nothing heard', {}, latest)[1:]:
            values = dict(status.values)
            assert {'stuck_probability', 'time_to_stuck_s', 'reason'} <= values.keys()
            assert values['reason'] == status.message == 'nothing heard'
            assert float(values['time_to_stuck_s']) >= 0.0
    assert values['slip_class'] == 'unknown'
    assert float(values['drawbar_pull_N']) > 0.0
