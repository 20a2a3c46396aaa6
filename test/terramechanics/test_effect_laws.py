# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Each form of an effect against a contact integrated by hand, written from the equations alone."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from terra_tools import SAND, WHEEL, state

from wheel_terra_estimator.terramechanics import effects
from wheel_terra_estimator.terramechanics.conditioned import (
    ConditionedForces,
    ConditionedInputs,
    contacts_as_built,
)
from wheel_terra_estimator.terramechanics.effects import Effect, EffectParameter, catalogue
from wheel_terra_estimator.terramechanics.effects.learned_closure import FEATURES, TARGETS
from wheel_terra_estimator.terramechanics.soil import Soil
from wheel_terra_estimator.terramechanics.terms import Terms
from wheel_terra_estimator.terramechanics.wheel import Wheel

TAN = math.tan(SAND.friction_angle)
G = 9.80665
LOAD = 240.0
SLIPS = (-0.3, 0.1, 0.6)


def model(slip: float, name: str, load: float = LOAD, **others) -> np.ndarray:
    base, _, form = name.partition(':')
    values = others.pop('values', {})
    settings = {base: {**({'form': form} if form else {}), **values}}
    return state(slip, load, effects=settings, **others).outputs()[0]


@pytest.mark.parametrize('slip', SLIPS)
def test_the_default_form_of_shear_deformation_is_a_factor_on_the_modulus(slip):
    stiff = Soil(**{**SAND.__dict__, 'shear_modulus': 1.5 * SAND.shear_modulus})
    ours = model(slip, 'shear_deformation', values={'log_factor': math.log(1.5)})
    assert ours == pytest.approx(state(slip, LOAD, soil=stiff).outputs()[0])


def test_friction_by_rate_costs_nothing_where_no_rate_is_known():
    """Effects on a channel are held against the campaigns' own formulas (test/lab/trials)."""
    name, damping = 'drivetrain_friction:viscous', {'damping': 0.5}
    found = model(0.3, name, values=damping, angular_velocity=math.nan)
    assert found[2] == pytest.approx(state(0.3, LOAD).torque[0])


def test_a_gain_acts_before_a_zero_error_and_after_the_soil():
    settings = {
        'sinkage_offset': {'offset': 0.002},
        'sinkage_gain': {'gain': 0.2},
        'lug_digging': {'kd': 1.0, 'rework': 1.0},
    }
    z = state(0.6, LOAD).sinkage[0]
    read = state(0.6, LOAD, effects=settings).sinkage[0]
    dug = WHEEL.lug_height * 0.6 / (1.0 - 0.6)
    assert read == pytest.approx(1.2 * (z + dug) + 0.002)


@pytest.mark.parametrize(('inside', 'felt'), [(-0.001, 0.0), (5e-4, 1.25e-4), (0.003, 0.0025)])
def test_a_hard_layer_begins_within_a_millimetre(inside, felt):
    """As printed: <x> = x^2 / (2 mm) up to x = 1 mm, x - 0.5 mm beyond."""
    stiffness, depth, radius, entrance = 2e6, 0.02, 0.2, 0.8
    angle = math.acos(math.cos(entrance) + (depth + inside) / radius)
    contact = SimpleNamespace(
        radius=radius, entrance_angle=entrance, angle=np.array([angle]), normal_stress=100.0
    )
    catalogue()['hard_layer'].on_normal_stress(
        contact, SimpleNamespace(stiffness=stiffness, depth=depth)
    )
    assert contact.normal_stress == pytest.approx([100.0 + stiffness * felt])


@pytest.mark.parametrize('name', ['soil_mound', 'soil_mound:conveyed'])
def test_the_soil_behind_the_wheel_stands_as_high_as_the_formula_says(name):
    slip, kappa, band = 0.7, 1.5, 0.003
    shape = {'band': band} if ':' in name else {'onset': 0.4}
    settings = {'soil_mound': {'form': name.partition(':')[2] or 'onset', 'kappa': kappa, **shape}}
    found = state(slip, LOAD, effects=settings)
    z = found.sinkage[0]
    conveyed = (WHEEL.lug_height + band) * slip / (1.0 - slip)
    x = conveyed / (conveyed + z) if ':' in name else (slip - 0.4) / (1.0 - 0.4)
    base = 1.0 - math.cos(SAND.leaving_angle_ratio * math.acos(1.0 - z / WHEEL.radius))
    rise = kappa * z / WHEEL.radius * x * x
    height = base + (1.0 - base) * (1.0 - math.exp(-rise / (1.0 - base)))
    assert 1.0 - math.cos(found.leaving_angle[0]) == pytest.approx(height, rel=1e-9)


ON_STRESS = {'hard_layer', 'hard_layer:bearing', 'multipass:rut'}
VARIANTS = [form.name for effect in catalogue().values() for form in effect.forms]


@pytest.mark.parametrize('name', [name for name in VARIANTS if name not in ON_STRESS])
@pytest.mark.parametrize('slip', [-0.3, 0.4])
def test_the_filter_s_forces_from_the_sinkage_agree_with_the_model(name, slip):
    """What stands at the sinkage of the steady state gives its torque and pull."""
    steady = state(slip, 150.0, effects={name: {}}, method='closed_form', angular_velocity=2.0)
    wheel = ConditionedForces(WHEEL, SAND, {name: {}})
    ratio = 1.0 - slip if slip >= 0.0 else 1.0 / (1.0 + slip)
    torque, pull = wheel.forces(
        ConditionedInputs(
            ratio,
            steady.sinkage[0],
            150.0,
            SAND.cohesion,
            TAN,
            SAND.shear_modulus,
            rim_speed=2.0 * WHEEL.radius,
        )
    )
    assert torque[0] == pytest.approx(steady.torque[0], rel=2e-3, abs=0.01)
    assert pull[0] == pytest.approx(steady.drawbar_pull[0], rel=2e-3, abs=0.1)


