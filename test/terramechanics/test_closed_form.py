# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Closed forms and the balance of loads: against integrals, the quadrature, finite differences."""

import itertools
import math
from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from terra_tools import EFFECTS, SAND, WHEEL, points, random_cases, state

from wheel_terra_estimator.terramechanics import quadrature
from wheel_terra_estimator.terramechanics.closed_form import branch_moments
from wheel_terra_estimator.terramechanics.conditioned import ConditionedForces, ConditionedInputs
from wheel_terra_estimator.terramechanics.load_balance import balance, solve_entrance_angle
from wheel_terra_estimator.terramechanics.model import WheelSoilModel
from wheel_terra_estimator.terramechanics.terms import set_angles
from wheel_terra_estimator.terramechanics.wheel import Wheel
from wheel_terra_lab.reproduction.equivalent_contact import decoupled_pull

MOUND = {**EFFECTS, 'soil_mound': {'kappa': 1.5, 'onset': 0.2}}


def test_decoupled_pull_is_exact_for_triangles():
    """Load, pull and torque of triangular stresses of 9 and 4 kPa, by quadrature."""
    t1, tm, t2, radius, width = 0.7, 0.3, -0.2, 0.16, 0.15

    def over(weight: Callable[[float], float]) -> float:
        def stress(t: float) -> float:
            return weight(t) * ((t1 - t) / (t1 - tm) if t >= tm else (t - t2) / (tm - t2))

        return width * radius * quad(stress, t2, t1, points=[tm])[0]

    load = over(lambda t: 9e3 * math.cos(t) + 4e3 * math.sin(t))
    pull = over(lambda t: 4e3 * math.cos(t) - 9e3 * math.sin(t))
    torque = radius * over(lambda t: 4e3)
    assert decoupled_pull(torque, load, t1, tm, t2, radius) == pytest.approx(pull, rel=1e-8)


@pytest.mark.parametrize('way', ['drives', 'skids', 'slides'])
def test_accuracy_over_random_contacts(way, monkeypatch):
    """Errors of forces and sinkage over slip up to 0.9, skid, or slip angles on both sides."""
    monkeypatch.setattr(quadrature, 'NODES', 40)
    drawn, errors, depth = np.random.default_rng(4), [], np.zeros(0)
    for soil, effects, row in random_cases(15, 11):
        turned = {
            'drives': {'slip': np.abs(row.slip)},
            'skids': {'slip': -np.abs(row.slip)},
            'slides': {'slip_angle': drawn.uniform(-1.5, 1.5, row.slip.shape)},
        }[way]
        truth, other = (
            WheelSoilModel(soil, effects, method).steady_state(replace(row, **turned))
            for method in ('quadrature', 'closed_form')
        )
        good = (truth.flags == 0) & (other.flags == 0)
        errors.append(
            np.array(
                [
                    np.abs(getattr(other, name) - getattr(truth, name))[good]
                    / row.normal_load[good]
                    for name in ('drawbar_pull', 'lateral_force')
                ]
            )
        )
        depth = np.append(depth, np.abs(other.sinkage / truth.sinkage - 1.0)[good])
    pull, aside = np.hstack(errors)
    assert pull.size > 450
    assert np.mean((pull < 0.05) & (depth < 0.1)) > 0.98
    assert np.quantile(pull, 0.95) < 0.01
    if way == 'slides':
        off = np.append(pull, aside)
        assert np.quantile(off, 0.95) < 0.005
        assert off.max() < 0.03


def conditioned(effects: dict, wheel: Wheel = WHEEL) -> ConditionedForces:
    return ConditionedForces(wheel, SAND, effects)


def answer(model: ConditionedForces, ratio, sinkage, load=80.0, **others):
    """Torque and pull of the only wheel."""
    soil = 250.0, math.tan(SAND.friction_angle), 0.0114
    torque, pull = model.forces(ConditionedInputs(ratio, sinkage, load, *soil, **others))
    return float(torque[0]), float(pull[0])


def test_wheels_and_rows_are_worked_out_alike():
    """Each of many at once as alone: no wheel and no finite step sees another."""
    random = np.random.default_rng(3)
    rows = random.uniform([0.1, 0.005, 40.0], [1.5, 0.04, 120.0], (5, 6, 3)).transpose(2, 0, 1)
    radius = random.uniform(0.1, 0.2, 6)
    together = conditioned(MOUND, Wheel(radius, 0.15, 0.01, 20)).forces(
        ConditionedInputs(*rows, 250.0, 0.6, 0.012)
    )
    for i, j in np.ndindex(5, 6):
        alone = conditioned(MOUND, Wheel(radius[j], 0.15, 0.01, 20)).forces(
            ConditionedInputs(*rows[:, i, j], 250.0, 0.6, 0.012)
        )
        for all_of_them, one in zip(together, alone, strict=True):
            assert all_of_them[i, j] == pytest.approx(one[0], rel=1e-12)


