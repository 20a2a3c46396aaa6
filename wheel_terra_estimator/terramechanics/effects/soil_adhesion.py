# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Soil sticks to the rim."""

from __future__ import annotations

from types import SimpleNamespace

from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects.base import Effect, EffectParameter
from wheel_terra_estimator.terramechanics.quantity import Quantity


def _layer(contact: Contact[Quantity], p: SimpleNamespace) -> None:
    contact.radius = contact.radius + p.thickness
    contact.shear_radius = contact.shear_radius + p.thickness


def _below_the_rim(contact: Contact[Quantity], p: SimpleNamespace) -> None:
    contact.sinkage = contact.sinkage - p.thickness


EFFECT = Effect(
    name='soil_adhesion',
    claim='soil sticks to the rim: a layer of it rolls with the wheel',
    symbol='r, R += thickness for the soil; z, at the rim, -= thickness',
    parameters=(
        EffectParameter(
            'thickness', 'm', 0.002, 0.0, 0.05, 0.003, 'half_normal', 'thickness of the layer'
        ),
    ),
    touches=frozenset({'sinkage', 'drawbar_pull', 'torque'}),
    confounded_with={
        'wheel_radius_bias': 'sinkage, which a misread slip changes less; a look at the rim',
        'lug_shear_radius': 'rows with other lugs or none; sinkage',
        'sinkage_offset': 'pull and torque; the zero reading on a hard floor',
    },
    validity='an even layer; the recorded slip keeps the configured radius',
    source='geometry of a coated wheel; sticking soil: Bekker 1969 (book, no DOI)',
    on_inputs=_layer,
    on_outputs=_below_the_rim,
)
