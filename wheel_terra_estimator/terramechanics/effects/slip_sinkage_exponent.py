# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The sinkage exponent changes with slip: soil flows sideways and backwards under the wheel."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects.base import Effect, EffectParameter


def _exponent(contact: Contact, p: SimpleNamespace, maths: Any) -> None:
    skid = maths.maximum(-contact.slip, 0.0)
    contact.sinkage_exponent = contact.sinkage_exponent + p.n1 * contact.slip + p.n2 * skid


EFFECT = Effect(
    name='slip_sinkage_exponent',
    claim='sinkage exponent N = n0 + n1 s: slip makes the wheel sink more than its load does',
    symbol='N = n0 + n1 s (+ n2 |s| where s < 0)',
    parameters=(
        EffectParameter(
            'n1', '-', 0.3, -0.5, 2.0, 0.4, 'half_normal', 'growth of the exponent with slip'
        ),
        EffectParameter(
            'n2', '-', 0.0, -1.0, 3.0, 0.5, 'normal', 'further growth while skidding', free=False
        ),
    ),
    touches=frozenset({'sinkage', 'drawbar_pull', 'torque'}),
    needs=('slip',),
    confounded_with={
        'stress_peak_shift': 'pull lost per millimetre of sinkage; slip near 0.9; high load',
        'lug_digging': 'pull and torque (digging leaves them alone); a second lug height',
        'hard_layer': 'a load series',
    },
    validity='slip 0 to 0.6 in the source; sinkage well below 1 m, where k z^N has its reference',
    source='Ding et al. 2010 eq. 13 (doi 10.1007/s11771-010-0021-7); n2: skid form of later work',
    on_inputs=_exponent,
)
