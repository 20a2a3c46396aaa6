# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Faults beside which another cure lies near: what is named is right, or named with its rival."""

import math
from dataclasses import replace

import numpy as np
import pytest
import rolling_rover as rolling
import scipy
from rolling_rover import checked, faults

from wheel_terra_estimator.checks import evidence, imu, turning
from wheel_terra_estimator.checks.calibration import calibrate
from wheel_terra_estimator.checks.evidence import gather
from wheel_terra_estimator.checks.rover_facts import from_configuration
from wheel_terra_estimator.checks.series import VelocitySeries, rows_of
from wheel_terra_estimator.checks.statistics import block_fit, block_fits

WHOLE = rolling.recording()


HALF, BASE = rolling.HALF_TRACK, rolling.HALF_BASE
X_FOR_Y = {'wheels.x': [HALF, -HALF] * 2, 'wheels.y': [BASE, BASE, -BASE, -BASE]}
TENTH = {key: [0.1 * v for v in rolling.PARAMETERS[key]] for key in ('wheels.x', 'wheels.y')}
ONE_SIDE = {'wheels.radius': [1.1 * rolling.RADIUS, rolling.RADIUS] * 2}


@pytest.mark.parametrize(
    ('wrong', 'fault', 'value', 'said'),
    [
        (TENTH, 'places', None, ''),
        (X_FOR_Y, 'axes', None, 'wheels.y: [0.400, -0.400, 0.400, -0.400]'),
        # Torque over radius is half of what slopes ask for as well; that is no mass.
        ({'wheels.radius': [2.0 * rolling.RADIUS] * 4}, 'radius', rolling.RADIUS, ''),
        (ONE_SIDE, '', None, 'wheels turn up to 10 %'),  # the gyro sees a straight drive straight
    ],
)
def test_what_is_wrong_in_a_rover_file_is_one_finding(wrong, fault, value, said):
    report = checked(rolling.rover(**wrong))
    assert faults(report) == [fault] * bool(fault)
    assert value is None or report.findings[0].value == pytest.approx(value, rel=0.03)
    assert said in str(report.findings or report.not_checked)


def test_turns_are_not_taken_across_a_gap():
    """Nothing tells how a rover turned while its IMU was dead: that is no scale of the gyro."""
    alive = (WHOLE.imu.seconds < 140.0) | (WHOLE.imu.seconds > 160.0)
    recording = replace(WHOLE, imu=rows_of(WHOLE.imu, alive))
    evidence = gather(recording, from_configuration(rolling.rover()), {})
    turns = turning._turns(evidence, evidence.time)
    assert turns == pytest.approx(turning.HEADING_TIME, rel=0.1)
    assert turns.size < evidence.time.size - evidence.rows_in(turning.HEADING_TIME)


def test_wheel_odometry_from_odom_is_checked_without_joint_states():
    """Its publisher knows radius and track; a gyro that turns the other way is seen."""
    rover = rolling.rover(**{'wheel_odometry': 'odom'})
    wheels, joints = rover.wheels, WHOLE.joints
    speed = joints.rate * wheels.slip_radius
    turn = np.polyfit(wheels.y, speed.T, 1)[0] * -1.0
    ahead = np.column_stack([speed.mean(axis=1), 0.0 * turn, 0.0 * turn])
    odom = VelocitySeries('/odom', joints.stamp, joints.log_time, ahead, turn, 0.0 * turn)
    assert faults(checked(rover, wheel_odometry=odom, joints=None)) == []
    report = checked(rover, wheel_odometry=odom, joints=None, imu={'rate': -WHOLE.imu.rate})
    assert report.findings and {f.topic for f in report.findings} <= {'/odom', WHOLE.imu.topic}
    assert {'radius', 'track'} <= {entry.kind for entry in report.not_checked}


def test_without_slopes_a_ratio_of_speeds_below_one_is_no_radius():
    """Gravity is taken off the accelerometer; the radius in the file is 12 % too large."""
    lean = replace(WHOLE.imu, force=WHOLE.imu.force - [0.0, 0.0, rolling.GRAVITY])
    report = checked(rolling.rover(**{'wheels.radius': [1.12 * rolling.RADIUS] * 4}), imu=lean)
    assert faults(report) == ['gravity_off']
    assert any('without slopes' in e.reason for e in report.not_checked if e.kind == 'radius')


def test_a_noisy_gyro_may_be_one_in_degrees_where_nothing_turns():
    straight = rolling.recording(rolling.ten_minute_drive(turns=False))
    noise = 0.15 * np.random.default_rng(1).standard_normal(straight.imu.rate.shape)
    report = checked(whole=straight, imu={'rate': straight.imu.rate + noise})
    assert faults(report) == ['imu_noise'] and 'a wrong unit' in report.findings[0].words


def test_a_radius_beside_an_odd_wheel_keeps_the_odd_one():
    """The truth: all wheels are 8 % larger than stated, one of them 20 % smaller than that."""
    true = 1.08 * rolling.RADIUS * np.array([1.0, 1.0, 0.8, 1.0])
    joints = replace(WHOLE.joints, rate=WHOLE.joints.rate * rolling.RADIUS / true)
    told = [f for f in checked(joints=joints).findings if f.fault == 'radius']
    radii = told[0].cure.partition('[')[2].partition(']')[0].split(',')
    np.testing.assert_allclose([float(radius) for radius in radii], true, rtol=0.03)


def test_noise_of_a_regressor_does_not_flatten_the_slope():
    """y = 1 - 0.5 m; two readings of m, each with noise as large as m varies."""
    random = np.random.default_rng(2)
    m = 0.1 * np.sin(np.arange(4000) / 300.0)
    first, second = (m + 0.1 * random.standard_normal(m.size) for _ in range(2))
    one, target = np.ones(m.size), 1.0 - 0.5 * m
    columns = [np.column_stack([one, reading]) for reading in (first, second)]
    flat, whole = block_fit(columns[0], target)[1], block_fit(*columns[:1], target, columns[1])[1]
    assert flat.value == pytest.approx(-0.5 / 3.0, abs=0.03)  # m varies by half of 0.1 squared
    assert abs(whole.value + 0.5) < 2.0 * whole.std < 0.1


def test_outliers_of_one_target_leave_the_fits_to_the_others_alone():
    random = np.random.default_rng(5)
    design = np.column_stack([random.normal(size=900), np.ones(900)])
    truth = np.array([[2.0, -1.0, 0.5], [0.3, 0.0, -4.0]])
    targets = design @ truth + random.normal(0.0, 0.1, (900, 3))
    least_squares = np.linalg.lstsq(design, targets, rcond=None)[0]
    targets[::7, 1] += 50.0
    targets[::14, 1] -= 100.0
    for k, fit in enumerate(block_fits(design, targets)):
        for one, true, plain in zip(fit, truth[:, k], least_squares[:, k], strict=True):
            assert abs(one.value - true) < 4.0 * one.std < 0.1
            assert one.value == pytest.approx(plain, abs=0.03)


def test_to_and_fro_over_the_same_cross_slope_turns_no_imu():
    """Starts forward are all at one place and starts back at another, which leans to the left."""
    knots = [0, 1, 8, 9, 10, 11, 18, 19, 20], np.array([0, 1, 1, 0, 0, -1, -1, 0, 0]) * 0.15
    motion = rolling.motion(240.0, lambda time: np.interp(time % 20.0, *knots))
    whole = rolling.recording(motion)
    way = np.interp(whole.imu.seconds, motion.time, np.cumsum(motion.speed) / rolling.RATE)
    lean = np.column_stack([0.0 * way, 0.35 * way, 0.0 * way])
    assert faults(checked(whole=whole)) == []
    assert faults(checked(whole=whole, imu={'force': whole.imu.force + lean})) == []


