# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A stiff layer at some depth."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects.base import Effect, EffectParameter, Form
from wheel_terra_estimator.terramechanics.quantity import Quantity

_BLEND = 0.001  # [m]; the layer comes in over a millimetre, so that derivatives exist


def _layer(contact: Contact[Quantity], p: SimpleNamespace) -> None:
    contact.normal_stress = contact.normal_stress + _support(contact, contact.angle, p)


def _bearing(contact: Contact[Quantity], p: SimpleNamespace) -> None:
    t1, tm, t2 = contact.entrance_angle, contact.peak_angle, contact.leaving_angle
    mirrored = t1 - (contact.angle - t2) * (t1 - tm) / (tm - t2)
    angle = np.where(contact.angle >= tm, contact.angle, mirrored)
    contact.normal_stress = contact.normal_stress + _support(contact, angle, p)


def _support(contact: Contact[Quantity], angle: Quantity, p: SimpleNamespace) -> Quantity:
    """Stress that the layer adds where the rim is as deep as at an angle [Pa]."""
    depth = contact.radius * (np.cos(angle) - np.cos(contact.entrance_angle))
    inside = np.maximum(depth - p.depth, 0.0)
    blended = np.where(inside < _BLEND, 0.5 * inside * inside / _BLEND, inside - 0.5 * _BLEND)
    return p.stiffness * blended


_PARAMETERS = (
    EffectParameter(
        'stiffness', 'Pa/m', 3e6, 0.0, 1e9, 1e7, 'half_normal', 'added bearing stiffness'
    ),
    EffectParameter(
        'depth', 'm', 0.02, 0.0, 0.3, 0.02, 'normal', 'depth of its top', prior_mean=0.02
    ),
)

EFFECT = Effect(
    name='hard_layer',
    claim='a stiff layer at some depth carries the wheel once it gets there',
    form='true_depth',
    symbol='sigma += stiffness <z(t) - depth>, z(t) = r (cos t - cos t_1); <x> = x^2/(2 mm) up to '
    'x = 1 mm, x - 0.5 mm beyond',
    parameters=_PARAMETERS,
    touches=frozenset({'sinkage', 'drawbar_pull', 'torque'}),
    needs=('sinkage',),
    confounded_with={
        'multipass': 'virgin soil beside the rut',
        'sinkage_offset': 'a load series',
        'slip_sinkage_exponent': 'a load series; a penetrometer',
    },
    validity='top of the layer not shallower than a few millimetres',
    source='own model: linear bearing of the lower layer, depth from the free surface',
    on_normal_stress=_layer,
    other_forms=(
        Form(
            name='bearing',
            claim='the pressure-sinkage curve stiffens below some depth, as plates show',
            symbol='p(z) = k z^N + stiffness <z - depth>, behind the peak at the mirrored angle',
            parameters=_PARAMETERS,
            validity='top of the layer not shallower than a few millimetres',
            source='Wong and Reece 1967 (doi 10.1016/0022-4898(67)90105-X) with the '
            'pressure-sinkage curve of layered ground',
            on_normal_stress=_bearing,
        ),
    ),
)
