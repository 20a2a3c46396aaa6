# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Contacts of plain floats, one per wheel of a rover, for the on-board closed forms."""

from __future__ import annotations

import numpy as np

from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.soil import Soil
from wheel_terra_estimator.terramechanics.wheel import Wheel


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
        contact.radius, contact.width = radius, width
        contact.lug_height, contact.lug_count, contact.lug_thickness = height, count, thickness
        contact.gravity, contact.density = gravity, float(soil.density)
        contact.reference_depth = width if soil.pressure_law == 'reece' else 1.0
        contacts.append((contact, radius + height if slip_radius == 'lug_tip' else radius))
    return contacts
