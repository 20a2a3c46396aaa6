# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""From contacts to the paper's figures: H, R_r, torque, angles of contact, averages."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

STATE = 'facts.json'
"""File of a state from which an interrupted run goes on."""
SERIES = (
    'time',  # [s] since the wheel began to turn
    'position',  # [m] of the axle along the slope
    'height',  # [m] of the axle above the floor
    'gross_traction',  # H [N], sum of the contacts' forces along +x
    'motion_resistance',  # R_r [N], sum of the contacts' forces along -x, positive
    'normal_force',  # [N], sum of the contacts' forces along y
    'torque',  # [N m], driving torque that balances the contacts' moment
    'entrance_angle',  # [rad] of the foremost contact, from the inward normal, forward positive
    'leaving_angle',  # [rad] of the rearmost contact
    'contacts',  # number of contacts of the wheel
    'body_torque',  # [N m], the engine's own sum on the rigid wheel, as driving torque
)


@dataclass(frozen=True)
class WheelContacts:
    """Forces of the soil on the wheel, one row per contact: points about the axle."""

    point: np.ndarray  # (n, 2) [m]
    force: np.ndarray  # (n, 2) [N]


def sums(contacts: WheelContacts) -> dict[str, float]:
    """Return H, R_r, normal force, torque and contact angles of one instant.

    H and R_r are contact-wise sums of the positive and the negative components along the
    slope (Nakashima et al. 2010, section 3.2).
    """
    if contacts.force.shape[0] == 0:
        zero = dict.fromkeys(SERIES[3:-1], 0.0)
        return zero | {'entrance_angle': math.nan, 'leaving_angle': math.nan}
    along, normal = contacts.force.T
    x, y = contacts.point.T
    loaded = np.hypot(along, normal) > 0
    angles = np.arctan2(x, -y)[loaded]
    return {
        'gross_traction': float(along[along > 0].sum()),
        'motion_resistance': float(-along[along < 0].sum()),
        'normal_force': float(normal.sum()),
        # Forward rolling turns clockwise: the soil's counter-clockwise moment is the drive torque.
        'torque': float((x * normal - y * along).sum()),
        'entrance_angle': float(angles.max()) if angles.size else math.nan,
        'leaving_angle': float(angles.min()) if angles.size else math.nan,
        'contacts': float(loaded.sum()),
    }
