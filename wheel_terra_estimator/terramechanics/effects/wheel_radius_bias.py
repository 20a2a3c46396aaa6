# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The effective radius differs from the configured one."""

from __future__ import annotations

from types import SimpleNamespace

from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects.base import Effect, EffectParameter
from wheel_terra_estimator.terramechanics.kinematics import slip_of_speed_ratio, speed_ratio
from wheel_terra_estimator.terramechanics.quantity import Quantity


def _bias(contact: Contact[Quantity], p: SimpleNamespace) -> None:
    scale = 1.0 + p.bias
    contact.velocity_ratio = contact.velocity_ratio / scale
    ratio = speed_ratio(contact.slip) / scale
    contact.slip = slip_of_speed_ratio(ratio)


EFFECT = Effect(
    name='wheel_radius_bias',
    claim='the effective rolling radius differs from the configured one, so slip is misread',
    symbol='1 - s_true = (1 - s_recorded)/(1 + bias)',
    parameters=(
        EffectParameter(
            'bias',
            '-',
            0.03,
            -0.3,
            0.3,
            0.04,
            'normal',
            'effective over configured radius, minus one',
        ),
    ),
    touches=frozenset({'sinkage', 'drawbar_pull', 'torque'}),
    instrument=True,
    needs=('slip',),
    confounded_with={
        'lug_shear_radius': 'rows with other lugs or none; roll-out on a hard floor',
    },
    validity='biases of up to some 10 %; the contact geometry keeps the configured radius',
    source='definition of the slip ratio; Ding et al. 2010 eq. 1 leaves the radius open',
    on_inputs=_bias,
)
