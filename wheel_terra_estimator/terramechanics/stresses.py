# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Stress laws under a rigid wheel: Bekker, Reece, Wong-Reece, Janosi-Hanamoto.

Bekker 1969 (book), Janosi and Hanamoto 1961 (proceedings): no DOI.
"""

from __future__ import annotations

import numpy as np

from wheel_terra_estimator.arrays import Quantity
from wheel_terra_estimator.terramechanics.contact import Contact


def gauss_rule(nodes: int) -> list[tuple[Quantity, Quantity]]:
    """Return nodes and weights of Gauss and Legendre on (0, 1)."""
    x, w = np.polynomial.legendre.leggauss(nodes)
    return list(zip((0.5 * (x + 1.0)).tolist(), (0.5 * w).tolist(), strict=True))


_NO_DISPLACEMENT = 1e-300  # [m]; keeps the direction of none finite


def bearing_law(
    pressure_law: str,
    cohesive: Quantity,
    frictional: Quantity,
    width: Quantity,
    cohesion: Quantity,
    weight_density: Quantity,
) -> tuple[Quantity, Quantity]:
    """Pressure at the reference depth [Pa], and that depth [m], of a law of ``Soil``.

    Reece: c kc' + rho g b kphi' at one width, p = k (z/b)^n; Bekker 1969: kc/b + kphi at 1 m.
    """
    if pressure_law == 'reece':
        return cohesion * cohesive + weight_density * width * frictional, width
    return cohesive / width + frictional, 1.0


def rolling_sinkage(
    load: Quantity, radius: Quantity, width: Quantity, modulus: Quantity, exponent: Quantity
) -> Quantity:
    """Sinkage of a towed rigid wheel without slip [m] (Bekker 1969).

    z = [3 W / ((3 - n) b k sqrt(D))]^(2/(2n+1)); small sinkage, n below 1.3, stress in front only.
    The series that it comes from ends before n = 3: beyond 2.8 it goes on with 3 - n = 0.2.
    """
    force = np.maximum(3.0 - exponent, 0.2) * width * modulus * (2.0 * radius) ** 0.5
    return (3.0 * load / force) ** (2.0 / (2.0 * exponent + 1.0))


def front_stress(contact: Contact, cosine: Quantity) -> Quantity:
    """Normal stress ahead of its peak, k [(r/z0)(cos t - cos t1)]^N, by cos t [Pa].

    Wong and Reece 1967 (doi 10.1016/0022-4898(67)90105-X); Ding et al. 2010 eq. 17
    (doi 10.1007/s11771-010-0021-7).
    """
    depth = contact.radius * (cosine - np.cos(contact.entrance_angle))
    relative = np.maximum(depth, 0.0) / contact.reference_depth
    return contact.bearing_modulus * relative**contact.sinkage_exponent


def mobilised_share(displacement: Quantity, shear_modulus: Quantity) -> Quantity:
    """Signed share of the shear strength, sgn(j) (1 - exp(-|j|/K)) (Janosi and Hanamoto) [-]."""
    share = -np.expm1(-np.abs(displacement) / shear_modulus)
    return np.where(displacement >= 0.0, share, -share)


def mobilised_shares(contact: Contact, sine: Quantity) -> tuple[Quantity, Quantity]:
    """Signed shares of the shear strength along the wheel (forward) and across it (left) [-].

    ``sine``: of the angles of the contact. Across, the soil is displaced by j_y = (v_y/w)(t1 - t),
    which is R (1 - s)(t1 - t) tan(beta) of Ishigami et al. 2007 eq. 13 (doi 10.1002/rob.20187)
    written with the two speeds. Both displacements share one strength: the resultant, of the size
    that Janosi's law gives the length of (j_x, j_y), acts against the rim's motion through the soil
    (friction circle). The paper takes each by itself: the resultant may exceed the strength.
    """
    along = shear_displacement(contact, sine)
    if contact.straight:
        return mobilised_share(along, contact.shear_modulus), 0.0
    across = contact.lateral_ratio * (contact.entrance_angle - contact.angle)
    length = np.maximum(np.sqrt(along * along + across * across), _NO_DISPLACEMENT)
    share = -np.expm1(-length / contact.shear_modulus) / length
    return share * along, -share * across


def shear_displacement(contact: Contact, sine: Quantity) -> Quantity:
    """Shear displacement j = R (t1 - t) - (v/w)(sin t1 - sin t), by t and sin t [m].

    Ding et al. 2010 eq. 14 (doi 10.1007/s11771-010-0021-7), with v/w so that slip radius and
    shear radius may differ; j < 0 is a rim that drags the soil along (braking).
    """
    t1 = contact.entrance_angle
    rolled = contact.velocity_ratio * (np.sin(t1) - sine)
    return contact.shear_radius * (t1 - contact.angle) - rolled
