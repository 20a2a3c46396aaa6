# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Sinkage sensors under each other's name, on ground whose soft spots each wheel meets alone."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rolling_rover as rolling

from wheel_terra_estimator.bags.series_reader import read_series
from wheel_terra_estimator.bags.storage import open_bag
from wheel_terra_estimator.checks.run import check_recording
from wheel_terra_estimator.configuration import reader

WHOLE = rolling.recording()


def patchy(order=(0, 1, 2, 3), resistance=6.0, seed=5):
    """Each wheel sinks by its own spots and pays for them with torque [N m per cm]."""
    random = np.random.default_rng(seed)
    joints, sinkage = WHOLE.joints, WHOLE.sinkage
    time = (joints.stamp - joints.stamp[0]) * 1e-9
    knots = np.arange(0.0, time[-1] + 4.0, 4.0)
    spots = np.column_stack(
        [np.interp(time, knots, random.uniform(0.0, 0.02, knots.size)) for _ in range(4)]
    )
    moving = np.abs(joints.rate) > 0.5
    torque = joints.torque + 100.0 * resistance * spots * moving * np.sign(joints.rate)
    depth = sinkage.sinkage + spots
    return replace(
        WHOLE,
        joints=replace(joints, torque=torque),
        sinkage=replace(sinkage, sinkage=depth[:, list(order)]),
    )


def found(recording):
    report = check_recording(recording, rolling.rover())
    said = [entry.reason for entry in report.not_checked if 'order of the sinkage' in entry.reason]
    return {f.wheel: f for f in report.findings if f.kind == 'exchanged_wheels'}, said


@pytest.mark.parametrize(
    ('order', 'wheels'),
    [((1, 0, 2, 3), (0, 1)), ((2, 1, 0, 3), (0, 2)), ((0, 3, 2, 1), (1, 3))],
)
def test_exchanged_sensors_are_named(order, wheels):
    names = [rolling.NAMES[i] for i in wheels]
    findings, _ = found(patchy(order))
    assert list(findings) == [', '.join(names)]
    for finding in findings.values():
        assert finding.topic == '/sinkage' and finding.confidence > 0.99
        assert f'exchange {names[0]} and {names[1]}' in finding.cure


@pytest.mark.parametrize('seed', range(3))
def test_sensors_in_order_are_told_to_be(seed):
    findings, said = found(patchy(seed=seed))
    assert not findings and not said


def test_ground_that_is_the_same_for_all_wheels_tells_nothing_and_that_is_said():
    findings, said = found(WHOLE)
    assert not findings
    assert '6 pairs' in said[0] and 'patchy ground' in said[0]


def test_without_torques_it_is_said():
    joints = WHOLE.joints
    blind = replace(WHOLE, joints=replace(joints, torque=np.full_like(joints.torque, np.nan)))
    findings, said = found(blind)
    assert not findings and 'without torques' in said[0]


def test_wheels_that_dig_themselves_in_are_not_taken_for_exchanged_sensors():
    """At high slip the deepest wheels take the least torque; the truth has these depths."""
    folder = Path(__file__).parents[2] / 'data' / 'demo' / 'entrapment'
    with open_bag(folder) as bag:
        recording = read_series(bag, {}, folder.name)
    report = check_recording(recording, reader.load(['generic_six_wheel', 'test_sand']))
    assert not report.findings
    assert any('order of the sinkage' in entry.reason for entry in report.not_checked)


def test_without_a_reference_it_is_said():
    findings, said = found(replace(patchy((1, 0, 2, 3)), reference=None))
    assert not findings and 'without a reference velocity' in said[0]
