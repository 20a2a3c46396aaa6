# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Torque is lost between the motor's torque reading and the wheel."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects.base import Effect, EffectParameter


def _friction(contact: Contact, p: SimpleNamespace, maths: Any) -> None:
    contact.torque = contact.torque + contact.direction * p.torque


EFFECT = Effect(
    name='drivetrain_friction',
    claim='torque is lost before the wheel: the reading is higher by a constant',
    symbol='T += torque sgn(w)',
    parameters=(
        EffectParameter(
            'torque', 'N m', 0.3, 0.0, 20.0, 0.5, 'half_normal', 'friction torque of the drive'
        ),
    ),
    touches=frozenset({'torque'}),
    instrument=True,
    confounded_with={'lug_shear_radius': 'torque of the wheel in the air; pull'},
    validity='a turning wheel',
    source='Coulomb friction of a drive',
    on_outputs=_friction,
)
