# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Faults that look like others: the one behind what was seen is named, and it alone."""

import math
from dataclasses import replace

import numpy as np
import pytest
import rolling_rover as rolling
from rolling_rover import found
from scipy.spatial.transform import Rotation

from wheel_terra_estimator.checks import turning
from wheel_terra_estimator.checks.calibration import calibrate
from wheel_terra_estimator.checks.evidence import gather
from wheel_terra_estimator.checks.rover_facts import from_configuration
from wheel_terra_estimator.checks.run import check_recording
from wheel_terra_estimator.checks.series import rows_of

WHOLE = rolling.recording()


def test_a_wheel_without_rates_keeps_its_sign():
    rate = WHOLE.joints.rate * [-1, math.nan, 1, 1]
    told = {f.fault: f for f in found(joints={'rate': rate})}
    assert told['backwards'].wheel == 'front_left'
    assert {*told} == {'backwards', 'missing_wheel', 'torque_sign'}


@pytest.mark.parametrize('unsigned', [np.abs, lambda rate: np.maximum(rate, 0.0)])
def test_rates_of_0_at_rest_are_a_standstill_also_of_rates_without_a_sign(unsigned):
    moves = np.abs(WHOLE.joints.rate).max(axis=1, keepdims=True) > 0.05  # [rad/s]
    joints = replace(WHOLE.joints, rate=unsigned(WHOLE.joints.rate) * moves)
    imu = replace(WHOLE.imu, rate=WHOLE.imu.rate + np.array([0.0, 0.0, 0.02]))
    told = {f.fault: f.value for f in found(joints=joints, imu=imu)}
    assert told == {'rates_unsigned': None, 'gyro_bias': pytest.approx(0.02, abs=0.001)}


def test_rates_and_reference_both_in_another_unit():
    joints = replace(WHOLE.joints, rate=WHOLE.joints.rate * 30.0 / math.pi)
    velocity, variance = 100.0 * WHOLE.reference.velocity, 1e4 * WHOLE.reference.variance
    told = found(joints=joints, reference={'velocity': velocity, 'variance': variance})
    assert {f.fault: f.value for f in told} == {
        'rate_unit': pytest.approx(math.pi / 30.0),
        'reference_unit': pytest.approx(0.01),
    }


def attitude(seconds):
    """Attitude (k, 4) of the drive: heading and slope."""
    motion = rolling.ten_minute_drive()
    heading = np.cumsum(motion.yaw_rate) * np.gradient(motion.time)
    angles = np.column_stack([heading, -motion.slope, 0.0 * heading])
    at = np.column_stack([np.interp(seconds, motion.time, column) for column in angles.T])
    noise = 0.002 * np.random.default_rng(1).standard_normal((seconds.size, 3))
    return (Rotation.from_euler('ZYX', at) * Rotation.from_rotvec(noise)).as_quat()


def test_an_orientation_of_a_world_with_z_down():
    right = attitude(WHOLE.imu.seconds)
    assert found(imu={'orientation': right}) == []
    down = Rotation.from_euler('x', math.pi)
    wrong = (down * Rotation.from_quat(right) * down).as_quat()
    (finding,) = found(imu={'orientation': wrong})
    assert finding.fault == 'orientation'
    flat, back = WHOLE.imu.force * [1.0, 0.0, 1.0], WHOLE.imu.rate * [1.0, 1.0, -1.0]
    (finding,) = found(imu={'force': flat, 'rate': back, 'orientation': right})
    assert finding.fault == 'gyro_reversed' and 'orientation' in finding.words


def test_an_imu_on_its_back_among_swapped_sides():
    """Starts are felt forward: not the accelerometer is wrong."""
    back = Rotation.from_euler('x', math.pi)
    right = Rotation.from_quat(attitude(WHOLE.imu.seconds))
    turned = {name: getattr(WHOLE.imu, name) * [1.0, -1.0, -1.0] for name in ('force', 'rate')}
    imu = replace(WHOLE.imu, orientation=(right * back).as_quat(), **turned)
    told = {f.fault: f for f in found(imu=imu, joints={'rate': WHOLE.joints.rate[:, [1, 0, 3, 2]]})}
    assert {*told} == {'imu_upside', 'swapped_sides'}
    assert told['imu_upside'].value == pytest.approx(180.0)


