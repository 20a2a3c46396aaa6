# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A wheel that slides sideways: against integrals of its own, symmetry, limits, closed form."""

import math
from dataclasses import fields, replace

import numpy as np
import pytest
from scipy.integrate import quad
from terra_tools import EFFECTS, SAND, WHEEL, points, second_model, state

from wheel_terra_estimator.terramechanics.effects import catalogue
from wheel_terra_estimator.terramechanics.model import METHODS, WheelSoilModel
from wheel_terra_estimator.terramechanics.terms import SOIL_NUMBERS, Terms, build_contact

FLANK = {'side_bulldozing': {'ks': 0.8}}
SECOND_MODEL = ('slip_sinkage_exponent', 'stress_peak_shift', 'lug_shear_radius')


@pytest.mark.parametrize(
    ('slip', 'beta'), [(0.3, 0.1), (-0.4, 0.5), (0.0, 0.8), (0.8, 1.4), (0.6, 0.0), (-0.6, 0.0)]
)
def test_agrees_with_integrals_of_its_own(slip, beta):
    effects = {name: EFFECTS[name] for name in SECOND_MODEL}
    truth = second_model(slip, 80.0, n1=0.3 * (beta == 0.0), c2=0.15, lam=0.5, beta=beta, ks=0.8)
    if beta:  # sliding sideways digs in as slip does: see below
        del effects['slip_sinkage_exponent']
    ours = state([slip], slip_angle=beta, effects={**effects, **FLANK})
    found = (*ours.outputs()[0], ours.lateral_force[0])
    assert found == pytest.approx(truth, rel=3e-4, abs=1e-4)


@pytest.mark.parametrize('method', METHODS)
def test_no_slip_angle_changes_no_digit(method):
    slip = np.linspace(-0.9, 0.9, 13)
    plain = state(slip, effects={**EFFECTS, **FLANK}, method=method)
    told = state(slip, effects={**EFFECTS, **FLANK}, method=method, slip_angle=0.0)
    without = state(slip, effects=EFFECTS, method=method)
    for field in fields(plain):
        assert np.array_equal(getattr(told, field.name), getattr(plain, field.name))
        assert np.array_equal(getattr(without, field.name), getattr(plain, field.name))
    assert not plain.lateral_force.any()
    # A straight row among others that slide sideways keeps its numbers too.
    mixed = state(slip, effects=EFFECTS, method=method, slip_angle=np.where(slip < 0, 0.3, 0.0))
    straight = slip >= 0.0
    assert mixed.outputs()[straight] == pytest.approx(plain.outputs()[straight], rel=1e-12)


@pytest.mark.parametrize('method', METHODS)
def test_left_mirrors_right(method):
    slip = np.tile(np.linspace(-0.8, 0.9, 9), 2)
    angle = np.repeat([0.2, 1.3], 9)
    effects = {**EFFECTS, **FLANK}
    left = state(slip, slip_angle=angle, effects=effects, method=method)
    right = state(slip, slip_angle=-angle, effects=effects, method=method)
    assert np.array_equal(left.outputs(), right.outputs())
    assert np.array_equal(left.lateral_force, -right.lateral_force)
    assert (left.lateral_force < 0.0).all()


def test_reverse_slides_to_the_same_side():
    forward = state([0.3], slip_angle=0.4, angular_velocity=1.0)
    backward = state([0.3], slip_angle=math.pi - 0.4, angular_velocity=-1.0)
    assert backward.drawbar_pull == pytest.approx(-forward.drawbar_pull)
    assert backward.lateral_force == pytest.approx(forward.lateral_force)


def test_no_effect_turns_the_slip_angle():
    at = points([0.1, -0.3], slip_angle=0.2, angular_velocity=0.5)
    numbers = {name: getattr(SAND, name) for name in SOIL_NUMBERS}
    for name, effect in catalogue().items():
        usual = {p.name: p.default for p in effect.parameters}
        for radius in ('lug_tip', 'shear'):
            terms = Terms({} if effect.sparse else {name: usual})
            contact = build_contact(replace(at, slip_radius=radius), numbers, 'bekker', terms)
            assert np.arctan2(*contact.heading()[::-1]) == pytest.approx(0.2), name
    # A misread slip: as at the true one.
    biased = state([0.1], slip_angle=0.2, effects={'wheel_radius_bias': {'bias': 0.1}})
    true = state([1.0 - 0.9 / 1.1], slip_angle=0.2)
    assert biased.lateral_force == pytest.approx(true.lateral_force)


@pytest.mark.parametrize('method', ['quadrature', 'closed_form'])
def test_at_90_degrees_the_two_speeds_decide(method):
    # Spinning on the spot while pushed aside: j turns nowhere, so Fy/(T/r) is v_y over r w.
    for ratio in (0.05, 0.5, 3.0):
        there = state([1.0], slip_angle=math.pi / 2, lateral_speed_ratio=ratio, method=method)
        tip = ratio * (WHEEL.radius + WHEEL.lug_height) / WHEEL.radius
        assert -there.lateral_force == pytest.approx(tip * there.torque / WHEEL.radius, rel=0.01)
        near = math.atan2(ratio, 1e-5)
        beside = state([1.0 - 1e-5], slip_angle=near, method=method)
        assert beside.lateral_force == pytest.approx(there.lateral_force, rel=1e-3)
        assert beside.drawbar_pull == pytest.approx(there.drawbar_pull, rel=1e-3)
    # A locked wheel pushed straight aside gives nothing along, all it can across.
    locked = state([-1.0], slip_angle=math.pi / 2, method=method)
    assert abs(locked.torque[0]) < 1e-3 * WHEEL.radius * abs(locked.lateral_force[0])
    assert np.isfinite(locked.outputs()).all()


