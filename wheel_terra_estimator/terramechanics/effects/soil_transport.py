# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The wheel carries soil round with it."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects.base import Effect, EffectParameter
from wheel_terra_estimator.terramechanics.quantity import Quantity


def _carry(contact: Contact[Quantity], p: SimpleNamespace) -> None:
    slip = np.maximum(contact.slip, 0.0)
    layer = p.fill * contact.lug_height * slip
    weight = contact.density * contact.gravity * contact.width * layer  # per rim travel
    contact.sinkage = contact.sinkage + layer
    lifted = 2.0 * contact.rim_radius
    contact.torque = contact.torque + contact.direction * weight * lifted * contact.rim_radius


EFFECT = Effect(
    name='soil_transport',
    claim='the wheel carries soil round with it: the rut gets deeper, lifting it takes torque',
    symbol='z += fill h s;  T += rho g b (fill h s) 2 r r sgn(w)',
    parameters=(
        EffectParameter(
            'fill', '-', 0.5, 0.0, 2.0, 0.5, 'half_normal', 'share of the lug height carried round'
        ),
    ),
    touches=frozenset({'sinkage', 'torque'}),
    needs=('slip', 'lug_height'),
    confounded_with={
        'lug_digging': 'torque, which digging leaves alone; a film of the wheel from the side',
        'drivetrain_friction': 'sinkage; torque of the wheel in the air',
    },
    validity='lugs that hold soil up to the top of the wheel; slip 0 to 0.9',
    source='balance of volume (soil dug per rim travel after Ding et al. 2010 eq. 12, doi '
    '10.1007/s11771-010-0021-7) and of energy: weight lifted by 2 r',
    on_outputs=_carry,
)
