# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Stress laws under a rigid wheel: Bekker, Reece, Wong-Reece, Janosi-Hanamoto."""

from __future__ import annotations

from typing import Any

import numpy as np

from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.kinematics import shear_displacement


def bekker_modulus(cohesive: Any, frictional: Any, width: Any) -> Any:
    """Pressure at 1 m depth, kc/b + kphi [Pa], for p = (kc/b + kphi) (z/1 m)^n (Bekker 1969)."""
    return cohesive / width + frictional


def reece_modulus(
    cohesive: Any, frictional: Any, width: Any, cohesion: Any, weight_density: Any
) -> Any:
    """Pressure at a depth of one width, c kc' + rho g b kphi' [Pa], for p = k (z/b)^n (Reece)."""
    return cohesion * cohesive + weight_density * width * frictional


def bearing_law(
    pressure_law: str,
    cohesive: Any,
    frictional: Any,
    width: Any,
    cohesion: Any,
    weight_density: Any,
) -> tuple[Any, Any]:
    """Pressure at the reference depth [Pa], and that depth [m], of a law of ``Soil``."""
    if pressure_law == 'reece':
        return reece_modulus(cohesive, frictional, width, cohesion, weight_density), width
    return bekker_modulus(cohesive, frictional, width), 1.0


def rolling_sinkage(
    load: Any, radius: Any, width: Any, modulus: Any, exponent: Any, maths: Any = np
) -> Any:
    """Sinkage of a towed rigid wheel without slip [m] (Bekker 1969).

    z = [3 W / ((3 - n) b k sqrt(D))]^(2/(2n+1)); small sinkage, n below 1.3, stress in front only.
    The series that it comes from ends before n = 3: beyond 2.8 it goes on with 3 - n = 0.2.
    """
    force = maths.maximum(3.0 - exponent, 0.2) * width * modulus * (2.0 * radius) ** 0.5
    return (3.0 * load / force) ** (2.0 / (2.0 * exponent + 1.0))


def front_stress(contact: Contact, angle: Any, maths: Any = np, cosine: Any = None) -> Any:
    """Normal stress ahead of its peak, k [(r/z0)(cos t - cos t1)]^N [Pa].

    Wong and Reece 1967; Ding et al. 2010 eq. 17 (doi 10.1007/s11771-010-0021-7). ``cosine`` of the
    angle, where it is known already.
    """
    cosine = maths.cos(angle) if cosine is None else cosine
    depth = contact.radius * (cosine - maths.cos(contact.entrance_angle))
    relative = maths.maximum(depth, 0.0) / contact.reference_depth
    return contact.bearing_modulus * relative**contact.sinkage_exponent


def mobilised_share(displacement: Any, shear_modulus: Any, maths: Any = np) -> Any:
    """Signed share of the shear strength, sgn(j) (1 - exp(-|j|/K)) (Janosi and Hanamoto) [-]."""
    share = -maths.expm1(-maths.abs(displacement) / shear_modulus)
    return maths.where(displacement >= 0.0, share, -share)


def shear_stress(
    contact: Contact, angle: Any, normal_stress: Any, maths: Any = np, sine: Any = None
) -> Any:
    """Shear stress (c + sigma tan phi) sgn(j) (1 - exp(-|j|/K)) [Pa].

    Janosi and Hanamoto 1961; Ding et al. 2010 eq. 18 (doi 10.1007/s11771-010-0021-7). ``sine`` of
    the angle, where it is known already.
    """
    displacement = shear_displacement(
        angle, contact.entrance_angle, contact.shear_radius, contact.velocity_ratio, maths, sine
    )
    strength = contact.cohesion + normal_stress * contact.tan_friction
    return strength * mobilised_share(displacement, contact.shear_modulus, maths)
