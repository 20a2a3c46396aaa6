# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Another bearing strength: with slip, over a layer below, in the rut of earlier wheels."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np

from wheel_terra_estimator.arrays import Quantity
from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects.base import (
    Effect,
    Form,
    magnitude,
    relative_pressure,
    shape,
    signed,
)
from wheel_terra_estimator.terramechanics.kinematics import speed_ratio

_BLEND = 0.001  # depth over which the layer comes in, so that derivatives exist [m]
_LN_2 = math.log(2.0)


def _layer(contact: Contact, p: SimpleNamespace) -> None:
    contact.normal_stress = contact.normal_stress + _support(contact, contact.angle, p)


def _bearing(contact: Contact, p: SimpleNamespace) -> None:
    t1, tm, t2 = contact.entrance_angle, contact.peak_angle, contact.leaving_angle
    mirrored = t1 - (contact.angle - t2) * (t1 - tm) / (tm - t2)
    angle = np.where(contact.angle >= tm, contact.angle, mirrored)
    contact.normal_stress = contact.normal_stress + _support(contact, angle, p)


def _support(contact: Contact, angle: Quantity, p: SimpleNamespace) -> Quantity:
    """Stress that the layer adds where the rim is as deep as at an angle [Pa]."""
    depth = contact.radius * (np.cos(angle) - np.cos(contact.entrance_angle))
    inside = np.maximum(depth - p.depth, 0.0)
    blended = np.where(inside < _BLEND, 0.5 * inside * inside / _BLEND, inside - 0.5 * _BLEND)
    return p.stiffness * blended


_PARAMETERS = (
    magnitude('stiffness', 'Pa/m', 3e6, 0.0, 1e9, 1e7, 'added bearing stiffness'),
    shape('depth', 'm', 0.02, 0.0, 0.3, 0.02, 'depth of its top'),
)

HARD_LAYER = Effect(
    name='hard_layer',
    claim='a stiff layer at some depth carries the wheel once it gets there',
    form='true_depth',
    symbol='sigma += stiffness <z(t) - depth>, z(t) = r (cos t - cos t_1); <x> = x^2/(2 mm) up to '
    'x = 1 mm, x - 0.5 mm beyond',
    parameters=_PARAMETERS,
    needs=('sinkage',),
    confounded_with={
        'multipass': 'virgin soil beside the rut',
        'sinkage_offset': 'a load series',
        'slip_sinkage_exponent': 'a load series; a penetrometer',
    },
    validity='top of the layer not shallower than a few millimetres',
    source='own model: linear bearing of the lower layer, depth from the free surface',
    on_normal_stress=_layer,
    other_forms=(
        Form(
            name='bearing',
            claim='the pressure-sinkage curve stiffens below some depth, as plates show',
            symbol='p(z) = k z^N + stiffness <z - depth>, behind the peak at the mirrored angle',
            parameters=_PARAMETERS,
            source='Wong and Reece 1967 (doi 10.1016/0022-4898(67)90105-X) with the '
            'pressure-sinkage curve of layered ground',
            on_normal_stress=_bearing,
        ),
    ),
)


def _compacted(contact: Contact, p: SimpleNamespace) -> None:
    gain = p.stiffening * _earlier_passes(contact)
    contact.bearing_modulus = contact.bearing_modulus * (1.0 + gain)


def _rut_stress(contact: Contact, p: SimpleNamespace) -> None:
    rut = p.rut * _earlier_passes(contact) / contact.reference_depth
    share = np.maximum(contact.normal_stress / contact.bearing_modulus, 0.0)
    depth = share ** (1.0 / contact.sinkage_exponent)  # below the bottom of the rut, over z0
    stress = contact.bearing_modulus * (depth + rut) ** contact.sinkage_exponent
    contact.normal_stress = np.where(rut > 0.0, stress, contact.normal_stress)


def _rut_depth(contact: Contact, p: SimpleNamespace) -> None:
    contact.sinkage = contact.sinkage + p.rut * _earlier_passes(contact)


def _earlier_passes(contact: Contact) -> Quantity:
    """Weight of the earlier passes, 0, 1, 3/2, 7/4, ...: each does half as much as the last."""
    earlier = np.maximum(contact.pass_number - 1.0, 0.0)
    return 2.0 * (1.0 - np.exp(-_LN_2 * earlier))


MULTIPASS = Effect(
    name='multipass',
    claim='later wheels or passes run in soil that the earlier ones compacted',
    form='stiffening',
    symbol='k_i = k [1 + 2 stiffening (1 - 2^(1-i))], i = pass number',
    parameters=(magnitude('stiffening', '-', 0.5, -0.3, 5.0, 0.5, 'gain of stiffness of pass 2'),),
    needs=('pass_number',),
    confounded_with={
        'rate_dependence': 'the same pass at another speed',
        'hard_layer': 'a load series on virgin soil',
    },
    validity='the same rut; passes that do not dig',
    source='form after Holm 1969 (saturating gain of stiffness), own reconstruction',
    on_inputs=_compacted,
    other_forms=(
        Form(
            name='rut',
            claim='later wheels start at the bottom of the rut, where the soil has borne its '
            'pressure already',
            symbol='p = k (z + z_r)^N below the rut, sinkage z + z_r, z_r = 2 rut (1 - 2^(1-i))',
            parameters=(magnitude('rut', 'm', 0.005, 0.0, 0.2, 0.01, 'depth that pass 1 leaves'),),
            validity='the same rut, its walls not counted; soil that does not spring back',
            source='Wong 1989 (book, no DOI), repetitive loading: at the depth of before, the '
            'pressure of before',
            on_normal_stress=_rut_stress,
            on_outputs=_rut_depth,
        ),
    ),
)


