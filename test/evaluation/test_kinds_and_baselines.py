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
from wheel_terra_estimator.evaluation import baselines, kinds
from wheel_terra_estimator.evaluation.runner import inputs_of_mode
from wheel_terra_estimator.simulation.scenario import load
from wheel_terra_estimator.simulation.sensors import Arrival


@pytest.mark.parametrize('name', [*kinds.KINDS, 'firm', 'limiter'])
def test_every_kind_is_a_scenario(name):
    extra = {'firm': kinds.FIRM, 'limiter': kinds.LIMITER}
    scenario = load(dict(extra.get(name) or kinds.KINDS[name]))
    # The simulated soil knows effects that the estimator is not told of.
    assert set(scenario.truth.effects) > set(scenario.configuration.effects)


def test_tuning_and_test_seeds_are_apart():
    assert not set(kinds.TUNING_SEEDS) & set(kinds.TEST_SEEDS)
    assert len(kinds.TEST_SEEDS) >= 20


def test_baselines_between_fixes():
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


def test_command_names_what_it_does_not_know(capsys, tmp_path):
    assert main(['evaluate', '--kinds', 'nonsense']) == 2
    assert 'nonsense' in capsys.readouterr().err
    there = tmp_path / 'there.md'
    there.write_text('x', encoding='utf-8')
    assert main(['evaluate', '-o', str(there)]) == 2


def test_modes_change_what_the_estimator_gets():
    wheels = WheelOdometry(10**9, np.array([1.0]), np.array([2.0]))
    fix = ReferenceVelocity(10**9, 0.05, 1e-6)
    inertial = InertialReading(10**9, np.zeros(3), np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))
    arrivals = [
        Arrival(10**9, wheels),
        Arrival(int(1.1e9), inertial),
        Arrival(int(1.4e9), fix),
        Arrival(int(2.9e9), replace(wheels, stamp=int(2.9e9))),
    ]
    assert list(inputs_of_mode(arrivals, 'reference')) == [a.measurement for a in arrivals]
    assert fix not in list(inputs_of_mode(arrivals, 'no_reference'))
    assert [type(m) for m in inputs_of_mode(arrivals, 'fixes_at_once')] == [
        *(WheelOdometry, ReferenceVelocity, InertialReading, WheelOdometry)
    ]
    assert list(inputs_of_mode(arrivals, 'fixes_2s_late'))[-1] is fix
    assert np.isnan(next(inputs_of_mode(arrivals, 'no_torque')).torque).all()
    assert list(inputs_of_mode(arrivals, 'no_orientation'))[1].orientation is None