@pytest.mark.parametrize('turns', [True, False])
def test_a_side_that_reads_zero_is_dead_where_the_rover_does_not_turn_about_it(turns):
    """The right side stands for 25 s, and the gyro sees that the rover turns about it, or not."""
    motion = rolling.ten_minute_drive()
    rows = (motion.time > 25.0) & (motion.time < 50.0)
    about = -0.5 * motion.speed / rolling.HALF_TRACK  # to the right
    speed = np.where(rows & turns, 0.5 * motion.speed, motion.speed)
    yaw = np.where(rows & turns, about, motion.yaw_rate)
    whole = rolling.recording(replace(motion, speed=speed, yaw_rate=yaw))
    rate = whole.joints.rate.copy()
    rate[np.ix_(rows, [1, 3])] = 0.0
    report = checked(whole=whole, joints={'rate': rate, 'torque': np.full_like(rate, np.nan)})
    frozen = [f for f in report.findings if f.fault == 'rate_frozen']
    assert bool(frozen) != turns
    # Without torques it may be dragged, locked.
    assert all(f.confidence == 0.5 and 'or it stands' in f.words for f in frozen)


def test_names_of_all_wheels_are_one_finding():
    other = tuple(f'{name}_wheel' for name in rolling.NAMES)
    report = checked(joints={'names': other}, sinkage={'names': other})
    assert faults(report) == ['joint_name']
    assert report.findings[0].cure == f'wheels.names: [{", ".join(other)}]'


def test_a_circle_with_a_gap_of_the_imu_tells_no_tilt():
    """Ninety degrees of a circle on a slope pass unseen: the slope looks like a tilt behind it."""
    motion = rolling.ten_minute_drive()
    psi = np.cumsum(motion.yaw_rate) / rolling.RATE
    at = np.interp(WHOLE.imu.seconds, motion.time, psi)
    slope = 0.1 * rolling.GRAVITY * np.column_stack([np.cos(at), -np.sin(at), 0.0 * at])
    turn = np.radians(90.0) / 0.2
    seconds = WHOLE.imu.seconds
    kept = ~((seconds > 140.0) & (seconds < 140.0 + turn))
    imu = rows_of(replace(WHOLE.imu, force=WHOLE.imu.force + slope), kept)
    assert 'imu_tilt' not in faults(checked(imu=imu))


def test_turns_over_hills_tell_no_tilt():
    """Slopes of up to 0.1 change along the way: in these turns they lean the rover by 5 degrees."""
    random = np.random.default_rng(37)
    curves = np.arange(0.0, 90.0, 8.0), random.uniform(-0.25, 0.25, 12)
    motion = rolling.motion(
        80.0, ([4.0, 5.0], [0.0, 0.3]), yaw=lambda time: np.interp(time, *curves) * (time > 4.0)
    )
    hills = rolling.recording(motion)
    heading = np.exp(1j * np.cumsum(motion.yaw_rate) / rolling.RATE)
    place = np.cumsum(motion.speed * heading) / rolling.RATE
    uphill = np.sin(place.real / 1.4) + 1j * np.sin(place.imag / 1.4 + random.uniform(0.0, 6.0))
    felt = np.interp(hills.imu.seconds, motion.time, 0.1 * rolling.GRAVITY * uphill / heading)
    lean = np.column_stack([felt.real, felt.imag, 0.0 * felt.real])
    report = checked(whole=hills, imu={'force': hills.imu.force + lean})
    assert not {'imu_tilt', 'force_bias'} & {*faults(report)}


def test_a_second_between_turns_tells_no_sign_of_a_torque():
    """At 50 Hz that is 50 rows; the left side, inside or outside, is dragged by the right one."""
    yaw = [4, 5, 18, 20, 32, 34, 46, 48], np.array([0, 1, 1, -1, -1, 1, 1, -1]) * 0.4
    speed = lambda t: np.interp(t, [4, 5], [0, 0.3]) + 0.03 * np.sin(4.0 * t) * (t > 5.0)  # noqa: E731
    weaves = rolling.driven(60.0, speed, yaw=yaw, rate=50.0)
    torque = weaves.joints.torque * [-1.0, 1.0, -1.0, 1.0]
    report = checked(whole=weaves, joints={'torque': torque})
    assert 'torque_sign' not in faults(report)


@pytest.mark.parametrize(
    ('order', 'signs'), [([0, 1, 2], [-1, 1, 1]), ([0, 1, 2], [1, -1, 1]), ([1, 0, 2], [1, 1, 1])]
)
def test_axes_of_the_accelerometer_that_no_rotation_gives_are_no_turned_imu(order, signs):
    """Starts are felt along x, curves along y: one of them reversed, or both exchanged."""
    whole = rolling.recording(rolling.starts_and_curves())
    force = whole.imu.force[:, order] * signs
    (finding,) = checked(whole=whole, imu={'force': force}).findings
    assert finding.fault == 'force_axes'


def test_wild_rates_however_many_make_no_velocity_without_a_sign():
    """One in thirty: of a rover that drives ahead they have both signs, its velocity has one."""
    whole = rolling.driven(120.0, ([5, 6], [0.0, 0.3]))
    rate, wild = whole.joints.rate.copy(), np.arange(200, 1200, 30)
    rate[wild, 1] = 30.0 * (-1.0) ** np.arange(wild.size)
    assert [f.fault for f in checked(whole=whole, joints={'rate': rate}).findings] == ['wild']


def test_velocities_too_rare_for_the_motion_are_no_noise():
    """Every three seconds, of a rover that changes its speed as fast; the wheels are late."""
    whole = rolling.driven(150.0, lambda time: 0.3 + 0.2 * np.sin(1.2 * time))
    rare = rows_of(whole.reference, np.arange(whole.reference.stamp.size) % 6 == 0)
    joints = replace(whole.joints, stamp=whole.joints.stamp + 1_500_000_000)
    told = checked(whole=replace(whole, reference=rare, joints=joints, imu=None))
    assert 'covariance' not in {f.fault for f in told.findings}


def test_single_wild_rates_and_torques_are_no_noise():
    random = np.random.default_rng(3)
    rate, torque = WHOLE.joints.rate.copy(), WHOLE.joints.torque.copy()
    for table, size in ((rate, 40.0), (torque, 300.0)):
        rows = random.choice(np.arange(3, table.shape[0] - 3, 3), 12, replace=False)
        table[rows, random.integers(4, size=12)] += size
    told = checked(joints={'rate': rate, 'torque': torque}).findings
    assert {(f.fault, f.words.split()[0]) for f in told} == {('wild', '12')} and len(told) == 2


def test_a_track_that_no_second_gyro_bears_out_is_told_with_its_rival():
    wide = rolling.rover(**{'wheels.y': [1.3 * rolling.HALF_TRACK, -1.3 * rolling.HALF_TRACK] * 2})
    (finding,) = checked(wide, reference={'yaw_rate': 0.0 * WHOLE.reference.yaw_rate}).findings
    assert finding.fault == 'track' and 'or the gyro has a scale error' in finding.words
    assert finding.value == pytest.approx(2.0 * rolling.HALF_TRACK, rel=0.03)
    (finding,) = checked(wide, reference=None).findings
    assert finding.confidence == 0.5 and 'or the wheels slip' in finding.words


@pytest.mark.parametrize('reversed_wheel', [False, True])
def test_a_wheel_that_the_others_drag_keeps_the_sign_of_its_torque(reversed_wheel):
    """On firm ground a smaller radius brakes both ways by more than rolling costs."""
    dragged = 1.6 * rolling.RESISTANCE * rolling.MASS * rolling.GRAVITY / 4 * rolling.RADIUS
    torque = WHOLE.joints.torque - np.sign(np.round(WHOLE.joints.rate, 1)) * [dragged, 0, 0, 0]
    torque *= [1.0, -1.0 if reversed_wheel else 1.0, 1.0, 1.0]
    report = checked(joints={'torque': torque})
    told = [f.wheel for f in report.findings if f.fault == 'torque_sign']
    assert told == (['front_right'] if reversed_wheel else [])


def test_noise_of_an_imu_is_that_of_the_livelier_half():
    """It shakes while the rover drives, six tenths of the time; columns differ by a factor."""
    values = np.random.default_rng(1).standard_normal((20_037, 2)) * [1.0, 3.0]
    values[8000:] *= 10.0
    assert imu._upper_rms(values) == pytest.approx([10.0, 30.0], rel=0.05)


