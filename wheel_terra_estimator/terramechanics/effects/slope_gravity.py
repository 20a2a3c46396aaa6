# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""On a slope, weight acts partly along the ground."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects.base import Effect, EffectParameter
from wheel_terra_estimator.terramechanics.quantity import Quantity


def _load(contact: Contact[Quantity], p: SimpleNamespace) -> None:
    lost = contact.stated_load * (1.0 - np.cos(contact.slope))
    contact.normal_load = contact.normal_load - p.share * lost


def _pull(contact: Contact[Quantity], p: SimpleNamespace) -> None:
    down_hill = contact.stated_load * np.sin(contact.slope)
    contact.drawbar_pull = contact.drawbar_pull - p.share * down_hill


EFFECT = Effect(
    name='slope_gravity',
    claim='the stated load is a weight: on a slope the soil carries W cos(slope) and the pull '
    'left at the hitch is smaller by W sin(slope)',
    symbol='W_n = W - share W (1 - cos a);  F -= share W sin a',
    parameters=(
        EffectParameter(
            'share',
            '-',
            1.0,
            0.0,
            1.5,
            0.15,
            'normal',
            'share of the weight that tilts with the slope (1: all of it)',
            prior_mean=1.0,
        ),
    ),
    touches=frozenset({'sinkage', 'drawbar_pull', 'torque'}),
    needs=('slope',),
    confounded_with={'pitch_bias': 'level rows, or the same slope driven both ways'},
    validity='any slope that the soil holds',
    source='statics; Nakashima et al. 2010 (slope runs with Px/W = sin a)',
    on_inputs=_load,
    on_outputs=_pull,
)
