# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings with any stamps and any numbers: no check fails, and one that did would be alone."""

import time
import warnings
from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rolling_rover import START, recording, rover, starts_and_curves

from wheel_terra_estimator.checks import run
from wheel_terra_estimator.checks.finding import INTERNAL_ERROR
from wheel_terra_estimator.checks.run import check_recording
from wheel_terra_estimator.checks.series import rows_of

WHOLE = recording()
CONFIGURATION = rover()
STAMPS = ('as they are', 'random', 'random days', 'random years', 'one', 'zero', 'back', 'far')
NUMBERS = ('as they are', 'one', 'nan', 'some nan', 'large', 'random')


def stamps(kind, stamp, random):
    size = stamp.size
    return {
        'as they are': stamp,
        'random': START + random.integers(0, 10**10, size),
        'random days': START + random.integers(0, 10**15, size),
        'random years': random.integers(-(2**63), 2**63 - 1, size),
        'one': np.full(size, START),
        'zero': np.zeros(size, dtype=np.int64),
        'back': stamp[::-1],
        'far': stamp + np.where(random.random(size) < 0.2, 4 * 10**18, 0),
    }[kind]


def numbers(kind, values, random):
    holes = np.where(random.random(values.shape) < 0.3, np.nan, values)
    return {
        'as they are': values,
        'one': np.full(values.shape, 1.0),
        'nan': np.full(values.shape, np.nan),
        'some nan': holes,
        'large': 1e8 * holes,
        'random': random.standard_normal(values.shape),
    }[kind]


@st.composite
def channels(draw, series):
    """A channel of the drive with some of its messages, other stamps and other numbers."""
    if series is None or draw(st.integers(0, 7)) == 0:
        return None
    random = np.random.default_rng(draw(st.integers(0, 2**32)))
    size = draw(st.sampled_from((0, 1, 2, 3, 9, 10, 11, 40, 200, 800, 2000)))
    rows = slice(*sorted(random.integers(0, series.stamp.size, 2))) if draw(st.booleans()) else None
    rows = slice(0, size) if rows is None else rows
    kind, value = draw(st.sampled_from(STAMPS)), draw(st.sampled_from(NUMBERS))
    changed = {
        field.name: getattr(series, field.name)[rows]
        for field in fields(series)
        if isinstance(getattr(series, field.name), np.ndarray)
    }
    for name, values in changed.items():
        if values.dtype == np.float64:
            changed[name] = numbers(value, values, random)
    changed['stamp'] = stamps(kind, changed['stamp'], random)
    if not changed['stamp'].size:
        return None
    return replace(series, **changed)


@st.composite
def recordings(draw):
    return replace(
        WHOLE,
        joints=draw(channels(WHOLE.joints)),
        imu=draw(channels(WHOLE.imu)),
        sinkage=draw(channels(WHOLE.sinkage)),
        reference=draw(channels(WHOLE.reference)),
    )


HALF = settings.default.max_examples // 2


@settings(max_examples=HALF, deadline=None, suppress_health_check=list(HealthCheck))
@given(recordings(), st.booleans())
def test_no_check_fails(any_recording, with_rover):
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        report = check_recording(any_recording, CONFIGURATION if with_rover else None)
    assert not [entry for entry in report.not_checked if entry.reason == INTERNAL_ERROR]
    for finding in report.findings:
        assert 0.0 <= finding.confidence <= 1.0
        assert 'nan' not in finding.words.split()


@pytest.mark.parametrize(
    ('channel', 'field', 'value'),
    [
        ('joints', 'torque', np.nan),
        pytest.param('joints', 'torque', 0.0, marks=pytest.mark.slow),
        ('joints', 'rate', np.inf),
        pytest.param('imu', 'force', np.nan, marks=pytest.mark.slow),
        ('imu', 'orientation', 1.0),
    ],
)
def test_no_check_fails_where_one_wheel_or_axis_tells_nothing(channel, field, value):
    told = getattr(WHOLE, channel)
    dead = getattr(told, field).copy()
    dead[:, 0] = value
    changed = replace(WHOLE, **{channel: replace(told, **{field: dead})})
    report = check_recording(changed, CONFIGURATION)
    assert not [entry for entry in report.not_checked if entry.reason == INTERNAL_ERROR]


