# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The whole estimator on short drives: signs, situations, missing inputs, rigs at the edge."""

import math
from dataclasses import fields, replace

import numpy as np
import pytest
from estimate_sets import assert_sound
from parts import SAND, drive, step_inputs

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.estimation.core import EstimatorCore
from wheel_terra_estimator.estimation.estimates import SlipClass
from wheel_terra_estimator.estimation.filter.ekf import GatedFilter
from wheel_terra_estimator.estimation.filter.state import SPEED
from wheel_terra_estimator.estimation.judgement.stuck.monitor import StuckMonitor
from wheel_terra_estimator.estimation.measurements import (
    InertialReading,
    LeavingAngleReading,
    ReferenceVelocity,
    SinkageReading,
    StepInputs,
    WheelOdometry,
)
from wheel_terra_estimator.estimation.wheel_soil_estimator import WheelSoilEstimator
from wheel_terra_estimator.simulation.drive import simulate
from wheel_terra_estimator.simulation.scenario import load
from wheel_terra_estimator.terramechanics.contact_law import LAWS
from wheel_terra_lab.evaluation import kinds
from wheel_terra_lab.evaluation.runner import inputs_of_mode

NAMES = {
    WheelOdometry: 'wheel_odometry',
    InertialReading: 'inertial',
    SinkageReading: 'sinkage',
    ReferenceVelocity: 'reference',
}


def merged(measurements):
    by_stamp = {}
    for m in measurements:
        by_stamp.setdefault(m.stamp, {})[NAMES[type(m)]] = m
    return [(stamp, StepInputs(**by_stamp[stamp])) for stamp in sorted(by_stamp)]


def estimate(drive, mode='reference', estimator=None):
    estimator = estimator or WheelSoilEstimator(drive.configuration)
    sets = []
    for stamp, inputs in merged(inputs_of_mode(drive.arrivals, mode)):
        estimator.step(stamp, inputs)
        if inputs.wheel_odometry is not None:
            sets.append(estimator.estimates())
    return sets


@pytest.fixture(scope='module')
def plain_drive():
    return drive()


def fault(kind, wheel, start, end):
    """Keys of a scenario in which one wheel has a fault from start to end [s]."""
    values = {'kind': kind, 'wheel': wheel, 'start': start, 'end': end}
    return {f'faults.{name}': [value] for name, value in values.items()}


def after_ten_seconds(kind, duration, mode):
    """Return sets of a drive of the bench, their rows in the truth, and the drive."""
    d = simulate(load({**kinds.KINDS[kind], 'duration': duration, 'sensors.jitter': 0.0}), 1000)
    row = {int(stamp): i for i, stamp in enumerate(d.truth.stamp)}
    sets = [s for s in estimate(d, mode) if s.stamp in row][100:]
    return sets, [row[s.stamp] for s in sets], d


def last(values, seconds=3):
    return np.mean(values[-10 * seconds :], axis=0)


def assert_followed(sets, truth):
    slip, pull = (last([getattr(s, name) for s in sets]) for name in ('slip', 'drawbar_pull'))
    assert slip == pytest.approx(last(truth.slip), abs=0.08)
    load = truth.normal_load.mean()
    assert pull == pytest.approx(last(truth.drawbar_pull), abs=0.05 * load)


@pytest.mark.parametrize(
    ('slope', 'speed'),
    [
        (8.0, 0.05),  # the climb
        (-4.0, -0.05),
        pytest.param(-4.0, 0.05, marks=pytest.mark.slow),
        pytest.param(4.0, -0.05, marks=pytest.mark.slow),
    ],
)
def test_each_quadrant_has_the_right_signs(slope, speed, climb, climbed):
    if slope == 8.0:
        sets, truth = climbed[1], climb.truth
    else:
        run = drive(5.5, **{'slope.angle_deg': [slope], 'drive.forward': [speed]})
        sets, truth = estimate(run), run.truth
    assert_followed(sets, truth)
    assert np.sign(last([s.drawbar_pull for s in sets]).sum()) == np.sign(slope)
    assert last([s.forward_velocity for s in sets]) * speed > 0.0
    assert last([s.slip_velocity for s in sets]) == pytest.approx(
        last(truth.slip_velocity), abs=0.004
    )
    assert not any(s.stuck for s in sets)


