# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The catalogue: effects do what they say in each form, vanish when neutral, are refused."""

import functools
import warnings
from dataclasses import replace

import numpy as np
import pytest
from terra_tools import SAND, WHEEL, points, state

from wheel_terra_estimator.api import Model
from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.terramechanics import effects as catalogue_module
from wheel_terra_estimator.terramechanics.conditioned import ConditionedForces, ConditionedInputs
from wheel_terra_estimator.terramechanics.effects import (
    OUTPUTS,
    Effect,
    EffectParameter,
    Form,
    by_variant,
    catalogue,
    load_file,
    register,
)
from wheel_terra_estimator.terramechanics.model import METHODS, WheelSoilModel
from wheel_terra_estimator.terramechanics.soil import Soil
from wheel_terra_estimator.terramechanics.wheel import Wheel

LISTED = (
    'slip_sinkage_exponent', 'lug_digging', 'lug_support', 'lug_shear_radius', 'soil_mound',
    'stress_peak_shift', 'slope_gravity', 'bulldozing', 'cohesion', 'multipass',
    'rate_dependence', 'hard_layer', 'drivetrain_friction', 'wheel_radius_bias',
    'sinkage_offset', 'pitch_bias', 'grouser_thrust', 'rim_friction', 'wheel_flexibility',
    'soil_adhesion', 'soil_transport', 'pull_zero', 'pull_gain', 'torque_gain', 'sinkage_gain',
)  # fmt: skip
# Rows on which every effect can show: slips of both signs, a slope, second pass, fast, deep.
ROW = {
    'slip': np.array([-0.4, 0.1, 0.4, 0.8]),
    'load': np.array([60.0, 80.0, 160.0, 480.0]),
    'slope': np.array([0.1, 0.0, 0.2, -0.1]),
    'pass_number': np.array([1, 2, 3, 2]),
    'angular_velocity': np.array([1.0, 0.2, 3.0, 0.5]),
}


@pytest.fixture(autouse=True)
def _forget_registered():
    yield
    catalogue_module._registered.clear()


def outputs(settings: dict, method: str = 'quadrature') -> np.ndarray:
    return state(**ROW, effects=settings, method=method).outputs()


@functools.cache
def plain(method: str) -> np.ndarray:
    return outputs({}, method)


def test_all_listed_names_are_there_and_complete():
    known = catalogue()
    assert set(LISTED) <= set(known)
    for effect in known.values():
        assert effect.parameters and effect.claim and effect.symbol and effect.source
        assert effect.validity
        assert set(effect.confounded_with) <= set(known)
        assert effect.incompatible_with <= set(known)
        assert not any(form.candidate and form.why_aside for form in effect.forms)
        for p in effect.all_parameters:
            assert p.lower <= p.default <= p.upper and p.prior_scale > 0.0 and p.unit
    assert known['lug_digging'].parameters[0].name == 'kd'


# A law without terms (sparse) changes nothing; test_proposal.py is about those with some.
VARIANTS = [
    form.name for effect in catalogue().values() if not effect.sparse for form in effect.forms
]


@pytest.mark.parametrize('name', VARIANTS)
@pytest.mark.parametrize('method', ['quadrature', 'closed_form'])
def test_neutral_values_change_nothing_and_defaults_what_is_said(name, method):
    effect = catalogue()[name]
    neutral = outputs({name: effect.neutral()}, method)
    assert neutral == pytest.approx(plain(method), rel=1e-9, abs=1e-12)
    smooth_rim = name == 'rim_friction'
    wheel = Wheel(WHEEL.radius, WHEEL.width) if smooth_rim else WHEEL
    off = state(**ROW, wheel=wheel, method=method).outputs()
    on = state(**ROW, wheel=wheel, effects={name: {}}, method=method).outputs()
    changed = {
        output for output, column in zip(OUTPUTS, (np.abs(on - off) > 1e-9).T, strict=True)
        if column.any()
    }  # fmt: skip
    aside = {**ROW, 'slip_angle': 0.3, 'wheel': wheel, 'method': method}
    if not changed:
        off, on = (state(**aside, effects=effects) for effects in ({}, {name: {}}))
        pairs = {output: (getattr(off, output), getattr(on, output))
                 for output in (*OUTPUTS, 'lateral_force')}  # fmt: skip
        changed = {output for output, pair in pairs.items() if not np.array_equal(*pair)}
    assert changed == set(effect.touches)


@pytest.mark.parametrize('name', VARIANTS)
def test_closed_form_and_quadrature_tell_the_same_change(name):
    change = [outputs({name: {}}, m) - plain(m) for m in ('quadrature', 'closed_form')]
    for ours, truth, scale in zip(change[1].T, change[0].T, (0.02, 100.0, 10.0), strict=True):
        assert ours == pytest.approx(truth, rel=0.25, abs=0.02 * scale)


