# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""No cure that a recording does not bear out: faults that imitate one another, from kinematics."""

from dataclasses import replace

import numpy as np
import pytest
import rolling_rover as rolling

from wheel_terra_estimator.checks.calibration import calibrate
from wheel_terra_estimator.checks.statistics import Trial, halves, tried

SKID = {'wheels.x': [0.3, 0.3, -0.3, -0.3]}  # wheels in two rows: its turns need skid


def spot_turns():
    """Four seconds ahead, then nothing but turns on the spot, to both sides."""
    yaw = [12, 13, 40, 41, 45, 46, 80, 81], [0, 0.4, 0.4, 0, 0, -0.4, -0.4, 0]
    return rolling.motion(90.0, ([5, 6, 9, 10], [0, 0.2, 0.2, 0]), yaw=yaw)


@pytest.mark.parametrize('seed', [0, pytest.param(1, marks=pytest.mark.slow)])
def test_turns_on_the_spot_reverse_no_side(seed):
    report = rolling.checked(whole=rolling.recording(spot_turns(), seed))
    assert not report.findings, [str(f) for f in report.findings]


@pytest.mark.parametrize('wheels', [(1,), (1, 3), pytest.param((0, 2), marks=pytest.mark.slow)])
def test_wheels_backwards_in_turns_on_the_spot_are_found_all_the_same(wheels):
    sound = rolling.recording(spot_turns())
    flip = np.where(np.isin(np.arange(4), wheels), -1.0, 1.0)
    joints = replace(sound.joints, rate=sound.joints.rate * flip, torque=sound.joints.torque * flip)
    (finding,) = rolling.checked(whole=sound, joints=joints).findings
    assert finding.wheel == ', '.join(rolling.NAMES[i] for i in wheels)
    assert finding.cure == f'wheels.direction: [{", ".join(f"{int(s)}" for s in flip)}]'
    assert 'on the other half' in finding.words


def test_wheels_that_spin_on_the_spot_without_turning_reverse_no_side_for_sure():
    """As on a real Husky that stalls: the rates of a drive ahead with one side read backwards."""
    spinning, stalls = (
        rolling.recording(rolling.motion(60.0, 0.0, yaw=(times, rates)))
        for times, rates in (([3, 4, 58, 59], [0, 0.4, 0.4, 0]), ([3, 4, 7], [0, 0.3, 0]))
    )
    whole = replace(stalls, joints=spinning.joints, reference=None)
    (finding,) = (f for f in rolling.checked(whole=whole).findings if f.kind == 'sign')
    assert finding.confidence < 0.8 and 'spins on the spot' in finding.words


def test_slip_that_makes_no_turn_exchanges_no_wheels():
    """Wheels of one axle slip by a twentieth of the turns that the rover makes, against them."""
    whole = rolling.driven(120.0, 0.3, yaw=lambda time: 0.03 * np.sign(np.sin(0.7 * time)))
    yaw = np.interp(whole.joints.seconds, whole.imu.seconds, whole.imu.rate[:, 2])[:, None]
    share = np.array([0.95, 0.95, 1.1, 1.1])  # of its turn that each wheel does not make
    rate = whole.joints.rate + share * yaw * rolling.HALF_TRACK * [1, -1, 1, -1] / rolling.RADIUS
    found = rolling.checked(rolling.rover(**SKID), whole=whole, joints={'rate': rate}).findings
    assert 'exchanged_wheels' not in {f.kind for f in found}, [str(f) for f in found]


def test_a_rover_that_slides_back_in_curves_has_no_reversed_wheels_for_sure():
    """Wheels drive up a slope of 0.2 rad, the body goes down."""
    whole = rolling.driven(120.0, 0.25, yaw=lambda time: 0.1 * np.sin(time / 5.0), slope=-0.2)
    (finding,) = rolling.checked(whole=whole, joints={'rate': -whole.joints.rate}).findings
    assert finding.confidence < 0.5 and 'or the rover slides back' in finding.words


@pytest.mark.parametrize('what', ['wheels', 'reference', 'both torque and reference'])
def test_slopes_tell_whether_wheels_or_reference_run_backwards(what):
    """A drive without turns, starts or stops: only the torque uphill says which way it goes."""
    whole = rolling.driven(120.0, 0.25, slope=([20, 30, 60, 70, 90], [0, 0.12, 0.12, -0.05, 0]))
    joints, reference = whole.joints, whole.reference
    if what == 'wheels':
        joints = replace(joints, rate=-joints.rate, torque=-joints.torque)
    else:
        reference = replace(reference, velocity=-reference.velocity)
    if 'torque' in what:
        joints = replace(joints, torque=-joints.torque)
    recording = replace(whole, joints=joints, reference=reference)
    findings = rolling.checked(whole=recording).findings
    cures, unsure = [f.cure for f in findings], 'or all wheels read negative'
    backwards, negated = 'wheels.direction: [-1, -1, -1, -1]', 'negate twist.linear.x'
    assert (backwards in cures) is (what == 'wheels')
    assert any(negated in cure for cure in cures) is (what != 'wheels')
    assert any(unsure in f.words for f in findings) is ('torque' in what)


