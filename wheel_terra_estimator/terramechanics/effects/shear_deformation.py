# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Another shear deformation modulus than configured."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects.base import (
    Effect,
    EffectParameter,
    Form,
    relative_pressure,
)
from wheel_terra_estimator.terramechanics.quantity import Quantity


def _factor(contact: Contact[Quantity], p: SimpleNamespace) -> None:
    contact.shear_modulus = contact.shear_modulus * np.exp(p.log_factor)


def _with_pressure(contact: Contact[Quantity], p: SimpleNamespace) -> None:
    growth = np.exp(p.growth * np.log(relative_pressure(contact)))
    contact.shear_modulus = contact.shear_modulus * growth


EFFECT = Effect(
    name='shear_deformation',
    claim='more or less shear deformation modulus K than configured',
    form='constant',
    symbol='K *= exp(log_factor)',
    parameters=(
        EffectParameter(
            'log_factor', '-', 0.3, -3.0, 3.0, 0.3, 'normal', 'logarithm of the factor on K'
        ),
    ),
    touches=frozenset({'sinkage', 'drawbar_pull', 'torque'}),
    needs=('slip',),
    confounded_with={
        'wheel_radius_bias': 'sinkage; visual odometry on hard ground',
        'cohesion': 'slip below 0.2, where K shows most',
    },
    validity='the same as a fitted soil.shear_modulus, hence not tried beside one',
    source='Janosi and Hanamoto 1961 (proceedings, no DOI)',
    candidate=False,
    why_aside='the refitted soil.shear_modulus stands for it',
    on_inputs=_factor,
    other_forms=(
        Form(
            name='pressure',
            claim='the shear deformation modulus K grows with the pressure under the wheel',
            symbol='K *= (W/(b r 3 kPa))^growth',
            parameters=(
                EffectParameter(
                    'growth', '-', 0.4, -1.5, 1.5, 0.4, 'normal', 'exponent of the mean pressure'
                ),
            ),
            needs=('normal_load',),
            candidate=True,
            validity='pressures W/(b r) of 0.5 to 20 kPa; invisible at one load',
            source='Wong, Theory of Ground Vehicles (book, no DOI): K of some soils rises with '
            'normal pressure; power law assumed',
            on_inputs=_with_pressure,
        ),
    ),
)
