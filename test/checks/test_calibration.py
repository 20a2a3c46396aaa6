# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Calibration of a rover that rolls without slip: the written figures are the true ones."""

import functools
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import rolling_rover as rolling
from scipy.spatial.transform import Rotation

from wheel_terra_estimator.checks.calibration import as_file, calibrate
from wheel_terra_estimator.checks.imu import gross_tilt
from wheel_terra_estimator.checks.run import check_recording
from wheel_terra_estimator.checks.series import rows_of
from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.errors import UserError

WRONG = {
    'wheels.radius': [0.94 * rolling.RADIUS] * 4,
    'wheels.y': [0.36, -0.36] * 2,
    'sensors.imu_mounting_pitch_deg': 3.0,
}


@functools.cache
def as_it_is(seed):
    return calibrate(rolling.recording(seed=seed), rolling.rover(**WRONG))


def calibrated(seed=0, **changes):
    configuration = rolling.rover(**WRONG)
    if not changes:
        return as_it_is(seed), configuration
    return calibrate(replace(rolling.recording(), **changes), configuration), configuration


@pytest.mark.parametrize('seed', [0, pytest.param(1, marks=pytest.mark.slow)])
def test_radius_track_and_mounting(seed):
    calibration, _ = calibrated(seed)
    told = {change.key: change for change in calibration.changes}
    radius, track = told['wheels.radius'], told['wheels.y']
    assert radius.after[0] == pytest.approx(rolling.RADIUS, rel=0.01)
    assert abs(radius.after[0] - rolling.RADIUS) < 2.0 * radius.std
    assert track.after[0] == pytest.approx(rolling.HALF_TRACK, rel=0.02)
    assert told['sensors.imu_mounting_pitch_deg'].after == pytest.approx(0.0, abs=0.3)


def test_a_reference_without_stated_variance_or_noise_keeps_a_deviation_that_is_allowed():
    """Noise is raised, never lowered; 0 would be refused by every command that reads the file."""
    reference = rolling.recording().reference
    stated = float(rolling.rover().sensors.reference_std)
    told = {}
    for noise in (0.0, 0.2 * stated, 4.0 * stated):
        scatter = noise * np.random.default_rng(1).standard_normal(reference.stamp.size)
        velocity = reference.velocity.copy()
        velocity[:, 0] = 0.3 * np.sign(velocity[:, 0]) + scatter
        given = replace(reference, velocity=velocity, variance=0.0 * reference.variance)
        calibration, _ = calibrated(reference=given)
        told[noise] = {change.key: change.after for change in calibration.changes}
    assert 'sensors.reference_std' not in told[0.0].keys() | told[0.2 * stated].keys()
    assert told[4.0 * stated]['sensors.reference_std'] == pytest.approx(4.0 * stated, rel=0.3)


def test_a_noise_that_is_stated_as_larger_than_the_rates_is_mended():
    calibration = calibrate(rolling.recording(), rolling.rover(**{'sensors.wheel_rate_std': 4.0}))
    told = {change.key: change.after for change in calibration.changes}
    assert told['sensors.wheel_rate_std'] == pytest.approx(0.004, rel=0.1)


@pytest.mark.parametrize('stated', ['specific_force_std', 'angular_rate_std', ''])
def test_a_rate_of_the_imu_is_written_where_it_is_no_density_of_a_default_noise(stated):
    """25 Hz where the default is 50 Hz: a default noise per message would become larger."""
    rover = rolling.rover(**({f'sensors.{stated}': 0.01} if stated else {}))
    told = {change.key: change for change in calibrate(rolling.recording(), rover).changes}
    assert bool(stated) == ('sensors.imu_rate' in told)
    assert told['sensors.reference_rate'].after == 2.0