@pytest.mark.parametrize('sinkage', [-0.01, 0.0, 1e-6, 0.05, 0.3])
def test_edges_are_those_of_the_model(sinkage):
    within = min(max(sinkage, 0.0), WHEEL.radius)
    plain, mound = conditioned({}), conditioned(MOUND)
    for ratio in (-0.5, 0.0, 1e-9, 1.0, 1e6, 1e12):
        assert np.isfinite(answer(mound, ratio, sinkage)).all(), ratio
        assert answer(plain, ratio, sinkage) == answer(plain, max(ratio, 0.0), within), ratio


@pytest.mark.parametrize('entry', range(7))
def test_no_input_ends_in_an_exception_or_in_nan(entry):
    for effects, value in itertools.product(({}, MOUND), (-1.0, math.nan, math.inf, -math.inf)):
        inputs = [0.7, 0.012, 80.0, 250.0, 0.6, 0.0114, 0.01]
        inputs[entry] = value
        torque, pull = conditioned(effects).forces(ConditionedInputs(*inputs))
        assert np.isfinite([torque[0], pull[0]]).all(), value


def test_a_measured_leaving_angle_overrides_the_law():
    low, raised, flat, none = (
        answer(conditioned(MOUND), 0.2, 0.02, leaving_angle=angle)
        for angle in (None, -0.5, 0.0, np.array([math.nan]))
    )
    # Contact further back pushes the wheel forward.
    assert raised[1] > low[1] > flat[1]
    assert none == low


def test_stresses_that_are_turned_about_the_hub_turn_load_and_pull_and_keep_the_torque():
    model, shift, load = conditioned({}), 0.4, 80.0
    torque, pull = answer(model, 0.5, 0.02, load, centroid_shift=shift)
    before = load * math.cos(shift) - pull * math.sin(shift)
    expected = torque, pull * math.cos(shift) + load * math.sin(shift)
    assert answer(model, 0.5, 0.02, before) == pytest.approx(expected)


def test_soil_without_shear_strength_takes_no_torque_and_resists():
    """Without c and tan(phi) there are normal stresses alone: they turn nothing and push back."""
    model = ConditionedForces(WHEEL, SAND)
    torque, pull = model.forces(ConditionedInputs(0.5, 0.02, 80.0, 0.0, 0.0, 0.012))
    assert torque[0] == pytest.approx(0.0, abs=1e-9)
    assert -80.0 < pull[0] < -5.0
    spinning, nearly, backwards = (answer(model, ratio, 0.02)[0] for ratio in (0.0, 1e-6, -0.4))
    assert spinning == pytest.approx(nearly, rel=1e-5)
    assert backwards == spinning


def test_cohesion_alone_is_mobilised_as_in_the_quadrature():
    clay = replace(SAND, cohesion=8e3, friction_angle=0.0, leaving_angle_ratio=-0.6)
    slip = [-0.6, -0.2, 0.1, 0.3, 0.6, 0.9]
    truth, ours = (state(slip, soil=clay, method=m) for m in ('quadrature', 'closed_form'))
    assert ours.torque == pytest.approx(truth.torque, rel=0.05)
    assert ours.drawbar_pull == pytest.approx(truth.drawbar_pull, abs=0.02 * 80.0)
    # A share in proportion to the displacement is, in the mean, that of its mean: no error.
    soft = replace(clay, shear_modulus=0.1)
    truth, ours = (state(slip[3:], soil=soft, method=m) for m in ('quadrature', 'closed_form'))
    assert ours.torque == pytest.approx(truth.torque, rel=0.01)


def test_balance_without_iteration_agrees_with_the_bracketed_solver():
    random, count = np.random.default_rng(12), 250
    wheel = Wheel(random.uniform(0.05, 0.3, count), random.uniform(0.05, 0.3, count), 0.01, 20)
    # One in ten is more than the soil carries.
    load = 10.0 ** random.uniform(2.0, 5.0, count) * wheel.radius * wheel.width
    slip = random.uniform(-1.0, 1.0, count)
    ours = WheelSoilModel(SAND, method='closed_form').steady_state(points(slip, load, wheel))
    # A mound of no height takes the general way.
    general = WheelSoilModel(SAND, {'soil_mound': {'kappa': 0.0}}, 'closed_form').steady_state(
        points(slip, load, wheel)
    )
    assert 0 < (ours.flags & 1).sum() < count
    np.testing.assert_array_equal(ours.flags, general.flags)
    for name in ('sinkage', 'drawbar_pull', 'torque', 'leaving_angle', 'peak_stress_angle'):
        a, b = getattr(ours, name), getattr(general, name)
        np.testing.assert_allclose(a, b, rtol=1e-8, atol=1e-9 * np.abs(b).max(), err_msg=name)


