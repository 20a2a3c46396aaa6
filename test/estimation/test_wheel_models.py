# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The filter's wheel models: derivatives, and agreement with the reference quadrature."""

import itertools

import numpy as np
import pytest

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.estimation.contacts.contact_models import contact_models
from wheel_terra_estimator.estimation.contacts.wheel_models import WheelForces, WheelStates
from wheel_terra_estimator.terramechanics.contact_law import LAWS, contact_law
from wheel_terra_estimator.terramechanics.model import WheelSoilModel
from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints
from wheel_terra_estimator.terramechanics.wheel import Wheel

KEYS = ['effects.lug_digging.enabled:=true', 'effects.slip_sinkage_exponent.enabled:=true']

SHEARED_LUGS = {'lug_shear_radius': {'lam': 0.5}}
"""What the estimator takes where no effect says at which radius the lugs shear."""


LEARNED = 'effects.learned_closure'  # as the proposal.yaml of a diagnosis states it
PROPOSAL = [
    f'{LEARNED}.enabled:=true',
    f'{LEARNED}.targets:=[torque, exponent, drawbar_pull]',
    f'{LEARNED}.features:=[slip, slip, one]',
    f'{LEARNED}.coefficients:=[0.05, 0.4, -0.03]',
]


def rover_with(law, keys):
    law = f'rover.contact_law:={law}'
    return reader.load(['generic_six_wheel', 'dry_sand_ding2015'], [law, *keys])


@pytest.fixture(
    scope='module',
    params=[
        (LAWS[0], KEYS),
        (LAWS[1], KEYS),
        (LAWS[0], PROPOSAL),
        (LAWS[1], PROPOSAL),
        (LAWS[2], []),
    ],
    ids=lambda param: f'{param[0]}-{len(param[1])}',
)
def rover(request):
    return rover_with(*request.param)


@pytest.fixture(scope='module')
def models(rover):
    return contact_models(rover)


def forces(models, ratio=0.7, z=0.02, load=290.0, a=0.1, k=-0.2, centroid=0.02):
    return of_first(models.forces(WheelStates(ratio, z, load, a, k, centroid, 0.05)))


def of_first(found):
    """Return the forces of the first of wheels that are alike."""
    return WheelForces(*(values[..., 0].tolist() for values in found))


@pytest.mark.parametrize('ratio', [-0.5, 0.15, 0.7, 0.95, 1.2])
def test_derivatives_against_differences(models, ratio):
    state = {'ratio': ratio, 'z': 0.02, 'a': 0.1, 'k': -0.2, 'centroid': 0.02}
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
    law = rover.rover.contact_law
    effects = rover.effects | SHEARED_LUGS
    truth = WheelSoilModel(rover.soil, effects)
    if law != LAWS[0]:
        truth = contact_law(law, rover.soil, effects, float(wheel.width))
    truth = truth.steady_state(points)
    z = float(truth.sinkage[0])
    onset = rover.flat()['effects.soil_mound.onset']
    usual_mound = 0.05 * (max(slip - onset, 0.0) / (1.0 - onset)) ** 2  # not in the truth
    state = WheelStates(1.0 - slip, z, load, centroid=usual_mound)
    answer = of_first(models.forces(state))
    assert answer.torque == pytest.approx(truth.torque[0], rel=0.03)
    assert answer.pull == pytest.approx(truth.drawbar_pull[0], abs=0.02 * load)
    bearing = models.bearing(state)
    assert bearing.load == pytest.approx(load, rel=0.04)
    # What the filter takes for the rate of ln(load) by ln(sinkage) and by the exponent.
    deeper = models.bearing(state._replace(sinkage=1.001 * z))
    assert np.log(deeper.load / bearing.load) / np.log(1.001) == pytest.approx(
        bearing.exponent + 0.5, rel=0.1
    )
    # n1 adds |s| times itself to the exponent of (depth / reference depth).
    softer = models.bearing(state._replace(slip_sinkage=1e-4))
    assert (softer.load < bearing.load).all()
    firmer = models.bearing(state._replace(stiffness=0.1))
    assert firmer.load == pytest.approx(np.exp(0.1) * bearing.load, rel=0.02)


def test_strength_of_the_resistive_force_is_friction_at_the_rim():
    models = contact_models(rover_with('resistive_force', []))
    pulls = [forces(models, a=a).pull for a in (-0.5, 0.0, 0.5)]
    torques = [forces(models, a=a).torque for a in (-0.5, 0.0, 0.5)]
    assert pulls[0] < pulls[1] < pulls[2] and torques[0] < torques[1] < torques[2]
    assert forces(models, k=0.0).pull == forces(models, k=-0.7).pull


def test_never_nan_outside_the_valid_range(models):
    for ratio, z in itertools.product([-1.0, 0.0, 1.0, 10.0], [-0.01, 0.0, 1e-6, 0.5]):
        state = WheelStates(ratio, z, 100.0, rim_speed=0.05)
        answer = models.forces(state)
        assert all(np.isfinite(values).all() for values in answer), (ratio, z)
        assert (models.bearing(state).load > 0.0).all(), (ratio, z)


def test_a_speed_against_the_rim_is_slip_one(models):
    at_stand = forces(models, ratio=0.0)
    for ratio in (-0.01, -1.0, -2.0):
        back = forces(models, ratio=ratio)
        assert (back.torque, back.pull) == (at_stand.torque, at_stand.pull)
        assert back.d_torque[0] == back.d_pull[0] == 0.0
        assert (back.d_torque[1:], back.d_pull[1:]) == (at_stand.d_torque[1:], at_stand.d_pull[1:])