@pytest.mark.parametrize('name', LISTED)
def test_a_soil_that_cannot_carry_the_wheel_gives_no_warning_of_numpy(name):
    for ratio, exponent, modulus, load in ((-1.0, 1.1, 1e4, 1e3), (-1.5, 0.3, 1e3, 1e4)):
        soil = replace(
            SAND,
            leaving_angle_ratio=ratio,
            sinkage_exponent=exponent,
            frictional_modulus=modulus,
            cohesive_modulus=0.0,
        )
        with warnings.catch_warnings():
            warnings.simplefilter('error')
            model = WheelSoilModel(soil, {name: {}})
            model.steady_state(points(**{**ROW, 'load': load}))


def test_effects_without_their_column_do_nothing():
    base = state(0.3).outputs()
    for name in ('multipass', 'rate_dependence', 'slope_gravity'):
        assert state(0.3, effects={name: {}}).outputs() == pytest.approx(base), name


@pytest.mark.parametrize(
    ('settings', 'words'),
    [
        ({'bulldozer': {}}, "'effects.bulldozer.enabled'; the nearest"),
        ({'cohesion': None}, 'effect cohesion is of type NoneType'),
        ({'lug_digging': {'k': 1.0}}, "nearest known one is 'effects.lug_digging.kd'"),
        ({'lug_digging': {'kd': 9.0}}, 'at least 0 and at most 4'),
        ({'lug_digging': {'kd': 'much'}}, "'much' is not a number"),
        ({'grouser_thrust': {}, 'lug_shear_radius': {}}, 'cannot be on together'),
        ({'slip_sinkage_exponent': {'form': 'none'}}, 'one of linear, lyasko, load'),
    ],
)
def test_settings_that_are_refused(settings, words):
    with pytest.raises(UserError, match=words):
        Model(WHEEL, SAND, settings)


OWN = """
import numpy as np

from wheel_terra_estimator.terramechanics.effects import Effect, EffectParameter

def term(contact, p):
    contact.normal_stress = contact.normal_stress * (1.0 + p.gain * np.cos(contact.angle))

def drag(contact, p):
    contact.drawbar_pull = contact.drawbar_pull - 10.0 * p.gain

SPRING = Effect(
    name='spring', claim='a test', symbol='s', validity='none', source='none',
    parameters=(EffectParameter('gain', '-', 0.3, 0.0, 2.0, 0.3, 'half_normal', 'gain'),),
    touches=frozenset({'sinkage', 'drawbar_pull', 'torque'}),
    on_normal_stress=term, on_outputs=drag,
)
"""


def test_a_user_s_effect_takes_part_everywhere(tmp_path):
    path = tmp_path / 'own.py'
    path.write_text(OWN)
    load_file(path)
    load_file(path)  # the same file again is fine
    settings = {'spring': {'gain': 0.3}}
    exact = outputs(settings)
    assert (exact[:, 0] < outputs({})[:, 0]).all()
    assert outputs(settings, 'closed_form') == pytest.approx(exact, rel=0.1, abs=2.0)
    inputs = ConditionedInputs(0.7, 0.01, 80.0, 250.0, 0.6, 0.01)
    _, with_effect = ConditionedForces(WHEEL, SAND, settings).forces(inputs)
    _, without = ConditionedForces(WHEEL, SAND).forces(inputs)
    assert with_effect == pytest.approx(without - 3.0)


def test_registering_refuses_taken_names_and_empty_effects(tmp_path):
    with pytest.raises(ValueError, match='cohesion is in the catalogue already'):
        register(catalogue()['cohesion'])
    with pytest.raises(ValueError, match='has no term'):
        Effect(
            'empty', 'c', 's',
            (EffectParameter('a', '-', 0.0, 0.0, 1.0, 1.0, 'normal', 'm'),),
            frozenset({'torque'}), 'v', 's',
        )  # fmt: skip
    broken = tmp_path / 'broken.py'
    broken.write_text('1/0\n')
    with pytest.raises(ValueError, match='ZeroDivisionError'):
        load_file(broken)
    broken.write_text(OWN.replace('(contact, p)', '(contact, p, maths)'))
    with pytest.raises(ValueError, match=r'takes \(contact, parameters\), not 3 arguments'):
        load_file(broken)
    broken.write_text('x = 1\n')
    with pytest.raises(ValueError, match='defines no Effect'):
        load_file(broken)
    with pytest.raises(ValueError, match='not a Python file'):
        load_file(tmp_path / 'missing.py')


# A skidding wheel digs in; an effect has several forms, of which settings choose one.


SKID = 'slip_sinkage_exponent'
FRICTIONLESS = Soil(0.0, 1.2e6, 0.9, 0.0, 0.0, 0.01, 0.3, 0.0)


