# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Lug tips carry a part of the load."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects.base import Effect, EffectParameter, Form
from wheel_terra_estimator.terramechanics.quantity import Quantity


def _support(contact: Contact[Quantity], p: SimpleNamespace) -> None:
    lifted = np.where(contact.lug_height > 0.0, p.dz4, 0.0)
    contact.sinkage = contact.sinkage - lifted


def _by_height(contact: Contact[Quantity], p: SimpleNamespace) -> None:
    high = np.maximum(contact.lug_height - p.free_height, 0.0)
    contact.sinkage = contact.sinkage - p.share * high


EFFECT = Effect(
    name='lug_support',
    claim='lugs carry load: sinkage of a lugged wheel is smaller by a constant',
    form='constant',
    symbol='z -= dz4 where h > 0',
    parameters=(
        EffectParameter(
            'dz4', 'm', 0.0015, 0.0, 0.02, 0.002, 'half_normal', 'sinkage saved by the lugs'
        ),
    ),
    touches=frozenset({'sinkage'}),
    needs=('lug_height',),
    confounded_with={'sinkage_offset': 'a smooth wheel; the sensor zero on a hard floor'},
    validity='thin lugs; 1.5 mm at h = 10 mm and 3 mm at h = 15 mm in the source, at 80 N',
    source='Ding et al. 2010 section 3.2.2, eq. 20 (doi 10.1007/s11771-010-0021-7)',
    on_outputs=_support,
    other_forms=(
        Form(
            name='by_height',
            claim='lugs carry load: sinkage is smaller by a share of the lug height',
            symbol='z -= share (h - free_height)+',
            parameters=(
                EffectParameter(
                    'share', '-', 0.3, 0.0, 2.0, 0.3, 'half_normal', 'sinkage saved per lug height'
                ),
                EffectParameter(
                    'free_height',
                    'm',
                    0.005,
                    0.0,
                    0.05,
                    0.003,
                    'normal',
                    'height of lugs that carry nothing yet',
                    prior_mean=0.005,
                    free=False,
                ),
            ),
            validity='thin lugs; the defaults give the two values of the source',
            source='straight line through the two values of Ding et al. 2010 '
            '(doi 10.1007/s11771-010-0021-7)',
            on_outputs=_by_height,
        ),
    ),
)