def _sliding(contact: Contact) -> Quantity:
    """Speed of the rim through the soil over the faster of rim and hub; |s| without side slip."""
    if contact.straight:
        return np.abs(contact.slip)
    forward = speed_ratio(contact.slip)
    back, lateral = 1.0 - forward, contact.lateral_ratio / contact.rim_radius
    fastest = np.maximum(np.sqrt(forward * forward + lateral * lateral), 1.0)
    return np.sqrt(back * back + lateral * lateral) / fastest


def _exponent(contact: Contact, p: SimpleNamespace) -> None:
    skid = np.maximum(-contact.slip, 0.0)
    growth = p.n1 * _sliding(contact) + p.n2 * skid
    contact.sinkage_exponent = contact.sinkage_exponent + growth
    if not contact.straight:
        # Soil that enters past the flank has not been rolled over: it bears less.
        cosine, sine = contact.heading()
        flank = contact.rim_radius * np.abs(sine)
        share = flank / (flank + contact.width * cosine)
        contact.bearing_modulus = contact.bearing_modulus * (1.0 - p.side * share * share)


def _lyasko(contact: Contact, p: SimpleNamespace) -> None:
    slip = _sliding(contact)
    gain = 1.0 + p.gain * ((1.0 + slip) / (1.0 - 0.5 * slip) - 1.0)
    # The load grows with k z^(N + 1/2): this modulus gives the sinkage `gain` times as much.
    weaker = gain ** -(contact.sinkage_exponent + 0.5)
    contact.bearing_modulus = contact.bearing_modulus * weaker


def _with_load(contact: Contact, p: SimpleNamespace) -> None:
    growth = p.nw * np.log(relative_pressure(contact)) + p.n1 * _sliding(contact)
    contact.sinkage_exponent = contact.sinkage_exponent + growth


_N1 = magnitude('n1', '-', 0.3, -0.5, 2.0, 0.4, 'growth of the exponent with |slip|')

SLIP_SINKAGE_EXPONENT = Effect(
    name='slip_sinkage_exponent',
    claim='sinkage exponent N = n0 + n1 |s|: slip or skid makes the wheel sink more than its load '
    'does',
    form='linear',
    symbol='N = n0 + n1 |s| (+ n2 |s| where s < 0); sideways |s| becomes |(v - r w, v_y)|/u, '
    'u = max(r w, |(v, v_y)|), and k *= 1 - side q^2, q = r |v_y|/(r |v_y| + b |v|)',
    parameters=(
        _N1,
        signed(
            'n2',
            '-',
            0.0,
            -2.0,
            3.0,
            0.5,
            'what the coefficient of a skidding wheel has beyond n1',
            free=False,
        ),
        magnitude(
            'side',
            '-',
            0.0,
            0.0,
            0.98,
            0.5,
            'share of the stiffness lost where all soil comes in past the flank',
            free=False,
        ),
    ),
    needs=('slip',),
    confounded_with={
        'stress_peak_shift': 'pull lost per millimetre of sinkage; slip near 0.9; high load',
        'lug_digging': 'pull and torque (digging leaves them alone); a second lug height',
        'hard_layer': 'a load series',
    },
    validity='slip 0 to 0.6 in the source, skid to -0.4 against measurements; sinkage well below '
    '1 m, where k z^N has its reference',
    source='Ding et al. 2010 eq. 13 (doi 10.1007/s11771-010-0021-7); |s|, n2 and side: measured '
    'rows of a wheel that brakes or slides sideways (docs/models/sideways.md)',
    on_inputs=_exponent,
    other_forms=(
        Form(
            name='lyasko',
            claim='slip or skid multiplies the sinkage at rest; the exponent stays',
            symbol='z = z0 [1 + gain ((1 + |s|)/(1 - |s|/2) - 1)] by k *= [...]^-(N + 1/2)',
            parameters=(
                magnitude('gain', '-', 1.0, 0.0, 8.0, 1.0, 'share of the published growth'),
            ),
            validity='slip 0 to 0.5; the factor is exact for small angles without shear',
            source='Lyasko 2010, Slip sinkage effect in soil-vehicle mechanics, J. Terramech. 47, '
            'as quoted in wheel studies; factor on the modulus derived here',
            on_inputs=_lyasko,
        ),
        Form(
            name='load',
            claim='the exponent grows with the pressure under the wheel, and with |slip|',
            symbol='N = n0 + nw ln(W/(b r 3 kPa)) + n1 |s|',
            parameters=(
                signed('nw', '-', 0.1, -0.5, 0.5, 0.1, 'growth with ln of the mean pressure'),
                _N1,
            ),
            needs=('normal_load',),
            validity='pressures W/(b r) of 0.5 to 20 kPa; invisible at one load',
            source='own form: exponents fitted to plates and wheels differ with their load',
            on_inputs=_with_load,
        ),
    ),
)
