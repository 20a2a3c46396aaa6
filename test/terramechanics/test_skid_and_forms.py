# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A skidding wheel digs in; an effect has several forms, of which settings choose one."""

import pytest
from terra_tools import SAND, points, state

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.terramechanics.effects import (
    Effect,
    EffectParameter,
    Form,
    by_variant,
    catalogue,
)
from wheel_terra_estimator.terramechanics.model import METHODS, WheelSoilModel
from wheel_terra_estimator.terramechanics.soil import Soil
from wheel_terra_estimator.terramechanics.wheel import Wheel

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
            other_forms=(Form('other', 'c', 's', (other,), 'v', 's', on_outputs=term),),
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
