# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Kinds of drives load; seeds are apart; baselines do what they are called."""

from dataclasses import replace

import numpy as np
import pytest

from wheel_terra_estimator.cli.main import main
from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.estimation.measurements import (
    InertialReading,
    ReferenceVelocity,
    WheelOdometry,
)
from wheel_terra_estimator.simulation.scenario import load
from wheel_terra_estimator.simulation.sensors import Arrival
from wheel_terra_lab.evaluation import baselines, bench, kinds, simulators, tables
from wheel_terra_lab.evaluation.runner import inputs_of_mode
from wheel_terra_lab.evaluation.two_state_filters import slip_course


@pytest.mark.parametrize('name', [*kinds.KINDS, 'firm', 'limiter'])
def test_every_kind_is_a_scenario(name):
    extra = {'firm': kinds.FIRM, 'limiter': kinds.LIMITER}
    scenario = load(dict(extra.get(name) or kinds.KINDS[name]))
    # The simulated soil knows effects that the estimator is not told of.
    assert set(scenario.truth.effects) > set(scenario.configuration.effects)


def test_tuning_and_test_seeds_are_apart():
    assert not set(kinds.TUNING_SEEDS) & set(kinds.TEST_SEEDS)
    assert len(kinds.TEST_SEEDS) >= 20


@pytest.mark.parametrize('kind', ['wheel_faults', 'scenarios/stalled_wheel'])
def test_another_rover_drives_any_kind_and_any_scenario_of_the_own_world(kind):
    drive = simulators.SIMULATORS['A'].simulate(kind, 1000, 1.0, 'frostyboy')
    assert drive.configuration.wheels.count == 4
    assert drive.configuration.rover.mass == reader.load(['frostyboy']).rover.mass
    assert drive.truth.slip.shape[1] == 4
    own = simulators.SIMULATORS['A'].simulate(kind, 1000, 1.0, None)
    assert drive.configuration.soil == own.configuration.soil


@pytest.mark.parametrize(
    ('options', 'words'),
    [
        (['--rover', 'hit_lss1'], 'not a rover file'),
        (['--rover', 'frosty'], 'frostyboy'),
        (['--rover', 'frostyboy', '--simulator', 'B', '--kinds', 'climb'], '--simulator A'),
        (['--rover', 'frostyboy', '--limiter'], '--limiter'),
        (['--kinds', 'scenarios/stalled'], 'stalled_wheel'),
        (['--config', 'frostyboy'], 'give it as --rover'),
        (['--config', 'frosty'], 'frostyboy'),
        (['-p', 'filter.clas_std:=0.1'], 'filter.class_std'),
        (['-p', 'filter.class_std:=0.1', '--limiter'], '--limiter'),
    ],
)
def test_what_is_no_rover_and_no_scenario_is_refused_before_the_first_drive(
    options, words, refused
):
    refused(['evaluate', '--seeds', '1', *options], words)


def test_the_estimator_is_told_of_config_and_parameters_and_the_drive_is_not(monkeypatch, printed):
    estimators, drives = [], []

    def score(simulator, kind, seed, mode, drive):
        estimators.append(drive.configuration)
        drives.append(drive.truth.slip)
        return bench.DriveScore(kind, seed, mode, None, None, {}, simulator)

    simulator = simulators.SIMULATORS['A']
    short = replace(
        simulator, simulate=lambda *given: simulator.simulate(given[0], given[1], 1.0, None)
    )
    monkeypatch.setitem(bench.SIMULATORS, 'A', short)
    monkeypatch.setattr(bench, 'score_mode', score)
    monkeypatch.setattr(tables, 'report', lambda *_: 'tables')
    command = ['evaluate', '--kinds', 'climb', '--seeds', '1', '--modes', 'reference']
    said = printed(command)
    assert 'told' not in said
    assert 'filter.class_std' in printed(
        [*command, '--config', 'dlr_mss', '-p', 'filter.class_std:=0.1']
    )
    plain, told = estimators
    assert told.filter.class_std == 0.1 and plain.filter.class_std != 0.1
    assert told.soil.cohesion == reader.load(['dlr_mss'], complete=False).soil.cohesion
    assert told.wheels.names == plain.wheels.names and plain.soil.cohesion != told.soil.cohesion
    np.testing.assert_array_equal(*drives)


def test_baselines_between_references():
    rover = reader.load(['generic_six_wheel'])
    measurements, stamps = [], []
    level = np.array([0.0, 0.0, 0.0, 1.0])
    for i in range(1, 21):
        stamp = 10**9 + i * 10**8
        measurements.append(InertialReading(stamp, np.array([0.1, 0.0, 9.8]), np.zeros(3), level))
        if i in (5, 15):
            measurements.append(ReferenceVelocity(stamp, 0.04 if i == 5 else 0.02, 1e-6))
        measurements.append(WheelOdometry(stamp, np.full(6, 0.4), np.full(6, np.nan)))
        stamps.append(stamp)
    stamps = np.array(stamps)
    held = baselines.held_speed(rover, measurements, stamps)
    assert held[3] == pytest.approx(0.4 * 0.125)
    assert held[13] == 0.04
    assert held[-1] == 0.02
    reckoned = baselines.dead_reckoned_speed(rover, measurements, stamps)
    assert reckoned[13] == pytest.approx(0.04 + 9 * 0.1 * 0.1, abs=0.006)


