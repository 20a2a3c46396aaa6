# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""One fault put into a rover that rolls without slip: found alone, with wheel, size and cure."""

import math
from dataclasses import replace

import numpy as np
import pytest
import rolling_rover as rolling
from pytest import approx

WHOLE = rolling.recording()
FL, FR, RL, RR = rolling.NAMES
IMU, JOINTS, REFERENCE, SINKAGE = 'imu', 'joints', 'reference', 'sinkage'


def by(factor):
    return lambda values: values * factor


def plus(*offsets):
    return lambda values: values + np.array(offsets)


def both(change):
    return dict.fromkeys(('rate', 'torque'), change)


def units(factor):
    """Velocities and their variances in another unit."""
    return {'velocity': by(factor), 'variance': by(factor**2)}


def stays(channel, field, column=..., since=120.0, until=160.0):
    """Seconds without a new number."""

    def change(values):
        values, seconds = values.copy(), getattr(WHOLE, channel).seconds
        rows = np.flatnonzero((seconds > since) & (seconds < until))
        values[rows, column] = values[rows[0], column]
        return values

    return channel, {field: change}


def since(time):
    """Rows of the wheels from a time [s] on."""
    return (WHOLE.joints.seconds > time)[:, None]


def in_steps(values):
    step = 0.25 * np.nanmax(np.abs(values))
    return step * np.round(values / step)


def of_the_wheels(velocity, rate=WHOLE.joints.rate):
    """Mean of the rates times a radius, as controllers of wheels publish it."""
    joints, reference = WHOLE.joints, WHOLE.reference
    near = np.abs(reference.stamp[:, None] - joints.stamp).argmin(axis=1)
    speed = 1.03 * rolling.RADIUS * rate[near].mean(axis=1)
    return np.column_stack([speed, 0.0 * speed, 0.0 * speed])


def between_stamps(velocity):
    """The same, of rates half way between two messages."""
    joints = WHOLE.joints
    return of_the_wheels(velocity, 0.5 * (joints.rate + np.roll(joints.rate, -1, axis=0)))


def one_number(*numbers):
    return lambda values: np.tile(numbers, (len(values), 1))


