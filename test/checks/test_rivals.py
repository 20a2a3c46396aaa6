# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Faults that imitate one another: the one that the evidence speaks for is named."""

from dataclasses import replace

import numpy as np
import pytest
import rolling_rover as rolling

from wheel_terra_estimator.checks import clocks
from wheel_terra_estimator.checks.finding import not_checked
from wheel_terra_estimator.checks.statistics import Trial, moving_mean

WHOLE = rolling.recording()


def faults(**channels):
    return {f.fault: f for f in rolling.checked(whole=WHOLE, **channels).findings}


@pytest.mark.parametrize('channel', ['imu', 'joints'])
def test_stamps_at_arrival_are_late_and_no_others_early(channel):
    """What is stamped 0.8 s late, when it arrives; the other would arrive before it is measured."""
    late, way = 800_000_000, {'imu': 1_000_000, 'joints': 5_000_000}  # [ns]
    whole = replace(WHOLE, reference=None)
    for name, age in way.items():
        series = getattr(WHOLE, name)
        stamp = series.stamp + late * (name == channel)
        whole = replace(whole, **{name: replace(series, stamp=stamp, log_time=stamp + age)})
    told = {f.fault: f for f in rolling.checked(whole=whole).findings}
    name = 'imu' if channel == 'imu' else 'wheel_odometry'
    finding = told[f'{name}_offset']
    assert finding.value == pytest.approx(0.8, abs=0.05)
    assert {key for key in told if key.endswith('_offset')} == {f'{name}_offset'}


def test_stamps_of_wheels_that_lie_in_the_future_make_no_reference_early():
    joints = replace(WHOLE.joints, stamp=WHOLE.joints.stamp + 800_000_000)
    told = faults(joints=joints, imu=None)
    assert {key for key in told if key.endswith('_offset')} == {'wheel_odometry_offset'}


def test_of_halves_that_count_against_each_other_the_reference_tells_which():
    whole, flip = rolling.driven(120.0, 0.3), np.array([-1.0, -1.0, 1.0, 1.0])
    joints = {name: flip * getattr(whole.joints, name) for name in ('rate', 'torque')}
    told = rolling.checked(whole=whole, joints=joints).findings
    assert [(f.fault, f.wheel) for f in told] == [('backwards', 'front_left, front_right')]


@pytest.mark.parametrize('swapped', [True, False])
def test_an_accelerometer_reversed_among_swapped_sides_is_an_imu_upside_down_in_a_mirror(swapped):
    """In one all is as in a mirror of the other: no drive tells them apart."""
    order, turned = ([1, 0, 3, 2], 1.0) if swapped else ([0, 1, 2, 3], np.array([-1.0, 1.0, -1.0]))
    joints = {name: getattr(WHOLE.joints, name)[:, order] for name in ('rate', 'torque')}
    force = WHOLE.imu.force * (-1.0 if swapped else turned)
    told = faults(joints=joints, imu={'force': force, 'rate': WHOLE.imu.rate * turned})
    assert told['imu_upside'].confidence <= 0.85 and 'are swapped' in told['imu_upside'].words


@pytest.mark.parametrize('axes', [[-1, -1, -1], [1, -1, -1]])
def test_an_accelerometer_and_all_wheels_reversed_are_an_imu_and_a_reference(axes):
    """Either way wheels, gyro, starts and reference agree: nothing is sure, nothing is written."""
    joints = {name: -getattr(WHOLE.joints, name) for name in ('rate', 'torque')}
    turned = np.array([1, -1, -1]) if axes[0] > 0 else 1.0  # upside down, or the force alone
    imu = {'force': WHOLE.imu.force * axes, 'rate': WHOLE.imu.rate * turned}
    told = faults(joints=joints, imu=imu)
    assert {*told} == {'imu_upside', 'reference_reversed'}
    assert 'linear_acceleration has the wrong sign' in told['imu_upside'].words
    assert 'all wheels read negative' in told['reference_reversed'].words
    assert all(f.confidence <= 0.5 for f in told.values())


def test_sides_that_push_against_each_other_have_no_torques_reversed():
    """Those of the right take less uphill, as in a slight turn; level ground costs nothing."""
    sense, force = np.sign(np.round(WHOLE.joints.rate, 1)), WHOLE.imu.force[:, :1]
    uphill = np.interp(WHOLE.joints.seconds, WHOLE.imu.seconds, force[:, 0])[:, None]
    level = rolling.RESISTANCE * rolling.MASS * rolling.GRAVITY * rolling.RADIUS / 4 * sense
    against = 2.0 * rolling.MASS * rolling.RADIUS / 4 * uphill * [1, -1, 1, -1]
    told = faults(joints={'torque': WHOLE.joints.torque - level + against})
    assert 'torque_sign' not in told


