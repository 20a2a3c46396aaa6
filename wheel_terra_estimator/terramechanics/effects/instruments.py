# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Errors of the readings: y (1 + gain), y + offset, and W sin(bias) in the pull by attitude."""

from __future__ import annotations

from functools import partial
from types import SimpleNamespace

import numpy as np

from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects.base import Effect, EffectParameter
from wheel_terra_estimator.terramechanics.quantity import Quantity


def _gain(quantity: str, contact: Contact[Quantity], p: SimpleNamespace) -> None:
    setattr(contact, quantity, getattr(contact, quantity) * (1.0 + p.gain))


def _offset(quantity: str, contact: Contact[Quantity], p: SimpleNamespace) -> None:
    setattr(contact, quantity, getattr(contact, quantity) + p.offset)


def _tilt(contact: Contact[Quantity], p: SimpleNamespace) -> None:
    contact.drawbar_pull = contact.drawbar_pull + contact.stated_load * np.sin(p.bias)


def _gain_of(
    reading: str, quantity: str, symbol: str, confounded_with: dict[str, str], validity: str
) -> Effect:
    return Effect(
        name=f'{reading}_gain',
        claim=f'gain error of the {reading} reading; positive: it reads too much',
        symbol=f'{symbol} *= 1 + gain',
        parameters=(
            EffectParameter(
                'gain', '-', 0.1, -0.8, 2.0, 0.1, 'normal', 'gain of the reading less one'
            ),
        ),
        touches=frozenset({quantity}),
        instrument=True,
        confounded_with=confounded_with,
        validity=f'constant over the table; {validity}',
        source='instrument model',
        on_outputs=partial(_gain, quantity),
    )


EFFECTS = (
    _gain_of(
        'pull',
        'drawbar_pull',
        'F',
        {
            'lug_shear_radius': 'torque: a gain of the pull leaves it alone',
            'bulldozing': 'pull at slip near zero, where a gain does little; the known weight',
        },
        'acts before a zero error',
    ),
    _gain_of(
        'sinkage',
        'sinkage',
        'z',
        {
            'sinkage_offset': 'shallow rows, or a known step under the sensor',
            'slip_sinkage_exponent': 'pull and torque, which a gain leaves alone; a known step',
        },
        'acts before a zero error',
    ),
    _gain_of(
        'torque',
        'torque',
        'T',
        {
            'drivetrain_friction': 'torque near zero; a known moment at the wheel',
            'lug_shear_radius': 'pull; a known moment at the wheel',
        },
        'acts on what the drive loses as well',
    ),
    Effect(
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
        on_outputs=partial(_offset, 'drawbar_pull'),
    ),
    Effect(
        name='sinkage_offset',
        claim='zero error of the sinkage sensor; positive: it reads too deep',
        symbol='z += offset',
        parameters=(
            EffectParameter('offset', 'm', 0.002, -0.05, 0.05, 0.002, 'normal', 'zero error'),
        ),
        touches=frozenset({'sinkage'}),
        instrument=True,
        confounded_with={
            'lug_support': 'a smooth wheel; the zero reading on a hard floor',
            'hard_layer': 'a load series',
        },
        validity='constant over the table',
        source='instrument model',
        on_outputs=partial(_offset, 'sinkage'),
    ),
    Effect(
        name='pitch_bias',
        claim='attitude error; positive: it reads too nose-up, pull reads W sin(bias) too high',
        symbol='F += W sin(bias)',
        parameters=(
            EffectParameter('bias', 'rad', 0.02, -0.3, 0.3, 0.03, 'normal', 'attitude error'),
        ),
        touches=frozenset({'drawbar_pull'}),
        instrument=True,
        confounded_with={
            'slope_gravity': 'level rows, or the same slope driven both ways',
            'bulldozing': 'three times the load or another wheel; a level check',
        },
        validity='constant over the table; does not change sign in reverse',
        source='statics',
        on_outputs=_tilt,
    ),
)
