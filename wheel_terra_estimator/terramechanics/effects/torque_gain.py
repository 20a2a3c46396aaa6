# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Gain error of the torque reading."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects.base import Effect, EffectParameter


def _gain(contact: Contact, p: SimpleNamespace, maths: Any) -> None:
    contact.torque = contact.torque * (1.0 + p.gain)


EFFECT = Effect(
    name='torque_gain',
    claim='gain error of the torque reading; positive: it reads too much',
    symbol='T *= 1 + gain',
    parameters=(
        EffectParameter('gain', '-', 0.1, -0.8, 2.0, 0.1, 'normal', 'gain of the reading less one'),
    ),
    touches=frozenset({'torque'}),
    instrument=True,
    confounded_with={
        'drivetrain_friction': 'torque near zero; a known moment at the wheel',
        'lug_shear_radius': 'pull; a known moment at the wheel',
    },
    validity='constant over the table; acts on what the drive loses as well',
    source='instrument model',
    on_outputs=_gain,
)
