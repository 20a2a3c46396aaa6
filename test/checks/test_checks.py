# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Faults put into a rover that rolls without slip; each check has to find its own and no other."""

import math
from dataclasses import replace

import numpy as np
import pytest
import rolling_rover as rolling
from rolling_rover import checked

from wheel_terra_estimator.checks.clocks import lags
from wheel_terra_estimator.checks.names import _pairs, check_wheel_names
from wheel_terra_estimator.checks.rover_facts import from_configuration
from wheel_terra_estimator.checks.run import check_recording
from wheel_terra_estimator.checks.series import JointSeries, Recording, rows_of
from wheel_terra_estimator.checks.statistics import MOST_TIMES, even_times
from wheel_terra_estimator.configuration import reader

WHOLE = rolling.recording()


def kinds(report):
    return {(finding.kind, finding.wheel) for finding in report.findings}


SERIES = 'stamp', 'log_time', 'velocity', 'yaw_rate', 'variance'


def only(report, kind, wheel=None):
    assert kinds(report) == {(kind, wheel)}, [str(f) for f in report.findings]
    return report.findings[0]


@pytest.mark.parametrize('seed', [0, pytest.param(1, marks=pytest.mark.slow)])
def test_nothing_is_found_where_nothing_is_wrong(seed):
    report = checked(whole=rolling.recording(seed=seed))
    assert not report.findings, [str(f) for f in report.findings]
    assert report.figures['rover.rolling_radius_m'] == pytest.approx(rolling.RADIUS, rel=0.01)


@pytest.mark.parametrize('seconds', [0.35, 0.6, 1.5, 3.9, 5.5, 9.0])
@pytest.mark.parametrize('side', [1.0, -1.0])
def test_short_recordings_at_100_hz_are_checked_as_far_as_they_go(seconds, side):
    yaw = lambda time: np.where(time > 0.5 * seconds, 0.2, 0.0)  # noqa: E731
    whole = rolling.driven(seconds, ([0.0, 1.0], [0.0, 0.3]), yaw=yaw, rate=100.0)
    joints = {'rate': side * whole.joints.rate, 'torque': side * whole.joints.torque}
    report = checked(whole=whole, joints=joints)
    assert report.not_checked
    assert side < 0.0 or not report.findings, [str(f) for f in report.findings]


def test_a_straight_drive_tells_no_sides():
    straight = rolling.recording(rolling.ten_minute_drive(turns=False))
    report = checked(whole=straight)
    assert 'drive a circle' in next(
        entry.reason for entry in report.not_checked if entry.kind == 'swapped_sides'
    )


@pytest.mark.parametrize('reference', [WHOLE.reference, None])
def test_rim_speed_and_revolutions_that_are_near_are_told_together(reference):
    report = checked(joints={'rate': WHOLE.joints.rate * rolling.RADIUS}, reference=reference)
    units = [finding for finding in report.findings if finding.kind == 'unit']
    assert {round(finding.value, 3) for finding in units} == {
        round(2 * math.pi, 3),
        1.0 / rolling.RADIUS,
    }
    assert all(finding.confidence < 0.5 for finding in units)
    assert not any(finding.parameter for finding in report.findings)


@pytest.mark.parametrize('degrees, gravity', [(4.0, rolling.GRAVITY), (8.0, 1.62)])
def test_a_small_tilt_is_told_by_full_turns(degrees, gravity):
    """On the Moon a zero of the accelerometer may be one of four degrees."""
    cosine, sine = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    about_y = np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])
    imu, share, motion = WHOLE.imu, gravity / rolling.GRAVITY, rolling.ten_minute_drive()
    slope = np.interp(imu.seconds, motion.time, motion.slope)
    up = np.column_stack([np.sin(slope), 0.0 * slope, np.cos(slope)])
    force = imu.force - (rolling.GRAVITY - gravity) * up
    tilted = replace(imu, force=force @ about_y, rate=imu.rate @ about_y)  # inverse turn
    joints, rover = WHOLE.joints, rolling.rover(**{'rover.gravity': gravity})
    lighter = replace(joints, torque=share * joints.torque)
    finding = only(checked(rover, imu=tilted, joints=lighter), 'mounting')
    assert finding.parameter == 'sensors.imu_mounting_pitch_deg'
    assert finding.value == pytest.approx(degrees, abs=0.3)


