# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Lugs as blades that push against the soil, each with its passive resistance."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects.base import Effect, EffectParameter, Form
from wheel_terra_estimator.terramechanics.quantity import Quantity


def _thrust(contact: Contact[Quantity], p: SimpleNamespace) -> None:
    slip = np.maximum(contact.slip, 0.0)
    passive = _passive_coefficient(contact)
    _push(contact, p.share, (passive - 1.0) * slip, slip)


def _textbook(contact: Contact[Quantity], p: SimpleNamespace) -> None:
    slip = np.maximum(contact.slip, 0.0)
    _push(contact, p.share, _passive_coefficient(contact), slip)


def _passive_coefficient(contact: Contact[Quantity]) -> Quantity:
    """Rankine's Np = tan^2(pi/4 + phi/2) [-]."""
    friction = np.arctan(contact.soil_friction)
    return np.tan(0.25 * np.pi + 0.5 * friction) ** 2


def _push(contact: Contact[Quantity], share: float, of_surcharge: Quantity, slip: Quantity) -> None:
    """Add the thrust of the lugs in the contact, with the given factor on the surcharge q h."""
    span = contact.entrance_angle - contact.leaving_angle
    engaged = contact.lug_count * span / (2.0 * np.pi)
    passive = _passive_coefficient(contact)
    height = contact.lug_height
    surcharge = contact.normal_load / (contact.width * contact.radius * span)
    blade = (
        0.5 * contact.density * contact.gravity * height * height * passive
        + surcharge * height * of_surcharge
        + 2.0 * contact.cohesion * height * np.sqrt(passive)
    )
    mobilised = -np.expm1(-slip * contact.radius * span / contact.shear_modulus)
    thrust = contact.direction * share * contact.width * engaged * blade * mobilised
    contact.drawbar_pull = contact.drawbar_pull + thrust
    contact.torque = contact.torque + thrust * (contact.radius + 0.5 * height)


_SHARE = EffectParameter(
    'share', '-', 0.15, 0.0, 1.5, 0.2, 'half_normal', 'share of the full passive thrust'
)

EFFECT = Effect(
    name='grouser_thrust',
    claim='lugs push against the soil like blades, each with its passive resistance',
    form='slip',
    symbol='F += share b n_e [rho g h^2 Np/2 + q h (Np - 1) s + 2 c h sqrt(Np)] (1 - exp(-s L/K))',
    parameters=(_SHARE,),
    touches=frozenset({'drawbar_pull', 'torque'}),
    needs=('slip', 'lug_height'),
    confounded_with={
        'lug_shear_radius': 'torque over pull: the longer arm gains twice as much torque',
        'cohesion': 'lug height and load series',
    },
    incompatible_with=frozenset({'lug_shear_radius'}),
    validity='lugs far apart; counts the same thrust as a larger shear radius, hence not with it',
    source='passive earth pressure on n_e grousers in the contact (Bekker 1969, book, no DOI, read '
    'at second hand)',
    on_outputs=_thrust,
    other_forms=(
        Form(
            name='textbook',
            claim='lugs push against the soil like blades under the whole load of the contact',
            symbol='F += share b n_e [rho g h^2 Np/2 + q h Np + 2 c h sqrt(Np)] (1 - exp(-s L/K))',
            parameters=(_SHARE,),
            validity='lugs far apart; counts the same thrust as a larger shear radius, hence not '
            'with it',
            source='Bekker 1969 and Wong, Theory of Ground Vehicles (books, no DOI): Rankine '
            'passive pressure with surcharge q; n_e lugs in the contact of length L',
            on_outputs=_textbook,
        ),
    ),
)
