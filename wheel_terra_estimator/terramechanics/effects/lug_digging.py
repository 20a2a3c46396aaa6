# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Lugs dig soil out from under the wheel."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects.base import Effect, EffectParameter, Form
from wheel_terra_estimator.terramechanics.quantity import Quantity

_STEADY = 0.95  # slip above which a steady state is not known; the term grows no further there


def _dig(contact: Contact[Quantity], p: SimpleNamespace) -> None:
    slip = np.maximum(contact.slip, 0.0)
    again = slip / (1.0 - np.minimum(slip, _STEADY))  # lugs per advance, less the first
    contact.sinkage = contact.sinkage + p.kd * contact.lug_height * slip * (1.0 + p.rework * again)


def _saturating(contact: Contact[Quantity], p: SimpleNamespace) -> None:
    slip = np.maximum(contact.slip, 0.0)
    dug = -np.expm1(-slip / p.range)
    contact.sinkage = contact.sinkage + p.kd * contact.lug_height * dug


_KD = EffectParameter(
    'kd', '-', 1.0, 0.0, 4.0, 1.0, 'half_normal', 'share of the lug height dug in the end'
)

EFFECT = Effect(
    name='lug_digging',
    claim='lugs dig soil out: sinkage grows with lug height times slip, forces do not change',
    form='linear',
    symbol='z += kd h s  (rework = 1: kd h s/(1 - s))',
    parameters=(
        _KD,
        EffectParameter(
            'rework',
            '-',
            0.0,
            0.0,
            1.0,
            0.3,
            'half_normal',
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
                EffectParameter(
                    'range',
                    '-',
                    0.3,
                    0.03,
                    2.0,
                    0.15,
                    'normal',
                    'slip at which two thirds are dug',
                    prior_mean=0.3,
                ),
            ),
            validity='s from 0 to 0.9; lugs that fill up',
            source='own form: the linear law of Ding et al. 2010 eq. 12, soil falls back',
            on_outputs=_saturating,
        ),
    ),
)