@pytest.mark.parametrize(
    'factor, told',
    [(0.9, {'gain'}), pytest.param(1.12, {'gain', 'radius'}, marks=pytest.mark.slow)],
)
def test_a_scale_of_the_reference_is_no_radius(factor, told):
    """Where the rover turns without skid the gyro tells; else starts do, or both are named."""
    whole = rolling.recording()
    scaled = replace(whole.reference, velocity=factor * whole.reference.velocity)
    recording = replace(whole, reference=scaled)
    (finding,) = rolling.checked(whole=recording).findings
    assert (finding.kind, finding.topic) == ('gain', '/reference_odom')
    assert finding.value == pytest.approx(1.0 / factor, abs=3.0 * finding.std)
    report = rolling.checked(rolling.rover(**SKID), whole=recording)
    skidding = {f.kind: f for f in report.findings}
    assert set(skidding) == told
    by_radius = skidding['radius'].confidence if 'radius' in told else 0.0
    assert by_radius < 0.6, 'never sure of the wrong one'
    assert all(('ten metres' in f.cure) == (len(told) > 1) for f in skidding.values())
    radii = {'wheels.radius': [rolling.RADIUS / factor] * len(rolling.NAMES)}
    wrong = rolling.checked(rolling.rover(**SKID, **radii), whole=whole).findings
    assert max(wrong, key=lambda f: f.confidence).kind == 'radius'
    radius = by_radius > skidding['gain'].confidence
    turned = factor if radius else 1.0  # the track by turns is that of the likelier
    track = report.figures['rover.effective_track_m'] / (2.0 * rolling.HALF_TRACK)
    assert track == pytest.approx(turned, rel=0.02)


def test_a_scale_of_the_reference_is_written_as_no_radius():
    """Steady driving says nothing of which it is: a prior alone writes no file."""
    steady = replace(rolling.driven(200.0, 0.3), imu=None)
    scaled = replace(steady.reference, velocity=1.15 * steady.reference.velocity)
    no_torque = replace(steady.joints, torque=np.nan * steady.joints.torque)
    recording = replace(steady, reference=scaled, joints=no_torque)
    calibration = calibrate(recording, rolling.rover(**SKID))
    assert 'wheels.radius' not in {change.key for change in calibration.changes}
    told = [f for f in calibration.findings if 'ten metres' in f.cure]
    assert {f.fault for f in told} == {'radius', 'reference_scale'}


@pytest.mark.parametrize('zero', [8.0, pytest.param(-8.0, marks=pytest.mark.slow)])
def test_a_zero_of_the_torques_is_no_radius(zero):
    motion = rolling.ten_minute_drive()
    forward = replace(motion, speed=np.maximum(motion.speed, 0.0))
    for drive in (motion, forward):
        whole = rolling.recording(drive)
        found = rolling.checked(whole=whole, joints={'torque': whole.joints.torque + zero}).findings
        assert 'radius' not in {f.kind for f in found}, [str(f) for f in found]


@pytest.mark.parametrize(
    ('since', 'until', 'moment'), [(-1.0, np.inf, 80.0), (20.0, 50.0, -1.0), (20.0, 50.0, 0.05)]
)
def test_a_wheel_held_under_torque_is_not_frozen(since, until, moment):
    """By more than the others pull; dragged by them, as much against them; or not driven."""
    whole = rolling.recording()
    rate, torque = whole.joints.rate.copy(), whole.joints.torque.copy()
    held = (whole.joints.seconds > since) & (whole.joints.seconds < until)
    rate[held, 1] = 0.0
    torque[held, 1] = moment if moment > 1.0 else moment * torque[held, 0]
    found = rolling.checked(whole=whole, joints={'rate': rate, 'torque': torque}).findings
    assert 'frozen' not in {f.kind for f in found}
    found = rolling.checked(whole=whole, joints={'rate': rate}).findings
    assert ('frozen', 'front_right') in {(f.kind, f.wheel) for f in found}


@pytest.mark.parametrize('channel, offset', [('imu', 0.7), ('reference', -0.8), ('joints', 0.6)])
def test_stamps_that_are_off_are_mended_by_a_parameter(channel, offset):
    whole = rolling.recording()
    series = getattr(whole, channel)
    off = replace(whole, **{channel: replace(series, stamp=series.stamp + round(offset * 1e9))})
    (finding,) = rolling.checked(whole=off).findings
    key = 'wheel_odometry' if channel == 'joints' else channel
    key = f'sensors.{key}_stamp_offset'
    assert (finding.kind, finding.parameter) == ('delay', key)
    assert finding.value == pytest.approx(offset, abs=max(2.0 * finding.std, 0.05))
    change = {c.key: c for c in calibrate(off, rolling.rover()).changes}[key]
    mended = rolling.checked(rolling.rover(**{key: change.after}), whole=off)
    assert not mended.findings, [str(f) for f in mended.findings]


def test_halves_hold_as_much_of_what_tells():
    energy = np.concatenate([np.zeros(50), np.ones(10), np.zeros(40)])
    first, second = halves(energy)
    assert energy[first].sum() == pytest.approx(energy[second].sum(), abs=1.0)


def test_a_cure_that_one_half_contradicts_does_not_pass():
    value = np.concatenate([np.full(50, 1.1), np.full(50, 0.95)])
    assert not tried(lambda rows: float(value[rows].mean()), 1.0, np.ones(100)).falls
    assert tried(lambda rows: 1.1, 1.0, np.ones(100)).falls
    assert Trial(1.0, 0.1, 0.5).passes and not Trial(1.0, 0.1, 0.11).passes


def test_turns_on_the_spot_without_a_gyro_or_a_wheel_say_nothing_of_signs_and_units():
    sound = rolling.recording(spot_turns())
    found = rolling.checked(whole=sound, imu={'rate': 0.0 * sound.imu.rate}).findings
    assert {f.kind for f in found} == {'placeholder'}, [str(f) for f in found]
    rate = sound.joints.rate.copy()
    rate[:, 0] = np.nan
    found = rolling.checked(whole=sound, joints={'rate': rate}).findings
    assert {f.kind for f in found} == {'missing_wheel'}, [str(f) for f in found]
