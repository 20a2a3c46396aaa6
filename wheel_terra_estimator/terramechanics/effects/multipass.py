# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Later wheels run in soil that earlier ones compacted."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects.base import Effect, EffectParameter


def _compacted(contact: Contact, p: SimpleNamespace, maths: Any) -> None:
    earlier = maths.maximum(contact.pass_number - 1.0, 0.0)
    # 1, 3/2, 7/4, ... times the gain of the second pass: each pass compacts half of what is left.
    gain = p.stiffening * 2.0 * (1.0 - maths.exp(-0.6931471805599453 * earlier))
    contact.bearing_modulus = contact.bearing_modulus * (1.0 + gain)


EFFECT = Effect(
    name='multipass',
    claim='later wheels or passes run in soil that the earlier ones compacted',
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
)
