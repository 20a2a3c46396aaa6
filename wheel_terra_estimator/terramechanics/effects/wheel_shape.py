# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The wheel is not the rigid, clean cylinder as configured."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from wheel_terra_estimator.arrays import Quantity
from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects.base import Effect, magnitude
from wheel_terra_estimator.terramechanics.stresses import rolling_sinkage


def _layer(contact: Contact, p: SimpleNamespace) -> None:
    contact.radius = contact.radius + p.thickness
    contact.shear_radius = contact.shear_radius + p.thickness


def _below_the_rim(contact: Contact, p: SimpleNamespace) -> None:
    contact.sinkage = contact.sinkage - p.thickness


SOIL_ADHESION = Effect(
    name='soil_adhesion',
    claim='soil sticks to the rim: a layer of it rolls with the wheel',
    symbol='r, R += thickness for the soil; z, at the rim, -= thickness',
    parameters=(magnitude('thickness', 'm', 0.002, 0.0, 0.05, 0.003, 'thickness of the layer'),),
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


_LEAST = 1e-9  # keeps a wheel without load free of divisions by zero [m]


def _widening(contact: Contact, p: SimpleNamespace) -> Quantity:
    """Circle of the same chord over the rim, r*/r = 1 + f/z0; nothing of the contact's shape."""
    modulus = np.maximum(contact.bearing_modulus, 1.0) / (
        contact.reference_depth**contact.sinkage_exponent
    )
    sinkage = rolling_sinkage(
        contact.normal_load, contact.rim_radius, contact.width, modulus, contact.sinkage_exponent
    )
    return 1.0 + p.compliance * contact.normal_load / np.maximum(sinkage, _LEAST)


def _flatten(contact: Contact, p: SimpleNamespace) -> None:
    """Widen the contact."""
    flatter = _widening(contact, p)
    contact.radius = contact.radius * flatter
    # The belt runs at the rim's speed along a longer contact: j and its force grow alike.
    contact.shear_radius = contact.shear_radius * flatter
    contact.scale_speed(flatter)


def _arm(contact: Contact, p: SimpleNamespace) -> None:
    """Keep the arm of the shear at the height of the hub."""
    contact.torque = contact.torque / _widening(contact, p)


WHEEL_FLEXIBILITY = Effect(
    name='wheel_flexibility',
    claim='the wheel flattens under its load: it bears on the soil like a larger rigid one',
    symbol='r* = r (1 + compliance W/z0), z0 = [3 W/((3 - N) b k sqrt(2 r))]^(2/(2N+1));'
    ' T keeps the arm of the hub',
    parameters=(magnitude('compliance', 'm/N', 2e-5, 0.0, 1e-3, 5e-5, 'flattening per load'),),
    confounded_with={
        'multipass': 'deflection on a hard floor; a load series',
        'hard_layer': 'deflection on a hard floor; a penetrometer',
    },
    validity='deflection below the sinkage; exponent below 1.3; z0 is that of the rigid wheel '
    'without slip',
    source='substitute circle of a flattened wheel (Schmid 1995, J. Terramech. 32), '
    '2 r (z + f) = 2 r* z; z0 after Bekker 1969 (book, no DOI)',
    on_inputs=_flatten,
    on_outputs=_arm,
)
