# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What lugs do: dig, carry, move the shear outwards, push against the soil, carry it round."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from wheel_terra_estimator.arrays import Quantity
from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects.base import Effect, Form, magnitude, shape
from wheel_terra_estimator.terramechanics.kinematics import STEADY_SLIP


def _dig(contact: Contact, p: SimpleNamespace) -> None:
    slip = np.maximum(contact.slip, 0.0)
    again = slip / (1.0 - np.minimum(slip, STEADY_SLIP))  # lugs per advance, less the first
    contact.sinkage = contact.sinkage + p.kd * contact.lug_height * slip * (1.0 + p.rework * again)


def _saturating(contact: Contact, p: SimpleNamespace) -> None:
    slip = np.maximum(contact.slip, 0.0)
    dug = -np.expm1(-slip / p.range)
    contact.sinkage = contact.sinkage + p.kd * contact.lug_height * dug


_KD = magnitude('kd', '-', 1.0, 0.0, 4.0, 1.0, 'share of the lug height dug in the end')

LUG_DIGGING = Effect(
    name='lug_digging',
    claim='lugs dig soil out: sinkage grows with lug height times slip, forces do not change',
    form='linear',
    symbol='z += kd h s  (rework = 1: kd h s/(1 - s))',
    parameters=(
        _KD,
        magnitude(
            'rework',
            '-',
            0.0,
            0.0,
            1.0,
            0.3,
            'digging counted per rim travel (0) or per advance (1)',
            free=False,
        ),
    ),
    touches=frozenset({'sinkage'}),
    needs=('slip', 'lug_height'),
    confounded_with={'slip_sinkage_exponent': 'pull and torque; a second lug height; load'},
    validity='s from 0 to 0.9',
    source='Ding et al. 2010 eqs 9 to 12 and 20 (doi 10.1007/s11771-010-0021-7)',
    on_outputs=_dig,
    other_forms=(
        Form(
            name='saturating',
            claim='lugs dig soil out: sinkage grows with slip at first, then no further',
            symbol='z += kd h (1 - exp(-s/range))',
            parameters=(
                _KD,
                shape('range', '-', 0.3, 0.03, 2.0, 0.15, 'slip at which two thirds are dug'),
            ),
            validity='s from 0 to 0.9; lugs that fill up',
            source='own form: the linear law of Ding et al. 2010 eq. 12, soil falls back',
            on_outputs=_saturating,
        ),
    ),
)


def _radius(contact: Contact, p: SimpleNamespace) -> None:
    contact.shear_radius = contact.shear_radius + p.lam * contact.lug_height


LUG_SHEAR_RADIUS = Effect(
    name='lug_shear_radius',
    claim='shear acts at the radius r + lambda h, not at the rim',
    symbol='R = r + lam h',
    parameters=(magnitude('lam', '-', 0.5, 0.0, 1.0, 0.5, 'share of the lug height, lambda'),),
    needs=('lug_height',),
    confounded_with={
        'wheel_radius_bias': 'rows with other lugs or none; roll-out on a hard floor',
        'drivetrain_friction': 'torque of the wheel in the air; pull',
    },
    validity='lugs close enough for a closed shear ring (spacing below about four heights)',
    source='Ding et al. 2010 eqs 14 and 16, lambda = 0.5 (doi 10.1007/s11771-010-0021-7)',
    on_inputs=_radius,
)


def _support(contact: Contact, p: SimpleNamespace) -> None:
    lifted = np.where(contact.lug_height > 0.0, p.dz4, 0.0)
    contact.sinkage = contact.sinkage - lifted


def _by_height(contact: Contact, p: SimpleNamespace) -> None:
    high = np.maximum(contact.lug_height - p.free_height, 0.0)
    contact.sinkage = contact.sinkage - p.share * high


LUG_SUPPORT = Effect(
    name='lug_support',
    claim='lugs carry load: sinkage of a lugged wheel is smaller by a constant',
    form='constant',
    symbol='z -= dz4 where h > 0',
    parameters=(magnitude('dz4', 'm', 0.0015, 0.0, 0.02, 0.002, 'sinkage saved by the lugs'),),
    touches=frozenset({'sinkage'}),
    needs=('lug_height',),
    confounded_with={'sinkage_offset': 'a smooth wheel; the sensor zero on a hard floor'},
    validity='thin lugs; 1.5 mm at h = 10 mm and 3 mm at h = 15 mm in the source, at 80 N',
    source='Ding et al. 2010 section 3.2.2, eq. 20 (doi 10.1007/s11771-010-0021-7)',
    on_outputs=_support,
    other_forms=(
        Form(
            name='by_height',
            claim='lugs carry load: sinkage is smaller by a share of the lug height',
            symbol='z -= share (h - free_height)+',
            parameters=(
                magnitude('share', '-', 0.3, 0.0, 2.0, 0.3, 'sinkage saved per lug height'),
                shape(
                    'free_height',
                    'm',
                    0.005,
                    0.0,
                    0.05,
                    0.003,
                    'height of lugs that carry nothing yet',
                    free=False,
                ),
            ),
            validity='thin lugs; the defaults give the two values of the source',
            source='straight line through the two values of Ding et al. 2010 '
            '(doi 10.1007/s11771-010-0021-7)',
            on_outputs=_by_height,
        ),
    ),
)


def _thrust(contact: Contact, p: SimpleNamespace) -> None:
    slip = np.maximum(contact.slip, 0.0)
    passive = _passive_coefficient(contact)
    _push(contact, p.share, (passive - 1.0) * slip, slip)


def _textbook(contact: Contact, p: SimpleNamespace) -> None:
    slip = np.maximum(contact.slip, 0.0)
    _push(contact, p.share, _passive_coefficient(contact), slip)


def _passive_coefficient(contact: Contact) -> Quantity:
    """Rankine's Np = tan^2(pi/4 + phi/2) [-]."""
    friction = np.arctan(contact.soil_friction)
    return np.tan(0.25 * np.pi + 0.5 * friction) ** 2


def _push(contact: Contact, share: float, of_surcharge: Quantity, slip: Quantity) -> None:
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


_SHARE = magnitude('share', '-', 0.15, 0.0, 1.5, 0.2, 'share of the full passive thrust')

GROUSER_THRUST = Effect(
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
            source='Bekker 1969 and Wong, Theory of Ground Vehicles (books, no DOI): Rankine '
            'passive pressure with surcharge q; n_e lugs in the contact of length L',
            on_outputs=_textbook,
        ),
    ),
)


def _carry(contact: Contact, p: SimpleNamespace) -> None:
    slip = np.maximum(contact.slip, 0.0)
    layer = p.fill * contact.lug_height * slip
    weight = contact.density * contact.gravity * contact.width * layer  # per rim travel
    contact.sinkage = contact.sinkage + layer
    lifted = 2.0 * contact.rim_radius
    contact.torque = contact.torque + contact.direction * weight * lifted * contact.rim_radius


SOIL_TRANSPORT = Effect(
    name='soil_transport',
    claim='the wheel carries soil round with it: the rut gets deeper, lifting it takes torque',
    symbol='z += fill h s;  T += rho g b (fill h s) 2 r r sgn(w)',
    parameters=(
        magnitude('fill', '-', 0.5, 0.0, 2.0, 0.5, 'share of the lug height carried round'),
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
