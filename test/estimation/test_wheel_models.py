# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The filter's wheel models: derivatives, and agreement with the reference quadrature."""

import numpy as np
import pytest

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.estimation.contacts.wheel_models import WheelModels, WheelState
from wheel_terra_estimator.terramechanics.model import WheelSoilModel
from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints
from wheel_terra_estimator.terramechanics.wheel import Wheel


@pytest.fixture(scope='module')
def rover():
    return reader.load(
        ['generic_six_wheel', 'dry_sand_ding2015'],
        ['effects.lug_digging.enabled:=true', 'effects.slip_sinkage_exponent.enabled:=true'],
    )


@pytest.fixture(scope='module')
def models(rover):
    return WheelModels(rover)


def forces(models, ratio=0.7, z=0.02, load=290.0, a=0.1, k=-0.2, centroid=0.02, mound=0.3):
    return models.forces(0, WheelState(ratio, z, load, a, k, centroid, mound, 0.05))


@pytest.mark.parametrize('ratio', [-0.5, 0.15, 0.7, 0.95, 1.2])
def test_derivatives_against_differences(models, ratio):
    state = {'ratio': ratio, 'z': 0.02, 'a': 0.1, 'k': -0.2, 'centroid': 0.02, 'mound': 0.3}
    there = forces(models, **state)
    for position, name in enumerate(state):
        step = 1e-6
        up = forces(models, **{**state, name: state[name] + step})
        down = forces(models, **{**state, name: state[name] - step})
        for value, answer in (('torque', there.d_torque), ('pull', there.d_pull)):
            expected = (getattr(up, value) - getattr(down, value)) / (2 * step)
            assert answer[position] == pytest.approx(expected, rel=1e-3, abs=1e-3), (name, value)


@pytest.mark.parametrize('slip', [0.05, 0.2, 0.5, 0.8])
def test_agrees_with_the_quadrature_at_its_own_steady_state(rover, models, slip):
    wheels = rover.wheels
    wheel = Wheel(
        radius=wheels.radius[0],
        width=wheels.width[0],
        lug_height=wheels.lug_height[0],
        lug_count=wheels.lug_count[0],
        lug_thickness=wheels.lug_thickness[0],
    )
    load = 290.0
    points = OperatingPoints(slip=np.array([slip]), normal_load=np.array([load]), wheel=wheel)
    truth = WheelSoilModel(rover.soil, rover.effects).steady_state(points)
    z = float(truth.sinkage[0])
    state = WheelState(1.0 - slip, z, load, 0.0, 0.0)
    answer = models.forces(0, state)
    assert answer.torque == pytest.approx(truth.torque[0], rel=0.03)
    assert answer.pull == pytest.approx(truth.drawbar_pull[0], abs=0.02 * load)
    bearing = models.bearing(0, state)
    assert bearing.load == pytest.approx(load, rel=0.15)


@pytest.mark.parametrize('enabled', ['true', 'false'])
def test_the_onset_of_the_mound_is_that_of_the_configuration(enabled):
    keys = [f'effects.soil_mound.enabled:={enabled}', 'effects.soil_mound.onset:=0.7']
    late = WheelModels(reader.load(['generic_six_wheel', 'dry_sand_ding2015'], keys))
    for ratio, pushes in ((0.5, False), (0.31, False), (0.29, True), (0.1, True)):
        without, pushed = (forces(late, ratio=ratio, mound=m) for m in (0.0, 0.5))
        assert (pushed.pull > without.pull) is pushes, ratio
    # At slip 1 the mound is whole, wherever it began.
    early = WheelModels(reader.load(['generic_six_wheel', 'dry_sand_ding2015'], keys[:1]))
    if enabled == 'false':
        assert forces(late, ratio=0.0).pull == pytest.approx(forces(early, ratio=0.0).pull)


def test_mound_pushes_only_above_its_onset(models):
    low = forces(models, ratio=0.7, mound=0.0), forces(models, ratio=0.7, mound=0.5)
    high = forces(models, ratio=0.1, mound=0.0), forces(models, ratio=0.1, mound=0.5)
    assert low[0].pull == low[1].pull
    assert high[1].pull > high[0].pull


@pytest.mark.parametrize('z', [-0.01, 0.0, 1e-6, 0.5])
@pytest.mark.parametrize('ratio', [-1.0, 0.0, 1.0, 10.0])
def test_never_nan_outside_the_valid_range(models, z, ratio):
    state = WheelState(ratio, z, 100.0, 0.0, 0.0, rim_speed=0.05)
    answer = models.forces(0, state)
    assert np.isfinite([answer.torque, answer.pull, *answer.d_torque, *answer.d_pull]).all()
    assert models.pull(0, state) == answer.pull
    assert models.bearing(0, state).load > 0.0


@pytest.mark.parametrize('ratio', [-0.01, -1.0, -2.0])
def test_a_speed_against_the_rim_is_slip_one(models, ratio):
    at_stand, back = (forces(models, ratio=r, mound=0.3) for r in (0.0, ratio))
    assert (back.torque, back.pull) == (at_stand.torque, at_stand.pull)
    assert back.d_torque[0] == back.d_pull[0] == 0.0
    assert (back.d_torque[1:], back.d_pull[1:]) == (at_stand.d_torque[1:], at_stand.d_pull[1:])
