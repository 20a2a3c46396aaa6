# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Closed forms: against integrals, the quadrature and finite differences; safe at the edges."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import quad
from terra_tools import EFFECTS, SAND, WHEEL, points, random_cases, state

from wheel_terra_estimator.terramechanics import closed_form
from wheel_terra_estimator.terramechanics.conditioned import INPUTS, ConditionedForces, _set_shares
from wheel_terra_estimator.terramechanics.maths import ScalarMaths
from wheel_terra_estimator.terramechanics.model import WheelSoilModel
from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints
from wheel_terra_estimator.terramechanics.soil import Soil
from wheel_terra_estimator.terramechanics.terms import Terms, build_contact, set_angles
from wheel_terra_estimator.terramechanics.wheel import Wheel
from wheel_terra_lab.terramechanics.decoupled_pull import decoupled_pull

MOUND = {**EFFECTS, 'soil_mound': {'kappa': 1.5, 'onset': 0.2}}


@pytest.mark.parametrize('angles', [(0.5, 0.25, -0.1), (0.9, 0.3, -0.6), (0.3, 0.15, 0.0)])
def test_coefficients_are_the_integrals_of_a_triangle(angles: tuple[float, float, float]) -> None:
    t1, tm, t2 = angles

    def triangle(t: float) -> float:
        return (t1 - t) / (t1 - tm) if t >= tm else (t - t2) / (tm - t2)

    for ours, weight in zip(
        closed_form.coefficients(t1, tm, t2), (math.cos, math.sin, lambda t: 1.0), strict=True
    ):
        truth = quad(lambda t, w=weight: triangle(t) * w(t), t2, t1, points=[tm])[0]
        assert ours == pytest.approx(truth, abs=1e-11)
    scalar = closed_form.coefficients(t1, tm, t2, ScalarMaths)
    assert scalar == pytest.approx(closed_form.coefficients(*map(np.array, angles)))


def test_decoupled_pull_is_exact_for_triangles() -> None:
    for soil, effects, row in random_cases(20, 5):
        answer = WheelSoilModel(soil, effects, 'triangles', strict=False).steady_state(row)
        good = answer.flags == 0
        R = row.wheel.radius + effects['lug_shear_radius']['lam'] * row.wheel.lug_height
        pull = decoupled_pull(
            answer.torque,
            row.normal_load,
            answer.entrance_angle,
            answer.peak_stress_angle,
            answer.leaving_angle,
            R,
        )
        assert pull[good] == pytest.approx(answer.drawbar_pull[good], rel=1e-8, abs=1e-6)