def test_modes_change_what_the_estimator_gets():
    wheels = WheelOdometry(10**9, np.array([1.0]), np.array([2.0]))
    reference = ReferenceVelocity(10**9, 0.05, 1e-6)
    inertial = InertialReading(10**9, np.zeros(3), np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))
    arrivals = [
        Arrival(10**9, wheels),
        Arrival(int(1.1e9), inertial),
        Arrival(int(1.4e9), reference),
        Arrival(int(2.9e9), replace(wheels, stamp=int(2.9e9))),
    ]
    assert list(inputs_of_mode(arrivals, 'reference')) == [a.measurement for a in arrivals]
    assert reference not in list(inputs_of_mode(arrivals, 'no_reference'))
    assert list(inputs_of_mode(arrivals, 'reference_2s_late'))[-1] is reference
    assert np.isnan(next(inputs_of_mode(arrivals, 'no_torque')).torque).all()
    assert list(inputs_of_mode(arrivals, 'no_orientation'))[1].orientation is None


def _straight(demand):
    return 0.1 + 0.8 * demand


def _curved(demand):
    """Janosi and Hanamoto: the slip runs away where the demand comes near the greatest one."""
    return 0.02 - 0.3 * np.log(1.0 - demand / 0.4)


def _two_state_drive(noise=0.0, delay=4, law=_straight):
    """Slip by a law of the mean torque over W r; references `delay` rows late."""
    rover = reader.load(['generic_six_wheel'])
    generator = np.random.default_rng(3)
    weight = rover.rover.mass * rover.rover.gravity
    radius, rate = rover.wheels.slip_radius, 0.4
    arrivals, truth, stamps = [], [], []
    for i in range(1, 600):
        stamp = 10**9 + i * 10**8
        demand = 0.2 + 0.15 * np.sin(i / 60.0)
        torque = demand * weight / 6 * radius
        arrivals.append((stamp, WheelOdometry(stamp, np.full(6, rate), torque)))
        slip = law(demand)
        truth.append(slip)
        stamps.append(stamp)
        if i % 10 == 0:
            speed = (1.0 - slip) * rate * radius[0] + noise * generator.standard_normal()
            arrivals.append((stamp + delay * 10**8 + 1, ReferenceVelocity(stamp, speed, 1e-6)))
    arrivals.sort(key=lambda pair: pair[0])
    return rover, [m for _, m in arrivals], np.array(stamps), np.array(truth)


@pytest.mark.parametrize('delay', [0, 15])
def test_two_states_learn_how_slip_follows_torque_though_the_reference_is_late(delay):
    rover, measurements, stamps, truth = _two_state_drive(delay=delay)
    course = slip_course(rover, measurements, stamps, 'torque')
    late = slice(200, None)
    error = course.slip[late] - truth[late, None]
    # The demand is smoothed over half a second; an unlearned offset alone would be off by 0.1.
    assert np.abs(error).max() < 0.015
    held = baselines.held_speed(rover, measurements, stamps)
    rim = np.full((len(stamps), 6), 0.4 * rover.wheels.slip_radius[0])
    held_slip = baselines.slip_of(held, np.zeros(len(stamps)), rim, rover.wheels.y)
    assert np.abs(held_slip[late] - truth[late, None]).max() > np.abs(error).max()


def test_three_states_learn_the_curvature_that_two_cannot():
    rover, measurements, stamps, truth = _two_state_drive(law=_curved)
    late = slice(300, None)
    errors = [
        np.abs(slip_course(rover, measurements, stamps, filter_name).slip[late, 0] - truth[late])
        for filter_name in ('curve', 'torque')
    ]
    assert np.ptp(truth[late]) > 0.3
    assert errors[0].max() < 0.04  # the low-pass of the torque lags behind by as much
    assert errors[0].mean() < 0.6 * errors[1].mean()


def test_pitch_filter_sees_the_slope_by_orientation_or_by_specific_force():
    rover = reader.load(['generic_six_wheel'])
    g, up = rover.rover.gravity, 0.1
    nose_up = np.array([0.0, -np.sin(0.5 * up), 0.0, np.cos(0.5 * up)])
    force = np.array([g * np.sin(up), 0.0, g * np.cos(up)])
    slips = []
    for orientation in (nose_up, None):
        measurements = []
        for i in range(1, 60):
            stamp = 10**9 + i * 10**8
            measurements.append(InertialReading(stamp, force, np.zeros(3), orientation))
            measurements.append(WheelOdometry(stamp, np.full(6, 0.4), np.full(6, np.nan)))
        slips.append(slip_course(rover, measurements, np.array([stamp]), 'pitch').slip[0, 0])
    assert slips[0] == pytest.approx(slips[1], abs=1e-3)
    assert slips[0] == pytest.approx(0.05 + 1.0 * np.sin(up), abs=0.01)


def test_a_filter_that_failed_on_a_drive_ends_evaluate_with_status_1(monkeypatch, printed):
    health = {'filter_restarts': 2}
    drive = bench.DriveScore('climb', 1, 'reference', None, None, health)
    monkeypatch.setattr(bench, 'run', lambda *_: bench.Results([drive]))
    monkeypatch.setattr(tables, 'report', lambda *_: 'tables')
    assert 'The filter was started anew 2 times in 1 runs.' in printed(
        ['evaluate', '--kinds', 'climb', '--seeds', '1'], 1
    )
    health['filter_restarts'] = 0
    assert main(['evaluate', '--kinds', 'climb', '--seeds', '1']) == 0
