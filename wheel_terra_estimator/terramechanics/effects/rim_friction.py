# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Soil slides on a smooth rim at less than its internal friction."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects.base import Effect, EffectParameter
from wheel_terra_estimator.terramechanics.quantity import Quantity


def _slide(contact: Contact[Quantity], p: SimpleNamespace) -> None:
    bare = np.exp(-contact.lug_height / p.ring_height)
    contact.rim_share = 1.0 - p.loss * bare
    contact.tan_friction = contact.tan_friction * contact.rim_share


EFFECT = Effect(
    name='rim_friction',
    claim='soil slides on a smooth rim at less than its internal friction; lugs restore it',
    symbol='tan(phi) *= 1 - loss exp(-h/ring_height)',
    parameters=(
        EffectParameter(
            'loss', '-', 0.25, 0.0, 0.9, 0.25, 'half_normal', 'share of the friction lost at h = 0'
        ),
        EffectParameter(
            'ring_height',
            'm',
            0.003,
            0.0005,
            0.05,
            0.002,
            'normal',
            'lug height at which a ring of soil begins to move with the wheel',
            prior_mean=0.003,
            free=False,
        ),
    ),
    touches=frozenset({'sinkage', 'drawbar_pull', 'torque'}),
    needs=('lug_height',),
    confounded_with={'cohesion': 'a load series; a lugged wheel'},
    validity='metal rims in dry sand, with the friction of soil on soil as '
    'soil.friction_angle_deg; the transition between smooth and lugged is assumed',
    source='Ding et al. 2010 section 2.4 in words (doi 10.1007/s11771-010-0021-7; metal-soil '
    'friction is below soil friction); '
    'formula reconstructed',
    on_inputs=_slide,
)