@pytest.mark.parametrize(
    ('times', 'reversed_reference', 'written'), [(2.0, 1, False), (6.0, 1, True), (6.0, -1, False)]
)
def test_noise_that_may_be_motion_or_hides_what_is_wrong_is_not_written(
    times, reversed_reference, written
):
    """The filter would follow the wheels less, and what is wrong more."""
    joints, reference = rolling.recording().joints, rolling.recording().reference
    noise = float(rolling.rover().sensors.wheel_rate_std) * times
    rate = joints.rate + noise * np.random.default_rng(2).standard_normal(joints.rate.shape)
    reference = replace(reference, velocity=reversed_reference * reference.velocity)
    noisy = replace(joints, rate=rate)
    given = replace(rolling.recording(), joints=noisy, reference=reference)
    calibration = calibrate(given, rolling.rover())
    assert ('sensors.wheel_rate_std' in {c.key for c in calibration.changes}) == written
    assert ('noise' in {entry.kind for entry in calibration.not_seen}) == (reversed_reference < 0)


def test_a_reversed_gyro_leaves_the_wheels_on_their_sides():
    """Swapped sides are its rival; without starts nothing tells which of both it is."""
    imu = rolling.recording().imu
    calibration, _ = calibrated(
        imu=replace(imu, rate=imu.rate * [1.0, 1.0, -1.0], force=imu.force * [1.0, 0.0, 1.0])
    )
    told = {change.key: change.after for change in calibration.changes}
    assert told['wheels.y'] == pytest.approx(
        [rolling.HALF_TRACK, -rolling.HALF_TRACK] * 2, rel=0.02
    )


def test_a_zero_of_the_accelerometer_is_written_and_what_stays_wrong_is_told():
    imu, reference = rolling.recording().imu, rolling.recording().reference
    off = replace(imu, force=imu.force + np.array([0.6, 0.0, 0.0]))
    back = replace(reference, velocity=-reference.velocity)
    rover = rolling.rover()
    calibration = calibrate(replace(rolling.recording(), imu=off, reference=back), rover)
    told = {change.key: change.after for change in calibration.changes}
    assert told['sensors.specific_force_bias'] == pytest.approx([0.6, 0.0, 0.0], abs=0.05)
    head = as_file(calibration, rover, 'drive').partition('/**')[0]
    assert 'Still wrong' in head and 'linear.x has the opposite sign to the wheels' in head


def test_zeros_of_a_gyro_are_in_the_frame_that_is_written():
    """Starts are felt backwards, curves not at all: which cure it is, nothing tells."""
    imu, zero = rolling.recording().imu, np.array([0.01, 0.004, 0.0])
    back = replace(imu, force=imu.force * [-1.0, 0.0, 1.0], rate=imu.rate + zero)
    calibration = calibrate(replace(rolling.recording(), imu=back), rolling.rover())
    told = {change.key: change.after for change in calibration.changes}
    (yaw,) = (f for f in calibration.findings if f.fault == 'imu_yaw')
    assert 'wrong sign: drive circles' in yaw.words and yaw.confidence < 0.8
    assert not any('mounting' in key for key in told)
    assert told['sensors.angular_rate_bias'] == pytest.approx(zero, abs=1e-3)


def test_nothing_is_told_from_where_there_is_no_imu():
    """It comes up in a circle at 0.2 rad/s, which is no bias at rest."""
    imu = rolling.recording().imu
    calibration, _ = calibrated(imu=rows_of(imu, imu.seconds > 140.0))
    told = {change.key: change.after for change in calibration.changes}
    bias = told.get('sensors.angular_rate_bias', [0.0, 0.0, 0.0])
    assert bias == pytest.approx([0.0, 0.0, 0.0], abs=0.002)
    assert not {'zero', 'unit'} & {finding.kind for finding in calibration.findings}


@pytest.mark.parametrize('factor', [-1.0, 1000.0])
def test_a_wrong_sinkage_moves_the_radius_by_no_more_than_its_deviation(factor):
    """Upside down or in millimetres."""
    sinkage = rolling.recording().sinkage
    calibration, _ = calibrated(sinkage=replace(sinkage, sinkage=factor * sinkage.sinkage))
    radius = next(c for c in calibration.changes if c.key == 'wheels.radius')
    assert radius.after[0] == pytest.approx(rolling.RADIUS, rel=0.02)