@pytest.mark.parametrize('backwards', [[-1, 1, 1, 1], [1, -1, 1, -1]])
def test_an_accelerometer_reversed_beside_wheels_that_count_backwards(backwards):
    """The gyro is upright: neither are the sides swapped nor does the reference run backwards."""
    joints = {name: getattr(WHOLE.joints, name) * backwards for name in ('rate', 'torque')}
    told = faults(joints=joints, imu={'force': -WHOLE.imu.force})
    assert {*told} == {'force_reversed', 'backwards'}
    assert told['backwards'].wheel == ', '.join(
        name for name, sign in zip(rolling.NAMES, backwards, strict=True) if sign < 0
    )


def lag(value, std, trial=(0.8, 0.2)):
    halves = (value - std, value + std)
    return clocks.Lag(value, 'starts', halves, Trial(*trial))


@pytest.mark.parametrize(
    ('imu', 'reference', 'told'),
    [
        (lag(-0.7, 0.11, (0.8, 0.68)), lag(-0.75, 0.01), ('wheel_odometry_offset', 0.97)),
        (lag(0.0, 0.01), lag(-0.75, 0.01), ('reference_offset', 0.97)),
        (None, lag(-0.75, 0.01), ('reference_offset', 0.5)),  # or the wheels are late
        (None, lag(0.75, 0.01), ('reference_offset', 0.97)),
        (lag(0.6, 0.25), None, None),
        (lag(0.02, 0.25), None, None),
    ],
)
def test_which_stamps_are_off_for_sure(monkeypatch, imu, reference, told):
    """The one that is off against both others; a lag that is not clear is left open."""
    nothing = not_checked('delay', 'seldom')
    monkeypatch.setattr(clocks, '_of_imu', lambda _: imu or nothing)
    monkeypatch.setattr(clocks, '_of_reference', lambda _: reference or nothing)
    arrival = WHOLE.reference.log_time + 1_000_000_000  # of stamps that may be early
    report = rolling.checked(reference={'log_time': arrival})
    delays = [(f.fault, f.confidence) for f in report.findings if f.kind == 'delay']
    assert delays == ([told] if told else [])
    left_open = [n.reason for n in report.not_checked if 'stamps look' in n.reason]
    assert len(left_open) == (not told and imu.value > 0.2)


def test_a_recording_that_ends_on_a_slope_shows_no_stop_there():
    """Means at its ends are those of what was read: a late IMU is told by the starts alone."""
    assert moving_mean(np.full(50, 3.0), 9) == pytest.approx(3.0)
    speed = [4, 5, 14, 15, 19, 20, 34, 35, 39, 40], [0, 0.3, 0.3, 0, 0, 0.3, 0.3, 0, 0, 0.3]
    whole = rolling.driven(60.0, speed, slope=([44.0, 50.0], [0.0, 0.2]))
    imu = {name: getattr(whole.imu, name) + 600_000_000 for name in ('stamp', 'log_time')}
    told = {f.fault: f for f in rolling.checked(whole=whole, imu=imu).findings}
    assert told['imu_offset'].value == pytest.approx(0.6, abs=0.1)


@pytest.mark.parametrize('scale', [0.8, 1.2])
def test_one_scale_of_speeds_and_turns_is_that_of_the_reference(scale):
    """Neither of the gyro, which turns as the rims do, nor of their radius."""
    twist = {name: scale * getattr(WHOLE.reference, name) for name in ('velocity', 'yaw_rate')}
    (told,) = rolling.found(reference=twist)
    assert told.fault == 'reference_scale' and told.confidence > 0.9
    assert told.value == pytest.approx(1.0 / scale, rel=0.02)


@pytest.mark.parametrize(('deeper', 'said'), [(0.0, 'hardly any'), (0.03, 'looks like depth')])
def test_one_zero_of_all_sinkages_is_said_to_look_like_depth(deeper, said):
    sinkage = {'sinkage': 0.3 * WHOLE.sinkage.sinkage + deeper}
    report = rolling.checked(sinkage=sinkage)
    assert not [f for f in report.findings if f.fault.startswith('sinkage')]
    told = {n.reason for n in report.not_checked if n.kind in ('sign', 'zero')}
    assert any(said in reason for reason in told)
