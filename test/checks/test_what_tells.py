# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What a check goes by must be in the recording: else a fault is left open, or told with others."""

import math
from dataclasses import replace

import numpy as np
import pytest
import rolling_rover as rolling
from rolling_rover import checked, faults
from scipy.spatial.transform import Rotation

from wheel_terra_estimator.checks.statistics import step_of

WHOLE = rolling.recording()
FLAT = replace(WHOLE.imu, force=WHOLE.imu.force * [1.0, 0.0, 1.0])  # curves tell nothing


def reasons(report, kind):
    return ' '.join(entry.reason for entry in report.not_checked if entry.kind == kind)


def one_way_and_a_turn():
    speed = [10, 11, 60, 61, 65, 66], [0, 0.3, 0.3, 0, 0, 0.3]
    return rolling.motion(107.5, speed, yaw=([100, 101, 107, 108], [0, 0.22, 0.22, 0]))


@pytest.mark.parametrize('degrees', [pytest.param(5.0, marks=pytest.mark.slow), 8.0])
@pytest.mark.parametrize('motion', [rolling.ten_minute_drive(), one_way_and_a_turn()])
def test_a_rover_that_slides_down_a_cross_slope_has_no_turned_reference(motion, degrees):
    """There and back, or one way before a turn: a turned frame is not the same down the slope."""
    whole = rolling.recording(motion)
    psi = np.cumsum(motion.yaw_rate)[::5] / rolling.RATE
    forward = whole.reference.velocity[:, 0]
    slide = -math.tan(math.radians(degrees)) * np.abs(forward) * np.cos(psi)
    velocity = np.column_stack([forward, slide, 0.0 * slide])
    report = checked(whole=whole, reference={'velocity': velocity})
    assert faults(report) == []


@pytest.mark.parametrize('swapped', [True, False])
def test_a_reference_against_the_gyro_may_be_made_of_the_wheels(swapped):
    joints, imu, reference = WHOLE.joints, FLAT, WHOLE.reference
    if swapped:
        order = [1, 0, 3, 2]
        joints = replace(joints, rate=joints.rate[:, order], torque=joints.torque[:, order])
        reference = replace(reference, yaw_rate=-reference.yaw_rate)
    else:
        imu = replace(imu, rate=imu.rate * [1.0, 1.0, -1.0])
    told = checked(joints=joints, imu=imu, reference=reference).findings
    assert {(f.fault, f.confidence) for f in told} == {
        ('swapped_sides', 0.5), ('gyro_reversed', 0.5)
    }  # fmt: skip


def test_an_odd_wheel_hides_no_radius_that_all_wheels_have_wrong():
    radii = 1.05 * rolling.RADIUS * np.array([1.06, 1.0, 1.0, 1.0])
    assert faults(checked(rolling.rover(**{'wheels.radius': radii.tolist()}))) == ['radius']
    radii = rolling.RADIUS * np.array([1.07, 1.0, 1.0, 1.0])
    alone = checked(rolling.rover(**{'wheels.radius': radii.tolist()}))
    assert faults(alone) == [] and 'wheels turn up to 7 %' in reasons(alone, 'radius')


@pytest.mark.parametrize(
    ('percent', 'told'), [((0, 0, 4, 4), False), ((0, 0, 7, 7), True), ((7, 0, 0, 0), True)]
)
def test_one_wheel_of_a_tricycle_is_as_odd_as_it_is(percent, told):
    """One wheel on each side and one, in two joints, on the centre line."""
    rate, half = WHOLE.joints.rate.copy(), rolling.HALF_TRACK
    rate[:, 2:] = rate[:, :2].mean(axis=1, keepdims=True)
    radii = ((1.0 + 0.01 * np.array(percent)) * rolling.RADIUS).tolist()
    places = {'wheels.x': [0.1, 0.1, -0.1, -0.2], 'wheels.y': [half, -half, 0.0, 0.0]}
    rover = rolling.rover(**{'wheels.radius': radii}, **places)
    report = checked(rover, joints={'rate': rate})
    assert ('wheels turn up to 7 %' in reasons(report, 'radius')) == told
    assert not (told and faults(report))