@pytest.mark.parametrize('slope', [-0.3, 0.0, 0.3])
@pytest.mark.parametrize('mounted', [('x', 180), ('x', 90), ('x', -90), ('y', 90), ('y', -90)])
def test_an_imu_on_its_back_or_side_on_a_slope_keeps_the_slope(slope, mounted):
    """About y, half a turn would turn the gyro and the slope round as well."""
    up = np.array([np.sin(slope), 0.5 * np.sin(slope), 0.0])
    true = rolling.GRAVITY * np.append(up[:2], np.sqrt(1.0 - up @ up))
    read = np.tile(Rotation.from_euler(*mounted, degrees=True).inv().apply(true), (50, 1))
    np.testing.assert_allclose(gross_tilt(SimpleNamespace(force=read)) @ read[0], true, atol=1e-9)


def test_an_imu_mounted_at_45_degrees_is_brought_upright():
    read = np.tile(rolling.GRAVITY * np.array([0.0, np.sqrt(0.5), np.sqrt(0.5)]), (50, 1))
    np.testing.assert_allclose(
        gross_tilt(SimpleNamespace(force=read)) @ read[0], [0.0, 0.0, rolling.GRAVITY], atol=1e-9
    )


def test_skidding_downhill_is_no_larger_radius():
    """Wheels in soft ground turn slower than the rover slides on their way down."""
    drive = rolling.ten_minute_drive(turns=False)
    ahead = np.interp(drive.time, [0.0, 15.0, 16.0], [0.0, 0.0, 0.3])
    slope = -0.1 + 0.05 * np.sin(0.05 * drive.time)
    down = rolling.recording(replace(drive, speed=ahead, slope=slope))
    soft = replace(down.sinkage, sinkage=down.sinkage.sinkage + 0.02)
    faster = replace(down.reference, velocity=1.12 * down.reference.velocity)
    told = calibrate(replace(down, reference=faster, sinkage=soft), rolling.rover())
    assert not [change for change in told.changes if change.key == 'wheels.radius']


def test_the_gravity_of_another_planet_is_mended():
    wrong = rolling.rover(**{'rover.gravity': 3.71})
    told = {change.key: change for change in calibrate(rolling.recording(), wrong).changes}
    assert told['rover.gravity'].after == pytest.approx(9.81, rel=0.01)


def test_zeros_of_the_torques_are_told_where_straights_are_driven_both_ways():
    joints = rolling.recording().joints
    zeros = np.linspace(-2.0, 2.0, joints.torque.shape[1])
    before, after = (
        next((c for c in calibrated(**j)[0].changes if c.key == 'sensors.torque_zero'), None)
        for j in ({}, {'joints': replace(joints, torque=joints.torque + zeros)})
    )
    stood = 0.0 if before is None else np.array(before.after)
    assert np.array(after.after) - stood == pytest.approx(zeros, abs=0.1)


def test_loads_that_a_slope_shifts_to_the_rear_are_no_zeros():
    """Up forwards, down backwards: the rear wheels carry more of the slope both ways."""
    joints = rolling.recording().joints
    share = 0.053 * rolling.MASS * rolling.GRAVITY * rolling.RADIUS / 4.0
    shifted = share * np.array([-1.0, -1.0, 1.0, 1.0])
    turning = np.abs(joints.rate) > 0.5
    told, _ = calibrated(joints=replace(joints, torque=joints.torque + shifted * turning))
    assert 'sensors.torque_zero' not in {change.key for change in told.changes}


