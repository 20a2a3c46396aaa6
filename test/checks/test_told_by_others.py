# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Faults that one channel alone does not show, beside what imitates them."""

from dataclasses import replace

import numpy as np
import pytest
import rolling_rover as rolling
from rolling_rover import checked, faults
from scipy.spatial.transform import Rotation

from wheel_terra_estimator.checks.clocks import Lag
from wheel_terra_estimator.checks.evidence import acceleration_fits, gather
from wheel_terra_estimator.checks.names import check_wheel_names
from wheel_terra_estimator.checks.rover_facts import from_configuration
from wheel_terra_estimator.checks.series import rows_of
from wheel_terra_estimator.checks.statistics import Trial
from wheel_terra_estimator.checks.turning import Fix, Turning, fits_of

WHOLE = rolling.recording()
HALF, NAMES = rolling.HALF_TRACK, rolling.NAMES
START = WHOLE.joints.stamp[0]


def of_whole(channel, change):
    series = getattr(WHOLE, channel)
    return {
        'stamp': START + change(series.stamp - START),
        'log_time': START + change(series.log_time - START),
    }


@pytest.mark.parametrize(
    ('times', 'right', 'wrong'), [(1000, 'milliseconds', 's'), (1e-3, 's', 'milliseconds')]
)
def test_a_log_in_another_unit_of_time_is_that_alone(times, right, wrong):
    def other(since_start):
        return np.round(since_start * times).astype(np.int64)

    names = 'joints', 'imu', 'sinkage', 'reference'
    (told,) = checked(**{name: of_whole(name, other) for name in names}).findings
    assert told.fault == 'time_unit' and told.value == pytest.approx(1.0 / times)
    assert f'times in {right} were taken for {wrong}' in told.words


@pytest.mark.parametrize('name', ['joints', 'reference'])
def test_a_second_publisher_with_the_same_stamps(name):
    series = getattr(WHOLE, name)
    twice = rows_of(series, np.repeat(np.arange(series.stamp.size), 2))
    blank = np.arange(twice.stamp.size) % 2 == 0
    fields = ('rate', 'torque') if name == 'joints' else ('velocity', 'yaw_rate')
    for field in fields:
        values = getattr(twice, field).copy()
        values[blank] = 0.0
        twice = replace(twice, **{field: values})
    arrival = twice.log_time + 1_000_000 * (np.arange(twice.stamp.size) % 2)
    (told,) = checked(**{name: replace(twice, log_time=arrival)}).findings
    assert told.fault == 'two_publishers' and told.topic == series.topic
    assert f'{series.stamp.size} messages' in told.words or name == 'joints'