def test_a_pitch_of_the_imu_that_no_circle_shows_is_named_beside_zeros_of_all_torques():
    motion = rolling.ten_minute_drive(turns=False)
    whole = rolling.recording(motion)
    pitch = Rotation.from_euler('y', 7.0, degrees=True)  # the x axis points down
    imu = replace(
        whole.imu, force=pitch.inv().apply(whole.imu.force), rate=pitch.inv().apply(whole.imu.rate)
    )
    (finding,) = rolling.checked(whole=whole, imu=imu).findings
    assert finding.fault == 'torque_zero' and 'or the IMU is pitched' in finding.words
    assert finding.confidence <= 0.5


JOINTS = ('front_left_steer', 'front_right_steer', 'rear_left_steer', 'rear_right_steer')


def steered(*given, **other):
    """The report on such a drive."""
    return check_recording(*circles(*given, **other))


def circles(
    change, x=(0.6, 0.6, -0.6, -0.6), names=rolling.NAMES, motion=None, sent=lambda v: v, **other
):
    """A rover with four steered wheels, long beside its track, in circles; angles changed."""
    rover, whole = rolling.rover(**{
        'wheels.x': list(x), 'wheels.steering_joints': list(JOINTS), 'wheels.names': list(names),
    }), rolling.recording(motion)  # fmt: skip
    motion = motion or rolling.ten_minute_drive()
    along = motion.speed[:, None] - motion.yaw_rate[:, None] * rover.wheels.y
    aside = motion.yaw_rate[:, None] * rover.wheels.x
    angle = np.arctan2(aside, np.abs(along)) * np.sign(along)
    noise = whole.joints.rate - along / rolling.rolling_radius()  # what the recording adds
    rate = np.hypot(along, aside) * np.sign(along) / rolling.rolling_radius() + noise
    none = np.full_like(rate, np.nan)
    joints = replace(
        whole.joints,
        names=whole.joints.names + JOINTS,
        rate=np.hstack([sent(rate), none]),
        torque=np.hstack([whole.joints.torque, none]),
        position=np.hstack([none, change(angle)]),
    )
    return replace(whole, joints=joints, **other), rover


def one_for_both(angle):
    """As if there were one wheel in the middle: off in turns, none straight ahead."""
    return angle.reshape(-1, 2, 2).mean(axis=2).repeat(2, axis=1)


ALL = ', '.join(rolling.NAMES)
RL_ALONE = np.array(rolling.NAMES) == 'rear_left'


@pytest.mark.parametrize(
    ('change', 'wheel', 'said'),
    [
        (lambda angle: angle, None, ''),
        (lambda angle: -angle, ALL, 'by -'),
        (lambda angle: angle * [1.0, 1.0, 0.0, 1.0], 'rear_left', 'by 0 %'),
        (lambda angle: angle * [1.0, 1.0, 0.0, 0.0], None, ''),  # both of an axle held straight
        (lambda angle: 0.0 * angle, None, ''),
        (lambda angle: angle + np.array([0.0, 0.14, 0, 0]), 'front_right', '8 degrees'),
        (lambda angle: angle[:, [2, 1, 0, 3]], 'front_left, rear_left', 'by -'),
        (lambda angle: angle[:, [1, 0, 3, 2]], ALL, '?'),  # so far off that a share is unclear
        (lambda angle: angle[:, [1, 0, 2, 3]], 'front_left, front_right', '?'),
        (one_for_both, None, ''),
    ],
)
def test_joints_that_do_not_steer_as_the_rover_turns(change, wheel, said):
    """Which of sign, zero, name or sensor it is nothing tells for sure."""
    report = steered(change)
    told = [f for f in report.findings if f.fault == 'steering_angle']
    assert [f.wheel for f in told] == [wheel] * (wheel is not None)
    assert all(said in f.words and 'by hand' in f.cure for f in told)
    assert {f.kind for f in report.findings} <= {'sign', 'radius', 'track'}


