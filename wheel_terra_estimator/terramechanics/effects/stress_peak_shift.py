# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The angle of greatest stress moves forward with slip."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects.base import Effect, EffectParameter, Form
from wheel_terra_estimator.terramechanics.quantity import Quantity


def _shift(contact: Contact[Quantity], p: SimpleNamespace) -> None:
    skid = np.maximum(-contact.slip, 0.0)
    contact.peak_ratio = contact.peak_ratio + p.c2 * contact.slip + p.skid * skid


def _retreat(contact: Contact[Quantity], p: SimpleNamespace) -> None:
    contact.peak_ratio = contact.peak_ratio - p.retreat * contact.slip


EFFECT = Effect(
    name='stress_peak_shift',
    claim='the angle of greatest stress moves forward with slip',
    form='forward',
    symbol='t_m = (c1 + c2 s) t_1 (+ skid |s| t_1 where s < 0)',
    parameters=(
        EffectParameter('c2', '-', 0.2, -0.5, 0.8, 0.2, 'half_normal', 'shift at s = 1'),
        EffectParameter(
            'skid',
            '-',
            0.0,
            -1.0,
            1.0,
            0.2,
            'normal',
            'shift forward of a skidding wheel, beyond c2',
            free=False,
        ),
    ),
    touches=frozenset({'sinkage', 'drawbar_pull', 'torque'}),
    needs=('slip',),
    confounded_with={
        'soil_mound': 'a rear camera: measured leaving angle',
        'slip_sinkage_exponent': 'high load, braking rows, slip near 0.9; stress cells in the rim',
    },
    validity='c1 + c2 s between 0 and 1; clamped inside the contact',
    source='Wong and Reece 1967 (doi 10.1016/0022-4898(67)90105-X); '
    'Ding et al. 2010 section 3.1.1 (doi 10.1007/s11771-010-0021-7); '
    'skid: measured rows of a single wheel that brakes (docs/models/validation.md)',
    on_inputs=_shift,
    other_forms=(
        Form(
            name='backward',
            claim='the angle of greatest stress moves backward with slip',
            symbol='t_m = (c1 - retreat s) t_1',
            parameters=(
                EffectParameter(
                    'retreat', '-', 0.1, 0.0, 0.8, 0.2, 'half_normal', 'shift back at s = 1'
                ),
            ),
            validity='c1 - retreat s between 0 and 1; clamped inside the contact',
            source='the same law with the other sign, as fits to small wheels give it '
            '(docs/models/validation.md)',
            on_inputs=_retreat,
        ),
    ),
)
