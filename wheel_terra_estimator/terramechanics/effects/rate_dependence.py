# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Strength of the soil depends on the speed of the rim."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects.base import Effect, EffectParameter
from wheel_terra_estimator.terramechanics.quantity import Quantity

REFERENCE_SPEED = 0.05  # [m/s]; rover speed, below which Ding et al. 2010 saw no influence


def _rate(contact: Contact[Quantity], p: SimpleNamespace) -> None:
    known = contact.rim_speed > 1e-4
    speed = np.where(known, contact.rim_speed, REFERENCE_SPEED)
    decades = np.log(speed / REFERENCE_SPEED)
    contact.bearing_modulus = contact.bearing_modulus * np.exp(p.bearing * decades)
    shear = np.exp(p.shear * decades)
    contact.cohesion = contact.cohesion * shear
    contact.tan_friction = contact.tan_friction * shear


EFFECT = Effect(
    name='rate_dependence',
    claim='bearing or shear strength depends on the rim speed',
    symbol='k *= (v_rim/0.05 m/s)^bearing;  c, tan(phi) *= (v_rim/0.05 m/s)^shear',
    parameters=(
        EffectParameter(
            'bearing', '-', 0.1, -0.6, 0.6, 0.15, 'normal', 'exponent of the bearing strength'
        ),
        EffectParameter(
            'shear', '-', 0.0, -0.4, 0.4, 0.05, 'normal', 'exponent of the shear strength'
        ),
    ),
    touches=frozenset({'sinkage', 'drawbar_pull', 'torque'}),
    needs=('angular_velocity',),
    confounded_with={'multipass': 'the same speed on virgin soil and in the rut'},
    validity='rim speed 1 mm/s to 1 m/s; no influence where the speed is not recorded',
    source='own power law; Ding et al. 2010 (doi 10.1007/s11771-010-0021-7): none below 55 mm/s',
    on_inputs=_rate,
)
