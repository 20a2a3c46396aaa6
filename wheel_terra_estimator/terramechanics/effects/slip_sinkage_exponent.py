# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A slipping or skidding wheel sinks in: soil flows sideways and backwards under it."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects.base import (
    Effect,
    EffectParameter,
    Form,
    relative_pressure,
)
from wheel_terra_estimator.terramechanics.kinematics import speed_ratio
from wheel_terra_estimator.terramechanics.quantity import Quantity


def _sliding(contact: Contact[Quantity]) -> Quantity:
    """Speed of the rim through the soil over the faster of rim and hub; |s| without side slip."""
    if contact.straight:
        return np.abs(contact.slip)
    forward = speed_ratio(contact.slip)
    back, aside = 1.0 - forward, contact.lateral_ratio / contact.rim_radius
    fastest = np.maximum(np.sqrt(forward * forward + aside * aside), 1.0)
    return np.sqrt(back * back + aside * aside) / fastest


def _exponent(contact: Contact[Quantity], p: SimpleNamespace) -> None:
    skid = np.maximum(-contact.slip, 0.0)
    growth = p.n1 * _sliding(contact) + p.n2 * skid
    contact.sinkage_exponent = contact.sinkage_exponent + growth
    if not contact.straight:
        # Soil that comes in past the flank was never rolled over: it bears less.
        cosine, sine = contact.heading()
        aside = contact.rim_radius * np.abs(sine)
        share = aside / (aside + contact.width * cosine)
        contact.bearing_modulus = contact.bearing_modulus * (1.0 - p.side * share * share)


def _lyasko(contact: Contact[Quantity], p: SimpleNamespace) -> None:
    slip = _sliding(contact)
    gain = 1.0 + p.gain * ((1.0 + slip) / (1.0 - 0.5 * slip) - 1.0)
    # The load grows with k z^(N + 1/2): this modulus gives the sinkage `gain` times as much.
    weaker = gain ** -(contact.sinkage_exponent + 0.5)
    contact.bearing_modulus = contact.bearing_modulus * weaker


def _with_load(contact: Contact[Quantity], p: SimpleNamespace) -> None:
    growth = p.nw * np.log(relative_pressure(contact)) + p.n1 * _sliding(contact)
    contact.sinkage_exponent = contact.sinkage_exponent + growth


_N1 = EffectParameter(
    'n1', '-', 0.3, -0.5, 2.0, 0.4, 'half_normal', 'growth of the exponent with |slip|'
)

EFFECT = Effect(
    name='slip_sinkage_exponent',
    claim='sinkage exponent N = n0 + n1 |s|: slip or skid makes the wheel sink more than its load '
    'does',
    form='linear',
    symbol='N = n0 + n1 |s| (+ n2 |s| where s < 0); sideways |s| becomes |(v - r w, v_y)|/u, '
    'u = max(r w, |(v, v_y)|), and k *= 1 - side q^2, q = r |v_y|/(r |v_y| + b |v|)',
    parameters=(
        _N1,
        EffectParameter(
            'n2',
            '-',
            0.0,
            -2.0,
            3.0,
            0.5,
            'normal',
            'what the coefficient of a skidding wheel has beyond n1',
            free=False,
        ),
        EffectParameter(
            'side',
            '-',
            0.0,
            0.0,
            0.98,
            0.5,
            'half_normal',
            'share of the stiffness lost where all soil comes in past the flank',
            free=False,
        ),
    ),
    touches=frozenset({'sinkage', 'drawbar_pull', 'torque'}),
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
                EffectParameter(
                    'gain', '-', 1.0, 0.0, 8.0, 1.0, 'half_normal', 'share of the published growth'
                ),
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
                EffectParameter(
                    'nw', '-', 0.1, -0.5, 0.5, 0.1, 'normal', 'growth with ln of the mean pressure'
                ),
                _N1,
            ),
            needs=('normal_load',),
            validity='pressures W/(b r) of 0.5 to 20 kPa; invisible at one load',
            source='own form: exponents fitted to plates and wheels differ with their load',
            on_inputs=_with_load,
        ),
    ),
)