def test_missing_inputs_widen_the_deviations_and_are_said(climb, climbed):
    start = replace(climb, arrivals=climb.arrivals[: len(climb.arrivals) // 4])
    for mode, key, field in (
        ('no_reference', 'reference', 'slip_std'),
        ('no_torque', 'torque', 'drawbar_pull_std'),
        ('no_sinkage', 'sinkage', 'sinkage_std'),
        ('no_orientation', 'orientation', None),
    ):
        poor = estimate(start, mode)[-1]
        full = next(s for s in climbed[1] if s.stamp == poor.stamp)
        assert key in poor.faults
        assert key not in full.faults
        if field is not None:
            assert getattr(poor, field).mean() > getattr(full, field).mean()


@pytest.mark.parametrize('law', LAWS[1:])
def test_each_contact_law_follows_a_climb_with_a_reference(climb, climbed, law):
    assert climb.configuration.rover.contact_law == LAWS[0]
    configuration = climb.configuration.replace({'rover.contact_law': law})
    sets = estimate(climb, estimator=WheelSoilEstimator(configuration))
    pairs = zip(sets, climbed[1], strict=True)
    assert any((s.slip != default.slip).any() for s, default in pairs)
    assert_followed(sets, climb.truth)


def test_a_soil_configured_by_mistake_does_not_bias_slip_and_sinkage():
    d = simulate(load({**kinds.KINDS['climb'], 'duration': 8.0, 'sensors.jitter': 0.0}), 1000)
    snow = reader.load(['generic_six_wheel', 'snow_us'])  # 60 times softer, 3 cm deep
    sets = estimate(d, estimator=WheelSoilEstimator(snow))
    slip, sinkage = (last([getattr(s, name) for s in sets]) for name in ('slip', 'sinkage'))
    assert slip == pytest.approx(last(d.truth.slip), abs=0.05)
    assert sinkage == pytest.approx(last(d.truth.sinkage), abs=0.004)


def test_the_slip_that_is_usual_at_a_torque_tells_the_speed_where_no_reference_does(climb):
    def told(mode, torque=1.0):
        estimator = WheelSoilEstimator(climb.configuration)
        for stamp, inputs in merged(
            inputs_of_mode(climb.arrivals[: len(climb.arrivals) // 4], mode)
        ):
            if (odometry := inputs.wheel_odometry) is not None:
                turned = replace(odometry, torque=torque * odometry.torque)
                inputs = replace(inputs, wheel_odometry=turned)
            estimator.step(stamp, inputs)
        rims = estimator._speed.state.rims
        return estimator._speed_by_torque(rims), rims.typical

    assert told('reference')[0] is None and told('no_reference', math.nan)[0] is None
    usual, rim = told('no_reference')
    assert 0.5 * rim < usual.speed < rim  # up 8 degrees it slips
    assert 0.0 < usual.variance < (0.5 * rim) ** 2


def test_the_warning_sees_the_deviation_of_the_slip_without_the_bend_of_the_curve(
    climb, monkeypatch
):
    seen, update = [], StuckMonitor.update

    def noted(monitor, time, motion):
        seen.append([wheel.slip_std for wheel in motion.wheels])
        return update(monitor, time, motion)

    monkeypatch.setattr(StuckMonitor, 'update', noted)
    start = replace(climb, arrivals=climb.arrivals[: len(climb.arrivals) // 4])
    for mode, least, most in (('no_reference', 1.5, 4.0), ('reference', 1.0, 1.0)):
        published = estimate(start, mode)[-1].slip_std
        widened = published / seen[-1]
        assert least <= widened.min() and widened.max() <= most


def test_snapshot_comes_back_to_the_bit(climb):
    inputs = merged(a.measurement for a in climb.arrivals)
    estimator = WheelSoilEstimator(climb.configuration)
    for stamp, given in inputs[:200]:
        estimator.step(stamp, given)
    memory = estimator.snapshot()
    ends = []
    for _ in range(2):
        for stamp, given in inputs[200:260]:
            estimator.step(stamp, given)
        ends.append(estimator.estimates())
        estimator.restore(memory)
    for entry in fields(ends[0]):
        assert np.array_equal(getattr(ends[0], entry.name), getattr(ends[1], entry.name))


def test_new_run_keeps_the_soil_only_when_asked(climb, climbed):
    estimator = WheelSoilEstimator(climb.configuration)
    start = estimator.estimates().soil
    estimator.restore(climbed[2].snapshot())
    learned = estimator.estimates()
    steepest = estimator._climb.state  # what the ground was seen to carry, and at which slip
    assert steepest.demand == pytest.approx(np.sin(np.radians(8.0)), rel=0.1)
    assert steepest.slip == pytest.approx(last(climb.truth.slip).mean(), abs=0.15)
    estimator.begin_run(learned.stamp + 10**9, keep_soil=True)
    kept = estimator.estimates()
    assert kept.soil == pytest.approx(learned.soil)
    assert (kept.soil_std >= learned.soil_std).all()
    assert (kept.slip_class == SlipClass.UNKNOWN).all()
    estimator.begin_run(learned.stamp + 2 * 10**9, keep_soil=False)
    assert estimator.estimates().soil == pytest.approx(start)


def test_rest_holds_slip_and_says_unknown():
    run = drive(5.5, **{'drive.time': [0.0, 2.0, 2.1], 'drive.forward': [0.05, 0.05, 0.0]})
    sets = estimate(run)
    at_rest = sets[-20:]
    assert all((s.slip_class == SlipClass.UNKNOWN).all() for s in at_rest)
    assert all(np.array_equal(s.slip, at_rest[0].slip) for s in at_rest)
    assert abs(at_rest[-1].forward_velocity) < 1e-3


def test_locked_wheels_that_slide_have_slip_minus_one():
    estimator, zero = WheelSoilEstimator(reader.load(SAND)), np.zeros(6)
    for i in range(50):
        speed = 0.03 if i % 5 == 0 else None
        estimator.step(*step_inputs(0.1 * i, zero, zero, (-1.7, 0.0, 9.6), speed))
    s = estimator.estimates()
    assert s.slip == pytest.approx(-np.ones(6))
    assert (s.slip_class != SlipClass.UNKNOWN).all()
    assert not s.stuck
    assert s.forward_velocity == pytest.approx(0.03, abs=0.005)


def test_wheel_without_load_is_found_by_its_torque_and_taken_back():
    run = drive(8.0, 2, **{'slope.angle_deg': [5.0]}, **fault('lifted', 'front_left', 2.5, 5.0))
    sets, truth = estimate(run), run.truth
    lifted, after = slice(40, 48), slice(69, 79)
    for part in (lifted, after):
        load = np.mean([s.normal_load for s in sets[part]], axis=0)
        assert load == pytest.approx(truth.normal_load[part].mean(axis=0), abs=25.0)
        slip = np.mean([s.slip for s in sets[part]], axis=0)
        assert slip == pytest.approx(truth.slip[part].mean(axis=0), abs=0.06)


SLIDE = 9.81 * np.sin(np.radians(20.0))  # weight along 20 degrees, of a kilogram [N]


def slid(followed):
    """Wheels turn forward on 20 degrees; from 2 s on a rover that is followed slides back."""
    estimator, sets = WheelSoilEstimator(reader.load(SAND)), []
    force = SLIDE, 0.0, 9.81 * np.cos(np.radians(20.0))
    for time in 0.1 * np.arange(90):
        told = followed and round(10 * time) % 5 == 0
        speed = float(np.clip(0.02 - 0.03 * (time - 2.0), -0.1, 0.02)) if told else None
        estimator.step(*step_inputs(time, np.full(6, 0.4), np.full(6, 20.0), force, speed))
        sets.append(estimator.estimates())
        assert_sound(sets[-1])
    return sets


def test_sliding_back_is_slip_one():
    s = slid(followed=True)[-1]
    assert s.forward_velocity == pytest.approx(-0.1, abs=0.01)
    assert s.slip == pytest.approx(np.ones(6), abs=0.0)
    assert (s.slip_class != SlipClass.UNKNOWN).all()
    assert s.stuck
    # At constant speed the pulls carry the rover's weight along the slope.
    weight = float(reader.load(SAND).rover.mass) * SLIDE
    assert s.drawbar_pull.sum() == pytest.approx(weight, rel=0.1)
    assert np.all(s.drawbar_pull_std < 0.15 * weight / np.sin(np.radians(20.0)) / 6.0)


def test_torques_alone_carry_no_rover_backwards():
    sets = slid(followed=False)
    assert min(s.forward_velocity for s in sets) > -0.002  # the least rim speed that turns
    assert np.all(sets[-1].slip_std > 0.15)  # of the slip nothing is known


def test_a_rover_that_is_stuck_stays_so_without_a_reference_until_the_ground_asks_for_less(parts):
    """On 8 degrees it digs itself in; its references end, and 9 s later the slope does."""
    estimator, rover = WheelSoilEstimator(parts.configuration), parts.rover
    torque = 0.35 * np.array(parts.cycle().loads.load) * np.array(rover.slip_radius)
    told = {}
    for time in np.arange(0.0, 21.0, 0.1):
        slope = math.radians(8.0 if time < 16.0 else 0.0)
        force = rover.gravity * np.array([math.sin(slope), 0.0, math.cos(slope)])
        speed = None if time > 7.0 else 0.002 if time > 2.5 else 0.095
        rate = 0.1 / np.array(rover.slip_radius)
        estimator.step(*step_inputs(time, rate, torque, tuple(force), speed))
        told[round(time)] = estimator.estimates()
    assert not told[2].stuck and told[2].slip.max() < 0.1
    assert all(told[time].stuck and told[time].slip.min() > 0.9 for time in range(6, 15))
    stds = [np.median(told[time].slip_std) for time in (7, 11, 15)]
    assert stds == sorted(stds), 'less and less is known'
    assert not told[20].stuck and told[20].slip.max() < 0.5


@pytest.mark.slow
def test_nothing_drifts_along_the_ridge_of_slip_and_strength():
    """One contact, looked at ten times a second, must not tell slip, strength and K apart.

    If each look counted anew, slip would be off by 0.05 and the tangent by 0.1.
    """
    sets, rows, d = after_ten_seconds('cruise', 20.0, 'no_reference')
    error = [np.nanmedian(s.slip - d.truth.slip[row]) for s, row in zip(sets, rows, strict=True)]
    assert np.sqrt(np.mean(np.square(error))) < 0.035
    found = dict(zip(sets[-1].soil_names, sets[-1].soil, strict=True))
    nominal = d.configuration.soil
    tangent = np.tan(np.radians(found['soil.friction_angle_deg']))
    assert abs(np.log(tangent / np.tan(nominal.friction_angle))) < 0.06
    assert abs(np.log(found['soil.shear_modulus'] / nominal.shear_modulus)) < 0.06


def test_a_wheel_sunk_to_its_hub_is_followed(plain_drive):
    d = plain_drive
    sunk = 0.98 * float(d.configuration.wheels.radius[0])
    half = d.arrivals[0].measurement.stamp + 3_000_000_000
    estimator = WheelSoilEstimator(d.configuration)
    for stamp, inputs in merged(inputs_of_mode(d.arrivals, 'reference')):
        if inputs.sinkage is not None and stamp > half:
            depth = inputs.sinkage.sinkage.copy()
            depth[0] = sunk
            inputs = replace(inputs, sinkage=replace(inputs.sinkage, sinkage=depth))
        estimator.step(stamp, inputs)
    found = estimator.estimates()
    assert found.sinkage[0] == pytest.approx(sunk, abs=0.003)
    assert found.sinkage[1] < 0.5 * sunk


@pytest.mark.slow
def test_sinkage_tells_weak_ground_where_no_torque_does():
    sets, rows, d = after_ten_seconds('mixed_soil', 22.0, 'no_torque')
    error = np.array([s.drawbar_pull for s in sets]) - d.truth.drawbar_pull[rows]
    std = np.array([s.drawbar_pull_std for s in sets])
    assert np.sqrt(np.nanmean(error**2)) < 0.03 * d.truth.normal_load.mean()
    assert (np.abs(error) < 1.96 * std).mean() > 0.9


def test_a_jolt_at_the_start_does_not_stop_the_speed_without_a_reference(plain_drive):
    start = min(a.measurement.stamp for a in plain_drive.arrivals)

    def jolted(arrival):
        reading = arrival.measurement
        if not isinstance(reading, InertialReading) or not 1e8 < reading.stamp - start < 4e8:
            return arrival
        force = reading.specific_force - np.array([0.3, 0.0, 0.0])
        return arrival._replace(measurement=replace(reading, specific_force=force))

    run = replace(plain_drive, arrivals=list(map(jolted, plain_drive.arrivals)))
    plain, estimated = (
        np.array([s.slip for s in estimate(one, 'no_reference')])[30:] for one in (plain_drive, run)
    )
    assert np.abs(estimated - plain).max() < 0.15


def test_wheel_rates_that_come_once_a_second_count(plain_drive):
    """Between them cycles go on without wheels; the next one may have come just before a rate."""
    d, speeds, sets = plain_drive, [], []
    for period in (100_000_000, 1_000_000_000):
        core = EstimatorCore(d.configuration)
        for m in inputs_of_mode(d.arrivals, 'no_reference'):
            if not isinstance(m, WheelOdometry) or m.stamp % period < 100_000_000:
                sets = core.add(m) or sets
        speeds.append(sets[-1].forward_velocity)
    assert speeds[0] > 0.03 and speeds[1] == pytest.approx(speeds[0], rel=0.2)


def test_a_steered_rover_is_judged_along_its_wheels():
    """On an arc the inner wheels of a steered rover are slow because they are on inner circles."""
    arcs = {
        'drive__time': [0.0, 0.5, 1.0],
        'drive__forward': [0.05, 0.05, 0.05],
        'drive__turn_rate': [0.0, 0.0, 0.05],
    }
    drive = simulate(load('steered_turns', **arcs), 4, duration=4.0)
    truth, configuration = drive.truth, drive.configuration
    turning = np.abs(truth.yaw_rate) > 0.03
    assert turning.sum() > 25
    errors = []
    for told in (True, False):
        core, found = EstimatorCore(configuration), {}
        for arrival in drive.arrivals:
            measurement = arrival.measurement
            if isinstance(measurement, WheelOdometry) and not told:
                measurement = replace(measurement, steering=None)
            found.update((s.stamp, s.slip) for s in core.add(measurement))
        rows = [i for i in np.flatnonzero(turning) if int(truth.stamp[i]) in found]
        error = [found[int(truth.stamp[i])] - truth.slip[i] for i in rows]
        errors.append(float(np.sqrt(np.mean(np.square(error)))))
    assert errors[0] < 0.06
    assert errors[0] < 0.4 * errors[1]


def test_what_a_standing_wheel_pulled_is_forgotten_when_all_have_stood():
    estimator, pulls = WheelSoilEstimator(reader.load(SAND)), []
    for i in range(60):
        rate = np.array([0.4 if i < 35 else 0.0] * 5 + [0.0])
        torque, speed = np.where(rate > 0.0, 4.0, -4.0), 0.1 * rate[0]
        estimator.step(*step_inputs(0.1 * i, rate, torque, (0.0, 0.0, 9.8), speed))
        pulls.append(float(estimator.estimates().drawbar_pull[5]))
    assert pulls[34] < -10.0
    assert pulls[-1] == pytest.approx(0.0, abs=0.1)


@pytest.mark.parametrize('wheel', ['rear_left', 'front_right'])
def test_a_drag_that_no_torque_tells_is_not_learned_as_soil(wheel):
    """Without torques one wheel locks after 5 s: the simulator gives the drag and the pulls."""
    run = drive(10.0, 3, **fault('locked', wheel, 5.0, 10.0))
    estimator, names = WheelSoilEstimator(run.configuration), run.configuration.wheels.names
    sets, locked = estimate(run, 'no_torque', estimator)[-10:], names.index(wheel)
    row = np.searchsorted(run.truth.stamp, [s.stamp for s in sets])
    error = np.array([s.drawbar_pull for s in sets]) - run.truth.drawbar_pull[row]
    std = np.array([s.drawbar_pull_std for s in sets])
    load = run.truth.normal_load.mean()
    assert run.truth.drawbar_pull[row, locked].mean() < -0.5 * load
    assert (std[:, locked] > 0.25 * load).all()
    assert np.sqrt(np.mean((error / std) ** 2)) < 3.0


# Rigs and mountings at the edge: one wheel, one axle, an IMU upside down, exact sensors.


ONE_WHEEL = ['hit_wh3', 'hit_lss1']


def run(estimator, seconds, wheels, up=9.8, gap=0.1, rate=0.4):
    sets = []
    for i in range(round(seconds / gap)):
        speed = 0.04 if gap > 1.0 or i % 10 == 5 else None
        rates, torques = np.full(wheels, rate), np.full(wheels, 2.0)
        estimator.step(*step_inputs(i * gap, rates, torques, (0.1, 0.0, up), speed))
        sets.append(estimator.estimates())
    return sets


@pytest.mark.parametrize('gap', [0.1, 2.0])
@pytest.mark.parametrize('rate', [0.0, 0.4, -3.0])
def test_a_rig_with_one_wheel_works(gap, rate):
    sets = run(WheelSoilEstimator(reader.load(ONE_WHEEL)), 50.0 * gap, 1, gap=gap, rate=rate)
    for s in sets:
        assert_sound(s)
        assert all((value > 0.0).all() for name, value in vars(s).items() if name.endswith('_std'))
    if rate > 0.0:
        rim = rate * float(reader.load(ONE_WHEEL).wheels.slip_radius[0])
        assert sets[-1].slip[0] == pytest.approx(1.0 - 0.04 / rim, abs=0.02)


def test_loads_of_an_imu_upside_down_are_not_known():
    sets = run(WheelSoilEstimator(reader.load(SAND)), 3.0, 6, up=-9.8)
    rover = reader.load(SAND).rover
    share = rover.mass * rover.gravity / 6
    assert sets[-1].normal_load_std == pytest.approx([share] * 6)
    assert sets[-1].drawbar_pull_std == pytest.approx([share] * 6)


def test_loads_have_a_deviation_even_where_the_load_model_is_said_to_be_exact():
    exact = reader.load(SAND, ['rover.load_std:=0.0'])
    for s in run(WheelSoilEstimator(exact), 3.0, 6):
        assert (s.normal_load_std > 0.0).all()
        assert (s.drawbar_pull_std > 0.0).all()


@pytest.mark.parametrize('measured', [True, False])
def test_the_error_of_the_rear_camera_counts_where_it_measures(measured):
    deviations = []
    for degrees in (0.1, 10.0):
        configuration = reader.load(SAND, [f'sensors.leaving_angle_std_deg:={degrees}'])
        estimator = WheelSoilEstimator(configuration)
        for i in range(16):
            speed = 0.045 if i % 10 == 5 else None
            stamp, given = step_inputs(0.1 * i, np.full(6, 0.4), np.full(6, 12.0), speed=speed)
            if measured:
                given = replace(given, leaving_angle=LeavingAngleReading(stamp, np.full(6, -0.2)))
            estimator.step(stamp, given)
        deviations.append(estimator.estimates().drawbar_pull_std.mean())
    if measured:
        assert deviations[1] > 1.1 * deviations[0]
    else:
        assert deviations[1] == deviations[0]


def test_noisy_rates_of_slow_wheels_do_not_weaken_the_soil():
    """Rates that scatter by 14 %: a strength fitted at those slips falls to a third of the true."""
    drive = simulate(load('calibration_drive', rover='pathfinder'), 9, duration=30.0)
    truth, estimator = drive.truth, WheelSoilEstimator(drive.configuration)
    sets = estimate(drive, estimator=estimator)[200:]  # 5 s after the start
    index = np.searchsorted(truth.stamp, [s.stamp for s in sets])
    error = np.array([s.slip for s in sets]) - truth.slip[index]
    std = np.array([s.slip_std for s in sets])
    assert np.sqrt(np.mean(error**2)) < 0.1
    assert np.mean(np.abs(error) < 1.96 * std) > 0.9
    learned = estimator.learned()['soil.friction_angle_deg']
    assert learned == pytest.approx(38.0, rel=0.3)  # that of the scenario


def test_references_off_by_more_than_they_state_widen_the_deviation_of_the_speed():
    """They are 1 cm/s off, to one side and the other for two seconds each; 3 mm/s is stated."""
    driven = drive(15.0, **{'sensors.reference_rate': 3.0})
    stds = []
    for error in (0.0, 0.01):
        arrivals, count = list(driven.arrivals), 0
        for i, arrival in enumerate(arrivals):
            if isinstance(m := arrival.measurement, ReferenceVelocity):
                count += 1
                off = m.forward + (error if count // 6 % 2 else -error)
                arrivals[i] = arrival._replace(measurement=replace(m, forward=off))
        sets = estimate(replace(driven, arrivals=arrivals))
        stds.append(np.sqrt(np.mean([s.forward_velocity_variance for s in sets[-100:]])))
    assert stds[1] > 2.0 * stds[0]


def test_references_at_rest_tell_nothing_of_the_noise_of_those_in_motion(parts):
    """A rover stands for 20 s before exact references; in motion they scatter by 6 mm/s."""
    estimator, rng, std = WheelSoilEstimator(parts.configuration), np.random.default_rng(2), 0.006
    rest, torque = np.zeros(6), np.full(6, 2.0)
    for i in range(600):
        moves = i >= 200
        speed = None if i % 5 else moves * (0.05 + std * rng.normal())
        rate = moves * 0.05 / np.array(parts.rover.slip_radius)
        estimator.step(*step_inputs(0.1 * i, rate + rest, torque, (0.0, 0.0, 9.8), speed))
        if i == 199:
            assert estimator._noise.observed('reference') is None
    assert estimator._noise.observed('reference') == pytest.approx(std, rel=0.3)


def test_slip_does_not_jump_when_references_end(parts):
    """They show a slip of 0.5; wheels with such a torque usually slip by 0.1."""
    estimator, rover = WheelSoilEstimator(parts.configuration), parts.rover
    torque = 0.25 * np.array(parts.cycle().loads.load) * np.array(rover.slip_radius)
    slips = []
    for i in range(300):
        speed = 0.05 if i % 5 == 0 and i <= 200 else None
        estimator.step(
            *step_inputs(0.1 * i, 0.1 / np.array(rover.slip_radius), torque, speed=speed)
        )
        slips.append(float(np.median(estimator.estimates().slip)))
    assert np.abs(np.diff(slips[200:])).max() < 0.02


@pytest.mark.parametrize(
    ('side', 'age', 'moves'), [(0.0, 1.0, True), (1.0, 1.0, False), (1.0, 10.0, True)]
)
def test_forces_that_references_contradict_do_not_move_the_speed(parts, side, age, moves):
    """Torques double on the same slope, as in a bog, some time after the last reference [s].

    `side`: mean of the normalised innovations of the references.
    """
    rover, estimator = parts.rover, WheelSoilEstimator(parts.configuration)
    lever = np.array(parts.cycle().loads.load) * np.array(rover.slip_radius)
    speeds = []
    for i in range(210 + round(10 * age)):
        if i == 200:
            update = estimator._reference
            update.state = update.state._replace(mean_innovation=side)
        speed = 0.09 if i % 10 == 0 and i < 200 else None
        torque = (0.2 if i < 200 + 10 * age else 0.45) * lever
        rates = 0.1 / np.array(rover.slip_radius)
        estimator.step(*step_inputs(0.1 * i, rates, torque, speed=speed))
        speeds.append(float(estimator._ekf.x[SPEED]))
    assert (speeds[-11] - speeds[-1] > 0.003) == moves


@pytest.mark.parametrize('speed', [0.09, -0.05])
def test_forces_of_wheels_that_turn_against_the_motion_do_not_tell_its_speed(
    parts, monkeypatch, speed
):
    """Sand slides back under them as fast as it will: the friction is the same."""
    held, fuse = [], GatedFilter.fuse
    monkeypatch.setattr(
        GatedFilter, 'fuse', lambda ekf, rows, kept=(): held.append(kept) or fuse(ekf, rows, kept)
    )
    rover, estimator = parts.rover, WheelSoilEstimator(parts.configuration)
    torque = 0.2 * np.array(parts.cycle().loads.load) * np.array(rover.slip_radius)
    for i in range(200):
        rates = 0.1 / np.array(rover.slip_radius)
        estimator.step(*step_inputs(0.1 * i, rates, torque, speed=None if i % 5 else speed))
    assert estimator._ekf.x[SPEED] * speed > 0.0
    assert (SPEED in [entry for kept in held[-5:] for entry in kept]) == (speed < 0.0)
