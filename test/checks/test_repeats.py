# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Readings that stay the same, and sizes without a sign, beside sound ones that look like them."""

import math
from dataclasses import replace

import numpy as np
import pytest
import rolling_rover as rolling
from rolling_rover import found

from wheel_terra_estimator.checks.series import rows_of
from wheel_terra_estimator.checks.wheel_rates import rate_step


def held(channel, field, since, until, column=...):
    """A channel whose numbers stay for a while."""
    seconds = channel.seconds
    values = getattr(channel, field).copy()
    rows = np.flatnonzero((seconds > since) & (seconds < until))
    values[rows, column] = values[rows[0], column]
    return replace(channel, **{field: values})


WHOLE, NAMES = rolling.recording(), rolling.NAMES


@pytest.mark.parametrize('dead', [None, 2])
def test_rates_without_noise_that_stay_together_are_alive_and_one_alone_is_not(dead):
    """A simulator without noise: a curve that changes all along, then a steady straight."""
    time = np.arange(0.0, 44.0, 1.0 / rolling.RATE)
    speed = np.interp(time, [0, 5, 30], [0.1, 0.3, 0.3]) + np.where(
        time < 30, 0.02 * np.sin(time) * np.sin(np.pi * time / 30), 0.0
    )
    yaw = np.where(time < 30, 0.1 * np.sin(np.pi * time / 30), 0.0)
    rate = (speed[:, None] - yaw[:, None] * rover_y()) / rolling.RADIUS
    whole = rolling.recording(rolling.Motion(time, speed, yaw, 0.0 * time))
    if dead is not None:
        rate[50:300, dead] = rate[50, dead]
    told = rolling.checked(whole=whole, joints={'rate': rate}).findings
    frozen = [f.wheel for f in told if f.kind == 'frozen']
    assert frozen == ([] if dead is None else [rolling.NAMES[dead]])


def rover_y():
    """Places of the wheels beside the middle [m]."""
    return np.array(rolling.rover().wheels.y)


def test_torques_that_brake_down_a_slope_have_a_sign():
    """Driven forth and back always downhill: what is positive on the way back holds the rover."""
    seconds, rate = WHOLE.joints.seconds, WHOLE.joints.rate.mean(axis=1)
    force = WHOLE.imu.force.copy()
    force[:, 0] -= np.sign(np.interp(WHOLE.imu.seconds, seconds, rate))
    joints = replace(WHOLE.joints, torque=np.abs(WHOLE.joints.torque))
    assert 'torque_unsigned' not in {f.fault for f in found(joints=joints, imu={'force': force})}


def test_a_seldom_reference_that_stays_for_six_readings():
    """One reading a second, with noise: six alike are no chance."""
    reference = rows_of(WHOLE.reference, np.arange(WHOLE.reference.stamp.size) % 2 == 0)
    (finding,) = found(reference=held(reference, 'velocity', 120.0, 127.5))
    assert finding.fault == 'reference_frozen'


def test_a_torque_that_is_never_read_is_no_scale_of_all():
    """A quarter of the torque is missing on slopes: no mass and no gain follow from that."""
    torque = WHOLE.joints.torque * [1.0, 1.0, 0.0, 1.0]
    (finding,) = found(joints={'torque': torque})
    assert (finding.fault, finding.wheel, finding.confidence) == ('torque_frozen', NAMES[2], 0.5)
    assert 'or it is not driven' in finding.words


@pytest.mark.parametrize('ratio', [0.4, 0.2])
def test_velocities_that_are_sent_more_often_than_measured(ratio):
    """Ten times a second from a source of four, each two or three times, or of two."""
    sent = np.arange(0.0, WHOLE.reference.seconds[-1], 0.5 * ratio)
    rows = np.searchsorted(WHOLE.reference.seconds, sent, side='right') - 1
    often = rows_of(WHOLE.reference, rows)
    stamp = WHOLE.reference.stamp[0] + np.round(1e9 * sent).astype(np.int64)
    often = replace(often, stamp=stamp, log_time=stamp + 300_000_000)
    assert [f.fault for f in found(reference=often)] == ['reference_held']


# Steps of a coarse encoder: counted from angles, told with their size, apart from noise.


COUNTS = 180  # per turn of the wheel


def counted(counts=COUNTS, jitter=0.0):
    """The drive as an encoder sees it: whole counts of the angle, over the time between stamps."""
    random = np.random.default_rng(4)
    joints = WHOLE.joints
    stamp = joints.stamp + np.round(jitter * random.uniform(size=joints.stamp.size) * 1e9)
    time = (stamp - stamp[0]) * 1e-9
    angle = np.vstack([np.zeros(4), np.cumsum(0.1 * joints.rate[1:], axis=0)])
    ticks = np.floor(angle * counts / (2.0 * math.pi))
    rate = np.diff(ticks, axis=0) * 2.0 * math.pi / counts / np.diff(time)[:, None]
    rate = np.vstack([np.zeros(4), rate])
    return replace(joints, stamp=stamp.astype(np.int64), rate=rate)


@pytest.mark.parametrize('jitter', [0.0, 0.02])
def test_steps_are_named_with_the_noise_that_they_make(jitter):
    """Of counts alone, a step over the root of 6; the scatter of the stamps comes on top."""
    joints, true = counted(jitter=jitter), WHOLE.joints.rate
    report = rolling.checked(joints=joints)
    (finding,) = [f for f in report.findings if f.parameter == 'sensors.wheel_rate_std']
    step = 2.0 * math.pi / COUNTS / 0.1
    assert finding.kind == 'noise' and finding.wheel is None
    assert report.figures['wheels.rate_step_rad_s'] == pytest.approx(step, rel=0.02)
    noise = np.std((joints.rate - true)[np.abs(true) > 0.5])
    assert finding.value == pytest.approx(noise if jitter else step / math.sqrt(6.0), rel=0.1)
    assert f'{COUNTS} counts per turn' in finding.words


def test_fine_steps_and_real_noise_are_no_steps():
    fine = rolling.checked(joints=counted(20_000))
    assert not fine.findings, [str(f) for f in fine.findings]
    assert 'wheels.rate_step_rad_s' not in rolling.checked().figures
    assert rate_step(np.full(100, 2.0), np.full(100, 0.1)) == 0.0, 'one value is no step'
    random = np.random.default_rng(1)
    assert rate_step(random.normal(size=500), np.full(500, 0.1)) == 0.0