RPM, DEGREES, COUNTS, G = 30.0 / math.pi, 180.0 / math.pi, 4096 / (2.0 * math.pi), rolling.GRAVITY
EXCHANGED = 'wheels.names: [front_right, front_left, rear_left, rear_right]'
SWAPPED = 'wheels.names: [front_right, front_left, rear_right, rear_left]'
RENAMED = 'wheels.names: [fl_wheel, front_right, rear_left, rear_right]'
THREE = {**both(lambda v: v[:, :3]), 'names': lambda names: names[:3]}
FROZEN = 'up to '
ALL = ', '.join(rolling.NAMES)
MOST = 0.8 * np.quantile(np.abs(WHOLE.joints.rate), 0.98)
NOISE = np.random.default_rng(9970).normal(0.0, 0.02, WHOLE.joints.rate.shape)
TENTH = (np.arange(WHOLE.joints.stamp.size) % 10 == 0)[:, None]
HALF_PERIOD = round(0.5e9 / rolling.RATE)
LOST = (WHOLE.reference.seconds % 10.0 < 2.0)[:, None]
SLIPS = np.where(WHOLE.reference.seconds % 100.0 < 70.0, 0.62, 1.0)[:, None]  # miles at 0.38?
LATER = np.where(WHOLE.joints.seconds > 88.0, 2_500_000_000, 0)
TWICE = np.abs(WHOLE.reference.seconds[:, None] - [30.0, 80.0]).min(axis=1, keepdims=True) < 1.0
BELOW = [0.0, 0.06, 0.0, 0.06]
GONE = (abs(WHOLE.reference.seconds - 140.0) < 20.0)[:, None]
FAULTS = [  # channel, what its fields become, the only fault, its wheel, its true size, said
    (JOINTS, both(by([1, 1, -1, 1])), 'backwards', RL, None, 'direction: [1, 1, -1, 1]'),
    (JOINTS, both(by([-1, 1, -1, 1])), 'backwards', f'{FL}, {RL}', None, '[-1, 1, -1, 1]'),
    (JOINTS, both(lambda v: v[:, [1, 0, 2, 3]]), 'exchanged', f'{FL}, {FR}', None, EXCHANGED),
    (JOINTS, both(lambda v: v[:, [1, 0, 3, 2]]), 'swapped_sides', None, None, SWAPPED),
    (JOINTS, {'rate': by(RPM)}, 'rate_unit', None, approx(1.0 / RPM), ''),
    (JOINTS, {'rate': by(DEGREES)}, 'rate_unit', None, approx(1.0 / DEGREES), ''),
    (JOINTS, {'rate': by(COUNTS)}, 'rate_counts', None, approx(1.0 / COUNTS, rel=0.05), 'counts'),
    (JOINTS, {'rate': by(4.0)}, 'rate_unit', None, approx(0.25, rel=0.03), 'before a gear'),
    (JOINTS, {'rate': by([RPM, 1, RPM, 1])}, 'rate_unit', f'{FL}, {RL}', approx(1.0 / RPM),
     'per minute'),
    (JOINTS, {'rate': np.abs}, 'rates_unsigned', None, None, ''),
    (JOINTS, {'rate': lambda v: np.maximum(v, 0.0)}, 'rates_unsigned', None, None, ''),
    (JOINTS, {'rate': in_steps}, 'rate_steps', None, None, 'steps of'),
    (JOINTS, {'rate': lambda v: np.clip(v, -MOST, MOST)}, 'rate_limit', ALL, None, f'{MOST:.4g}'),
    (JOINTS, {'rate': lambda v: v[:, [0, 1, 0, 3]]}, 'copied', f'{FL}, {RL}', None, 'a copy'),
    (JOINTS, {'rate': lambda v: v[:, [0, 1, 2, 0]]}, 'copied', f'{FL}, {RR}', None, 'a copy'),
    (JOINTS, {'torque': lambda v: v[:, [0, 1, 2, 0]]}, 'copied', f'{FL}, {RR}', None, 'effort'),
    (JOINTS, {'rate': lambda v: np.where([1, 0, 0, 0], np.abs(v), v)}, 'rates_unsigned', FL, None,
     'other wheels'),
    (JOINTS, {'rate': lambda v: v * [1, 1, 0, 1] + NOISE}, 'rate_frozen', RL, None, 'up to'),
    (JOINTS, {'rate': lambda v: np.where(TENTH, 0.0, v)}, 'rate_zeros', ALL, None, 'publisher'),
    (JOINTS, {'rate': lambda v: np.where(TENTH & [[0, 1, 0, 0]], 0.0, v)}, 'rate_zeros', FR, None,
     ''),
    (*stays(JOINTS, 'rate'), 'rate_frozen', ALL, None, FROZEN),
    (*stays(JOINTS, 'rate', since=30.0, until=math.inf), 'rate_frozen', ALL, None, 'to 189'),
    (JOINTS, both(lambda v: v[np.arange(len(v)) // 2 * 2]), 'rates_held', None, None, '2 times'),
    (JOINTS, {'rate': by([1, 1, 0.5, 1])}, 'wheel_counts', RL, None, ''),
    (JOINTS, {'rate': by([1, 1, 1.2, 1])}, 'wheel_scale', RL, approx(0.2 / 1.2, rel=0.01), ''),
    (JOINTS, {'torque': np.abs}, 'torque_unsigned', None, None, ''),
    (JOINTS, {'torque': by(0.0)}, 'torque_placeholder', None, None, 'effort'),
    (JOINTS, {'torque': by([1, -1, 1, 1])}, 'torque_sign', FR, None, ''),
    (JOINTS, {'torque': by(1e-3)}, 'torque_scale', None, None, 'gear'),  # kilonewton metres
    (JOINTS, {'torque': plus(*4 * [20.0])}, 'torque_zero', ALL, approx(20.0, rel=0.1), ''),
    (JOINTS, {'torque': plus(*4 * [60.0])}, 'torque_zero', ALL, approx(60.0, rel=0.1), ''),
    (JOINTS, {'stamp': lambda s: s + LATER}, 'order', None, None, 'None'),  # no offset mends it
    (*stays(JOINTS, 'torque', 2), 'torque_frozen', RL, None, FROZEN),
    (JOINTS, {'names': lambda n: ('fl_wheel', *n[1:])}, 'joint_name', FL, None, RENAMED),
    (JOINTS, THREE, 'missing_wheel', RR, None, ''),
    (IMU, {k: by([1, -1, -1]) for k in ('force', 'rate')}, 'imu_upside', None, approx(180.0),
     'sensors.imu_mounting_roll_deg'),
    (IMU, {'force': by(1.0 / G)}, 'force_unit', None, approx(G), ''),
    (IMU, {'force': by(1000.0 / G)}, 'force_unit', None, approx(G / 1000.0), ''),
    (IMU, {'force': plus(0.0, 0.0, -G)}, 'gravity_off', None, None, ''),
    (IMU, {'force': plus(1.0, 0.0, -G)}, 'gravity_off', None, None, 'REP 145'),  # on a slope
    (IMU, {'force': by(1.62 / G)}, 'planet', None, approx(1.62), 'rover.gravity: 1.62'),
    (IMU, {'force': plus(0.0, 0.0, 0.6)}, 'force_scale', None, None, 'z zero'),
    (IMU, {'force': by(1.25)}, 'force_scale', None, None, 'rover.gravity'),
    (IMU, {'force': plus(0.6, 0.0, 0.0)}, 'force_bias', None, approx(0.6, abs=0.05), 'bias: [0.6'),
    (IMU, {'force': np.round}, 'imu_noise', None, approx(1.0 / math.sqrt(12.0), rel=0.1), ''),
    (IMU, {'force': np.negative}, 'force_reversed', None, None, 'linear_acceleration'),
    (IMU, {'rate': np.degrees}, 'gyro_degrees', None, approx(math.radians(1.0)), ''),
    (IMU, {'rate': by(0.0)}, 'force_zero', None, None, ''),
    (IMU, {'force': by(math.nan)}, 'imu_nan', None, None, 'linear_acceleration'),
    (IMU, {'rate': by(math.nan)}, 'imu_nan', None, None, 'angular_velocity'),
    (IMU, {'force': by([math.nan, 1, 1])}, 'imu_nan', None, None, 'linear_acceleration'),
    (REFERENCE, {'velocity': by(math.nan)}, 'reference_nan', None, None, 'NaN'),
    (JOINTS, {'rate': by([1, 1, math.nan, 1])}, 'missing_wheel', RL, None, 'velocity is empty'),
    (JOINTS, {'rate': by([1, 1, math.nan, 1]), 'position': lambda _: 0.0 * WHOLE.joints.rate},
     'missing_wheel', RL, None, 'change of its position'),
    (JOINTS, both(lambda v: np.where(since(80.0) & [[0, 0, 1, 0]], math.nan, v)), 'missing_wheel',
     RL, None, 'in 63 % of the seconds'),
    (IMU, {'rate': plus(0.0, 0.0, 0.03)}, 'gyro_bias', None, approx(0.03, abs=1e-3), ''),
    (IMU, {'rate': by(1.15)}, 'gyro_scale', None, approx(1.0 / 1.15, rel=0.01), ''),
    (IMU, {'force': one_number(2.6, 2.0, 2.4), 'rate': one_number(0.01, 0.01, 0.01)},
     'sensor_frozen', None, None, ''),  # far from what gravity is, but that is not told
    (IMU, {'force': lambda v: 0.0 * v + v[0]}, 'sensor_frozen', None, None, 'in every message'),
    (*stays(IMU, 'force'), 'sensor_frozen', None, None, FROZEN),
    (*stays(IMU, 'rate'), 'sensor_frozen', None, None, FROZEN),
    (REFERENCE, {'velocity': np.negative}, 'reference_reversed', None, None, ''),
    (REFERENCE, {'velocity': np.abs}, 'reference_unsigned', None, None, ''),
    (REFERENCE, {'velocity': by(0.0)}, 'reference_zero', None, None, ''),
    (REFERENCE, {'velocity': of_the_wheels}, 'reference_wheels', None, None, 'slip is always 0'),
    (REFERENCE, {'velocity': between_stamps, 'stamp': lambda s: s + HALF_PERIOD},
     'reference_wheels', None, None, ''),
    (REFERENCE, {'velocity': lambda v: np.where(LOST, 0.0, v)}, 'reference_zeros', None, None, ''),
    (REFERENCE, {'velocity': by(3.6)}, 'reference_unit', None, approx(1.0 / 3.6), 'kilometres'),
    (REFERENCE, {'velocity': by(3.6 * SLIPS)}, 'reference_unit', None, approx(1.0 / 3.6), ''),
    (REFERENCE, units(100.0), 'reference_unit', None, approx(0.01), ''),
    (REFERENCE, units(1000.0), 'reference_unit', None, approx(0.001), ''),
    (REFERENCE, {'variance': lambda v: 0.0 * v + 1e6}, 'covariance', None, None, ''),
    (REFERENCE, {'variance': lambda v: 1e-4 * v * np.linspace(0.5, 2.0, len(v))},
     'covariance', None, approx(0.01, rel=0.3), ''),
    (*stays(REFERENCE, 'velocity'), 'reference_frozen', None, None, FROZEN),
    (*stays(REFERENCE, 'velocity', since=50.0, until=math.inf), 'reference_frozen', None, None, ''),
    (REFERENCE, {'velocity': lambda v: np.where(GONE, 0.0, v)}, 'reference_frozen', None, None,
     FROZEN),
    (SINKAGE, {'sinkage': by(1000.0)}, 'sinkage_unit', None, approx(0.001), ''),
    (SINKAGE, {'stamp': lambda s: s + 800_000_000}, 'sinkage_offset', None, approx(0.8, abs=0.1),
     'sensors.sinkage_stamp_offset'),
    (SINKAGE, {'sinkage': lambda v: v * [1, 1, 1, 0]}, 'sinkage_frozen', RR, None, 'is 0 in every'),
    (SINKAGE, {'sinkage': plus(0.0, 0.04, 0.0, 0.0)}, 'sinkage_zero', FR,
     approx(0.04, abs=0.002), ''),
    (*stays(SINKAGE, 'sinkage', 1), 'sinkage_frozen', FR, None, FROZEN),
]  # fmt: skip


@pytest.mark.parametrize(
    ('channel', 'changes', 'fault', 'wheel', 'size', 'said'),
    FAULTS,
    ids=[f'{fault}-{number}' for number, (*_, fault, _, _, _) in enumerate(FAULTS)],
)
def test_the_fault_is_the_only_finding(channel, changes, fault, wheel, size, said):
    told = getattr(WHOLE, channel)
    changed = {field: change(getattr(told, field)) for field, change in changes.items()}
    (finding,) = rolling.checked(**{channel: replace(told, **changed)}).findings
    assert (finding.fault, finding.wheel) == (fault, wheel)
    assert size is None or abs(finding.value) == size
    assert said in f'{finding.words} {finding.parameter} {finding.cure}'
    if said == FROZEN:
        assert float(finding.words.split(said)[1].split(' s')[0]) == approx(40.0, abs=0.5)
    assert 0.8 <= finding.confidence < 1.0
    if fault == 'rate_counts':
        assert float(finding.words.split('about ')[1].split()[0]) == approx(4096.0, rel=0.05)


def rounded(step):
    return lambda values: step * np.round(values / step)


def scattered(size):
    return lambda v: v + size * np.random.default_rng(3).standard_normal(v.shape)


def counted(rate):
    """Counts of an encoder come and go: between them the rate is nought."""
    turned = np.cumsum(rate, axis=0) / rolling.RATE
    return np.diff(np.floor(turned / 0.25), axis=0, prepend=0.0) * 0.25 * rolling.RATE


def one_dead_among_coarse(rate):
    return np.where([False, False, True, False], 0.7, rounded(0.05)(rate))


def jerks(torque):
    """A hundred newton metres for an instant at starts and stops."""
    starts = np.searchsorted(WHOLE.joints.seconds, [15.0, 65.0, 105.0])
    return torque + 100.0 * np.isin(np.arange(len(torque)), starts)[:, None]


def damaged(rate):
    """Two messages of all wheels."""
    return np.where(np.isin(np.arange(len(rate)), (300, 400))[:, None], 40.0, rate)


def jittered(stamp):
    """By one and a half periods, as they come."""
    jitter = 1.5 * np.median(np.diff(stamp)) * np.random.default_rng(4).standard_normal(stamp.size)
    return np.sort(stamp + jitter.astype(np.int64))


def too_late(stamp):
    return stamp + 2_500_000_000


def wandered(rate):
    """A bias until the first start."""
    return rate + np.outer(WHOLE.imu.seconds < 12.0, [0.0, 0.0, 0.05])


ALIKE = [  # channel, what its fields become, the only faults that may be told, what is not told
    (JOINTS, {'rate': rounded(0.1)}, {'rate_steps'}, ''),
    (JOINTS, {'rate': rounded(0.02)}, set(), ''),
    (JOINTS, {'rate': counted}, {'rate_steps'}, ''),
    (JOINTS, {'rate': one_dead_among_coarse}, {'rate_frozen', 'rate_steps'}, ''),
    (JOINTS, both(lambda v: np.where(since(120.0) & [[0, 0, 1, 0]], math.nan, v)), set(), ''),
    (JOINTS, {'rate': damaged}, set(), ''),
    (JOINTS, {'rate': lambda v: v[:, [0, 1, 0, 1]]}, set(), ''),  # an encoder for each side
    (JOINTS, {'torque': jerks}, set(), ''),
    (JOINTS, {'torque': rounded(1.0)}, set(), ''),
    (IMU, {'force': scattered(0.4)}, {'imu_noise'}, 'yaw of the IMU below'),
    (IMU, {'force': by(math.nan), 'absent': lambda _: ('force',)}, set(), 'no linear_acceleration'),
    (IMU, {'stamp': jittered}, set(), ''),
    (IMU, {'stamp': too_late, 'log_time': too_late}, set(), 'or stamps more than 2 s off'),
    (IMU, {'rate': rounded(0.1)}, {'imu_noise'}, ''),
    (IMU, {'rate': scattered(0.1)}, {'imu_noise'}, ''),
    (IMU, {'rate': wandered}, set(), ''),
    (REFERENCE, {'velocity': rounded(0.05)}, {'covariance'}, ''),
    (REFERENCE, {'velocity': lambda v: np.where(TWICE, 0.0, v)}, set(), ''),
    (*stays(REFERENCE, 'velocity', since=0.0, until=15.0), set(), ''),
    (*stays(SINKAGE, 'sinkage', since=0.0, until=15.0), set(), ''),
    (SINKAGE, {'sinkage': by(0.0)}, set(), ''),  # on firm ground
    (SINKAGE, {'sinkage': lambda v: v - BELOW}, set(), ''),  # half of the wheels
    (SINKAGE, {'sinkage': rounded(0.005)}, set(), ''),
    (SINKAGE, {'sinkage': scattered(0.06)}, set(), ''),
    (SINKAGE, {'sinkage': lambda v: scattered(0.2)(0.0 * v + 0.05)}, set(), 'a wrong unit'),
]


@pytest.mark.parametrize(('channel', 'changes', 'allowed', 'untold'), ALIKE)
def test_what_looks_like_a_fault_is_none(channel, changes, allowed, untold):
    sensor = getattr(WHOLE, channel)
    changed = {field: change(getattr(sensor, field)) for field, change in changes.items()}
    report = rolling.checked(**{channel: replace(sensor, **changed)})
    assert {finding.fault for finding in report.findings} <= allowed
    assert not untold or any(untold in entry.reason for entry in report.not_checked)
    frozen = {finding.wheel for finding in report.findings if finding.fault == 'rate_frozen'}
    assert frozen == ({RL} if 'rate_frozen' in allowed else set())


def test_inches_of_sinkage_are_not_surely_centimetres():
    (told,) = rolling.checked(sinkage={'sinkage': WHOLE.sinkage.sinkage / 0.0254}).findings
    assert told.fault == 'sinkage_unit' and told.confidence < 0.8
    assert 'inches' in told.words and 'centimetres' in told.words


def test_wild_samples_of_a_gyro_are_told_in_any_unit():
    rate = np.degrees(WHOLE.imu.rate)
    rate[500::900] += math.degrees(20.0)
    told = rolling.checked(imu={'rate': rate}).findings
    (finding,) = (f for f in told if f.fault == 'imu_wild')
    assert finding.words.startswith('6 samples') and 'rad/s' in finding.words
