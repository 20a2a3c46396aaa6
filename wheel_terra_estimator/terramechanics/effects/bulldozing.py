# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Soil pushed ahead of the wheel resists."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects.base import Effect, EffectParameter


def _push(contact: Contact, p: SimpleNamespace, maths: Any) -> None:
    friction = maths.arctan(contact.tan_friction)
    wedge = 0.25 * maths.pi - 0.5 * friction  # angle of the failure plane, Xc
    cot = 1.0 / maths.tan(wedge)
    d1 = cot + maths.tan(wedge + friction)
    d2 = cot + cot * cot * contact.tan_friction
    depth = contact.radius * (1.0 - maths.cos(contact.entrance_angle))
    weight = contact.density * contact.gravity
    resistance = contact.width * d1 * (contact.cohesion * depth + 0.5 * d2 * weight * depth**2)
    contact.drawbar_pull = contact.drawbar_pull - contact.direction * p.kb * resistance


EFFECT = Effect(
    name='bulldozing',
    claim='soil is pushed ahead of the wheel',
    symbol='F -= kb b D1 (c z + D2 rho g z^2/2), D1 = cot X + tan(X + phi), '
    'D2 = cot X + cot^2 X tan(phi), X = pi/4 - phi/2',
    parameters=(
        EffectParameter(
            'kb', '-', 0.5, 0.0, 5.0, 0.5, 'half_normal', 'share of the full passive wedge'
        ),
    ),
    touches=frozenset({'drawbar_pull'}),
    confounded_with={'pitch_bias': 'three times the load or another wheel; a level check'},
    validity='sinkage below half the radius; the wedge is taken over the rim width',
    source='Hegedus 1960 in the form of Ishigami et al. 2007 (side force turned to the front)',
    on_outputs=_push,
)