def test_a_scale_that_may_be_the_mass_is_left_to_the_user():
    joints = rolling.recording().joints
    wrong = replace(rolling.recording(), joints=replace(joints, torque=1.4 * joints.torque))
    told = calibrate(wrong, rolling.rover())
    assert 'sensors.torque_gain' not in {change.key for change in told.changes}
    left = next(finding for finding in told.findings if finding.kind == 'gain')
    assert left.value == pytest.approx(1.4, rel=0.1) and 'rover.mass' in left.cure
    mass = next(f for f in check_recording(wrong, rolling.rover()).findings if f.kind == 'mass')
    assert mass.confidence == left.confidence <= 0.5
    mended = rolling.rover(**{'sensors.torque_gain': [left.value]})
    assert not {'gain', 'mass'} & {f.kind for f in check_recording(wrong, mended).findings}


def test_a_body_that_digs_in_is_on_no_slope():
    """Level sand: wheels that dig take more torque and tilt the body, which looks like a slope."""
    drive = rolling.ten_minute_drive()
    sunk, level = (rolling.recording(replace(drive, slope=s * drive.slope)) for s in (1.0, 0.33))
    resists = -0.013 * rolling.GRAVITY * rolling.MASS * rolling.RADIUS / 4.0
    turning = np.abs(level.joints.rate) > 0.5
    torque = level.joints.torque + resists * turning * np.sign(level.joints.rate)
    sunk = replace(sunk, joints=replace(level.joints, torque=torque))
    told = rolling.checked(whole=sunk)
    assert told.figures['torque.gain'] == pytest.approx(0.33, abs=0.05)
    assert not {'gain', 'mass'} & {finding.kind for finding in told.findings}
    assert 'sensors.torque_gain' not in {c.key for c in calibrate(sunk, rolling.rover()).changes}


def test_what_the_recording_cannot_tell_stays():
    straight = rolling.recording(rolling.ten_minute_drive(turns=False))
    calibration = calibrate(straight, rolling.rover(**WRONG))
    changed = {change.key for change in calibration.changes}
    assert not changed & {'wheels.y', 'sensors.imu_mounting_pitch_deg'}
    assert any('circle' in entry.reason for entry in calibration.not_seen)


def test_the_file_is_accepted_and_says_where_numbers_come_from(tmp_path):
    calibration, configuration = calibrated()
    text = as_file(calibration, configuration, 'drive')
    path = tmp_path / 'rover.yaml'
    path.write_text(text)
    radius = reader.load([path]).wheels.radius
    assert np.allclose(radius, rolling.RADIUS, rtol=0.01)
    above = text.splitlines()[
        text.splitlines().index(
            next(line for line in text.splitlines() if 'wheels.radius:' in line and '#' not in line)
        )
        - 1
    ]
    assert 'was [0.188' in above and '+-' in above and '/reference_odom' in above
    assert math.isfinite(radius[0])


@pytest.mark.parametrize('unit', [1.0, math.degrees(1.0)])
def test_no_zero_of_a_gyro_whose_unit_no_turn_tells(unit):
    """On a straight a gyro in degrees per second looks like one with a large zero."""
    straight = rolling.recording(rolling.ten_minute_drive(turns=False))
    imu = replace(straight.imu, rate=unit * (straight.imu.rate + 0.002))
    calibration = calibrate(replace(straight, imu=imu), rolling.rover())
    assert 'sensors.angular_rate_bias' not in {change.key for change in calibration.changes}
    assert any('unit' in entry.reason for entry in calibration.not_seen if entry.kind == 'zero')
    zeros = [f for f in calibration.findings if f.fault == 'gyro_bias']
    assert len(zeros) == (unit > 1.0)
    assert all(f.confidence <= 0.5 and 'degrees per second' in f.words for f in zeros)


def test_a_few_wheel_rates_are_called_few():
    whole = rolling.recording()
    joints = rows_of(whole.joints, np.arange(whole.joints.stamp.size) < 20)
    with pytest.raises(UserError, match='hardly any wheel rates; record a longer drive'):
        calibrate(replace(whole, joints=joints), rolling.rover())