@pytest.mark.parametrize('method', METHODS)
def test_a_wheel_without_shear_sinks_by_slip_and_skid_alike(method):
    """Without friction and cohesion motion acts through |s| alone, so the sinkage is even in s."""
    model = WheelSoilModel(FRICTIONLESS, {SKID: {'n1': 0.5}}, method)
    z = model.steady_state(points([-0.6, 0.6, 0.0])).sinkage
    # The closed form places its stresses otherwise in skid (branch_moments): its own error.
    assert z[0] == pytest.approx(z[1], rel=0.01 if method == 'closed_form' else 1e-9)
    assert z[0] > 1.5 * z[2]


def test_skid_has_a_coefficient_of_its_own():
    settings = {SKID: {'n1': 0.4, 'n2': -0.1}}
    skid = state(-0.4, effects=settings)
    same = WheelSoilModel(
        Soil(**{**SAND.__dict__, 'sinkage_exponent': SAND.sinkage_exponent + 0.3 * 0.4})
    ).steady_state(points(-0.4))
    assert skid.outputs() == pytest.approx(same.outputs(), rel=1e-9)
    assert state(0.4, effects=settings).outputs() == pytest.approx(
        state(0.4, effects={SKID: {'n1': 0.4}}).outputs()
    )


# The mechanism ---------------------------------------------------------------------------------


def test_forms_are_effects_of_one_form_under_keys_of_their_own():
    effect = catalogue()[SKID]
    names = [form.name for form in effect.forms]
    assert names == [SKID, f'{SKID}:lyasko', f'{SKID}:load']
    assert catalogue()[f'{SKID}:lyasko'] == effect.forms[1]
    assert effect.forms[1].base_name == SKID
    assert {p.name for p in effect.all_parameters} == {'n1', 'n2', 'side', 'gain', 'nw'}
    assert f'{SKID}:none' not in catalogue()
    assert by_variant({SKID: {'form': 'lyasko', 'gain': 0.5}}) == {f'{SKID}:lyasko': {'gain': 0.5}}


def test_two_forms_stand_side_by_side_in_one_model():
    """What a search over forms needs: the one at its neutral value leaves the other alone."""
    both = state(0.4, effects={SKID: {'n1': 0.3}, f'{SKID}:lyasko': {'gain': 0.0}})
    assert both.outputs() == pytest.approx(state(0.4, effects={SKID: {'n1': 0.3}}).outputs())


def test_the_order_of_settings_does_not_matter():
    """A misread slip is put right before any law of the soil sees it."""
    settings = {SKID: {'n1': 0.4}, 'wheel_radius_bias': {'bias': 0.1}, 'stress_peak_shift': {}}
    turned = dict(reversed(settings.items()))
    assert state(0.3, effects=settings).outputs() == pytest.approx(
        state(0.3, effects=turned).outputs(), rel=1e-12
    )
    smooth = Wheel(0.15, 0.15)
    true_slip = 1.0 - (1.0 - 0.3) / 1.1
    known = {SKID: {'n1': 0.4}, 'stress_peak_shift': {}}
    assert state(0.3, wheel=smooth, effects=settings).outputs() == pytest.approx(
        state(true_slip, wheel=smooth, effects=known).outputs(), rel=1e-9
    )


def test_a_shared_parameter_means_the_same_in_every_form():
    def term(contact, p):
        contact.torque = contact.torque + p.a

    one = EffectParameter('a', '-', 0.0, 0.0, 1.0, 1.0, 'normal', 'm')
    other = EffectParameter('a', '-', 0.0, 0.0, 2.0, 1.0, 'normal', 'm')
    with pytest.raises(ValueError, match='states the parameter a in two ways'):
        Effect(
            'twice', 'c', 's', (one,), frozenset({'torque'}), 'v', 's', on_outputs=term,
            other_forms=(Form('other', 'c', 's', (other,), on_outputs=term),),
        )  # fmt: skip


# Configuration ---------------------------------------------------------------------------------

ON = f'effects.{SKID}.enabled:=true'


def configured(*keys: str) -> dict:
    return reader.load(['hit_wh3'], [ON, *(f'effects.{SKID}.{key}' for key in keys)]).effects


def test_the_form_is_a_key_of_the_configuration():
    assert configured('n1:=0.4')[SKID] == {'n1': 0.4, 'n2': 0.0, 'side': 0.0}
    settings = configured('form:=lyasko', 'gain:=0.7')
    assert settings[SKID] == {'form': 'lyasko', 'gain': 0.7}
    assert state(0.4, effects=settings).sinkage > state(0.4).sinkage
    # A later file may choose a form over the parameters of an earlier one.
    assert configured('n1:=0.4', 'form:=lyasko')[SKID] == {'form': 'lyasko', 'gain': 1.0}


@pytest.mark.parametrize(
    ('keys', 'words'),
    [
        (['form:=lyaskos'], "form: 'lyaskos' is unknown, nearest is 'lyasko'"),
        (['gain:=0.7'], f"the form 'linear' has no such parameter; state effects.{SKID}.form: lya"),
    ],
)
def test_keys_of_another_form_are_refused(keys, words):
    with pytest.raises(UserError, match=words):
        configured(*keys)