@pytest.mark.parametrize('name', ['bulldozing', 'bulldozing:terzaghi', 'grouser_thrust'])
def test_soil_is_pushed_with_its_own_friction_whatever_that_of_the_rim(name):
    """What the soil gives to a wall of soil, at one contact, does not know the rim."""

    def pushed(*others: str) -> float:
        settings = {key: {} for key in (name, *others)}
        contact = contacts_as_built(Wheel(0.15, 0.15, 0.002, 24), SAND, G)
        contact.slip = contact.velocity_ratio = 0.3
        contact.cohesion, contact.tan_friction, contact.shear_modulus = 500.0, TAN, 0.01
        contact.normal_load, contact.direction = LOAD, 1.0
        terms = Terms(effects.with_defaults(settings))
        terms.apply('on_inputs', contact)
        contact.entrance_angle, contact.leaving_angle = 0.6, -0.1
        terms.apply('on_outputs', contact)
        return float(contact.drawbar_pull[0])

    assert abs(pushed()) > 1.0
    assert pushed('rim_friction') == pytest.approx(pushed(), rel=1e-12)


LASTING = (
    'width', 'lug_height', 'lug_count', 'lug_thickness', 'gravity', 'density', 'reference_depth',
    'rim_speed', 'pass_number', 'slope', 'direction',
)  # fmt: skip


def test_a_term_may_change_what_stays_from_call_to_call(monkeypatch):
    """Wheel, soil and motion are those of the call, however often the term has changed them."""

    def halve(contact, p) -> None:
        seen.append([float(np.ravel(getattr(contact, name))[0]) for name in LASTING])
        for name in LASTING:
            setattr(contact, name, p.share * getattr(contact, name))

    seen: list[list[float]] = []
    share = EffectParameter('share', '-', 0.5, 0.0, 1.0, 0.5, 'normal', '', neutral=1.0)
    effect = Effect(
        'halved', '', '', (share,), frozenset({'torque'}), 'none', 'none', on_inputs=halve
    )
    monkeypatch.setattr(effects, '_registered', {'halved': effect})
    forces = ConditionedForces(WHEEL, SAND, {'halved': {}})
    seen.clear()
    motion = {'rim_speed': 0.3, 'pass_number': 2.0, 'slope': 0.1, 'direction': -1.0}
    for _ in range(3):
        forces.forces(ConditionedInputs(0.7, 0.01, 80.0, 500.0, TAN, 0.01, **motion))
    wheel = (WHEEL.width, WHEEL.lug_height, WHEEL.lug_count, WHEEL.lug_thickness)
    assert len(seen) == 3
    for values in seen:
        assert values == [*wheel, G, SAND.density, seen[0][6], *motion.values()]


# Digging in above the slip of a steady state.


HEAVY = 10.0 * 1600.0 * 9.8 * 0.1 * 0.2**2  # ten times rho g b r^2
CONTACT = {
    'slip': -0.5,
    'stated_load': HEAVY,
    'direction': -1.0,
    'torque': 0.3 * HEAVY * 0.2,
    'drawbar_pull': -0.2 * HEAVY,
    'density': 1600.0,
    'gravity': 9.8,
    'width': 0.1,
    'radius': 0.2,
    'lug_height': 0.01,
    'rim_speed': 0.5,
    'pass_number': 3.0,
    'slope': 0.1,
    'entrance_angle': math.acos(0.75),
}
BY_HAND = {
    'one': 1.0,
    'slip': 0.5,
    'slip_squared': 0.25,
    'slip_over_02': 0.3,
    'slip_over_04': 0.1,
    'slip_over_06': 0.0,
    'slip_near_02': 0.0,  # 0.3 away, beyond the foot at 0.25
    'slip_near_04': 0.7056,  # (1 - 0.4^2)^2
    'slip_near_06': 0.7056,
    'load': 1.0,  # a decade
    'lug': 0.05,
    'width': 0.5,
    'rim_speed': 1.0,  # a decade above 0.05 m/s
    'pass': 2.0,  # earlier ones
    'slope': 0.1,
    'depth': 0.25,  # z/r = 1 - cos(t1)
    'slip_times_load': 0.5,
    'slip_times_lug': 0.025,
    'slip_times_width': 0.25,
    'slip_times_rim_speed': 0.5,
    'slip_times_pass': 1.0,
    'load_times_lug': 0.05,
    'load_times_rim_speed': 1.0,
    'load_times_pass': 2.0,
    'pull': 0.2,  # as it would be forward
    'torque': -0.3,
    'torque_squared': -0.9,  # against the way: 0.3^2 of W r, ten times as heavy as rho g b r^2
}


def test_a_feature_is_what_it_says():
    contact = SimpleNamespace(**CONTACT)
    arrays = SimpleNamespace(**{key: np.array([value]) for key, value in CONTACT.items()})
    for name, feature in FEATURES.items():
        assert feature.value(contact) == pytest.approx(BY_HAND[name], abs=1e-12), name
        assert feature.value(arrays) == pytest.approx([BY_HAND[name]], abs=1e-12), name


def test_a_rim_speed_that_was_not_recorded_is_the_usual_one():
    contact = SimpleNamespace(**{**CONTACT, 'rim_speed': math.nan})
    assert FEATURES['rim_speed'].value(contact) == 0.0


def test_a_correction_of_the_usual_size_is_far_from_its_bound():
    """Three prior deviations: a bound that is nearer would be the prior."""
    for name, target in TARGETS.items():
        assert target.bound >= 3.0 * target.usual, name