def test_wheels_that_hardly_change_do_not_make_copies_of_others():
    """Each side on one encoder, the left one of which changes every ten seconds."""
    rate = WHOLE.joints.rate[:, [0, 1, 0, 1]].copy()
    rate[:, [0, 2]] = rate[np.arange(len(rate)) // 100 * 100][:, [0, 2]]
    assert 'copied' not in faults(checked(joints={'rate': rate}))
    seldom = WHOLE.joints.rate.copy()
    seldom[:, 0] = rate[:, 0]
    seldom[:, 3] = seldom[:, 1]
    told = [f.wheel for f in checked(joints={'rate': seldom}).findings if f.fault == 'copied']
    assert told == [f'{NAMES[1]}, {NAMES[3]}']


@pytest.mark.parametrize('lost', [0.0, 0.3])
def test_the_gyro_beside_rates_that_come_unevenly_turns_as_the_rover_does(lost):
    """Turns that start and stop all along, also between two messages of the wheels."""
    weave = np.arange(0.0, 200.0, 1.3), 0.6 * (np.arange(154) % 2) - 0.2
    whole = rolling.driven(200.0, ([0.0, 5.0], [0.0, 0.3]), yaw=weave)
    kept = np.random.default_rng(7).uniform(size=whole.joints.stamp.size) >= lost
    heard = replace(whole, joints=rows_of(whole.joints, kept))
    evidence = gather(heard, from_configuration(rolling.rover()), {})
    for seen in (evidence, evidence.rows(np.arange(evidence.time.size) % 4 == 0)):
        at = np.append(0.0, seen.time)
        true = np.interp(
            at, whole.joints.seconds, np.cumsum(np.interp(seconds_of(whole), *weave)) * 0.1
        )
        off = np.cumsum(seen.gyro[1:, 2] * np.diff(seen.time)) - (true[2:] - true[1])
        assert np.abs(off).max() < 0.06


def seconds_of(whole):
    return whole.joints.seconds


def weaving(yaw=0.35):
    """Curves to both sides on a slope that the rover climbs, never straight for long."""
    time = np.arange(0.0, 160.0, 1.0 / rolling.RATE)
    turn = yaw * np.sin(0.5 * time) * (time > 8.0)
    slope = 0.08 + 0.03 * np.sin(0.11 * time)
    return rolling.Motion(time, np.interp(time, [2, 4], [0, 0.3]), turn, slope)


def test_reversed_torques_of_all_wheels_are_so_where_curves_hide_some():
    """The sides push against each other in curves, which slopes along them seem to change."""
    whole = rolling.recording(weaving(0.05))
    push = 2.0 * np.sin(0.5 * whole.joints.seconds)[:, None] * [-1.0, 1.0, -1.0, 1.0]
    push += 3.0 * (np.sin(0.11 * whole.joints.seconds))[:, None] * [-1.0, 0.0, 0.0, 0.0]
    told = checked(whole=whole, joints={'torque': -whole.joints.torque - push}).findings
    assert [f.wheel for f in told if f.fault == 'torque_sign'] == [', '.join(NAMES)]
    right = checked(whole=whole, joints={'torque': whole.joints.torque + push})
    assert 'torque_sign' not in faults(right)


def test_straights_and_spins_whose_turns_no_gyro_sees_are_told_apart_by_the_reference():
    """A left side that counts backwards has one for the other."""
    straight = np.arange(400) // 50 % 2 == 0
    ahead = np.where(straight, 0.2, 0.0) + 0.01 * np.random.default_rng(2).standard_normal(400)
    speed = np.where(straight[:, None], 0.2, [-0.2, 0.2, -0.2, 0.2])
    right, backwards = Fix((1, 1, 1, 1)), Fix((1, -1, 1, -1))
    nothing = np.zeros(400)
    for sign, true in ((1.0, right), (-1.0, backwards)):
        read = speed * [sign, 1.0, sign, 1.0]
        stretch = Turning(read, nothing, np.zeros(4), True, np.ones(read.shape), ahead)
        costs = {
            fix: fit.cost
            for fix, fit in zip(
                (right, backwards), fits_of([right, backwards], stretch), strict=True
            )
        }
        other = backwards if true is right else right
        assert costs[true] < costs[other] - 0.2
        mute = [fit.cost for fit in fits_of([right, backwards], replace(stretch, ahead=nothing))]
        assert mute[0] == pytest.approx(mute[1])


@pytest.mark.parametrize('reversed_wheel', [None, 0])
def test_sides_that_stand_in_turns_have_a_sign(reversed_wheel):
    """Turns about the right side, whose wheels creep back a little, as in sand."""
    time = np.arange(0.0, 160.0, 1.0 / rolling.RATE)
    about = (time > 60.0) & (time < 130.0)
    speed = np.where(about, 0.0, np.interp(time, [2.0, 4.0], [0.0, 0.2]))
    whole = rolling.recording(rolling.Motion(time, speed, 0.0 * time, 0.0 * time))
    rate = np.where(about[:, None], [1.0, -0.02, 1.0, -0.02], whole.joints.rate)
    rate += 0.004 * np.random.default_rng(3).standard_normal(rate.shape)
    if reversed_wheel is not None:
        rate[:, reversed_wheel] *= -1.0
    told = checked(whole=whole, joints={'rate': rate}).findings
    assert 'rates_unsigned' not in [f.fault for f in told]


SORTED = [
    ('left_front', 'right_front', 'left_rear', 'right_rear'),
    ('axle_1_left', 'axle_1_right', 'axle_2_left', 'axle_2_right'),
    ('wheel_0_l', 'wheel_0_r', 'wheel_1_l', 'wheel_1_r'),
    ('frontLeft', 'frontRight', 'backLeft', 'backRight'),
    ('wheel_1', 'wheel_2', 'wheel_3', 'wheel_4'),
    ('lf', 'rf', 'lb', 'rb'),
]


@pytest.mark.parametrize('order', [(0, 1, 2, 3), (2, 0, 3, 1), (3, 1, 2, 0)])
@pytest.mark.parametrize('names', SORTED)
def test_other_names_of_wheels_keep_their_places(names, order):
    """However the message lists them: front to rear, left before right."""
    renamed = [f'{name}_wheel_joint' for name in NAMES]
    facts = from_configuration(rolling.rover(**{'wheels.names': renamed}))
    joints = replace(WHOLE.joints, names=tuple(names[i] for i in order))
    _, found = check_wheel_names(replace(WHOLE, joints=joints), facts)
    assert found.names == names


def test_counts_that_come_now_and_then_are_no_second_publisher():
    """A count a message, over the time between the readings of the counter."""
    random, joints = np.random.default_rng(5), WHOLE.joints
    seconds = joints.seconds
    read = seconds + 0.03 * random.uniform(-1.0, 1.0, seconds.size)
    angle = np.cumsum(np.abs(joints.rate) * 0.1, axis=0)
    step = 0.12
    seen = np.column_stack([np.interp(read, seconds, one) for one in angle.T])
    counts = np.floor(seen / step + random.uniform(size=4))
    rate = np.diff(counts, axis=0, prepend=counts[:1]) * step / np.diff(read, prepend=-0.1)[:, None]
    told = faults(checked(joints={'rate': rate * np.sign(joints.rate)}))
    assert 'rate_zeros' not in told and told
    lost = WHOLE.joints.rate.copy()
    lost[random.choice(len(lost), 120, replace=False), 1] = 0.0
    assert 'rate_zeros' in faults(checked(joints={'rate': lost}))


@pytest.mark.parametrize('repeats', [1, 2])
def test_a_sinkage_in_steps_below_its_noise_that_stays(repeats):
    """A camera of half a millimetre; on its noise each reading, or every other, is another."""
    step, sinkage = 0.0006, WHOLE.sinkage
    rows = np.arange(sinkage.stamp.size) // repeats * repeats
    values = step * np.round(sinkage.sinkage[rows] / step)
    assert 'sinkage_frozen' not in faults(checked(sinkage={'sinkage': values}))
    stays = (sinkage.seconds > 40.0) & (sinkage.seconds < 75.0)  # over a stop
    values[stays, 2] = values[stays, 2][0]
    (told,) = checked(sinkage={'sinkage': values}).findings
    assert (told.fault, told.wheel) == ('sinkage_frozen', NAMES[2])


def test_accelerations_of_few_slow_curves_are_known_no_better_than_they_are():
    """Cross slopes that the heading turns: a rover that drives curves feels both, of one size."""
    off = []
    for seed in range(24):
        random = np.random.default_rng(seed)
        time = np.arange(0.0, 150.0, 1.0 / rolling.RATE)
        yaw = np.where((time > 40.0) & (time < 110.0), 0.25 * np.sign(np.sin(0.2 * time)), 0.0)
        ground = random.normal(0.0, 0.03, 76)
        roll = np.interp(time, np.arange(0.0, 152.0, 2.0), ground)
        whole = rolling.recording(rolling.Motion(time, 0.1 * (time > 3.0), yaw, 0.0 * time), seed)
        force = whole.imu.force.copy()
        force[:, 1] += rolling.GRAVITY * np.interp(whole.imu.seconds, time, roll)
        imu = replace(whole.imu, force=force)
        facts = from_configuration(rolling.rover())
        _, across = acceleration_fits(gather(replace(whole, imu=imu), facts, {}))
        off.append(abs(across.value - 1.0) / across.std)
    assert np.mean(np.array(off) > 2.0) < 0.1, sorted(off)


@pytest.mark.parametrize('sense', [1.0, -1.0])
def test_an_orientation_that_leans_the_wrong_way_is_told_by_slopes(sense):
    """Uphill the nose points up: about y by less than nothing (REP 103)."""
    motion = rolling.ten_minute_drive()
    angles = np.column_stack([np.cumsum(motion.yaw_rate) * 0.1, -sense * motion.slope])
    at = np.column_stack([np.interp(WHOLE.imu.seconds, motion.time, one) for one in angles.T])
    oriented = Rotation.from_euler('ZY', at).as_quat()
    told = checked(imu={'orientation': oriented}).findings
    assert [f.fault for f in told] == ([] if sense > 0.0 else ['orientation'])
    assert all('leans' in f.words for f in told)


@pytest.mark.parametrize('deep', [0.016, 0.009])
def test_a_zero_of_one_wheel_is_not_that_of_the_one_beside_it(deep):
    """A front axle that sinks a centimetre less than the rear one, of which the left reads more."""
    sinkage = WHOLE.sinkage.sinkage - rolling.DEPTH + [deep, deep, deep + 0.012, deep + 0.012]
    assert 'sinkage_zero' not in faults(checked(sinkage={'sinkage': sinkage}))
    told = checked(sinkage={'sinkage': sinkage + np.array([0.012, 0.0, 0.0, 0.0])}).findings
    sure = [f.wheel for f in told if f.confidence > 0.5]
    assert sure in ([], [NAMES[0]]) and all(NAMES[0] in f'{f.wheel} {f.words}' for f in told)


@pytest.mark.parametrize(('left', 'counts'), [(0.47, False), (0.2, True)])
def test_a_lag_that_both_halves_show_has_to_explain_something(left, counts):
    """Two halves may agree by chance where turns of wheels and gyro are half unlike all along."""
    evidence = gather(WHOLE, from_configuration(rolling.rover()), {})
    lag = Lag(-0.48, 'turns', (-0.482, -0.478), Trial(0.476, left))
    assert lag.counts(evidence, 'imu') == counts
