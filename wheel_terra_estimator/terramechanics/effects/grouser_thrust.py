# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Lugs as blades that push against the soil, each with its passive resistance."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects.base import Effect, EffectParameter


def _thrust(contact: Contact, p: SimpleNamespace, maths: Any) -> None:
    span = contact.entrance_angle - contact.leaving_angle
    engaged = contact.lug_count * span / (2.0 * maths.pi)
    friction = maths.arctan(contact.tan_friction)
    passive = maths.tan(0.25 * maths.pi + 0.5 * friction) ** 2
    height = contact.lug_height
    slip = maths.maximum(contact.slip, 0.0)
    surcharge = contact.normal_load / (contact.width * contact.radius * span)
    blade = (
        0.5 * contact.density * contact.gravity * height * height * passive
        + surcharge * height * (passive - 1.0) * slip
        + 2.0 * contact.cohesion * height * maths.sqrt(passive)
    )
    mobilised = -maths.expm1(-slip * contact.radius * span / contact.shear_modulus)
    thrust = contact.direction * p.share * contact.width * engaged * blade * mobilised
    contact.drawbar_pull = contact.drawbar_pull + thrust
    contact.torque = contact.torque + thrust * (contact.radius + 0.5 * height)


EFFECT = Effect(
    name='grouser_thrust',
    claim='lugs push against the soil like blades, each with its passive resistance',
    symbol='F += share b n_e [rho g h^2 Np/2 + q h (Np - 1) s + 2 c h sqrt(Np)] (1 - exp(-s L/K))',
    parameters=(
        EffectParameter(
            'share', '-', 0.15, 0.0, 1.5, 0.2, 'half_normal', 'share of the full passive thrust'
        ),
    ),
    touches=frozenset({'drawbar_pull', 'torque'}),
    needs=('slip', 'lug_height'),
    confounded_with={
        'lug_shear_radius': 'torque over pull: the longer arm gains twice as much torque',
        'cohesion': 'lug height and load series (cohesion acts at h = 0 too)',
    },
    incompatible_with=frozenset({'lug_shear_radius'}),
    validity='lugs far apart; counts the same thrust as a larger shear radius, hence not with it',
    source='passive earth pressure on grousers (Bekker 1969), n_e lugs in the contact; after '
    'literature read at second hand',
    on_outputs=_thrust,
)
