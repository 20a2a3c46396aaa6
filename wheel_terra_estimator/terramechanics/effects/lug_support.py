# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Lug tips carry a part of the load."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects.base import Effect, EffectParameter


def _support(contact: Contact, p: SimpleNamespace, maths: Any) -> None:
    lifted = maths.where(contact.lug_height > 0.0, p.dz4, 0.0)
    contact.sinkage = contact.sinkage - lifted


EFFECT = Effect(
    name='lug_support',
    claim='lugs carry load: sinkage of a lugged wheel is smaller by a constant',
    symbol='z -= dz4 where h > 0',
    parameters=(
        EffectParameter(
            'dz4', 'm', 0.0015, 0.0, 0.02, 0.002, 'half_normal', 'sinkage saved by the lugs'
        ),
    ),
    touches=frozenset({'sinkage'}),
    needs=('lug_height',),
    confounded_with={'sinkage_offset': 'a smooth wheel; the sensor zero on a hard floor'},
    validity='thin lugs; 1.5 mm at h = 10 mm and 3 mm at h = 15 mm in the source, at 80 N',
    source='Ding et al. 2010 section 3.2.2, eq. 20 (doi 10.1007/s11771-010-0021-7)',
    on_outputs=_support,
)