def test_a_wheel_whose_rate_is_frozen_is_not_said_to_be_steered_wrongly():
    def frozen(rate):
        since = len(rate) // 3
        return np.where((np.arange(len(rate)) > since)[:, None] & RL_ALONE, rate[since], rate)

    report = steered(lambda angle: angle, sent=frozen)
    assert [(f.fault, f.wheel) for f in report.findings] == [('rate_frozen', 'rear_left')]


@pytest.mark.parametrize('change', [lambda angle: -angle, lambda angle: angle[:, [2, 3, 0, 1]]])
def test_half_a_radian_of_turning_shows_angles_reversed_or_of_the_other_axle(change):
    """Too little to tell a zero from a slide down a cross slope."""
    yaw = [10.0, 11.0, 20.0, 21.0, 30.0, 31.0, 40.0, 41.0], [0, 0.05, 0.05, 0, 0, -0.05, -0.05, 0]
    curves = rolling.motion(60.0, ([3.0, 4.0], [0.0, 0.3]), yaw=yaw)
    off = np.array([0.14, 0.0, 0.0, 0.0])
    assert not steered(lambda angle: angle + off, motion=curves).findings
    (finding,) = steered(change, motion=curves).findings
    assert (finding.fault, finding.wheel) == ('steering_angle', ALL)


@pytest.mark.parametrize(('rate', 'found'), [(0.1, True), (0.02, False)])
def test_joints_of_an_axle_that_are_exchanged_show_by_two_degrees(rate, found):
    """In circles of 3 and 15 m the wheels of an axle differ by 2.2 and 0.1 degrees."""
    yaw = [10.0, 11.0, 30.0, 31.0, 40.0, 41.0, 60.0, 61.0], [0, rate, rate, 0, 0, -rate, -rate, 0]
    curves = rolling.motion(80.0, ([3.0, 4.0], [0.0, 0.3]), yaw=yaw)
    report = steered(lambda angle: angle[:, [1, 0, 3, 2]], motion=curves)
    assert [f.fault for f in report.findings] == ['steering_angle'] * found


def test_the_noise_of_a_gyro_makes_no_track_narrower():
    """A fit to it alone has 0.938 of the track."""
    rate = WHOLE.imu.rate + np.random.default_rng(3).normal(0.0, 0.06, WHOLE.imu.rate.shape)
    figures = rolling.checked(imu=replace(WHOLE.imu, rate=rate)).figures
    assert figures['rover.effective_over_stated_track'] == pytest.approx(1.0, abs=0.03)


def test_the_noise_of_a_gyro_makes_no_joint_steer_less():
    """As large as the turns: a fit to it has wheels half as much steered."""
    rate = WHOLE.imu.rate + np.random.default_rng(3).normal(0.0, 0.15, WHOLE.imu.rate.shape)
    drive, rover = circles(lambda angle: angle, imu=replace(WHOLE.imu, rate=rate))
    gain = turning._steered_as_turned(gather(drive, from_configuration(rover), {})).gain
    assert gain == pytest.approx(np.ones(4), abs=0.1)


def test_joints_across_that_are_exchanged():
    yaw = lambda t: np.interp(t, [10.0, 11.0], [0.0, 0.3]) * np.sign(np.sin(0.3 * t))  # noqa: E731
    weaves = rolling.motion(120.0, ([3.0, 4.0], [0.0, 0.3]), yaw=yaw)
    report = steered(lambda angle: angle[:, [1, 0, 2, 3]], motion=weaves)
    assert [f.wheel for f in report.findings if f.fault == 'steering_angle'] == [
        'front_left, front_right'
    ]


def test_angles_of_curves_driven_backward_are_right_where_rates_have_no_sign():
    yaw = [5.0, 6.0, 30.0, 31.0, 85.0, 86.0, 110.0, 111.0], [0, 0.2, 0.2, 0] * 2
    speed = [1.0, 2.0, 79.0, 80.0, 81.0, 159.0], [0.0, 0.3, 0.3, 0.0, -0.3, -0.3]
    curves = rolling.motion(160.0, speed, yaw=yaw)
    report = steered(lambda angle: angle, motion=curves, sent=np.abs)
    assert {f.fault for f in report.findings} == {'rates_unsigned'}


