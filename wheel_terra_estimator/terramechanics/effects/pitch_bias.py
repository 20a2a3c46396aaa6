# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Attitude error: a part of the weight is read as pull."""

from __future__ import annotations

from types import SimpleNamespace

from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects.base import Effect, EffectParameter
from wheel_terra_estimator.terramechanics.maths import Maths, Quantity


def _tilt(contact: Contact[Quantity], p: SimpleNamespace, maths: Maths) -> None:
    contact.drawbar_pull = contact.drawbar_pull + contact.stated_load * maths.sin(p.bias)


EFFECT = Effect(
    name='pitch_bias',
    claim='attitude error; positive: it reads too nose-up, pull reads W sin(bias) too high',
    symbol='F += W sin(bias)',
    parameters=(EffectParameter('bias', 'rad', 0.02, -0.3, 0.3, 0.03, 'normal', 'attitude error'),),
    touches=frozenset({'drawbar_pull'}),
    instrument=True,
    confounded_with={
        'slope_gravity': 'level rows, or the same slope driven both ways',
        'bulldozing': 'three times the load or another wheel; a level check',
    },
    validity='constant over the table; does not change sign in reverse',
    source='statics',
    on_outputs=_tilt,
)
