# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Closed form of load, pull and torque at given contact angles.

One representative angle per side of the peak, placed and weighted by the exact moments of the
pressure-sinkage curve, so that the shape of the normal stress (its exponent) and the growth of
shear along the contact are kept. Nothing in it is fitted; over the validation family its error is
some ten times smaller than that of triangular stresses (coefficients A, B, C).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from wheel_terra_estimator.arrays import Quantity
from wheel_terra_estimator.terramechanics import stresses
from wheel_terra_estimator.terramechanics.branch_moments import BranchForces
from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.terms import PEAK_MARGIN, Terms

# Stress that effects add (a hard layer) is integrated with Gauss's four points per side.
_POINTS, _WEIGHTS = (
    (0.5 * (nodes + 1.0)).tolist() if k == 0 else (0.5 * nodes).tolist()
    for k, nodes in enumerate(np.polynomial.legendre.leggauss(4))
)


def coefficients(
    entrance_angle: Quantity, peak_angle: Quantity, leaving_angle: Quantity
) -> tuple[Any, Any, Any]:
    """Integrals A, B, C of a unit triangle times cos t, sin t and 1 over the contact.

    A = (cos tm - cos t2)/(tm - t2) + (cos tm - cos t1)/(t1 - tm), B the same with sines,
    C = (t1 - t2)/2; by parts, exact.
    """
    front, rear = entrance_angle - peak_angle, peak_angle - leaving_angle
    cos_m, sin_m = np.cos(peak_angle), np.sin(peak_angle)
    a = (cos_m - np.cos(leaving_angle)) / rear + (cos_m - np.cos(entrance_angle)) / front
    b = (sin_m - np.sin(leaving_angle)) / rear + (sin_m - np.sin(entrance_angle)) / front
    return a, b, 0.5 * (entrance_angle - leaving_angle)


def peak_stresses(contact: Contact[Any], terms: Terms) -> tuple[Any, Any]:
    """Normal and shear stress at the peak angle, effects included [Pa]."""
    peak = contact.peak_angle
    contact.angle = peak
    contact.normal_stress = stresses.front_stress(contact, peak)
    terms.apply('on_normal_stress', contact)
    sigma = contact.normal_stress
    return sigma, stresses.shear_stress(contact, peak, sigma)


def forces(contact: Contact[Quantity], terms: Terms) -> tuple[Quantity, Quantity, Quantity]:
    """Load [N], pull [N] and torque [N m] from branch moments, angles given."""
    t1 = contact.entrance_angle
    form = BranchForces(contact, contact.peak_angle / t1, contact.leaving_angle / t1)
    result = form.forces(t1)
    if terms.stages['on_normal_stress']:
        added = _added_stress_forces(contact, terms)[:3]
        result = tuple(a + b for a, b in zip(result, added, strict=True))
    return result


def lateral_force(contact: Contact[Quantity], terms: Terms) -> Quantity:
    """Force of the soil under the rim on the wheel, positive left [N], angles given."""
    t1 = contact.entrance_angle
    if contact.straight:
        return 0.0 * t1
    form = BranchForces(contact, contact.peak_angle / t1, contact.leaving_angle / t1)
    force = form.lateral_force(t1)
    if terms.stages['on_normal_stress']:
        force = force + _added_stress_forces(contact, terms)[3]
    return force


def angles_in_proportion(terms: Terms) -> bool:
    """Return whether no effect moves the angles or adds stress: ``proportional_forces`` holds."""
    return not (terms.stages['on_contact'] or terms.stages['on_normal_stress'])


def proportional_forces(contact: Contact[Quantity]) -> BranchForces:
    """Forces for all entrance angles at once, peak and leaving angle in proportion to them."""
    leaving = contact.leaving_ratio
    margin = PEAK_MARGIN * (1.0 - leaving)
    peak = np.minimum(np.maximum(contact.peak_ratio, leaving + margin), 1.0 - margin)
    return BranchForces(contact, peak, leaving)


def _added_stress_forces(contact: Contact[Quantity], terms: Terms) -> tuple[Any, ...]:
    """Load, pull, torque, lateral force of what effects add to the normal stress, friction too."""
    t1, tm, t2 = contact.entrance_angle, contact.peak_angle, contact.leaving_angle
    R = contact.shear_radius
    load = pull = torque = lateral = 0.0
    for low, high, behind in ((tm, t1, False), (t2, tm, True)):
        for point, weight in zip(_POINTS, _WEIGHTS, strict=True):
            angle = low + (high - low) * point
            mirror = t1 - (t1 - tm) * (point if behind else 1.0 - point)
            stress = stresses.front_stress(contact, mirror)
            contact.angle, contact.normal_stress = angle, stress
            terms.apply('on_normal_stress', contact)
            normal = (contact.normal_stress - stress) * weight * (high - low)
            along, across = stresses.mobilised_shares(contact, angle)
            friction = normal * contact.tan_friction * R
            shear = friction * along
            normal = normal * contact.radius
            cosine, sine = np.cos(angle), np.sin(angle)
            load = load + normal * cosine + shear * sine
            pull = pull + shear * cosine - normal * sine
            torque = torque + shear
            lateral = lateral + friction * across
    width = contact.width
    return width * load, width * pull, width * R * torque, width * lateral
