# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Torque and pull of a balanced contact with derivatives: the inner loop of the filter.

The algebra of ``branch_moments`` for plain floats, with the peak stress eliminated by the load
balance and the derivatives written out (forward mode), at a few microseconds a wheel.
"""

from __future__ import annotations

import math

from wheel_terra_estimator.terramechanics.branch_moments import branch_moments, moment_spread
from wheel_terra_estimator.terramechanics.contact import Contact

# Rates of (t1, tm, t2, v/w, N) per unit of the direction's variable.
Direction = tuple[float, float, float, float, float]
_STEP = 1e-6


def balanced_forces(
    contact: Contact, shift: float, by_speed: Direction, by_depth: Direction
) -> tuple[float, float, tuple[float, ...], tuple[float, ...]]:
    """Torque and pull whose normal stress carries ``contact.normal_load``, angles given.

    Parameters
    ----------
    contact : Contact
        Floats, angles set.
    shift : float
        Rotation of the stresses towards the front [rad].
    by_speed, by_depth : tuple
        Directions in which derivatives are wanted.

    Returns
    -------
    torque, pull : float
        [N m], [N].
    d_torque, d_pull : tuple of float
        Their derivatives along the two directions, then by load, cohesion, tan(phi), K and shift.
    """
    r, R, width = contact.radius, contact.shear_radius, contact.width
    t1, tm, t2 = contact.entrance_angle, contact.peak_angle, contact.leaving_angle
    cohesion, mu, modulus = contact.cohesion, contact.tan_friction, contact.shear_modulus
    exponent, ratio = contact.sinkage_exponent, contact.velocity_ratio
    front, rear, total = t1 - tm, tm - t2, t1 + tm
    skew = front / total
    area, centroid = branch_moments(exponent, skew)
    spread = 0.5 * moment_spread(exponent)
    sin, cos = math.sin, math.cos
    sin_1 = sin(t1)
    if shift:
        sin_shift, cos_shift = sin(shift), cos(shift)

    # Sums over the branches per unit of peak normal stress (n), of that times tan(phi) (f) and of
    # cohesion (c).
    n_lift = n_push = f_lift = f_push = f_torque = c_lift = c_push = c_torque = 0.0
    branches = []
    for span, angle, middle, scale in (
        (front, t1 - front * centroid, 0.5 * (t1 + tm) + shift, 0.125),
        (rear, t2 + rear * centroid, 0.5 * (tm + t2) + shift, 0.0625),
    ):
        sine, cosine = sin(angle), cos(angle)
        climb, pace = sin_1 - sine, R - ratio * cosine  # pace: -dj/dt
        x = (R * (t1 - angle) - ratio * climb) / modulus
        base = 1.0 / (1.0 + scale * (x if x >= 0.0 else -x))
        power = base * base
        power *= power
        power *= power
        if scale < 0.1:  # behind the peak: the 16th power
            power *= power
        share = 1.0 - power if x >= 0.0 else power - 1.0
        if shift:
            sine, cosine = (
                sine * cos_shift + cosine * sin_shift,
                cosine * cos_shift - sine * sin_shift,
            )
        sin_middle, cos_middle = sin(middle), cos(middle)
        # A branch is an arc: its resultant is a little smaller than the sum of its stresses.
        square = span * span
        weight = area * span * (1.0 - spread * square)
        rub, cling = R * weight, R * span * (1.0 - square / 24.0)
        n_lift += weight * cosine
        n_push += weight * sine
        f_lift += rub * share * sine
        f_push += rub * share * cosine
        f_torque += area * span * share
        c_lift += cling * share * sin_middle
        c_push += cling * share * cos_middle
        c_torque += span * share
        # Last: d share/d j.
        branches.append(
            (span, square, weight, rub, cling, share, climb, pace, x, sine, cosine, sin_middle,
             cos_middle, power * base / modulus)
        )  # fmt: skip
    lift, push, twist = r * n_lift + mu * f_lift, mu * f_push - r * n_push, mu * f_torque
    unit_load = contact.normal_load / width
    sigma = (unit_load - cohesion * c_lift) / lift
    thrust = push * sigma + cohesion * c_push
    arm = width * R * R
    # What more lift takes from the peak stress, and so from pull and torque.
    push_lost, twist_lost = push / lift, twist / lift
    sheared = sigma * mu

    # By v/w and K: only the mobilised shares move.
    v_lift = v_push = v_torque = k_lift = k_push = k_torque = 0.0
    scaled = []
    for (
        span, _, weight, rub, cling, share, climb, _, x, sine, cosine, sin_middle, cos_middle,
        slope,
    ) in branches:  # fmt: skip
        rubbing, clinging = sheared * rub, cohesion * cling
        by_lift = rubbing * sine + clinging * sin_middle
        by_push = rubbing * cosine + clinging * cos_middle
        by_torque = (sheared * area + cohesion) * span
        faster, softer = slope * climb, slope * x
        v_lift -= faster * by_lift
        v_push -= faster * by_push
        v_torque -= faster * by_torque
        k_lift -= softer * by_lift
        k_push -= softer * by_push
        k_torque -= softer * by_torque
        normal, friction = sigma * r * weight, rubbing * share
        scaled.append(
            (normal * cosine + friction * sine, friction * cosine - normal * sine,
             clinging * share, by_lift, by_push, by_torque)
        )  # fmt: skip

    d_torques, d_pulls = [], []
    for d_t1, d_tm, d_t2, d_ratio, d_exponent in (by_speed, by_depth):
        d_lift, d_push, d_torque = d_ratio * v_lift, d_ratio * v_push, d_ratio * v_torque
        if d_t1 or d_tm or d_t2 or d_exponent:
            d_front, d_rear = d_t1 - d_tm, d_tm - d_t2
            d_skew = (d_front - skew * (d_t1 + d_tm)) / total
            d_area = d_centroid = d_spread = 0.0
            if d_exponent or not -1e-9 < d_skew < 1e-9:
                moved = exponent + _STEP * d_exponent
                moved_area, moved_centroid = branch_moments(moved, skew + _STEP * d_skew)
                d_area = (moved_area - area) / _STEP
                d_centroid = (moved_centroid - centroid) / _STEP
                d_spread = (0.5 * moment_spread(moved) - spread) / _STEP
            entering = (R - ratio * cos(t1)) * d_t1
            d_span, d_middle = d_front, 0.5 * (d_t1 + d_tm)
            d_angle = d_t1 - d_front * centroid - front * d_centroid
            for (
                (span, square, _, _, _, share, _, pace, _, _, _, sin_middle, cos_middle, slope),
                (down, along, sticking, by_lift, by_push, by_torque),
            ) in zip(branches, scaled, strict=True):
                d_share = slope * (entering - pace * d_angle)
                arc = spread * square
                growth = d_area / area + ((1.0 - 3.0 * arc) * d_span / span - d_spread * square) / (
                    1.0 - arc
                )
                turned = sticking * d_middle
                stretch = cohesion * R * share * d_span * (1.0 - 0.125 * square)
                d_lift += (
                    growth * down
                    + along * d_angle
                    + d_share * by_lift
                    + turned * cos_middle
                    + stretch * sin_middle
                )
                d_push += (
                    growth * along
                    - down * d_angle
                    + d_share * by_push
                    - turned * sin_middle
                    + stretch * cos_middle
                )
                d_torque += d_share * by_torque + share * (
                    sheared * (d_area * span + area * d_span) + cohesion * d_span
                )
                # The rear branch comes second.
                d_span, d_middle = d_rear, 0.5 * (d_tm + d_t2)
                d_angle = d_t2 + d_rear * centroid + rear * d_centroid
        d_torques.append(arm * (d_torque - twist_lost * d_lift))
        d_pulls.append(width * (d_push - push_lost * d_lift))
    # Load, cohesion, tan(phi) and K act on the sums; a rotation turns lift into push.
    return (
        arm * (twist * sigma + cohesion * c_torque),
        width * thrust,
        (
            *d_torques,
            R * R * twist_lost,
            arm * (c_torque - twist_lost * c_lift),
            arm * sigma * (f_torque - twist_lost * f_lift),
            arm * (k_torque - twist_lost * k_lift),
            -arm * twist_lost * thrust,
        ),
        (
            *d_pulls,
            push_lost,
            width * (c_push - push_lost * c_lift),
            width * sigma * (f_push - push_lost * f_lift),
            width * (k_push - push_lost * k_lift),
            -width * (unit_load + push_lost * thrust),
        ),
    )