@pytest.mark.parametrize(('rows', 'told'), [(1, ['no_drive']), (140, [])])
def test_a_recording_without_a_drive_is_said_to_be_one(rows, told):
    """Fourteen seconds of standing tell no unit, and nothing to mend; a row tells nothing."""
    changes = {
        name: rows_of(channel, channel.seconds < WHOLE.joints.seconds[rows - 1] + 0.01)
        for name in ('joints', 'imu', 'sinkage', 'reference')
        if (channel := getattr(WHOLE, name)) is not None
    }
    report = checked(**changes)
    assert faults(report) == told
    assert bool(told) or any('hardly moves' in entry.reason for entry in report.not_checked)


@pytest.mark.parametrize('other', ['both', 'to and fro', 'gyro alone', 'one velocity'])
def test_encoders_that_read_nought_all_along_are_told_and_break_no_check(other):
    """By a velocity whose mean is nothing, or by the gyro."""
    velocity, changes = WHOLE.reference, {}
    if other == 'to and fro':
        sign = np.where(np.arange(len(velocity.stamp)) % 600 < 300, 1.0, -1.0)[:, None]
        still = np.random.default_rng(5).normal(0.0, 0.004, WHOLE.imu.rate.shape)
        changes = {'reference': replace(velocity, velocity=sign * abs(velocity.velocity))}
        changes['imu'] = replace(WHOLE.imu, rate=still)
    elif other == 'gyro alone':
        changes = {'reference': None}
    elif other == 'one velocity':
        changes = {'reference': rows_of(velocity, np.arange(1))}
    rate = np.zeros_like(WHOLE.joints.rate)
    report = checked(joints={'rate': rate}, **changes)
    assert faults(report)[-1] == ('silent' if other == 'one velocity' else 'no_drive')
    assert not any('internal error' in entry.reason for entry in report.not_checked)


def test_sides_that_slip_apart_are_no_gyro_in_degrees():
    """The rover turns 22 times as fast as its wheels say, and slower than about a side at rest."""
    drive = rolling.ten_minute_drive()
    whole = rolling.recording(replace(drive, yaw_rate=drive.yaw_rate / 22.0))
    whole = replace(whole, imu=replace(whole.imu, rate=whole.imu.rate * [1.0, 1.0, 22.0]))
    evidence = gather(whole, from_configuration(rolling.rover()), {})
    assert 0.004 < abs(turning.track_ratio(evidence)) < 0.07
    assert turning.check_gyro_unit(evidence)[0] == []


def test_a_gyro_that_no_rest_tells_the_zero_of_exchanges_no_wheels():
    """Turns of 0.2 rad/s with a zero of a third of that, and never a standstill."""
    turns = rolling.driven(60.0, 0.3, yaw=lambda time: 0.2 * np.sin(0.3 * time))
    told = faults(checked(whole=turns, imu={'rate': turns.imu.rate + 0.07 * np.eye(3)[2]}))
    assert not {'exchanged', 'backwards', 'swapped_sides'} & {*told}


@pytest.mark.parametrize('angle', [90.0, 15.0, pytest.param(-140.0, marks=pytest.mark.slow)])
def test_a_reference_that_points_aside_is_no_reversed_one(angle):
    forward, a = 1.1 * WHOLE.reference.velocity[:, 0], math.radians(angle)
    aside = np.column_stack([forward * math.cos(a), forward * math.sin(a), 0.0 * forward])
    report = checked(reference={'velocity': aside})
    if angle == 15.0:  # a slide down a cross slope does it: no scale, no radius
        assert not report.findings
        assert any('15 degrees aside' in entry.reason for entry in report.not_checked)
        return
    (told,) = (f for f in report.findings if f.kind == 'mounting')
    assert told.fault == 'reference_turned' and 'world' in told.words and told.confidence <= 0.5
    assert told.value == pytest.approx(angle, abs=3.0)


def test_a_turn_on_the_spot_reverses_no_axis_of_the_accelerometer():
    """What the ground does to y in it is far more than a curve of next to no speed."""
    speed = [2, 3, 8, 9, 30, 31, 36, 37], [0, 0.3, 0.3, 0, 0, 0.3, 0.3, 0]
    motion = rolling.motion(40.0, speed, yaw=([10, 11, 19, 20, 28, 29], [0, 0.3, 0.3, 0.1, 0.3, 0]))
    motion = replace(motion, speed=motion.speed + 0.03 * (motion.yaw_rate > 0))
    whole = rolling.recording(motion)
    force = whole.imu.force.copy()
    force[:, 1] -= 8.0 * 0.03 * np.interp(whole.imu.seconds, motion.time, motion.yaw_rate)
    assert 'force_axes' not in faults(checked(whole=whole, imu={'force': force}))


def test_a_steering_joint_stands_in_for_no_wheel():
    names = list(rolling.NAMES)
    steered = [f'{name}_steer' for name in names]
    there = [0, 2, 3]
    joints = replace(
        WHOLE.joints, names=(*(names[i] for i in there), *steered),
        rate=np.hstack([WHOLE.joints.rate[:, there], np.zeros((WHOLE.joints.stamp.size, 4))]),
        torque=np.hstack([WHOLE.joints.torque[:, there], np.zeros((WHOLE.joints.stamp.size, 4))]),
        position=np.zeros((WHOLE.joints.stamp.size, 7)),
    )  # fmt: skip
    report = checked(rolling.rover(**{'wheels.steering_joints': steered}), joints=joints)
    assert 'missing_wheel' in faults(report) and 'joint_name' not in faults(report)


def test_an_imu_on_its_back_is_written_only_where_turns_tell_it():
    """Without turns the accelerometer may as well count the other way round."""
    for turns in (True, False):
        whole = rolling.recording(rolling.ten_minute_drive(turns))
        over = [1.0, -1.0, -1.0]
        imu = replace(whole.imu, force=whole.imu.force * over, rate=whole.imu.rate * over)
        written = calibrate(replace(whole, imu=imu), rolling.rover()).changes
        assert any('mounting_roll' in change.key for change in written) == turns


def later(name, seconds, stamp=0.0):
    """A channel that arrives later, with a stamp that is later by another time [s]."""
    channel = getattr(WHOLE, name)
    stamps = channel.stamp + np.round(1e9 * (stamp + np.zeros(channel.stamp.size))).astype(np.int64)
    way = np.round(1e9 * (seconds + np.zeros(channel.stamp.size))).astype(np.int64)
    return {name: replace(channel, stamp=stamps, log_time=channel.log_time + way)}


@pytest.mark.parametrize(
    ('name', 'seconds', 'stamp', 'fault', 'off'),
    [
        ('imu', 1.5, 0.0, '', 0.0),  # comes late, with right stamps
        ('joints', 1.5, 0.0, '', 0.0),
        ('imu', 0.4, 2.2, 'imu_offset', 2.2),  # log time tells their sum, the motions which
        ('joints', 0.4, 2.2, 'wheel_odometry_offset', 2.2),
        ('reference', 0.0, -1.7e9, 'order', None),  # time since start
        ('imu', 0.0, 0.003 * WHOLE.imu.seconds, 'order', None),  # a clock that drifts
        ('reference', 0.0, 0.003 * WHOLE.reference.seconds, 'order', None),
        ('imu', *(sign * 0.45 * (WHOLE.imu.seconds > 167.0) for sign in (-1, 1)), 'order', None),
    ],
)
def test_stamps_and_ways_that_are_late(name, seconds, stamp, fault, off):
    """The last steps by half a second between the circles: a clock was set, that is no offset."""
    told = checked(**later(name, seconds, stamp)).findings
    assert [f.fault for f in told] == [fault] * bool(fault)
    assert not off or told[0].value == pytest.approx(off, abs=0.1)


@pytest.mark.parametrize('seed', range(4))
@pytest.mark.parametrize(('name', 'every', 'most'), [('reference', 4, 3.0), ('joints', 4, 0.8)])
def test_delays_that_differ_from_message_to_message_are_no_steps_of_a_clock(
    name, every, most, seed
):
    """The next one waits for those before it."""
    channel = getattr(WHOLE, name)
    channel = rows_of(channel, np.arange(0, channel.stamp.size, every))
    delays = np.random.default_rng(seed).uniform(0.0, most, channel.stamp.size)
    arrival = np.maximum.accumulate(channel.stamp + np.round(1e9 * delays).astype(np.int64))
    report = checked(**{name: replace(channel, log_time=arrival)})
    assert not any('they step' in f.words for f in report.findings)