def test_a_ratio_of_speeds_that_differs_between_the_halves_is_no_radius():
    faster = np.where(WHOLE.reference.seconds < 90.0, 1.06, 1.13)[:, None]
    report = checked(reference={'velocity': faster * WHOLE.reference.velocity})
    assert faults(report) == [] and 'differs between the halves' in reasons(report, 'radius')


def test_a_joint_that_turns_like_a_wheel_is_named():
    names = (*rolling.NAMES, 'tail_wheel')
    joints = {n: np.hstack([getattr(WHOLE.joints, n)] * 2)[:, :5] for n in ('rate', 'torque')}
    (told,) = checked(joints=joints | {'names': names}).findings
    assert (told.fault, told.wheel) == ('spare_joint', 'tail_wheel')


SKIDS = rolling.rover(**{'wheels.x': [0.6, 0.6, -0.6, -0.6]})
SLOWER = replace(WHOLE.reference, velocity=0.95 * WHOLE.reference.velocity)
NONE, STUCK = np.nan * WHOLE.sinkage.sinkage, 0.0 * WHOLE.sinkage.sinkage


@pytest.mark.parametrize('sinkage', [None, {'sinkage': NONE}, {'sinkage': STUCK}, WHOLE.sinkage])
def test_without_a_depth_soft_ground_may_be_a_radius(sinkage):
    told = checked(SKIDS, reference=SLOWER, sinkage=sinkage).findings
    told = [f for f in told if f.fault in ('radius', 'reference_scale')]
    may_be = sinkage is not WHOLE.sinkage
    assert told and all(('soft ground causes slip' in f.words) == may_be for f in told)
    assert not may_be or all(f.confidence <= 0.5 for f in told)


def test_without_a_way_back_zeros_of_the_torques_may_hide_slip():
    hill = [20, 22, 38, 40, 42, 58], [0, 0.12, 0.12, -0.12, -0.12, 0]
    whole = rolling.driven(220.0, ([10, 11], [0.0, 0.3]), slope=hill)
    told = checked(SKIDS, whole, reference={'velocity': 0.95 * whole.reference.velocity}).findings
    assert len(told) == 2 and all('torque zeros hide slip' in f.words for f in told)
    assert max(f.confidence for f in told) <= 0.5


def tilted(yaw, **rover):
    motion = rolling.ten_minute_drive()
    whole = rolling.recording(replace(motion, yaw_rate=yaw(motion.yaw_rate)))
    tilt = Rotation.from_euler('y', 1.8, degrees=True).inv()
    imu = replace(whole.imu, force=tilt.apply(whole.imu.force), rate=tilt.apply(whole.imu.rate))
    return checked(rolling.rover(**rover), whole=whole, imu=imu)


def test_a_lean_in_turns_one_way_alone_is_no_mounting():
    assert faults(tilted(lambda yaw: yaw)) == ['imu_tilt']
    assert faults(tilted(np.abs)) == []


def test_a_tilt_below_the_zero_of_the_accelerometer_is_left_open():
    report = tilted(lambda yaw: yaw, **{'sensors.specific_force_bias_std': 0.2})
    assert faults(report) == [] and 'tilts below 4.' in reasons(report, 'mounting')


def test_a_reference_from_the_future_is_off_whatever_its_speeds_are():
    noise = np.random.default_rng(1).standard_normal(WHOLE.reference.velocity.shape)
    ahead = replace(
        WHOLE.reference, stamp=WHOLE.reference.stamp + 30_000_000_000,
        velocity=WHOLE.reference.velocity + 0.2 * noise,
    )  # fmt: skip
    (told,) = [f for f in checked(reference=ahead).findings if f.fault == 'reference_offset']
    assert told.value == pytest.approx(29.7, abs=0.1) and 'log time' in told.words


@pytest.mark.parametrize(('scatter', 'step'), [(0.003, 0.0), (0.5, 0.1)])
def test_one_wild_value_makes_no_steps_and_hides_none(scatter, step):
    """A rate times the length of a pause is one."""
    values = np.random.default_rng(1).normal(2.0, scatter, 2000)
    values = step * np.round(values / step) if step else values
    values[500] = 5.0e5
    assert step_of(values) == pytest.approx(step, rel=1e-3)
