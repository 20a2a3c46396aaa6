# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Soil between the lugs moves with the wheel: shear acts outside the rim."""

from __future__ import annotations

from types import SimpleNamespace

from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects.base import Effect, EffectParameter
from wheel_terra_estimator.terramechanics.quantity import Quantity


def _radius(contact: Contact[Quantity], p: SimpleNamespace) -> None:
    contact.shear_radius = contact.shear_radius + p.lam * contact.lug_height


EFFECT = Effect(
    name='lug_shear_radius',
    claim='shear acts at the radius r + lambda h, not at the rim',
    symbol='R = r + lam h',
    parameters=(
        EffectParameter(
            'lam', '-', 0.5, 0.0, 1.0, 0.5, 'half_normal', 'share of the lug height, lambda'
        ),
    ),
    touches=frozenset({'sinkage', 'drawbar_pull', 'torque'}),
    needs=('lug_height',),
    confounded_with={
        'wheel_radius_bias': 'rows with other lugs or none; roll-out on a hard floor',
        'drivetrain_friction': 'torque of the wheel in the air; pull',
    },
    validity='lugs close enough for a closed shear ring (spacing below about four heights)',
    source='Ding et al. 2010 eqs 14 and 16, lambda = 0.5 (doi 10.1007/s11771-010-0021-7)',
    on_inputs=_radius,
)
