# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Zero error of the sinkage sensor."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects.base import Effect, EffectParameter


def _offset(contact: Contact, p: SimpleNamespace, maths: Any) -> None:
    contact.sinkage = contact.sinkage + p.offset


EFFECT = Effect(
    name='sinkage_offset',
    claim='zero error of the sinkage sensor; positive: it reads too deep',
    symbol='z += offset',
    parameters=(EffectParameter('offset', 'm', 0.002, -0.05, 0.05, 0.002, 'normal', 'zero error'),),
    touches=frozenset({'sinkage'}),
    instrument=True,
    confounded_with={
        'lug_support': 'a smooth wheel; the zero reading on a hard floor',
        'hard_layer': 'a load series',
    },
    validity='constant over the table',
    source='instrument model',
    on_outputs=_offset,
)