def test_a_wheel_without_torque_leaves_the_scale_open():
    torque = WHOLE.joints.torque * [1.0, np.nan, 1.0, 1.0]  # without it nobody knows the sum
    report = checked(joints={'torque': 1.5 * torque})
    assert not report.findings
    untold = {o.kind for o in report.not_checked if 'a wheel without torque' in o.reason}
    assert untold == {'gain', 'mass'}
    ends = np.where(WHOLE.joints.seconds[:, np.newaxis] < 80.0, WHOLE.joints.torque, np.nan)
    whole = checked(joints={'torque': ends})  # what is left tells it
    assert whole.figures['torque.gain'] == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize(('share', 'soft'), [(0.1, False), (0.2, True)])
def test_soft_ground_tells_no_scale_of_the_torques(share, soft):
    """Rolling that costs so much of the weight beside the twelfth of the drive itself."""
    joints, rover = WHOLE.joints, rolling.rover()
    drag = share * rover.rover.mass * rover.rover.gravity * rover.wheels.radius / 4
    report = checked(joints=replace(joints, torque=joints.torque + drag * np.sign(joints.rate)))
    told = [entry.reason for entry in report.not_checked if entry.kind == 'gain']
    assert [reason.startswith('torque: soft ground') for reason in told] == [True] * soft


def test_a_variance_of_zero_is_right_where_the_rover_file_states_what_is_seen():
    reference = rolling.recording().reference
    silent = replace(reference, variance=np.zeros_like(reference.variance))
    recording = replace(rolling.recording(), reference=silent)
    told = checked(whole=recording)  # states 0.01 m/s, the true scatter
    assert not [f for f in told.findings if f.kind == 'covariance']
    far = checked(rolling.rover(**{'sensors.reference_std': 0.5}), whole=recording)
    assert [f for f in far.findings if f.kind == 'covariance']


def test_a_rover_that_starts_and_stops_between_references_scatters_no_reference():
    drive = rolling.ten_minute_drive(turns=False)
    speed = 0.15 + 0.15 * np.sin(2.0 * np.pi / 3.0 * drive.time)
    recording = rolling.recording(replace(drive, speed=speed, slope=0.0 * speed))
    every = slice(0, None, 4)  # about one a second: the speed changes by 0.2 m/s between two
    rare = {f: getattr(recording.reference, f)[every] for f in SERIES}
    told = checked(whole=recording, reference=replace(recording.reference, **rare))
    assert not [f for f in told.findings if f.kind == 'covariance']
    assert 0.007 < told.figures['reference.noise_m_s'] < 0.03  # true: 0.01; speeds differ by 0.2


def test_sinkage():
    sinkage = WHOLE.sinkage
    spells = (np.arange(sinkage.stamp.size) % 100 < 25).astype(float)
    deep = sinkage.sinkage * (1.0 + 3.0 * spells)[:, None]
    only(checked(sinkage=replace(sinkage, sinkage=deep - 0.025)), 'zero')
    for even in (-sinkage.sinkage, -deep, sinkage.sinkage - 0.02):  # which, nothing tells
        told = only(checked(sinkage=replace(sinkage, sinkage=even)), 'sign')
        assert told.confidence <= 0.5 and 'or a zero error' in told.words
    few = np.where([True, True, False, False], np.nan, sinkage.sinkage)
    few[:, 2] = -5.0  # a dead sensor, and one that is left
    only(checked(sinkage=replace(sinkage, sinkage=few)), 'frozen', 'rear_left')


def test_sinkage_counted_upwards_by_a_small_wheel():
    small = {'wheels.radius': [0.035] * 4, 'wheels.width': [0.02] * 4}
    micro = replace(WHOLE.sinkage, sinkage=-0.23 * WHOLE.sinkage.sinkage)
    told = [f.fault for f in checked(rolling.rover(**small), sinkage=micro).findings]
    assert 'sinkage_sign' in told


