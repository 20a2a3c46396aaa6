# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Drawbar pull from torque, load and contact angles: both stresses eliminated from the balances.

``decoupled_pull`` needs no soil at all (triangles); ``decoupled_pull_shaped`` takes the shape of
the stresses from the soil and is the form to use where anything is known of it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from wheel_terra_estimator.terramechanics.branch_moments import branch_moments, moment_spread
from wheel_terra_estimator.terramechanics.closed_form import coefficients
from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.kinematics import shear_displacement


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

    F = (A^2 + B^2)/(A C) T/R - (B/A) W: both peak stresses eliminated from the three balances.
    """
    a, b, c = coefficients(entrance_angle, peak_angle, leaving_angle, maths)
    return (a * a + b * b) / (a * c) * torque / shear_radius - b / a * normal_load


def decoupled_pull_shaped(torque: Any, contact: Contact, maths: Any = np) -> Any:
    """Drawbar pull from measured torque and load, the soil used for the shape of stress only [N].

    The size of both stresses comes from torque and load, as in ``decoupled_pull``; exponent,
    cohesion over friction, and K only say how the shear is spread over the contact. Soil numbers
    wrong by a factor of two change the pull by less than 1 % of W, but the shape makes the error
    some ten times smaller than that of the triangles.

    Parameters
    ----------
    torque : float or array_like
        [N m].
    contact : Contact
        Angles set, nominal soil, ``normal_load``.
    """
    t1, tm, t2 = contact.entrance_angle, contact.peak_angle, contact.leaving_angle
    R, ratio = contact.shear_radius, contact.velocity_ratio
    front, rear = t1 - tm, tm - t2
    area, centroid = branch_moments(contact.sinkage_exponent, front / (t1 + tm))
    spread = 0.5 * moment_spread(contact.sinkage_exponent)
    places = (
        (front, t1 - front * centroid, t1 - 0.5 * front, _mean_share_front),
        (rear, t2 + rear * centroid, tm - 0.5 * rear, _mean_share_rear),
    )
    shares = [
        mean_share(shear_displacement(angle, t1, R, ratio, maths) / contact.shear_modulus, maths)
        for _, angle, _, mean_share in places
    ]
    # Where shear changes its sign inside the contact, torque says nothing of its size: even share.
    opposed = (
        maths.abs(shares[0] + shares[1])
        < 0.5 * (maths.abs(shares[0]) + maths.abs(shares[1])) + 1e-9
    )
    normal_x = normal_y = friction_x = friction_y = friction_sum = 0.0
    cohesion_x = cohesion_y = cohesion_sum = 0.0
    for (span, angle, middle, _), mobilised in zip(places, shares, strict=True):
        share = maths.where(opposed, 1.0, mobilised)
        arc, even_arc = 1.0 - spread * span * span, 1.0 - span * span / 24.0
        cosine, sine = maths.cos(angle) * arc, maths.sin(angle) * arc
        normal_x = normal_x + area * span * cosine
        normal_y = normal_y + area * span * sine
        friction_x = friction_x + area * span * share * cosine
        friction_y = friction_y + area * span * share * sine
        friction_sum = friction_sum + area * span * share
        cohesion_x = cohesion_x + span * share * even_arc * maths.cos(middle)
        cohesion_y = cohesion_y + span * share * even_arc * maths.sin(middle)
        cohesion_sum = cohesion_sum + span * share
    unit_load = contact.normal_load / contact.width
    sigma = unit_load / (contact.radius * normal_x)
    thrust = torque / (contact.width * R)
    along = down = 0.0
    for _ in range(2):
        mix = contact.cohesion / (maths.maximum(contact.tan_friction * sigma, 1.0))
        total = friction_sum + mix * cohesion_sum
        along = (friction_x + mix * cohesion_x) / total
        down = (friction_y + mix * cohesion_y) / total
        sigma = (unit_load - thrust * down) / (contact.radius * normal_x)
    return contact.width * (thrust * along - contact.radius * sigma * normal_y)


def _mean_share_front(displacement: Any, maths: Any = np) -> Any:
    """Mobilised share of shear strength in front of the peak; argument j/K at its centroid.

    The mean of exp(-j/K) over the branch, where j spreads from 0: (1 + x/8)^-8 (the mean over a
    gamma distribution whose variance is that of the stress-weighted j) instead of exp(-x).
    """
    base = 1.0 / (1.0 + 0.125 * maths.abs(displacement))
    base *= base
    base *= base
    return maths.copysign(1.0 - base * base, displacement)


def _mean_share_rear(displacement: Any, maths: Any = np) -> Any:
    """Return the same behind the peak, where j spreads less around its mean: (1 + x/16)^-16."""
    base = 1.0 / (1.0 + 0.0625 * maths.abs(displacement))
    base *= base
    base *= base
    base *= base
    return maths.copysign(1.0 - base * base, displacement)
