# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Torque is lost between the motor's torque reading and the wheel."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects.base import Effect, EffectParameter, Form
from wheel_terra_estimator.terramechanics.quantity import Quantity


def _friction(contact: Contact[Quantity], p: SimpleNamespace) -> None:
    contact.torque = contact.torque + contact.direction * p.torque


def _in_proportion(contact: Contact[Quantity], p: SimpleNamespace) -> None:
    lost = p.share * np.abs(contact.torque)
    contact.torque = contact.torque + contact.direction * lost


def _viscous(contact: Contact[Quantity], p: SimpleNamespace) -> None:
    known = contact.rim_speed > 0.0  # not where it is nan
    rate = np.where(known, contact.rim_speed, 0.0) / contact.rim_radius
    contact.torque = contact.torque + contact.direction * p.damping * rate


EFFECT = Effect(
    name='drivetrain_friction',
    claim='torque is lost before the wheel: the reading is higher by a constant',
    form='constant',
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
    other_forms=(
        Form(
            name='proportional',
            claim='torque is lost before the wheel in proportion to what the wheel takes',
            symbol='T += share |T| sgn(w)',
            parameters=(
                EffectParameter(
                    'share', '-', 0.1, 0.0, 2.0, 0.15, 'half_normal', 'torque lost over torque used'
                ),
            ),
            validity='a turning wheel; one gear stage loses a few per cent, a worm drive half',
            source='efficiency of a gear, 1/(1 + share) while the motor drives',
            on_outputs=_in_proportion,
        ),
        Form(
            name='viscous',
            claim='torque is lost before the wheel in proportion to its rate',
            symbol='T += damping w',
            parameters=(
                EffectParameter(
                    'damping', 'N m s/rad', 0.5, 0.0, 100.0, 0.5, 'half_normal', 'viscous friction'
                ),
            ),
            needs=('angular_velocity',),
            validity='a turning wheel; nothing where the rate is not recorded',
            source='viscous friction of bearings and grease',
            on_outputs=_viscous,
        ),
    ),
)