def test_the_turn_from_rolling_to_skid_is_smooth():
    slip = np.linspace(-0.12, 0.05, 171)
    pull = state(slip, effects=EFFECTS, method='closed_form').drawbar_pull
    steps = np.diff(pull)
    assert (steps > 0.0).all()
    assert np.max(np.abs(np.diff(steps))) < 0.25 * np.max(steps)


@pytest.mark.parametrize('peak', [-2.0, -0.3, 0.4, 2.0])
def test_a_peak_beyond_the_contact_is_moved_into_it_alike_everywhere(peak):
    """By a thousandth of the contact: in the explicit balance as in the general one."""
    soil = SimpleNamespace(leaving_ratio=-0.3, peak_ratio=peak)
    set_angles(soil, 0.5, None, SimpleNamespace(apply=lambda *_: None))
    expected = min(max(0.5 * peak, -0.15 + 0.65e-3), 0.5 - 0.65e-3)
    assert soil.peak_angle == pytest.approx(expected)
    assert soil.leaving_angle == pytest.approx(-0.15)


# Moments of the stress on one side of its peak against integrals.


def moment(exponent, skew, power):
    return quad(lambda v: v**power * (v * (1.0 + skew * (1.0 - v))) ** exponent, 0.0, 1.0)[0]


@pytest.mark.parametrize('skew', [-0.3, 0.0, 0.4])
@pytest.mark.parametrize(('exponent', 'tolerance'), [(1.0, 1e-10), (2.0, 1e-10), (1.3, 2e-3)])
def test_area_and_centroid_are_those_of_the_integral(exponent, tolerance, skew):
    """The series in the skew ends after its square for whole exponents up to two."""
    area, centroid, _ = branch_moments(exponent, skew)
    assert area == pytest.approx(moment(exponent, skew, 0), rel=tolerance)
    first = moment(exponent, skew, 1)
    assert area * centroid == pytest.approx(first, rel=tolerance)


@pytest.mark.parametrize('exponent', [0.5, 1.0, 1.7])
def test_spread_is_the_variance_under_the_stress(exponent):
    area, first, second = (moment(exponent, 0.0, power) for power in range(3))
    expected = second / area - (first / area) ** 2
    assert branch_moments(exponent, 0.0)[2] == pytest.approx(expected)


# The angle at which the soil carries a load, against laws with a known inverse.


@pytest.mark.parametrize('load', [1e-6, 1.0, 1e6])
def test_a_load_is_met_to_a_share_of_itself(load):
    """However light: the force is a power of the angle, 0.3 rad at the load."""
    angle, carries = solve_entrance_angle(
        lambda t: load * (t / 0.3) ** 2.2, np.array([load]), np.array([0.5])
    )
    assert carries.all()
    assert angle == pytest.approx(0.3, rel=1e-9)


def test_newton_on_logarithms_meets_a_power_at_once():
    """Its exponent is the slope of the logarithms: the second look is at the solution."""
    looks = []

    def carried(angles: Any) -> Any:
        looks.append(angles[0])
        return 5.0 * angles**2.2

    angle, carries = solve_entrance_angle(carried, np.array([2.0]), np.array([0.1]))
    exact = (2.0 / 5.0) ** (1.0 / 2.2)
    assert carries.all() and angle == pytest.approx(exact, rel=1e-9)
    assert looks[1] == pytest.approx(exact, rel=1e-4) and len(looks) <= 4


def test_what_three_angles_do_not_settle_goes_to_the_bracketed_solver():
    """A force that is no power of the angle: W = exp(20 t) - 1, so that t = ln(1 + W) / 20."""

    def form(count: int) -> Any:
        def forces(t: Any) -> tuple[Any, Any, Any]:
            return np.expm1(20.0 * t), 2.0 * t, 3.0 * t

        return SimpleNamespace(
            exponent=np.full(count, 1.0),
            small_angle=lambda load: np.full(len(load), 0.02),
            forces=forces,
            take=lambda rest: form(int(rest.sum())),
        )

    load = np.array([0.5, 50.0, 1e6])
    angle, pull, torque, carries = balance(form(3), load)
    expected = np.log1p(load) / 20.0
    assert carries.all()
    np.testing.assert_allclose(angle, expected, rtol=1e-8)
    np.testing.assert_allclose(pull, 2.0 * expected, rtol=1e-8)
    np.testing.assert_allclose(torque, 3.0 * expected, rtol=1e-8)