def test_steering_angles_in_degrees():
    report = steered(np.degrees)
    assert [finding.fault for finding in report.findings] == ['steering_degrees']
    assert report.figures['rover.effective_over_stated_track'] == pytest.approx(1.0, abs=0.02)


def test_a_gyro_that_turns_against_wheels_and_steering_is_reversed():
    """Curves tell nothing: the accelerometer has no y."""
    flat, back = WHOLE.imu.force * [1.0, 0.0, 1.0], WHOLE.imu.rate * [1.0, 1.0, -1.0]
    (finding,) = steered(
        lambda angle: angle, imu=replace(WHOLE.imu, force=flat, rate=back)
    ).findings
    assert finding.fault == 'gyro_reversed' and finding.confidence > 0.8


@pytest.mark.parametrize('order', [(2, 3, 0, 1), (2, 1, 0, 3)])
def test_front_and_rear_exchanged_where_only_the_front_is_steered(order):
    """Seen from the rear axle the front wheels go the longer way; steered alike, they do not."""
    names = [rolling.NAMES[i] for i in order]
    front = (1.2, 1.2, 0.0, 0.0)
    (finding,) = steered(lambda angle: angle, front, names).findings
    assert finding.fault == 'exchanged' and set(finding.wheel.split(', ')) == {
        name for name, now in zip(rolling.NAMES, names, strict=True) if name != now
    }
    assert finding.cure == f'wheels.names: [{", ".join(rolling.NAMES)}]'


def test_wheels_in_their_places_or_steered_alike_are_not_said_to_be_exchanged():
    assert not steered(lambda angle: angle, (1.2, 1.2, 0.0, 0.0)).findings
    names = [rolling.NAMES[i] for i in (2, 3, 0, 1)]
    assert not steered(lambda angle: angle, names=names).findings  # both alike: nothing tells


@pytest.mark.parametrize('degrees', [-15.0, 20.0])
def test_a_small_yaw_of_the_imu(degrees):
    whole = rolling.recording(rolling.starts_and_curves())
    turn = Rotation.from_euler('z', -degrees, degrees=True)
    (finding,) = rolling.checked(whole=whole, imu={'force': turn.apply(whole.imu.force)}).findings
    assert finding.fault == 'imu_yaw' and abs(finding.value - degrees) < 2.0 * finding.std < 6.0


def test_a_turn_in_a_gap_of_the_imu_is_no_straight():
    """Between its last reading in a turn and the next the IMU seems to go on turning."""
    motion = rolling.ten_minute_drive()
    yaw = np.where(motion.time > 175.0, 0.0, motion.yaw_rate)  # straight after the circle
    whole = rolling.recording(replace(motion, yaw_rate=yaw))
    heard = (whole.imu.seconds < 160.0) | (whole.imu.seconds > 190.0)
    report = rolling.checked(whole=whole, imu=rows_of(whole.imu, heard))
    assert {finding.kind for finding in report.findings} == {'drop_outs'}


def test_a_slope_driven_both_ways_is_no_zero_of_the_torques():
    """Up forwards, down backwards: in place, so that no circle tells slope from mounting."""
    motion = rolling.ten_minute_drive(turns=False)
    told = [
        calibrate(rolling.recording(replace(motion, slope=0.0 * motion.slope + slope), seed=2),
                  rolling.rover())
        for slope in (0.0, 0.02)
    ]  # fmt: skip
    assert not [c for one in told for c in one.changes if c.key == 'sensors.torque_zero']


def test_slopes_to_one_side_alone_are_not_called_none():
    motion = rolling.ten_minute_drive(turns=False)
    climb = replace(motion, slope=np.where(motion.speed > 0.0, 0.138, 0.0))
    report = rolling.checked(whole=rolling.recording(climb))
    (reason,) = {e.reason for e in report.not_checked if e.kind == 'gain'}
    assert 'slopes one way only, of 7.9 degrees' in reason


def test_names_out_of_order_steer_no_wheel_wrongly():
    """Where a wheel stands is open then, and so where it has to point."""
    names = [rolling.NAMES[i] for i in (0, 2, 1, 3)]
    assert [f.fault for f in steered(lambda angle: angle, names=names).findings] == ['axes']