def test_log_time_alone_does_not_tell_a_clock_from_a_slow_way():
    dead = {
        'rate': 0.0 * WHOLE.imu.rate,
        'force': np.tile([0.0, 0.0, 9.81], (WHOLE.imu.stamp.size, 1)),
    }
    for way, stamp in ((3.0, 0.0), (0.0, 3.0)):
        imu = replace(later('imu', way, stamp)['imu'], **dead)
        told = [f for f in checked(imu=imu).findings if f.fault == 'imu_offset']
        assert [f.value for f in told] == pytest.approx([stamp - way])
        assert ('come late' in told[0].words) == (told[0].confidence < 0.8) == (way > 0.0)


@pytest.mark.parametrize(
    'name', [pytest.param('reference', marks=pytest.mark.slow), 'sinkage', 'imu']
)
def test_an_input_beyond_the_history_silences_no_other(name):
    told = [f for f in checked(**later(name, 6.0)).findings if f.fault != 'imu_offset']
    assert [(f.fault, f.parameter, f.value) for f in told] == [('too_late', 'history', 10.0)]
    assert told[0].topic == getattr(WHOLE, name).topic


@pytest.mark.parametrize(('tardy', 'told'), [(0.05, []), (0.3, [5.0])])  # 1.5 (2.4 + 0.3) s
def test_an_input_of_which_a_part_comes_after_the_history(tardy, told):
    late = np.where(np.arange(WHOLE.reference.stamp.size) % 20 < 20 * tardy, 2.4, 1.4)  # [s]
    report = checked(**later('reference', late))
    assert [f.value for f in report.findings if f.parameter == 'history'] == told


def test_a_logger_whose_clock_is_off_blames_no_input():
    """Its clock gains on all stamps alike, or is ahead; or a reference grows older evenly."""

    def of_all(way):
        return {k: v for name in ('imu', 'joints', 'reference', 'sinkage')
                for k, v in later(name, way(getattr(WHOLE, name))).items()}  # fmt: skip

    assert not faults(checked(**of_all(lambda channel: 0.002 * channel.seconds)))
    assert not faults(checked(**of_all(lambda channel: 5.0)))
    aging = later('reference', 0.3 + 0.6 * WHOLE.reference.seconds / WHOLE.reference.seconds[-1])
    assert not faults(checked(**aging))
    ahead = of_all(lambda channel: 9.0)
    early = rows_of(ahead['imu'], WHOLE.imu.seconds < WHOLE.imu.seconds[-1] - 12.0)
    assert 'silent' in faults(checked(**{**ahead, 'imu': early}))


