# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""More or less soil cohesion than configured."""

from __future__ import annotations

from types import SimpleNamespace

from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects.base import Effect, EffectParameter
from wheel_terra_estimator.terramechanics.quantity import Quantity


def _cohesion(contact: Contact[Quantity], p: SimpleNamespace) -> None:
    contact.cohesion = contact.cohesion + p.delta


EFFECT = Effect(
    name='cohesion',
    claim='more or less soil cohesion than configured',
    symbol='tau = (c + delta + sigma tan(phi)) (1 - exp(-j/K))',
    parameters=(
        EffectParameter(
            'delta',
            'Pa',
            300.0,
            -5000.0,
            10000.0,
            500.0,
            'normal',
            'cohesion added to soil.cohesion',
        ),
    ),
    touches=frozenset({'sinkage', 'drawbar_pull', 'torque'}),
    confounded_with={
        'bulldozing': 'a load series',
        'grouser_thrust': 'other lugs or none; a load series',
        'rim_friction': 'a load series; rows with higher lugs',
    },
    validity='c + delta not below zero',
    source='Mohr-Coulomb strength in Janosi and Hanamoto 1961 (proceedings, no DOI); '
    'Ding et al. 2010 eq. 18 (doi 10.1007/s11771-010-0021-7)',
    on_inputs=_cohesion,
)
