# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The flank of a wheel that slides sideways pushes soil aside."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects.base import Effect, EffectParameter
from wheel_terra_estimator.terramechanics.effects.bulldozing import wedge_resistance
from wheel_terra_estimator.terramechanics.stresses import mobilised_share

# Gauss's nodes and weights on (0, 1), over the flank in the soil.
_NODES = tuple(
    (0.5 * (x + 1.0), 0.5 * w)
    for x, w in zip(*(part.tolist() for part in np.polynomial.legendre.leggauss(8)), strict=True)
)


def _push_aside(contact: Contact, p: SimpleNamespace, maths: Any) -> None:
    if contact.straight:
        return
    t1, r = contact.entrance_angle, contact.radius
    span, edge = t1 - contact.leaving_angle, maths.cos(t1)
    force = 0.0
    for place, weight in _NODES:
        behind_entry = place * span
        cosine = maths.cos(t1 - behind_entry)
        depth = maths.maximum(r * (cosine - edge), 0.0)
        moved = mobilised_share(contact.lateral_ratio * behind_entry, contact.shear_modulus, maths)
        force = force + weight * moved * wedge_resistance(contact, depth, maths) * (
            r - depth * cosine
        )
    contact.lateral_force = contact.lateral_force - p.ks * span * force


EFFECT = Effect(
    name='side_bulldozing',
    claim='a wheel that slides sideways pushes soil aside with its flank',
    symbol='F_y -= ks Int D1 (c h + D2 rho g h^2/2) (1 - exp(-|j_y|/K)) (r - h cos t) dt, '
    'h = r (cos t - cos t_1), j_y = (v_y/w)(t_1 - t); D1, D2 as in bulldozing',
    parameters=(
        EffectParameter(
            'ks', '-', 1.0, 0.0, 5.0, 0.5, 'half_normal', 'share of the full passive resistance'
        ),
    ),
    touches=frozenset({'lateral_force'}),
    needs=('slip_angle',),
    validity='flank smooth and upright, sinkage below half the radius; the share that the lateral '
    'displacement mobilises is taken as that of shear, so that no slip angle gives no force',
    source='Ishigami et al. 2007 eq. 9 and 11 (doi 10.1002/rob.20187), resistance of Hegedus 1960',
    on_outputs=_push_aside,
)
