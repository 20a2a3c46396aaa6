# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Wheels of a rover as contacts of plain floats: common part of the on-board closed forms."""

from __future__ import annotations

import numpy as np

from wheel_terra_estimator.terramechanics.checks import check_range
from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects import EffectSettings, check_settings
from wheel_terra_estimator.terramechanics.operating_points import STANDARD_GRAVITY
from wheel_terra_estimator.terramechanics.soil import Soil
from wheel_terra_estimator.terramechanics.stresses import bearing_law
from wheel_terra_estimator.terramechanics.terms import SOIL_NUMBERS, Terms
from wheel_terra_estimator.terramechanics.wheel import Wheel


class ScalarWheels:
    """Wheels on one soil with a set of effects.

    Parameters
    ----------
    wheel : Wheel
        Floats, or (n,) arrays for n wheels.
    soil : Soil
        Floats.
    effects : mapping
        Switched-on effects.
    slip_radius : str
        ``lug_tip`` or ``rim``: radius of the rim speed in speed ratios.
    gravity : float
        [m/s^2].
    """

    def __init__(
        self,
        wheel: Wheel,
        soil: Soil,
        effects: EffectSettings | None = None,
        slip_radius: str = 'lug_tip',
        gravity: float = STANDARD_GRAVITY,
    ) -> None:
        for name in SOIL_NUMBERS:
            if np.ndim(getattr(soil, name)):
                raise ValueError(
                    f'soil {name} has shape {np.shape(getattr(soil, name))}; allowed is one number'
                )
        check_range('gravity', gravity, 0.0, unit='m/s^2', open_lower=True)
        self._settings = check_settings(effects or {})
        self._terms = Terms(self._settings)
        self._soil = soil
        self._wheels = scalar_contacts(wheel, soil, slip_radius, gravity)
        self._prepare()

    def _prepare(self) -> None:
        """Derive what does not change from call to call."""

    def __len__(self) -> int:
        return len(self._wheels)


def scalar_contacts(
    wheel: Wheel, soil: Soil, slip_radius: str, gravity: float
) -> list[tuple[Contact, float]]:
    """Return, per wheel, a contact with its geometry filled in and its slip radius [m]."""
    if slip_radius not in ('lug_tip', 'rim'):
        raise ValueError(f"slip radius is {slip_radius!r}; allowed is 'lug_tip' or 'rim'")
    columns = np.broadcast_arrays(
        *(
            np.atleast_1d(np.asarray(value, float))
            for value in (
                wheel.radius,
                wheel.width,
                wheel.lug_height,
                wheel.lug_count,
                wheel.lug_thickness,
            )
        )
    )
    contacts = []
    blank: dict[str, float] = dict.fromkeys(Contact.__dataclass_fields__, 0.0)
    for radius, width, height, count, thickness in zip(*(c.tolist() for c in columns), strict=True):
        contact = Contact(**blank)
        contact.radius = contact.rim_radius = radius
        contact.width = width
        contact.lug_height, contact.lug_count, contact.lug_thickness = height, count, thickness
        contact.gravity, contact.density = gravity, float(soil.density)
        contact.bearing_modulus, contact.reference_depth = bearing_law(
            soil.pressure_law,
            soil.cohesive_modulus,
            soil.frictional_modulus,
            width,
            soil.cohesion,
            soil.density * gravity,
        )
        contacts.append((contact, radius + height if slip_radius == 'lug_tip' else radius))
    return contacts
