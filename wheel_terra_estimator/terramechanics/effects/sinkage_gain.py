# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Gain error of the sinkage reading."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects.base import Effect, EffectParameter


def _gain(contact: Contact, p: SimpleNamespace, maths: Any) -> None:
    contact.sinkage = contact.sinkage * (1.0 + p.gain)


EFFECT = Effect(
    name='sinkage_gain',
    claim='gain error of the sinkage reading; positive: it reads too much',
    symbol='z *= 1 + gain',
    parameters=(
        EffectParameter('gain', '-', 0.1, -0.8, 2.0, 0.1, 'normal', 'gain of the reading less one'),
    ),
    touches=frozenset({'sinkage'}),
    instrument=True,
    confounded_with={
        'sinkage_offset': 'shallow rows, or a known step under the sensor',
        'slip_sinkage_exponent': 'pull and torque, which a gain leaves alone; a known step',
    },
    validity='constant over the table; acts before a zero error',
    source='instrument model',
    on_outputs=_gain,
)
