# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A stiff layer at some depth."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects.base import Effect, EffectParameter

_BLEND = 0.001  # [m]; the layer comes in over a millimetre, so that derivatives exist


def _layer(contact: Contact, p: SimpleNamespace, maths: Any) -> None:
    depth = contact.radius * (maths.cos(contact.angle) - maths.cos(contact.entrance_angle))
    inside = maths.maximum(depth - p.depth, 0.0)
    blended = maths.where(inside < _BLEND, 0.5 * inside * inside / _BLEND, inside - 0.5 * _BLEND)
    contact.normal_stress = contact.normal_stress + p.stiffness * blended


EFFECT = Effect(
    name='hard_layer',
    claim='a stiff layer at some depth carries the wheel once it gets there',
    symbol='sigma += stiffness (z(t) - depth)+, z(t) = r (cos t - cos t_1)',
    parameters=(
        EffectParameter(
            'stiffness', 'Pa/m', 3e6, 0.0, 1e9, 1e7, 'half_normal', 'added bearing stiffness'
        ),
        EffectParameter(
            'depth', 'm', 0.02, 0.0, 0.3, 0.02, 'normal', 'depth of its top', prior_mean=0.02
        ),
    ),
    touches=frozenset({'sinkage', 'drawbar_pull', 'torque'}),
    needs=('sinkage',),
    confounded_with={
        'multipass': 'virgin soil beside the rut',
        'sinkage_offset': 'a load series',
        'slip_sinkage_exponent': 'a load series; a penetrometer',
    },
    validity='top of the layer not shallower than a few millimetres',
    source='own model: linear bearing of the lower layer, depth from the free surface',
    on_normal_stress=_layer,
)