def test_flank_needs_sideways_motion_and_grows_with_sinkage():
    def flank(load: float, angle: float) -> float:
        row = points([0.2], load, slip_angle=angle)
        on, off = (WheelSoilModel(SAND, e).steady_state(row) for e in (FLANK, {}))
        assert np.array_equal(on.outputs(), off.outputs())
        return float(off.lateral_force[0] - on.lateral_force[0])

    assert flank(80.0, 0.0) == 0.0
    assert 0.0 < flank(80.0, 1e-4) < 1e-2 * flank(80.0, 0.5)  # grows from nothing, no step
    assert flank(200.0, 0.5) > 2.5 * flank(80.0, 0.5)  # faster than the load


def test_sliding_sideways_digs_in_as_slip_does():
    exponent = {'slip_sinkage_exponent': {'n1': 0.3}}
    depth = state(np.zeros(4), slip_angle=[0.0, 0.3, 0.8, 1.3], effects=exponent).sinkage
    assert (np.diff(depth) > 0.0).all()
    # At 60 degrees and rim speed = speed over ground, the rim moves through the soil as fast as
    # it rolls: the exponent of a wheel that spins on the spot.
    beta = math.pi / 3
    sliding = state([1.0 - math.cos(beta)], slip_angle=beta, effects=exponent, slip_radius='rim')
    other = replace(SAND, sinkage_exponent=SAND.sinkage_exponent + 0.3)
    same = state([1.0 - math.cos(beta)], slip_angle=beta, soil=other, slip_radius='rim')
    assert sliding.sinkage == pytest.approx(same.sinkage)


def plate_state(slip: float, beta: float, load: float, **points_of: float):
    effects = {'side_bulldozing': {'form': 'plate', 'ks': 0.7}}
    row = points([slip], load, slip_angle=beta, **points_of)
    on, off = (WheelSoilModel(SAND, e).steady_state(row) for e in (effects, {}))
    push = float(off.lateral_force[0] - on.lateral_force[0])
    return push, float(on.drawbar_pull[0] - off.drawbar_pull[0]), on, off


@pytest.mark.parametrize('beta', [0.05, 0.6, 1.2])
def test_flank_as_a_plate_agrees_with_an_integral_of_its_own(beta):
    slip, load = 0.2, 200.0
    push, rub, on, off = plate_state(slip, beta, load)
    r, phi = WHEEL.radius, SAND.friction_angle
    t1, t2 = float(on.entrance_angle[0]), float(on.leaving_angle[0])
    front, back = r * math.sin(t1), r * math.sin(t2)

    def per_length(x: float) -> float:
        bottom = math.sqrt(r * r - x * x)
        share = (front - x) / (front - back)
        surface = r * (math.cos(t1) + share * (math.cos(t2) - math.cos(t1)))
        h = max(bottom - surface, 0.0)
        cot = math.tan(math.pi / 4 + phi / 2)
        d1, d2 = 2.0 * cot, cot + cot**2 * math.tan(phi)
        weight = SAND.density * 9.80665
        moved = -math.expm1(-(front - x) * math.tan(beta) / SAND.shear_modulus)
        return moved * d1 * (SAND.cohesion * h + d2 * weight * h * h / 2)

    assert push == pytest.approx(0.7 * quad(per_length, back, front, epsrel=1e-9)[0], rel=1e-3)
    # Friction on the flank works against the flank's motion, and its torque at two thirds of r.
    assert abs(rub) <= push * math.tan(phi)
    assert float(on.torque[0] - off.torque[0]) == pytest.approx(2.0 / 3.0 * r * rub)


def test_a_wheel_pushed_straight_aside_is_a_plate():
    aside = {'beta': math.pi / 2, 'load': 80.0}
    push, rub, _, _ = plate_state(1.0, **aside, lateral_speed_ratio=0.02)
    # Spinning fast, all friction of the flank drives the wheel on; hardly turning, none does.
    assert rub == pytest.approx(push * math.tan(SAND.friction_angle), rel=1e-2)
    _, slow, _, _ = plate_state(1.0, **aside, lateral_speed_ratio=200.0)
    assert abs(slow) < 0.02 * push
    # It pushes no soil ahead, and bears less than where it rolls.
    ahead = {'bulldozing': {'kb': 1.0}}
    row = {'slip_angle': math.pi / 2, 'lateral_speed_ratio': 0.5}
    plain, blade = (state([1.0], effects=e, **row).drawbar_pull[0] for e in ({}, ahead))
    assert blade == pytest.approx(plain, abs=1e-6)
    # Wholly from the side, the soil has lost the stated share of its stiffness.
    soft = state([1.0], effects={'slip_sinkage_exponent': {'n1': 0.0, 'side': 0.6}}, **row)
    weaker = replace(SAND, cohesive_modulus=0.4 * SAND.cohesive_modulus,
                     frictional_modulus=0.4 * SAND.frictional_modulus)  # fmt: skip
    assert soft.sinkage == pytest.approx(state([1.0], soil=weaker, **row).sinkage)