def test_stamps_of_a_coarse_clock_are_no_losses():
    """64 Hz by a clock of 10 ms: 10 or 20 ms apart, never more."""
    stamp = WHOLE.imu.stamp
    even = np.arange(stamp[0], stamp[-1], 10**9 // 64)
    rows = np.minimum(np.searchsorted(stamp, even), stamp.size - 1)
    coarse = even // 10**7 * 10**7
    imu = replace(rows_of(WHOLE.imu, rows), stamp=coarse, log_time=even)
    assert 'drop_outs' not in faults(checked(imu=imu))


def test_circles_on_a_slope_are_no_scale_of_the_accelerometer():
    """In each of them the slope's share of gravity comes from all sides."""
    turned, slope = 0.4 * WHOLE.imu.seconds, np.radians(22.0)
    aside = 9.81 * np.sin(slope) * np.column_stack([np.cos(turned), np.sin(turned)])
    force = np.column_stack([aside, np.full(turned.size, 9.81 * np.cos(slope))])
    told = faults(checked(imu={'force': force}))
    assert 'force_scale' not in told
    assert 'force_scale' in faults(checked(imu={'force': 0.94 * force}))


def test_no_yaw_seems_better_known_than_it_scatters(monkeypatch):
    """A motion beside hills of three times its size, neither of which the other knows of."""
    random, told = np.random.default_rng(1), []
    for _ in range(100):
        real, imaginary = scipy.ndimage.gaussian_filter1d(random.standard_normal((2, 2, 3000)), 8.0)
        motion, hills = real + 1j * imaginary
        monkeypatch.setattr(evidence, '_motions', lambda *_, m=motion, h=hills: (m, m + 3.0 * h))
        told.append(evidence.mounting_yaw(None))
    value, std = np.array([yaw for yaw in told if yaw is not None]).T
    assert value.size > 90 and std.min() > 0.7 * value.std()
    assert np.median(std) < 1.3 * value.std()


@pytest.mark.parametrize(
    ('costs', 'told', 'gravity'), [(0.08, True, 9.81), (0.17, False, 9.81), (0.17, False, 3.71)]
)
def test_slip_that_loose_soil_makes_is_no_radius(costs, told, gravity):
    """The rover makes 0.6 of its way; what that costs is that of firm ground, or of loose.

    The weight is that of the IMU's gravity where the rover file states that of another planet.
    """
    sense = np.sign(np.round(WHOLE.joints.rate, 1))
    weight = rolling.MASS * rolling.GRAVITY
    more = (costs - rolling.RESISTANCE) * weight * rolling.RADIUS / 4 * sense
    slower = {'velocity': 0.6 * WHOLE.reference.velocity}
    joints, rover = (
        {'torque': WHOLE.joints.torque + more},
        rolling.rover(**{'rover.gravity': gravity}),
    )
    report = checked(rover, joints=joints, reference=slower, sinkage=None)
    assert bool({*faults(report)} & {'radius', 'reference_scale'}) == told
    if not told:
        assert any('torques are 0.17' in e.reason for e in report.not_checked)


@pytest.mark.parametrize('dead', [False, True])
def test_a_wheel_between_the_sides_stands_in_a_turn_on_the_spot(dead):
    motion = rolling.ten_minute_drive()
    rows = (motion.time > 25.0) & (motion.time < 50.0)
    speed = np.where(rows & ~dead, 0.0, motion.speed)
    yaw = np.where(rows & ~dead, 0.5, motion.yaw_rate)
    whole = rolling.recording(replace(motion, speed=speed, yaw_rate=yaw))
    rate = whole.joints.rate.copy()
    rate[:, 2:] = rate[:, :2].mean(axis=1, keepdims=True)
    rate[rows, 2] = 0.0
    half, torque = rolling.HALF_TRACK, np.full_like(rate, np.nan)
    places = {'wheels.x': [0.1, 0.1, -0.1, -0.2], 'wheels.y': [half, -half, 0.0, 0.0]}
    joints = replace(whole.joints, rate=rate, torque=torque)
    told = faults(checked(rolling.rover(**places), whole=whole, joints=joints))
    assert ('rate_frozen' in told) == dead


@pytest.mark.parametrize(
    ('factor', 'slip', 'units'),
    [
        (2.23694, 0.13, ['knots', 'miles']),
        pytest.param(1.9438, 0.0, ['knots', 'miles'], marks=pytest.mark.slow),
        (2.23694, 0.25, ['miles', 'kilometres', 'knots']),
    ],
)
def test_units_of_a_reference_that_slip_leaves_open_are_told_together(factor, slip, units):
    velocity = factor * (1.0 - slip) * WHOLE.reference.velocity
    report = checked(reference={'velocity': velocity})
    told = [f for f in report.findings if f.fault == 'reference_unit']
    assert sorted(f.words.split(' in ')[1].split()[0] for f in told) == sorted(units)
    assert min(abs(f.value * factor - 1.0) for f in told) < 1e-4
    assert len(units) == 1 or max(f.confidence for f in told) < 0.8


def test_without_a_turn_the_unit_may_be_that_of_the_rates_or_of_the_reference():
    """At a radius of 0.265 m metres per second of the rim are as far from rad/s as km/h."""
    whole = rolling.recording(rolling.ten_minute_drive(turns=False))
    smaller = replace(whole.joints, rate=whole.joints.rate * rolling.RADIUS / 0.265)
    faster = replace(whole.reference, velocity=3.6 * 0.75 * whole.reference.velocity)
    rover = rolling.rover(**{'wheels.radius': [0.265] * 4})
    told = checked(rover, whole=whole, joints=smaller, reference=faster).findings
    assert {'rate_unit', 'reference_unit'} <= {f.fault for f in told}
    assert max(f.confidence for f in told if f.kind == 'unit') < 0.8


@pytest.mark.parametrize(('name', 'lost'), [('joints', 0.2), ('imu', 0.6)])
def test_messages_that_are_lost_at_random_are_told(name, lost):
    """Where most are lost two that follow each other are not usual."""
    channel = getattr(WHOLE, name)
    kept = np.random.default_rng(2).random(channel.stamp.size) > lost
    report = checked(**{name: rows_of(channel, kept)})
    (told,) = (f for f in report.findings if f.fault == 'drop_outs')
    share = float(told.words.split(' % of')[0].split()[-1])
    assert share == pytest.approx(100.0 * (1.0 - kept.mean()), abs=1.0)
    assert report.figures[f'{name}.rate_hz'] == pytest.approx(1e9 / np.diff(channel.stamp)[0])


@pytest.mark.parametrize(('noise', 'told'), [(1e-4, False), (1e-2, True)])
def test_a_simulation_without_noise_and_slip_has_no_reference_of_its_wheels(noise, told):
    motion, y = rolling.ten_minute_drive(), np.array(rolling.PARAMETERS['wheels.y'])
    rate = (motion.speed[:, None] - motion.yaw_rate[:, None] * y) / rolling.rolling_radius()
    rate += noise * np.random.default_rng(1).standard_normal(rate.shape)
    speed = rolling.rolling_radius() * rate[::5].mean(axis=1)
    velocity = np.column_stack([speed, 0.0 * speed, 0.0 * speed])
    report = checked(joints={'rate': rate}, reference={'velocity': velocity})
    assert ('reference_wheels' in faults(report)) == told


@pytest.mark.parametrize(
    'torques, told',
    [
        ((2.0, -1.5, -0.7, 1.0), False),  # ground that hardly gives: slower wheels brake
        ((3.0, -2.8, 3.2, 3.1), True),  # loose ground
        ((3.0, -2.8, 3.2, -3.1), True),  # a side reversed
    ],
)
def test_wheels_that_fight_on_firm_ground_have_no_wrong_sign(torques, told):
    motion = rolling.motion(60.0, ([3.0, 6.0], [0.0, 0.3]))
    whole = rolling.recording(motion)
    noise = 0.02 * np.random.default_rng(1).standard_normal(whole.joints.torque.shape)
    starts = rolling.MASS * rolling.RADIUS / 4.0 * np.gradient(motion.speed, motion.time)
    torque = np.outer(motion.speed > 0.0, torques) + np.outer(starts, np.sign(torques)) + noise
    report = rolling.checked(whole=whole, joints={'torque': torque})
    assert ('torque_sign' in faults(report)) == told


def test_torques_of_a_slight_curve_have_no_wrong_sign_and_no_zero():
    """The tighter the curve the more the inner wheels brake; here the steeper the slope too."""
    speed = [2, 3, 48, 52, 97, 98], [0, 0.3, 0.3, -0.3, -0.3, 0]
    drive = rolling.motion(100.0, speed, yaw=([10, 45, 55, 90], [0, 0.08, 0.08, 0]))
    yaw = np.sign(drive.speed) * drive.yaw_rate
    whole = rolling.recording(replace(drive, yaw_rate=yaw, slope=0.8 * yaw))
    torque = whole.joints.torque + 150.0 * np.outer(yaw, [-1.0, 1.0, -1.0, 1.0])
    assert not faults(checked(whole=whole, joints={'torque': torque}))


@pytest.mark.parametrize('there', [True, False])
def test_where_the_reference_takes_no_side_not_all_wheels_are_backwards_for_sure(
    monkeypatch, there
):
    """One side is reversed, in turns through loose sand: starts are felt against their mean."""
    monkeypatch.setattr(turning, '_chosen', lambda *_: turning._Chosen(np.ones(4), -2.1))
    monkeypatch.setattr(turning, '_direction', lambda *_: (None, -0.96))
    (told,) = checked(reference={} if there else None).findings[:1]
    assert told.fault == 'backwards' and ('some of them' in told.words) == there
    assert told.confidence == pytest.approx(0.5 if there else 0.99, abs=0.01)


def test_wheels_that_spin_on_the_spot_do_not_lack_a_sign():
    """What the reference of an entrapped rover goes back is its noise."""
    drive = rolling.ten_minute_drive(turns=False)
    whole = rolling.recording(replace(drive, speed=np.abs(drive.speed)))
    noise = 0.03 * np.random.default_rng(3).standard_normal(whole.reference.stamp.size)
    velocity = np.column_stack([noise, 0.0 * noise, 0.0 * noise])
    assert not faults(checked(whole=whole, reference={'velocity': velocity}))


def lagged(values, seconds, rate=rolling.RATE):
    """Readings (k, p) behind a filter of first order."""
    keep = math.exp(-1.0 / (rate * seconds))
    out = values.copy()
    for i in range(1, len(out)):
        out[i] = keep * out[i - 1] + (1.0 - keep) * values[i]
    return out


def test_what_would_come_before_it_is_measured_is_not_early():
    """Rates that a driver makes smooth lag all else: a camera's velocity is not ahead of itself."""
    joints = replace(WHOLE.joints, rate=lagged(WHOLE.joints.rate, 0.8))
    told = [f for f in checked(imu=None, joints=joints).findings if f.kind == 'delay']
    assert [f.fault for f in told] == ['wheel_odometry_offset']
    assert 0.4 < told[0].value < 0.9


def test_a_reference_that_is_made_smooth_has_no_other_scale():
    """Stops of 2.5 s after 7.5 s of driving: it never comes to rest, nor to its speed."""
    drive = rolling.ten_minute_drive(until=300.0)
    whole = rolling.recording(replace(drive, speed=drive.speed * (drive.time % 10.0 < 7.5)))
    slow = lagged(whole.reference.velocity, 2.0, rolling.RATE / 5.0)
    told = faults(checked(whole=whole, reference={'velocity': slow}))
    assert told == ['reference_offset']


def test_wheels_told_five_times_a_second_a_quarter_of_a_second_late():
    rows = np.arange(WHOLE.joints.stamp.size) % 2 == 0
    joints = rows_of(later('joints', 0.0, stamp=0.25)['joints'], rows)
    (told,) = checked(joints=joints).findings
    assert told.fault == 'wheel_odometry_offset' and told.value == pytest.approx(0.25, abs=0.08)
    assert faults(checked(joints=rows_of(WHOLE.joints, rows))) == []


def test_a_tilted_gyro_has_no_other_scale():
    """It has cos(25 degrees) of the turns on z, and the rest on x."""
    turn = np.array([[0.906, 0.0, 0.423], [0.0, 1.0, 0.0], [-0.423, 0.0, 0.906]])
    assert 'gyro_scale' not in faults(checked(imu={'rate': WHOLE.imu.rate @ turn}))
    half = replace(WHOLE.imu, rate=0.5 * WHOLE.imu.rate)
    told = [f for f in checked(imu=half).findings if f.fault == 'gyro_scale']
    assert told[0].value == pytest.approx(2.0, abs=0.1)


def test_wheels_of_a_side_that_hang_on_one_encoder_are_no_copies():
    joints = replace(WHOLE.joints, rate=WHOLE.joints.rate[:, [0, 1, 0, 1]])
    swapped = rolling.rover(**{'wheels.names': [rolling.NAMES[i] for i in (1, 0, 2, 3)]})
    assert faults(checked(swapped, joints=joints)) == ['exchanged']
    reverse = replace(joints, rate=joints.rate * [-1, 1, 1, 1])
    reverse = replace(reverse, torque=joints.torque * [-1, 1, 1, 1])
    assert faults(checked(joints=reverse)) == ['backwards']


def test_rates_of_a_simulator_without_noise_are_no_copies():
    """Of six wheels the corner ones are steered about the middle axle: front and rear are alike."""
    motion, half = rolling.ten_minute_drive(), rolling.HALF_TRACK
    inner, corner = (
        np.hypot(motion.speed[:, None] - motion.yaw_rate[:, None] * [half, -half], reach)
        * np.sign(motion.speed)[:, None]
        / rolling.rolling_radius()
        for reach in (0.0, rolling.HALF_BASE * np.abs(motion.yaw_rate)[:, None])
    )
    names = *rolling.NAMES[:2], 'middle_left', 'middle_right', *rolling.NAMES[2:]
    rate = np.hstack([corner, inner, corner])
    base = np.repeat([rolling.HALF_BASE, 0.0, -rolling.HALF_BASE], 2).tolist()
    six = {'names': list(names), 'x': base, 'y': [half, -half] * 3}
    sizes = {'radius': [rolling.RADIUS] * 6, 'width': [0.1] * 6}
    rover = rolling.rover(**{f'wheels.{key}': value for key, value in (six | sizes).items()})
    joints = replace(WHOLE.joints, names=names, rate=rate, torque=np.full(rate.shape, np.nan))
    assert 'copied' not in faults(checked(rover, joints=joints))


def test_one_late_message_beside_a_loss_is_no_step_of_a_clock():
    reference = rows_of(
        WHOLE.reference, ~np.isin(np.arange(WHOLE.reference.stamp.size), (200, 201))
    )
    arrival = reference.log_time.copy()
    arrival[199] += 900_000_000  # before the two that are lost
    late = replace(reference, log_time=arrival)
    assert faults(rolling.checked(reference=late)) == []


BACK = rolling.ten_minute_drive().speed[:, None] < 0.0


@pytest.mark.parametrize('torque', [0.0, 3.0, math.nan])
def test_a_rover_that_is_dragged_back_on_locked_wheels_has_rates_with_a_sign(torque):
    held = torque + np.random.default_rng(1).normal(0.0, 0.2, WHOLE.joints.rate.shape)
    joints = replace(
        WHOLE.joints,
        rate=np.where(BACK, 0.0, WHOLE.joints.rate),
        torque=np.where(BACK | math.isnan(torque), held, WHOLE.joints.torque),
    )
    assert 'rates_unsigned' not in faults(checked(joints=joints))


@pytest.mark.parametrize('turned', [1.0, -1.0])  # of an IMU that looks back
@pytest.mark.parametrize('climbs', [True, False])
def test_a_rover_that_slides_back_on_a_slope_has_rates_with_a_sign(climbs, turned):
    """On 20 degrees it slides back for a third of the drive while its wheels go on."""
    whole = rolling.driven(120.0, 0.3, slope=0.35 * climbs)
    velocity = whole.reference.velocity.copy()
    velocity[np.arange(len(velocity)) % 60 > 40, 0] -= 0.5
    imu = {'force': whole.imu.force * [turned, turned, 1.0]}
    report = checked(whole=whole, imu=imu, reference={'velocity': velocity})
    assert ('rates_unsigned' in faults(report)) == (not climbs)


@pytest.mark.parametrize('stands', [True, False])
def test_a_locked_wheel_that_the_others_drag_keeps_the_sign_of_its_torque(stands):
    """Of six wheels one is locked; those beside it turn faster than the others."""
    middle, y = ('middle_left', 'middle_right'), [rolling.HALF_TRACK, -rolling.HALF_TRACK] * 3
    rate, torque = (
        np.hstack([one, one[:, :2]]) for one in (WHOLE.joints.rate, WHOLE.joints.torque)
    )
    random = np.random.default_rng(3)
    rate, torque = random.normal(rate, 0.004), random.normal(torque, 0.2)
    rate[:, ::2] *= 1.2
    rate[:, 0] *= not stands
    torque[:, 0] *= -1.0
    file = {'wheels.names': [*rolling.NAMES, *middle], 'wheels.x': [0.1, 0.1, -0.1, -0.1, 0.0, 0.0]}
    file |= {'wheels.radius': [rolling.RADIUS] * 6, 'wheels.width': [0.1] * 6, 'wheels.y': y}
    joints = replace(WHOLE.joints, names=(*rolling.NAMES, *middle), rate=rate, torque=torque)
    report = checked(rolling.rover(**file), sinkage=None, joints=joints)
    assert ('torque_sign' in faults(report)) == (not stands)


def test_rates_without_a_sign_reverse_no_wheels_of_a_rover_that_turns_backwards_alone():
    drive = rolling.ten_minute_drive()
    speed = np.where(drive.time > 105.0, -drive.speed, drive.speed)
    whole = rolling.recording(replace(drive, speed=speed))
    assert faults(checked(whole=whole)) == []
    told = faults(checked(whole=whole, joints={'rate': np.abs(whole.joints.rate)}))
    assert told == ['rates_unsigned']


def test_noise_of_a_rover_that_stands_in_a_rut_takes_no_sign_off_its_rates():
    """Where its wheels spin the reference scatters about 0, one reading ahead and one back."""
    whole = rolling.driven(300.0, ([5, 6], [0.0, 0.3]))
    velocity, late = whole.reference.velocity.copy(), whole.reference.seconds > 210.0
    velocity[late, 0] = 0.2 * (-1.0) ** np.arange(late.sum())
    assert 'rates_unsigned' not in faults(checked(whole=whole, reference={'velocity': velocity}))


def test_standstills_hide_no_rates_without_a_sign():
    """It goes back for 14 % of the way and for 8 % of the time."""
    knots = [0, 80, 81, 141, 142, 150, 151, 161, 162, 170]
    speed = knots, [0, 0, 0.3, 0.3, 0, 0, -0.3, -0.3, 0, 0]
    whole = rolling.recording(rolling.motion(170.0, speed))
    assert faults(checked(whole=whole)) == []
    told = faults(checked(whole=whole, joints={'rate': np.abs(whole.joints.rate)}))
    assert told == ['rates_unsigned']


@pytest.mark.parametrize('alike', [True, False])
def test_wheels_that_turn_otherwise_than_the_rover_tell_no_unit(alike):
    """A body that slides and turns on wheels that hardly do; in another unit they turn alike."""
    whole = rolling.recording()
    apart = 0.0 if alike else np.sin(whole.joints.seconds)[:, None] * [1.0, 1.0, -1.0, -1.0]
    rate = whole.joints.rate / (2.0 * math.pi) + apart
    report = checked(whole=whole, joints={'rate': rate}, reference=None)
    assert ('rate_unit' in faults(report)) == alike


def oriented(whole, motion, noise=1e-4):
    """The attitude on level ground."""
    psi = np.interp(whole.imu.seconds, motion.time, np.cumsum(motion.yaw_rate) / rolling.RATE)
    psi = psi + noise * np.random.default_rng(3).standard_normal(psi.size)
    return scipy.spatial.transform.Rotation.from_rotvec(np.outer(psi, [0.0, 0.0, 1.0])).as_quat()


@pytest.mark.parametrize('seed', range(4))
def test_a_turn_that_stays_the_same_shows_no_scale_of_the_gyro(seed):
    """A piece of a circle: a bias of the gyro would look alike."""
    motion = rolling.motion(30.0, 0.3, yaw=0.2)
    whole = rolling.recording(motion, seed)
    told = faults(checked(whole=whole, imu={'orientation': oriented(whole, motion)}))
    assert not {'gyro_scale', 'gyro_degrees'} & set(told)


@pytest.mark.parametrize(('since', 'noise'), [(20.0, 0.0), (20.0, 1e-4), (140.0, 1e-4)])
def test_an_orientation_that_stays_is_frozen_where_it_has_noise_or_the_rover_turns(since, noise):
    """For 40 s of a straight, and of circles."""
    motion = rolling.ten_minute_drive()
    whole = rolling.recording(motion)
    orientation = oriented(whole, motion, noise)
    assert faults(checked(whole=whole, imu={'orientation': orientation})) == []
    stays = (whole.imu.seconds > since) & (whole.imu.seconds < since + 40.0)
    orientation[stays] = orientation[stays][0]
    told = faults(checked(whole=whole, imu={'orientation': orientation}))
    assert told == ['sensor_frozen'] * (since > 100.0 or noise > 0.0)


def test_turns_about_the_z_of_a_leaning_rover_are_no_scale_of_its_gyro():
    """On 20 degrees uphill the heading turns 1/cos(20 degrees) times as fast as the rover does."""
    yaw = lambda time: 0.15 * np.sign(np.sin(time)) * (time > 10.0)  # noqa: E731
    motion = rolling.motion(220.0, 0.3, yaw=yaw, slope=0.35)
    whole = rolling.recording(motion)
    psi = np.interp(whole.imu.seconds, motion.time, np.cumsum(motion.yaw_rate) / rolling.RATE)
    lean = scipy.spatial.transform.Rotation.from_euler('y', -0.35)
    turned = lean * scipy.spatial.transform.Rotation.from_rotvec(np.outer(psi, [0.0, 0.0, 1.0]))
    assert 'gyro_scale' not in faults(checked(whole=whole, imu={'orientation': turned.as_quat()}))
    rate = 0.9 * whole.imu.rate
    report = checked(whole=whole, imu={'orientation': turned.as_quat(), 'rate': rate})
    (told,) = [f for f in report.findings if f.fault == 'gyro_scale']
    assert told.value == pytest.approx(1.0 / 0.9, abs=0.02)


def test_a_gyro_against_its_orientation_may_be_either_where_the_wheels_see_no_turn():
    psi = np.interp(
        WHOLE.imu.seconds, WHOLE.joints.seconds, np.cumsum(rolling.ten_minute_drive().yaw_rate)
    )
    yaw = scipy.spatial.transform.Rotation.from_rotvec(np.outer(psi / rolling.RATE, [0, 0, 1]))
    mean = WHOLE.joints.rate.mean(axis=1, keepdims=True) + 0.0 * WHOLE.joints.rate
    back = WHOLE.imu.rate * [1.0, 1.0, -1.0]
    joints = replace(WHOLE.joints, rate=mean)
    report = checked(joints=joints, imu={'rate': back, 'orientation': yaw.as_quat()})
    assert [f.confidence for f in report.findings if f.fault == 'orientation'] == [0.5]


@pytest.mark.parametrize('scale', [0.88, 1.12])
def test_the_track_of_sides_that_differ_on_straights_is_not_written(scale):
    """One side has another radius than the file says: circles to the left alone fit a track."""
    drive = rolling.ten_minute_drive()
    whole = rolling.recording(replace(drive, yaw_rate=np.abs(drive.yaw_rate)))
    file = rolling.rover(**{'wheels.radius': [rolling.RADIUS, scale * rolling.RADIUS] * 2})
    assert 'track' not in faults(checked(file, whole=whole))
    assert 'wheels.y' not in {change.key for change in calibrate(whole, file).changes}


def test_a_late_reference_of_a_rover_that_turns_late_is_no_fault_of_its_wheels():
    """The chassis turns 0.18 s after its wheels; what arrives as stamped is stamped well."""
    imu = later('imu', 0.18, stamp=0.18)['imu']
    reference = later('reference', 0.37, stamp=0.37)['reference']
    told = [f for f in checked(imu=imu, reference=reference).findings if f.kind == 'delay']
    assert [f.fault for f in told] == ['reference_offset']


def test_the_unit_of_rates_is_told_in_turns_about_a_point_between_steered_wheels():
    """The rims of steered wheels run faster than the rover: it turns slowly about its middle."""
    speed = [10.0, 11.0, 40.0, 42.0], [0.0, 0.28, 0.28, 0.3]
    motion = rolling.motion(200.0, speed, yaw=([40.0, 42.0], [0.0, 0.8]))
    whole = rolling.recording(motion)
    x, y = np.array([0.4, 0.4, -0.4, -0.4]), np.array(rolling.PARAMETERS['wheels.y'])
    along = motion.speed[:, None] - motion.yaw_rate[:, None] * y
    aside = motion.yaw_rate[:, None] * x
    angle = np.arctan(aside / np.where(along == 0.0, 1.0, along))
    rate = along / np.cos(angle) / rolling.RADIUS
    rate += np.random.default_rng(2).normal(0.0, 0.004, rate.shape)
    steered = [f'{name}_steering' for name in rolling.NAMES]
    none = np.full(rate.shape, np.nan)
    joints = replace(
        whole.joints,
        names=(*rolling.NAMES, *steered),
        rate=np.hstack([np.degrees(rate), none]),
        torque=np.hstack([whole.joints.torque, none]),
        position=np.hstack([none, angle]),
    )
    rover = rolling.rover(**{'wheels.x': x.tolist(), 'wheels.steering_joints': steered})
    (told,) = [f for f in checked(rover, whole=whole, joints=joints).findings if f.kind == 'unit']
    assert told.fault == 'rate_unit' and told.value == pytest.approx(math.radians(1.0))


def test_rates_in_rpm_at_a_slip_of_a_third_may_be_counts_of_a_coarse_encoder():
    """Speed is 0.067 of the rims': 0.64 of 2 pi/60, or 94 counts per turn."""
    file, slips = rolling.rover(), {'velocity': 0.64 * WHOLE.reference.velocity}
    rpm = {'rate': WHOLE.joints.rate * 60.0 / (2.0 * math.pi)}
    blind = replace(WHOLE.imu, rate=0.0 * WHOLE.imu.rate)
    told = checked(file, imu=blind, joints=rpm, reference=slips).findings
    assert {f.fault: f.confidence for f in told if f.kind == 'unit'} == {
        'rate_unit': 0.45,
        'rate_counts': 0.45,
    }


def test_out_and_back_in_the_world_is_no_reversing():
    """After half a turn in place a velocity in the world is negative, and the wheels are not."""
    speed = [10, 11, 58, 59, 70, 71, 130, 131], [0, 0.3, 0.3, 0, 0, 0.3, 0.3, 0]
    yaw = [60, 61, 66, 67], [0.0, math.pi / 6.0, math.pi / 6.0, 0.0]
    motion = rolling.motion(150.0, speed, yaw=yaw)
    whole = rolling.recording(motion)
    ahead = np.sign(np.cos(np.cumsum(motion.yaw_rate) / rolling.RATE))
    way = np.interp(whole.reference.seconds, motion.time, ahead)
    world = {'velocity': whole.reference.velocity * way[:, None]}
    assert faults(checked(whole=whole, reference=world)) == ['reference_world']


@pytest.mark.parametrize('share', [1.0, 0.6])
def test_rates_of_a_rover_that_drives_down_backwards_show_that_they_have_no_sign(share):
    """On 12 degrees; one that goes by other than its wheels may slide."""
    drive = rolling.ten_minute_drive(turns=False)
    steep = rolling.recording(replace(drive, slope=0.2 * (drive.time > 4.0)))
    back = (steep.reference.velocity[:, :1] < -0.1) * (share - 1.0) + 1.0
    report = checked(
        whole=steep,
        joints={'rate': np.abs(steep.joints.rate)},
        reference={'velocity': back * steep.reference.velocity},
    )
    assert ('rates_unsigned' in faults(report)) == (share == 1.0)


def test_a_wheel_that_a_rover_of_two_turns_about_is_not_frozen():
    """Half a minute about the left wheel, whose coarse encoder shows nothing."""
    yaw = [30, 31, 60, 61], [0.0, 0.75, 0.75, 0.0]  # speed over half the track
    whole = rolling.driven(80.0, ([4.0, 5.0, 75.0, 76.0], [0.0, 0.3, 0.3, 0.0]), yaw=yaw)
    stands = np.abs(whole.joints.rate[:, :2]) < 0.2
    rate = np.where(stands, 0.0, whole.joints.rate[:, :2])
    joints = {'names': rolling.NAMES[:2], 'rate': rate, 'torque': whole.joints.torque[:, :2]}
    two = {key: rolling.PARAMETERS[key][:2] for key in rolling.PARAMETERS if 'wheels' in key}
    file = rolling.rover(**two, **{'rover.suspension': 'shares'})
    assert 'rate_frozen' not in faults(checked(file, whole=whole, joints=joints, sinkage=None))
    dead = joints | {'rate': rate * [0.0, 1.0]}
    assert 'rate_frozen' in faults(checked(file, whole=whole, joints=dead, sinkage=None))


def test_counts_that_come_and_go_at_a_crawl_are_no_zeros_of_a_wheel_in_another_unit():
    drive = rolling.motion(120.0, ([4.0, 5.0, 60.0, 61.0], [0.0, 0.3, 0.3, 0.02]))
    whole = rolling.recording(drive)
    turned = np.cumsum(drive.speed) / rolling.RATE / rolling.RADIUS
    counts = np.floor(turned[:, None] / 0.02 + [0.1, 0.3, 0.6, 0.8])
    random = np.random.default_rng(2)
    interval = random.uniform(0.99, 1.01, drive.time.size) / rolling.RATE
    rate = 0.02 * np.diff(counts, axis=0, prepend=counts[:1]) / interval[:, None]
    told = checked(whole=whole, joints={'rate': rate * [30.0 / math.pi, 1.0, 1.0, 1.0]}).findings
    assert {f.kind for f in told} >= {'unit'} and 'jumps' not in {f.kind for f in told}


@pytest.mark.parametrize(('seconds', 'sure'), [(0.3, False), (0.0, True)])
def test_a_lag_of_a_chassis_is_no_clock_for_sure(seconds, sure):
    """What is stamped 0.3 s late when it comes is late for sure only if it would come before."""
    imu = later('imu', seconds, stamp=0.3)
    (told,) = [f for f in checked(**imu, reference=None).findings if f.kind == 'delay']
    assert (told.confidence > 0.8) == sure
    written = calibrate(replace(WHOLE, **imu, reference=None), rolling.rover()).changes
    assert ('sensors.imu_stamp_offset' in {c.key for c in written}) == sure
    assert sure or not any('stamp_offset' in change.key for change in written)


@pytest.mark.parametrize('starts', [True, False])
def test_an_imu_upside_down_may_be_turned_about_either_axis_where_no_start_tells(starts):
    drive = rolling.ten_minute_drive()
    drive = drive if starts else replace(drive, speed=0.0 * drive.speed + 0.3)
    whole = rolling.recording(drive)
    back = {name: getattr(whole.imu, name) * [1.0, -1.0, -1.0] for name in ('force', 'rate')}
    (told,) = [f for f in checked(whole=whole, imu=back).findings if f.fault == 'imu_upside']
    assert (told.confidence > 0.8) == starts and ('x axis' in told.words) == (not starts)


def test_a_gyro_that_turns_sixty_times_as_its_orientation_is_in_degrees():
    """So little is turned, and by slip, that neither shows the scale well."""
    drive = rolling.ten_minute_drive(turns=False)
    turns = 0.06 * np.sin(0.3 * drive.time) * (drive.time > 110.0)
    whole = rolling.recording(replace(drive, yaw_rate=turns))
    straight = {'rate': rolling.recording(drive).joints.rate}
    half = 0.47 * np.interp(whole.imu.seconds, drive.time, np.cumsum(turns) / rolling.RATE)
    shown = np.column_stack([0.0 * half, 0.0 * half, np.sin(half), np.cos(half)])
    imu = {'rate': np.degrees(whole.imu.rate), 'orientation': shown}
    told = checked(whole=whole, joints=straight, imu=imu).findings
    assert {f.fault for f in told if f.kind in ('unit', 'gain')} == {'gyro_degrees'}


def test_a_side_that_reads_negative_without_an_imu_is_told_by_the_reference():
    """Sides that go apart are a turn on the spot only while the rover stays where it is."""
    rate = WHOLE.joints.rate * [1.0, -1.0, 1.0, -1.0]
    report = checked(imu=None, joints={'rate': rate, 'torque': math.nan * rate})
    told = [f for f in report.findings if f.kind == 'sign']
    assert [(f.fault, f.wheel) for f in told] == [('backwards', 'front_right, rear_right')]


def test_a_wheel_that_was_read_in_one_turn_alone_has_no_other_radius():
    """On the inner side, without an IMU: what it was like on the other half is not known."""
    seconds = WHOLE.joints.seconds
    rate = WHOLE.joints.rate.copy()
    rate[(seconds < 130.0) | (seconds > 165.0), 0] = math.nan
    assert 'radius' not in {f.kind for f in checked(imu=None, joints={'rate': rate}).findings}


def test_the_height_of_the_hubs_is_no_depth():
    """It falls where the wheels sink in, from nearly the radius."""
    height = rolling.RADIUS - WHOLE.sinkage.sinkage
    (told,) = checked(sinkage={'sinkage': height}).findings
    assert told.fault == 'sinkage_sign' and 'positive upwards, or a zero error' in told.words


@pytest.mark.parametrize('late', [0.4, 0.5, 0.8])
def test_stamps_that_are_late_by_half_a_swing_reverse_nothing(late):
    """To and fro: with no lag the gyro goes against the wheels, half a swing later with them."""
    sway = lambda time: 0.08 * np.sin(4.5 * time + np.sin(0.9 * time))  # noqa: E731
    whole = rolling.driven(60.0, 0.3, yaw=sway)
    stamp = whole.imu.stamp + round(1e9 * late)
    (told,) = checked(
        whole=whole, imu={'stamp': stamp, 'log_time': stamp + 2_000_000}, sinkage=None
    ).findings
    assert told.fault == 'imu_offset' and told.value == pytest.approx(late, abs=0.1)


@pytest.mark.parametrize('seconds', [12.0, 30.0])
def test_wheels_that_hold_a_heading_on_uneven_soil_are_on_their_sides(seconds):
    """Soil turns the rover to the right by 0.03 rad/s while its wheels steer to the left."""
    speed, veer = ([4.0, 5.0], [0.0, 0.3]), [20.0, 21.0, 20.0 + seconds, 21.0 + seconds]
    turned, wheels = (
        rolling.driven(70.0, speed, yaw=(veer, [0.0, yaw, yaw, 0.0])) for yaw in (-0.03, 0.03)
    )
    told = faults(checked(whole=turned, joints={'rate': wheels.joints.rate}, reference=None))
    assert ('swapped_sides' in told) == (seconds > 20.0)


def test_a_short_turn_against_wheels_and_orientation_blames_no_orientation_for_sure():
    yaw = [20.0, 21.0, 30.5, 31.5], [0.0, 0.04, 0.04, 0.0]
    turn = rolling.driven(60.0, ([4.0, 5.0], [0.0, 0.3]), yaw=yaw)
    half = 0.5 * np.cumsum(turn.imu.rate[:, 2]) * 0.04
    oriented = np.column_stack([0.0 * half, 0.0 * half, np.sin(half), np.cos(half)])
    imu = {'rate': turn.imu.rate * [1.0, 1.0, -1.0], 'orientation': oriented}
    told = [f for f in checked(whole=turn, imu=imu).findings if f.fault == 'orientation']
    assert [f.confidence for f in told] == [0.5]


def test_a_velocity_in_the_world_is_no_reversed_one_where_the_drive_begins_to_the_west():
    heading = math.pi + np.cumsum(rolling.ten_minute_drive().yaw_rate)[::5] / rolling.RATE
    velocity = WHOLE.reference.velocity[:, :1] * np.column_stack(
        [np.cos(heading), np.sin(heading), 0.0 * heading]
    )
    assert faults(checked(reference={'velocity': velocity})) == ['reference_world']


def test_an_orientation_beside_a_reversed_accelerometer_is_right():
    """On a hill both lean opposite ways, and up is down all the time: no orientation does that."""
    motion = rolling.ten_minute_drive()
    angles = np.column_stack([np.cumsum(motion.yaw_rate) * 0.1, -motion.slope])
    at = np.column_stack([np.interp(WHOLE.imu.seconds, motion.time, one) for one in angles.T])
    oriented = scipy.spatial.transform.Rotation.from_euler('ZY', at).as_quat()
    imu = {'force': -WHOLE.imu.force, 'orientation': oriented}
    assert faults(checked(imu=imu)) == ['force_reversed']


@pytest.mark.parametrize('step', [0.01, 0.5])
def test_zeros_between_rates_of_few_counts_are_counts(step):
    """A steady drive; of a fine encoder no reading between two at speed is 0."""
    whole = rolling.driven(60.0, ([2.0, 3.0], [0.0, 0.3]))
    random = np.random.default_rng(3)
    rate = step * np.floor(whole.joints.rate / step + random.uniform(size=whole.joints.rate.shape))
    rate[random.choice(500, 40, replace=False) + 60, 1] = 0.0
    assert ('rate_zeros' in faults(checked(whole=whole, joints={'rate': rate}))) == (step < 0.1)
