# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Closed form: the stresses replaced by triangles with their peak at the peak angle.

Form of Iagnemma, Shibly and Ding/Yoshida/Nagatani, derived again here by parts. With
``maths = ScalarMaths`` everything runs on floats.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from wheel_terra_estimator.terramechanics import stresses
from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.terms import Terms


def coefficients(
    entrance_angle: Any, peak_angle: Any, leaving_angle: Any, maths: Any = np
) -> tuple[Any, Any, Any]:
    """Integrals A, B, C of a unit triangle times cos t, sin t and 1 over the contact.

    A = (cos tm - cos t2)/(tm - t2) + (cos tm - cos t1)/(t1 - tm), B the same with sines,
    C = (t1 - t2)/2.
    """
    front, rear = entrance_angle - peak_angle, peak_angle - leaving_angle
    cos_m, sin_m = maths.cos(peak_angle), maths.sin(peak_angle)
    a = (cos_m - maths.cos(leaving_angle)) / rear + (cos_m - maths.cos(entrance_angle)) / front
    b = (sin_m - maths.sin(leaving_angle)) / rear + (sin_m - maths.sin(entrance_angle)) / front
    return a, b, 0.5 * (entrance_angle - leaving_angle)


def forces(contact: Contact, terms: Terms, maths: Any = np) -> tuple[Any, Any, Any]:
    """Vertical force [N], longitudinal force [N] and torque [N m], angles given.

    W = b (r A sigma_m + R B tau_m), F = b (R A tau_m - r B sigma_m), T = b R^2 C tau_m.
    """
    a, b, c = coefficients(
        contact.entrance_angle, contact.peak_angle, contact.leaving_angle, maths
    )
    contact.angle = contact.peak_angle
    contact.normal_stress = stresses.front_stress(contact, contact.peak_angle, maths)
    terms.apply('on_normal_stress', contact, maths)
    sigma = contact.normal_stress
    tau = stresses.shear_stress(contact, contact.peak_angle, sigma, maths)
    r, R, width = contact.radius, contact.shear_radius, contact.width
    load = width * (r * a * sigma + R * b * tau)
    pull = width * (R * a * tau - r * b * sigma)
    return load, pull, width * R * R * c * tau


def decoupled_pull(
    torque: Any,
    normal_load: Any,
    entrance_angle: Any,
    peak_angle: Any,
    leaving_angle: Any,
    shear_radius: Any,
    maths: Any = np,
) -> Any:
    """Drawbar pull from torque, load and contact angles: no soil parameter, no width [N].

    F = (A^2 + B^2)/(A C) T/R - (B/A) W: eliminate both peak stresses from the three balances.
    """
    a, b, c = coefficients(entrance_angle, peak_angle, leaving_angle, maths)
    return (a * a + b * b) / (a * c) * torque / shear_radius - b / a * normal_load