@pytest.fixture(scope='module')
def one_backwards():
    """A short drive with one wheel that counts backwards: the only finding."""
    whole = recording(starts_and_curves())
    flip = np.array([-1.0, 1.0, 1.0, 1.0])
    joints = replace(whole.joints, rate=whole.joints.rate * flip, torque=whole.joints.torque * flip)
    faulty = replace(whole, joints=joints)
    assert [f.wheel for f in check_recording(faulty, CONFIGURATION).findings] == ['front_left']
    return faulty


CHECKS = [
    (module, name)
    for module in vars(run).values()
    if getattr(module, '__package__', '') == 'wheel_terra_estimator.checks'
    for name in vars(module)
    if name.startswith('check_') and getattr(module, name).__module__ == module.__name__
]


@pytest.mark.check_fails
@pytest.mark.parametrize('others', [True, False])
def test_checks_that_fail_are_told_and_the_others_go_on(others, one_backwards, monkeypatch):
    """All but those that tell the sign, or these."""
    failed = []

    def fail(name):
        failed.append(name)
        raise ZeroDivisionError('on purpose')

    failing = [one for one in CHECKS if (one[1] not in ('check_signs', 'check_unit')) == others]
    for module, name in failing:
        monkeypatch.setattr(module, name, lambda *_, name=name: fail(name))
    report = check_recording(one_backwards, CONFIGURATION)
    assert sorted(failed) == sorted(name for _, name in failing)
    assert [entry.reason for entry in report.not_checked].count(INTERNAL_ERROR) == len(failed)
    assert not others or [f.wheel for f in report.findings if f.kind == 'sign'] == ['front_left']


def test_a_required_input_that_is_missing_is_the_first_finding():
    joints = WHOLE.joints
    turned_round = replace(joints, rate=joints.rate * np.array([-1.0, 1.0, 1.0, 1.0]))
    for configuration in (CONFIGURATION, None):
        report = check_recording(replace(WHOLE, imu=None, joints=turned_round), configuration)
        first = report.findings[0]
        assert (first.kind, first.topic) == ('drop_outs', '/imu/data')
        assert '--remap imu/data:=' in first.cure
        assert 'sign' in [finding.kind for finding in report.findings]
    odometry = replace(WHOLE.reference, topic='/wheel/odometry')
    report = check_recording(replace(WHOLE, joints=None, wheel_odometry=odometry), CONFIGURATION)
    assert '-p wheel_odometry:=odom --remap odom:=/wheel/odometry' in report.findings[0].cure
    report = check_recording(replace(WHOLE, joints=None, wheel_odometry=odometry), None)
    assert report.findings[0].cure.startswith('wheel-terra init --bag BAG --wheels NAMES')


def test_a_few_wheel_rates_in_a_long_time_are_not_correlated():
    """Eleven days on an even grid would take half a minute."""
    joints = replace(WHOLE.joints, stamp=START + 300 * (WHOLE.joints.stamp - START))
    imu = replace(WHOLE.imu, stamp=START + 300 * (WHOLE.imu.stamp - START))
    begun = time.process_time()
    report = check_recording(replace(WHOLE, joints=joints, imu=imu), CONFIGURATION)
    assert time.process_time() - begun < 5.0
    reasons = [entry.reason for entry in report.not_checked if entry.kind == 'delay']
    assert any('too seldom' in reason for reason in reasons)


@pytest.mark.parametrize('left', [0, 1])
@pytest.mark.parametrize('name', ['joints', 'imu', 'reference', 'sinkage'])
def test_no_check_fails_on_a_channel_of_one_message_or_none(name, left):
    channel = getattr(WHOLE, name)
    few = rows_of(channel, np.arange(channel.stamp.size) < left)
    report = check_recording(replace(WHOLE, **{name: few}), CONFIGURATION)
    assert INTERNAL_ERROR not in [entry.reason for entry in report.not_checked]
