# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Zero error of the pull reading."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects.base import Effect, EffectParameter


def _offset(contact: Contact, p: SimpleNamespace, maths: Any) -> None:
    contact.drawbar_pull = contact.drawbar_pull + p.offset


EFFECT = Effect(
    name='pull_zero',
    claim='zero error of the pull reading; positive: it reads too much',
    symbol='F += offset',
    parameters=(EffectParameter('offset', 'N', 2.0, -1e4, 1e4, 3.0, 'normal', 'zero error'),),
    touches=frozenset({'drawbar_pull'}),
    instrument=True,
    confounded_with={
        'pitch_bias': 'a load series: an attitude error grows with the load',
        'bulldozing': 'a load series; the reading of the unloaded cell',
    },
    validity='constant over the table; does not change sign in reverse',
    source='instrument model',
    on_outputs=_offset,
)