def family_errors(method: str, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Errors of pull and sinkage over slip 0 to 0.9."""
    pull, depth = [], []
    for soil, effects, row in random_cases(150, seed):
        driving = replace(row, slip=np.abs(row.slip))
        truth = WheelSoilModel(soil, effects, strict=False).steady_state(driving)
        other = WheelSoilModel(soil, effects, method, strict=False).steady_state(driving)
        good = (truth.flags == 0) & (other.flags == 0)
        pull += list(((other.drawbar_pull - truth.drawbar_pull) / row.normal_load)[good])
        depth += list((other.sinkage / truth.sinkage - 1.0)[good])
    return np.abs(pull), np.abs(depth)


def test_accuracy_over_random_contacts() -> None:
    pull, depth = family_errors('closed_form', 11)
    assert pull.size > 500
    assert np.mean((pull < 0.05) & (depth < 0.1)) > 0.98
    assert np.quantile(pull, 0.95) < 0.01
    # The triangles of the literature, for comparison: far off, which is why they are not used.
    triangle_pull, _ = family_errors('triangles', 11)
    assert np.quantile(triangle_pull, 0.95) > 4.0 * np.quantile(pull, 0.95)


def conditioned(effects: dict, wheel: Wheel = WHEEL) -> ConditionedForces:
    return ConditionedForces(wheel, SAND, effects)


def answer(model: ConditionedForces, ratio: float, sinkage: float, load: float = 80.0, **others):
    return model.forces(
        0, ratio, sinkage, load, 250.0, math.tan(SAND.friction_angle), 0.0114, **others
    )


@pytest.mark.parametrize('slip', [-0.4, 0.0, 0.2, 0.5, 0.9])
def test_conditioned_forces_are_the_closed_form_at_its_own_sinkage(slip: float) -> None:
    # The load balance that gave the sinkage and the one that eliminates the stress are the same.
    steady = WheelSoilModel(SAND, MOUND, 'closed_form').steady_state(points([slip]))
    ratio = 1.0 - slip if slip >= 0.0 else 1.0 / (1.0 + slip)
    got = answer(conditioned(MOUND), ratio, float(steady.sinkage[0]))
    # In skid the filter's form keeps one place per side, the model takes four: 3 % of the load.
    error = 1e-6 if slip > 0.0 else 0.03 * 80.0
    assert got.torque == pytest.approx(steady.torque[0], rel=1e-6, abs=error * WHEEL.radius)
    assert got.drawbar_pull == pytest.approx(steady.drawbar_pull[0], rel=1e-6, abs=error)


def test_conditioned_forces_are_close_to_the_quadrature() -> None:
    slip = np.linspace(0.0, 0.9, 10)
    truth = WheelSoilModel(SAND, MOUND).steady_state(points(slip))
    model = conditioned(MOUND)
    for k in range(slip.size):
        got = answer(model, 1.0 - slip[k], float(truth.sinkage[k]))
        assert got.drawbar_pull == pytest.approx(truth.drawbar_pull[k], abs=0.02 * 80.0)
        assert got.torque == pytest.approx(truth.torque[k], abs=0.02 * 80.0 * 0.16)


@pytest.mark.parametrize(
    'effects',
    [
        {},
        {**MOUND, 'rate_dependence': {'shear': 0.1}, 'wheel_radius_bias': {}, 'cohesion': {}},
        {**MOUND, 'bulldozing': {}, 'pitch_bias': {}, 'drivetrain_friction': {}},
    ],
)
@pytest.mark.parametrize('ratio', [0.1, 0.7, 0.99, 1.4])
@pytest.mark.parametrize('direction', [1.0, -1.0])
def test_derivatives_of_the_conditioned_forces(
    effects: dict, ratio: float, direction: float
) -> None:
    model = conditioned(effects)
    base = [ratio, 0.02, 80.0, 300.0, 0.6, 0.012, 0.02]
    got = model.forces(0, *base, rim_speed=0.2, direction=direction)
    for k, name in enumerate(INPUTS):
        step = 1e-5 * max(abs(base[k]), 1e-3)
        ends = []
        for sign in (1.0, -1.0):
            moved = list(base)
            moved[k] += sign * step
            ends.append(model.forces(0, *moved, rim_speed=0.2, direction=direction))
        torque = (ends[0].torque - ends[1].torque) / (2 * step)
        pull = (ends[0].drawbar_pull - ends[1].drawbar_pull) / (2 * step)
        scale = 1e-4 / max(abs(base[k]), 1e-3)
        assert got.d_torque[k] == pytest.approx(torque, rel=2e-3, abs=10 * scale), name
        assert got.d_pull[k] == pytest.approx(pull, rel=2e-3, abs=80 * scale), name


@pytest.mark.parametrize('ratio', [-0.5, 0.0, 1e-9, 1.0, 1e6, math.inf])
@pytest.mark.parametrize('sinkage', [-0.01, 0.0, 1e-6, 0.05, 0.3])
def test_edges_are_clamped_and_flagged(ratio: float, sinkage: float) -> None:
    if ratio == math.inf:
        ratio = 1e12
    got = answer(conditioned(MOUND), ratio, sinkage)
    numbers = [got.torque, got.drawbar_pull, *got.d_torque, *got.d_pull]
    assert np.isfinite(numbers).all()
    if sinkage < -0.001 or sinkage > WHEEL.radius + 0.02:
        assert got.clamped
    if sinkage == 0.05:
        assert got.clamped == (ratio < 0.0)


@pytest.mark.parametrize('value', [-1.0, math.nan, math.inf, -math.inf])
@pytest.mark.parametrize('entry', range(7))
def test_no_input_ends_in_an_exception_or_in_nan(entry: int, value: float) -> None:
    for effects in ({}, MOUND):
        inputs = [0.7, 0.012, 80.0, 250.0, 0.6, 0.0114, 0.01]
        assert not conditioned(effects).forces(0, *inputs).clamped
        inputs[entry] = value
        got = conditioned(effects).forces(0, *inputs)
        assert np.isfinite([got.torque, got.drawbar_pull, *got.d_torque, *got.d_pull]).all()
        assert got.clamped == (not (INPUTS[entry] == 'centroid_shift' and value == -1.0))


def test_six_wheels_and_a_measured_leaving_angle() -> None:
    model = ConditionedForces(Wheel(np.full(6, 0.15), 0.15, 0.01, 20), SAND, MOUND)
    low = model.forces(5, 0.2, 0.02, 80.0, 250.0, 0.6, 0.012)
    raised = model.forces(5, 0.2, 0.02, 80.0, 250.0, 0.6, 0.012, leaving_angle=-0.5)
    flat = model.forces(5, 0.2, 0.02, 80.0, 250.0, 0.6, 0.012, leaving_angle=0.0)
    # Contact further back pushes the wheel forward.
    assert raised.drawbar_pull > low.drawbar_pull > flat.drawbar_pull


def test_the_load_alone_is_that_of_all_forces() -> None:
    """The short form, which a load balance asks for again and again."""
    for soil, effects, row in random_cases(20, 9):
        model = WheelSoilModel(soil, effects, 'closed_form', strict=False)
        terms = Terms(model.effects)
        form = closed_form.proportional_forces(build_contact(row, model._soil, 'bekker', terms))
        for angle in (0.05, 0.3, 0.8):
            angles = np.full(len(row.slip), angle)
            np.testing.assert_allclose(form.load(angles), form.forces(angles)[0], rtol=1e-12)


def test_soil_without_shear_strength_takes_no_torque_and_resists() -> None:
    """Without c and tan(phi) there are normal stresses alone: they turn nothing and push back."""
    model = ConditionedForces(WHEEL, SAND)
    found = model.forces(0, 0.5, 0.02, 80.0, 0.0, 0.0, 0.012)
    assert not found.clamped
    assert found.torque == pytest.approx(0.0, abs=1e-9)
    assert -80.0 < found.drawbar_pull < -5.0
    spinning = model.forces(0, 0.0, 0.02, 80.0, 250.0, 0.6, 0.012)
    assert not spinning.clamped
    nearly = model.forces(0, 1e-6, 0.02, 80.0, 250.0, 0.6, 0.012)
    assert spinning.torque == pytest.approx(nearly.torque, rel=1e-5)
    backwards = model.forces(0, -0.4, 0.02, 80.0, 250.0, 0.6, 0.012)
    assert backwards.clamped and backwards.torque == spinning.torque


def test_balance_without_iteration_agrees_with_the_bracketed_solver() -> None:
    random, count = np.random.default_rng(12), 500
    wheel = Wheel(random.uniform(0.05, 0.3, count), random.uniform(0.05, 0.3, count), 0.01, 20)
    # One in ten is more than the soil carries.
    load = 10.0 ** random.uniform(2.0, 5.0, count) * wheel.radius * wheel.width
    slip = random.uniform(-1.0, 1.0, count)
    ours = WheelSoilModel(SAND, method='closed_form', strict=False).steady_state(
        points(slip, load, wheel)
    )
    # A mound of no height takes the general way.
    general = WheelSoilModel(
        SAND, {'soil_mound': {'kappa': 0.0}}, 'closed_form', strict=False
    ).steady_state(points(slip, load, wheel))
    assert 0 < (ours.flags & 1).sum() < count
    np.testing.assert_array_equal(ours.flags, general.flags)
    for name in ('sinkage', 'drawbar_pull', 'torque', 'leaving_angle', 'peak_stress_angle'):
        a, b = getattr(ours, name), getattr(general, name)
        np.testing.assert_allclose(a, b, rtol=1e-8, atol=1e-9 * np.abs(b).max(), err_msg=name)


def test_closed_form_in_skid_is_as_close_as_in_slip() -> None:
    """Random contacts of skidding wheels against 40 nodes: 95 % in shares of the load."""
    random = np.random.default_rng(77)
    count = 300
    wheel = Wheel(random.uniform(0.05, 0.3, count), 0.15, 0.01, 20)
    cases = OperatingPoints(random.uniform(-0.6, 0.0, count), 3000.0 * 0.15 * wheel.radius, wheel)
    soil = Soil(
        0.0,
        10 ** random.uniform(5.8, 6.5, count),
        random.uniform(0.6, 1.2, count),
        random.uniform(0.0, 800.0, count),
        random.uniform(0.4, 0.7, count),
        random.uniform(0.004, 0.03, count),
        random.uniform(0.3, 0.6, count),
        random.uniform(-0.4, 0.0, count),
    )
    effects = {'slip_sinkage_exponent': {'n1': 0.3}, 'lug_shear_radius': {}}
    form, exact = (
        WheelSoilModel(soil, effects, method, strict=False, nodes=40).steady_state(cases)
        for method in ('closed_form', 'quadrature')
    )
    error = np.abs(form.drawbar_pull - exact.drawbar_pull) / cases.normal_load
    assert np.quantile(error, 0.95) < 0.008
    assert np.quantile(np.abs(form.sinkage / exact.sinkage - 1.0), 0.95) < 0.02


def test_the_turn_from_rolling_to_skid_is_smooth() -> None:
    slip = np.linspace(-0.12, 0.05, 171)
    pull = state(slip, effects=EFFECTS, method='closed_form').drawbar_pull
    steps = np.diff(pull)
    assert (steps > 0.0).all()
    assert np.max(np.abs(np.diff(steps))) < 0.25 * np.max(steps)


@pytest.mark.parametrize('peak', [-2.0, -0.3, 0.4, 2.0])
def test_a_peak_beyond_the_contact_is_moved_into_it_alike_everywhere(peak: float) -> None:
    """By a thousandth of the contact: in the filter's form as in the general one."""
    contacts = [
        SimpleNamespace(leaving_ratio=-0.3, peak_ratio=peak, entrance_angle=0.5) for _ in range(2)
    ]
    set_angles(contacts[0], 0.5, None, SimpleNamespace(apply=lambda *_: None))
    _set_shares(contacts[1], 0.5)
    expected = min(max(0.5 * peak, -0.15 + 0.65e-3), 0.5 - 0.65e-3)
    for contact in contacts:
        assert contact.peak_angle == pytest.approx(expected)
        assert contact.leaving_angle == pytest.approx(-0.15)