def test_messages_read_from_a_buffer_are_named_and_not_lost():
    """Eight at a time, 0.1 ms apart, stamped when they are read."""
    joints = WHOLE.joints
    row = np.arange(joints.stamp.size)
    stamp = joints.stamp[np.minimum(row // 8 * 8 + 7, row[-1])] + 100_000 * (row % 8)
    read = replace(joints, stamp=stamp, log_time=stamp + 2_000_000)
    report = checked(joints=read)
    assert 'bursts, stamped up to 0.7 s late' in only(report, 'order').words
    assert report.figures['joints.rate_hz'] == pytest.approx(10.0, rel=0.01)
    assert report.figures['imu.delay_s'] == pytest.approx(0.0, abs=0.05)
    for many, of in ((60, 100), (4, 24)):  # of a recorder that pauses
        assert only(checked(joints=rows_of(joints, row % of < many)), 'drop_outs')


def test_transport():
    joints = WHOLE.joints
    keep = (np.arange(joints.stamp.size) // 40) % 4 > 0
    assert ('drop_outs', None) in kinds(checked(joints=rows_of(joints, keep)))
    for nonzero in (np.arange(joints.stamp.size) % 10, False):
        zero = replace(joints, stamp=np.where(nonzero, joints.stamp, 0))
        only(checked(joints=zero), 'order')
    back = joints.stamp - 10**10 * (np.arange(joints.stamp.size) == 500)
    told = only(checked(joints=replace(joints, stamp=back)), 'order')
    assert 'step by +10 s against their arrival' in told.words


@pytest.mark.parametrize(
    'name', ['joints', pytest.param('imu', marks=pytest.mark.slow), 'reference']
)
def test_an_input_that_is_not_there_at_an_end_is_told(name):
    channel = getattr(WHOLE, name)
    dies = only(checked(**{name: rows_of(channel, channel.seconds < 200.0)}), 'drop_outs')
    assert dies.topic == channel.topic and 'in the last 20 s' in dies.words
    late = checked(**{name: rows_of(channel, channel.seconds > 8.0)})
    words = [finding.words for finding in late.findings]
    assert ['in the first 8 s' in told for told in words] == [True] * (name != 'reference')


@pytest.mark.parametrize('by', [-3.0, 30.0])
def test_a_clock_that_was_set_is_one_finding_whatever_it_stamps(by):
    changes = {}
    for name in ('joints', 'imu', 'sinkage', 'reference'):
        channel = getattr(WHOLE, name)
        later = channel.stamp > WHOLE.joints.stamp[1200]
        stamp = channel.stamp + round(by * 1e9) * later
        changes[name] = replace(channel, stamp=stamp)
    told = [f for f in checked(**changes).findings if f.kind in ('order', 'drop_outs', 'delay')]
    assert [f.kind for f in told] == ['order']
    assert 'a clock was set' in told[0].words
    assert all(topic in told[0].words for topic in ('/imu/data', '/sinkage', '/reference_odom'))


@pytest.mark.parametrize('how', ['doubled', 'reversed'])
def test_messages_in_another_order_are_one_fault_of_each_topic(how):
    changes = {}
    for name in ('joints', 'imu', 'reference'):
        channel = getattr(WHOLE, name)
        rows = np.arange(channel.stamp.size)
        changed = rows_of(channel, rows.repeat(2) if how == 'doubled' else rows[::-1])
        changes[name] = replace(changed, log_time=np.sort(changed.log_time))
    assert {finding.kind for finding in checked(**changes).findings} == {'order'}


def in_messages_of_their_own(joints, apart):
    """Each wheel in its own message, so many seconds after the one before."""
    wheels = len(joints.names)
    own = np.tile(np.eye(wheels, dtype=bool), (joints.stamp.size, 1))
    after = np.tile((1e9 * apart * np.arange(wheels)).astype(np.int64), joints.stamp.size)
    all_of_them = rows_of(joints, np.repeat(np.arange(joints.stamp.size), wheels))
    return replace(
        all_of_them,
        stamp=all_of_them.stamp + after,
        log_time=all_of_them.log_time + after,
        rate=np.where(own, all_of_them.rate, np.nan),
        torque=np.where(own, all_of_them.torque, np.nan),
    )


def one_wheel_seldom(joints):
    there = np.arange(joints.stamp.size)[:, None] % 3 == [0, 0, 0, 0]
    there[:, :3] = True
    rate, torque = (np.where(there, table, np.nan) for table in (joints.rate, joints.torque))
    return replace(joints, rate=rate, torque=torque)


@pytest.mark.parametrize('apart', [0.025, None, pytest.param(0.0, marks=pytest.mark.slow)])
def test_messages_that_hold_some_of_the_wheels_are_checked_as_whole_ones(apart):
    usual, joints = checked(), WHOLE.joints
    some = one_wheel_seldom(joints) if apart is None else in_messages_of_their_own(joints, apart)
    report = checked(joints=some)
    assert not report.findings
    assert [e.kind for e in report.not_checked] == [e.kind for e in usual.not_checked]
    assert report.figures['joints.rate_hz'] == pytest.approx(rolling.RATE)
    assert report.figures['torque.gain'] == pytest.approx(usual.figures['torque.gain'], abs=0.02)
    assert report.figures['wheels.rate_noise_rad_s'] == pytest.approx(0.004, rel=0.1)  # the truth
    only(checked(joints=rows_of(some, np.repeat(np.arange(some.stamp.size), 2))), 'order')


def test_without_a_rover_file_signs_are_found_all_the_same():
    flip = np.array([1.0, 1.0, 1.0, -1.0])
    joints = replace(WHOLE.joints, rate=WHOLE.joints.rate * flip, torque=WHOLE.joints.torque * flip)
    report = check_recording(replace(WHOLE, joints=joints), None)
    assert kinds(report) == {('sign', 'rear_right')}


def test_values_that_are_no_numbers_are_passed_over_and_many_of_the_imu_are_told():
    imu, joints, reference = WHOLE.imu, WHOLE.joints, WHOLE.reference
    force, rate, velocity = imu.force.copy(), joints.rate.copy(), reference.velocity.copy()
    force[::9], rate[::5, 1], velocity[::7] = np.nan, np.nan, np.nan
    report = checked(
        imu=replace(imu, force=force),
        joints=replace(joints, rate=rate),
        reference=replace(reference, velocity=velocity),
    )
    (finding,) = report.findings
    assert (finding.kind, finding.topic) == ('placeholder', '/imu/data')
    assert finding.words.startswith('11 % ') and 'linear_acceleration' in finding.words


def test_degrees_per_second_behind_a_side_that_counts_backwards():
    """Wheels that count against each other hide the turns; both faults are told, nothing else."""
    recording = rolling.recording()
    joints, imu = recording.joints, recording.imu
    left = np.array([-1.0, 1.0, -1.0, 1.0])
    faulty = replace(
        recording,
        joints=replace(joints, rate=left * joints.rate, torque=left * joints.torque),
        imu=replace(imu, rate=np.degrees(imu.rate)),
    )
    report = checked(whole=faulty)
    found = {(f.kind, f.topic, f.wheel) for f in report.findings}
    assert found == {
        ('unit', '/imu/data', None),
        ('sign', '/joint_states', 'front_left, rear_left'),
    }
    assert not any('wheel rates' in entry.reason for entry in report.not_checked)


def test_wheels_that_are_named_otherwise_half_way_are_told():
    joints, half = WHOLE.joints, WHOLE.joints.stamp.size // 2
    rate = np.full((joints.stamp.size, 8), np.nan)
    rate[:half, :4], rate[half:, 4:] = joints.rate[:half], joints.rate[half:]
    names = (*joints.names, 'a', 'b', 'c', 'd')
    renamed = replace(joints, names=names, rate=rate, torque=np.full_like(rate, np.nan))
    (outcome,), _ = check_wheel_names(
        replace(WHOLE, joints=renamed), from_configuration(rolling.rover())
    )
    assert 'only a, b, c, d' in outcome.words and outcome.wheel == ', '.join(rolling.NAMES)


def test_both_imus_are_named_where_neither_is_listened_to():
    two = ('/imu_front', '/imu_rear')
    topics = tuple((name, 'sensor_msgs/msg/Imu', 9) for name in two)
    whole = replace(WHOLE, topics=topics, imu=replace(WHOLE.imu, topic=two[0]))
    finding = only(checked(whole=whole), 'unknown_name')
    assert finding.words.endswith('has /imu_front and /imu_rear') and '/imu_front' in finding.cure


def test_even_times_over_stamps_that_jump():
    """The longest stretch, where a clock jumps by years; the whole drive where it only pauses."""
    drive = np.arange(0.0, 60.0, 0.1)
    paused = np.concatenate([drive, drive + 900.0])
    assert even_times(paused, 0.05)[-1] == pytest.approx(paused[-1], abs=0.051)
    for jumped in (np.concatenate([drive, [4e8]]), np.concatenate([[0.0, 1.0], drive + 4e8])):
        found = even_times(jumped, 0.05)
        assert found[-1] - found[0] == pytest.approx(59.9, abs=0.051)
    assert even_times(np.arange(0.0, 4e9, 3500.0), 0.05).size <= MOST_TIMES + 1


@pytest.mark.parametrize(
    ('at_tips', 'reference'), [(0.0, 'rim'), (1.0, 'lug_tip'), (0.0, 'lug_tip')]
)
def test_a_wheel_with_lugs_rolls_on_the_radius_that_shears_the_soil(at_tips, reference):
    """Lugs of 2 cm: where the soil shears at rim or tips, the rover rolls over just that radius."""
    lug = 0.02
    rolls = rolling.RADIUS + at_tips * lug
    joints = replace(WHOLE.joints, rate=WHOLE.joints.rate * rolling.RADIUS / rolls)
    stated = rolling.rover(**{
        'wheels.lug_height': [lug] * 4,
        'slip_radius': reference,
        'effects.lug_shear_radius.enabled': True,
        'effects.lug_shear_radius.lam': at_tips,
    })  # fmt: skip
    report = check_recording(replace(WHOLE, joints=joints), stated)
    told = rolling.RADIUS + lug * (reference == 'lug_tip')
    assert report.figures['rover.rolling_radius_m'] == pytest.approx(told, rel=0.005)


@pytest.mark.parametrize('period', [0.25, 0.75, 1.4])
@pytest.mark.parametrize('late', [-0.6, 0.0, 0.35])
def test_starts_that_fall_alike_between_references_do_not_look_late(period, late):
    """Every start is as far behind a stamp of the reference: no line between these tells when."""
    time = 0.05 * np.arange(3000)
    at = np.arange(0.0, time[-1], period)
    starts = [period * round(k * 9.0 / period) + 0.1 * period for k in range(1, 16)]

    def speed(t):
        ramps = [np.clip((t - start) / 1.2, 0.0, 1.0) * (-1) ** k for k, start in enumerate(starts)]
        return np.sum(ramps, axis=0)

    told, _ = lags(time, speed(time), at, speed(at - late), 3.0)(slice(0, at.size))
    assert told == pytest.approx(late, abs=0.03)


# Joints that steer are not passed over where the rover file knows of none.


STEERED = "['', '', '', '', rear_left_steering_joint, rear_right_steering_joint]"


@pytest.mark.parametrize('stated', [False, True])
def test_joints_that_steer(stated):
    parameters = [f'wheels.steering_joints:={STEERED}'] if stated else []
    rover = reader.load(['generic_six_wheel'], parameters)
    names = (*rover.wheels.names, 'rear_left_steering_joint', 'rear_right_steering_joint')
    stamp = np.arange(10) * 100_000_000
    rate = np.ones((10, len(names)))
    joints = JointSeries('/joint_states', stamp, stamp, names, rate, np.full_like(rate, np.nan))
    outcomes, _ = check_wheel_names(
        Recording('drive', (), joints, None, None, None, None), from_configuration(rover)
    )
    cures = [str(outcome.cure) for outcome in outcomes]
    assert [cure.split(':')[0] for cure in cures] == ['wheels.steering_joints'] * (not stated)


def test_names_that_are_like_none_are_taken_in_the_usual_order():
    assert _pairs(['fore', 'hind'], ['m1', 'm2']) == {'fore': 'm1', 'hind': 'm2'}
    assert _pairs(['fore', 'hind'], ['m1', 'm2', 'm3']) == {}
