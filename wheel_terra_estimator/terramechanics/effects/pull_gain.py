# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Gain error of the pull reading."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects.base import Effect, EffectParameter


def _gain(contact: Contact, p: SimpleNamespace, maths: Any) -> None:
    contact.drawbar_pull = contact.drawbar_pull * (1.0 + p.gain)


EFFECT = Effect(
    name='pull_gain',
    claim='gain error of the pull reading; positive: it reads too much',
    symbol='F *= 1 + gain',
    parameters=(
        EffectParameter('gain', '-', 0.1, -0.8, 2.0, 0.1, 'normal', 'gain of the reading less one'),
    ),
    touches=frozenset({'drawbar_pull'}),
    instrument=True,
    confounded_with={
        'lug_shear_radius': 'torque: a gain of the pull leaves it alone',
        'bulldozing': 'pull at slip near zero, where a gain does little; the known weight',
    },
    validity='constant over the table; acts before a zero error',
    source='instrument model',
    on_outputs=_gain,
)
