# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Drawbar pull from measured torque, load and contact, stresses on an equivalent radius.

The lugs carry a ring of soil: stresses act at a radius between rim and lug tip, and entrance and
leaving angle are those of that circle. With the leaving angle measured (a mound behind the wheel
is higher than the ground) the form holds up to a slip of 0.9, where angles without it fail.

Guo, Ding et al., High-slip wheel-terrain contact modelling for grouser-wheeled planetary rovers
traversing on sandy terrains, Mech. Mach. Theory: equivalent radius, angles and the three
coefficients k1, k2, k3. Their formulas are not public; these are derived here from the words of the
paper, with `coefficients` for the three coefficients.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from wheel_terra_estimator.terramechanics.checks import check_range

_LUG_SHARE = 0.5  # of the lug height in the radius, lambda [-]


def coefficients(entrance_angle: Any, peak_angle: Any, leaving_angle: Any) -> tuple[Any, Any, Any]:
    """Integrals A, B, C of a unit triangle times cos t, sin t and 1 over the contact.

    A = (cos tm - cos t2)/(tm - t2) + (cos tm - cos t1)/(t1 - tm), B the same with sines,
    C = (t1 - t2)/2; by parts, exact.
    """
    front, rear = entrance_angle - peak_angle, peak_angle - leaving_angle
    cos_m, sin_m = np.cos(peak_angle), np.sin(peak_angle)
    a = (cos_m - np.cos(leaving_angle)) / rear + (cos_m - np.cos(entrance_angle)) / front
    b = (sin_m - np.sin(leaving_angle)) / rear + (sin_m - np.sin(entrance_angle)) / front
    return a, b, 0.5 * (entrance_angle - leaving_angle)


def decoupled_pull(
    torque: Any,
    normal_load: Any,
    entrance_angle: Any,
    peak_angle: Any,
    leaving_angle: Any,
    shear_radius: Any,
) -> Any:
    """Drawbar pull from torque, load and contact angles: no soil parameter, no width [N].

    F = (A^2 + B^2)/(A C) T/R - (B/A) W: both peak stresses eliminated from the three balances.
    """
    a, b, c = coefficients(entrance_angle, peak_angle, leaving_angle)
    return (a * a + b * b) / (a * c) * torque / shear_radius - b / a * normal_load


@dataclass(frozen=True)
class EquivalentContact:
    """Angles of a contact on its equivalent circle, one entry per measurement."""

    radius: Any  # r_e [m]
    entrance_angle: Any  # [rad]
    peak_angle: Any  # [rad]
    leaving_angle: Any  # [rad], negative behind the hub

    def drawbar_pull(self, torque: Any, normal_load: Any) -> Any:
        """Pull from torque and load, no soil parameter [N].

        F = (k1^2 + k2^2)/(k1 k3) T/r_e - (k2/k1) W.
        """
        return decoupled_pull(
            torque,
            normal_load,
            self.entrance_angle,
            self.peak_angle,
            self.leaving_angle,
            self.radius,
        )


def equivalent_contact(
    wheel: Any,  # rim radius and lug height count
    sinkage: Any,  # of the rim, as measured [m]
    rear_height: Any,  # of the soil behind the wheel above the lowest point of the rim, z2 [m]
    peak_ratio: Any,  # angle of greatest stress over entrance angle, c1 + c2 s [-]
    lug_sinkage: Any = 0.0,  # part of the sinkage that lugs dug or saved, dz [m]
) -> EquivalentContact:
    """Return the contact on the circle of radius r + lambda h.

    t1e = arccos(1 - (z - dz)/r_e), t2e = -arccos(1 - z2/r_e), tme = peak_ratio t1e.
    The rear height is above the sinkage where a mound stands there. Raises ValueError if the
    sinkage less the lugs' part, or the rear height, is outside 0 to the radius, or the peak outside
    the contact.
    """
    radius = wheel.radius + _LUG_SHARE * np.asarray(wheel.lug_height)
    depth = np.asarray(sinkage, float) - lug_sinkage
    largest = float(np.min(radius))
    check_range('sinkage less lugs', depth, 0.0, largest, 'm', open_lower=True)
    check_range('rear height', rear_height, 0.0, largest, 'm')
    check_range('peak ratio', peak_ratio, 0.0, 0.99, open_lower=True)
    entrance = np.arccos(1.0 - depth / radius)
    leaving = -np.arccos(1.0 - np.asarray(rear_height, float) / radius)
    return EquivalentContact(radius, entrance, peak_ratio * entrance, leaving)
