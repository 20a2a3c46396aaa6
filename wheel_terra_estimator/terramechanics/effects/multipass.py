# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Later wheels run in soil that earlier ones compacted."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects.base import Effect, EffectParameter, Form
from wheel_terra_estimator.terramechanics.quantity import Quantity


def _compacted(contact: Contact[Quantity], p: SimpleNamespace) -> None:
    gain = p.stiffening * _earlier_passes(contact)
    contact.bearing_modulus = contact.bearing_modulus * (1.0 + gain)


def _rut_stress(contact: Contact[Quantity], p: SimpleNamespace) -> None:
    rut = p.rut * _earlier_passes(contact) / contact.reference_depth
    share = np.maximum(contact.normal_stress / contact.bearing_modulus, 0.0)
    depth = share ** (1.0 / contact.sinkage_exponent)  # below the bottom of the rut, over z0
    stress = contact.bearing_modulus * (depth + rut) ** contact.sinkage_exponent
    contact.normal_stress = np.where(rut > 0.0, stress, contact.normal_stress)


def _rut_depth(contact: Contact[Quantity], p: SimpleNamespace) -> None:
    contact.sinkage = contact.sinkage + p.rut * _earlier_passes(contact)


def _earlier_passes(contact: Contact[Quantity]) -> Quantity:
    """Weight of the earlier passes, 0, 1, 3/2, 7/4, ...: each does half as much as the last."""
    earlier = np.maximum(contact.pass_number - 1.0, 0.0)
    return 2.0 * (1.0 - np.exp(-0.6931471805599453 * earlier))


EFFECT = Effect(
    name='multipass',
    claim='later wheels or passes run in soil that the earlier ones compacted',
    form='stiffening',
    symbol='k_i = k [1 + 2 stiffening (1 - 2^(1-i))], i = pass number',
    parameters=(
        EffectParameter(
            'stiffening', '-', 0.5, -0.3, 5.0, 0.5, 'half_normal', 'gain of stiffness of pass 2'
        ),
    ),
    touches=frozenset({'sinkage', 'drawbar_pull', 'torque'}),
    needs=('pass_number',),
    confounded_with={
        'rate_dependence': 'the same pass at another speed',
        'hard_layer': 'a load series on virgin soil',
    },
    validity='the same rut; passes that do not dig',
    source='form after Holm 1969 (saturating gain of stiffness), own reconstruction',
    on_inputs=_compacted,
    other_forms=(
        Form(
            name='rut',
            claim='later wheels start at the bottom of the rut, where the soil has borne its '
            'pressure already',
            symbol='p = k (z + z_r)^N below the rut, sinkage z + z_r, z_r = 2 rut (1 - 2^(1-i))',
            parameters=(
                EffectParameter(
                    'rut', 'm', 0.005, 0.0, 0.2, 0.01, 'half_normal', 'depth that pass 1 leaves'
                ),
            ),
            validity='the same rut, its walls not counted; soil that does not spring back',
            source='Wong 1989 (book, no DOI), repetitive loading: at the depth of before, the '
            'pressure of before',
            on_normal_stress=_rut_stress,
            on_outputs=_rut_depth,
        ),
    ),
)
