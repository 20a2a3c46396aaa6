# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Torque and pull of a balanced contact with derivatives: the inner loop of the filter.

The algebra of ``closed_form.forces`` for plain floats, with the peak stress eliminated by the load
balance and the derivatives written out (forward mode), at a few microseconds a wheel.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from wheel_terra_estimator.terramechanics.branch_moments import branch_moments, moment_spread
from wheel_terra_estimator.terramechanics.contact import Contact

# Rates of (t1, tm, t2, v/w, N) per unit of the direction's variable.
Direction = tuple[float, float, float, float, float]
# Torque [N m] and pull [N], or their derivatives.
Pair = tuple[float, float]
_STEP = 1e-6


def balanced_forces(
    contact: Contact, shift: float, directions: Sequence[Direction]
) -> tuple[Pair, list[Pair]]:
    """Torque and pull whose normal stress carries ``contact.normal_load``, angles given.

    Parameters
    ----------
    contact : Contact
        Floats, angles set.
    shift : float
        Rotation of the stresses towards the front [rad].
    directions : sequence of tuple
        Directions in which derivatives are wanted.

    Returns
    -------
    tuple
        Torque and pull.
    list of tuple
        Their derivatives along the directions, then by load, cohesion, tan(phi), K and shift.
    """
    r, R, width = contact.radius, contact.shear_radius, contact.width
    t1, tm, t2 = contact.entrance_angle, contact.peak_angle, contact.leaving_angle
    cohesion, mu, modulus = contact.cohesion, contact.tan_friction, contact.shear_modulus
    exponent, ratio = contact.sinkage_exponent, contact.velocity_ratio
    front, rear, total = t1 - tm, tm - t2, t1 + tm
    skew = front / total
    area, centroid = branch_moments(exponent, skew)
    spread = 0.5 * moment_spread(exponent)
    sin_1, cos_1 = math.sin(t1), math.cos(t1)
    sin_d, cos_d = (math.sin(shift), math.cos(shift)) if shift else (0.0, 1.0)

    # Sums over the branches per unit of peak normal stress (n), of that times tan(phi) (f) and of
    # cohesion (c); k: what f and c lose per unit of K.
    n_lift = n_push = f_lift = f_push = f_torque = c_lift = c_push = c_torque = 0.0
    kf_lift = kf_push = kf_torque = kc_lift = kc_push = kc_torque = 0.0
    grip, drag = mu * R, cohesion * R
    branches = []
    for span, angle, middle, scale, doublings in (
        (front, t1 - front * centroid, 0.5 * (t1 + tm), 0.125, 3),
        (rear, t2 + rear * centroid, 0.5 * (tm + t2), 0.0625, 4),
    ):
        sine, cosine = math.sin(angle), math.cos(angle)
        climb = sin_1 - sine
        x = (R * (t1 - angle) - ratio * climb) / modulus
        base = 1.0 / (1.0 + scale * abs(x))
        power = base * base
        power *= power
        power *= power
        if doublings == 4:
            power *= power
        share = 1.0 - power if x >= 0.0 else power - 1.0
        slope = power * base / modulus  # d share/d j
        pace = R - ratio * cosine  # -dj/dt
        sin_middle, cos_middle = math.sin(middle + shift), math.cos(middle + shift)
        if shift:
            sine, cosine = sine * cos_d + cosine * sin_d, cosine * cos_d - sine * sin_d
        # A branch is an arc: its resultant is a little smaller than the sum of its stresses.
        square = span * span
        cut, arc = spread * square, R * (1.0 - square / 24.0)
        whole = area * span
        weight = whole * (1.0 - cut)
        n_lift += weight * cosine
        n_push += weight * sine
        rub, cling, fading = R * weight, arc * span, -slope * x
        f_lift += rub * share * sine
        f_push += rub * share * cosine
        f_torque += whole * share
        c_lift += cling * share * sin_middle
        c_push += cling * share * cos_middle
        c_torque += span * share
        kf_lift += rub * fading * sine
        kf_push += rub * fading * cosine
        kf_torque += whole * fading
        kc_lift += cling * fading * sin_middle
        kc_push += cling * fading * cos_middle
        kc_torque += span * fading
        branches.append(
            (span, square, whole, weight, cut, share, slope, pace, climb, sine, cosine,
             drag * span * share * (1.0 - square / 24.0), sin_middle, cos_middle)
        )  # fmt: skip
    lift, push, twist = r * n_lift + mu * f_lift, mu * f_push - r * n_push, mu * R * f_torque
    unit_load = contact.normal_load / width
    sigma = (unit_load - cohesion * c_lift) / lift
    thrust = push * sigma + cohesion * c_push
    arm = width * R

    derivatives: list[Pair] = []
    for d_t1, d_tm, d_t2, d_ratio, d_exponent in directions:
        if not (d_t1 or d_tm or d_t2 or d_exponent):
            # Only the shear displacement moves: the common case of speed without effects.
            d_lift = d_push = d_torque = 0.0
            for (
                span, square, whole, weight, _, _, slope, _, climb, sine, cosine, _,
                sin_middle, cos_middle,
            ) in branches:  # fmt: skip
                d_share = -slope * climb * d_ratio
                d_friction = sigma * grip * weight * d_share
                d_whole_sticking = drag * span * d_share
                d_sticking = d_whole_sticking * (1.0 - square / 24.0)
                d_lift += d_friction * sine + d_sticking * sin_middle
                d_push += d_friction * cosine + d_sticking * cos_middle
                d_torque += sigma * grip * whole * d_share + d_whole_sticking
            d_sigma = -d_lift / lift
            derivatives.append(
                (arm * (d_torque + twist * d_sigma), width * (d_push + push * d_sigma))
            )
            continue
        d_front = d_t1 - d_tm
        d_skew = (d_front - skew * (d_t1 + d_tm)) / total
        d_area = d_centroid = d_spread = 0.0
        if d_exponent or abs(d_skew) > 1e-9:
            moved = exponent + _STEP * d_exponent
            moved_area, moved_centroid = branch_moments(moved, skew + _STEP * d_skew)
            d_area, d_centroid = (moved_area - area) / _STEP, (moved_centroid - centroid) / _STEP
            d_spread = (0.5 * moment_spread(moved) - spread) / _STEP
        d_angle = d_t1 - d_front * centroid - front * d_centroid
        d_span, d_middle = d_front, 0.5 * (d_t1 + d_tm)
        entering = (R - ratio * cos_1) * d_t1
        d_lift = d_push = d_torque = 0.0
        for (
            span, square, whole, weight, cut, share, slope, pace, climb, sine, cosine, sticking,
            sin_middle, cos_middle,
        ) in branches:  # fmt: skip
            d_share = slope * (entering - pace * d_angle - climb * d_ratio)
            d_whole = d_area * span + area * d_span
            d_weight = d_whole * (1.0 - cut) - area * square * (
                d_spread * span + 2.0 * spread * d_span
            )
            d_sticking = drag * (
                d_span * (1.0 - 0.125 * square) * share + span * (1.0 - square / 24.0) * d_share
            )
            d_normal = r * d_weight
            d_friction = grip * (d_weight * share + weight * d_share)
            normal, friction = r * weight, grip * weight * share
            d_lift += (
                sigma
                * (
                    d_normal * cosine
                    + d_friction * sine
                    + (friction * cosine - normal * sine) * d_angle
                )
                + d_sticking * sin_middle
                + sticking * cos_middle * d_middle
            )
            d_push += (
                sigma
                * (
                    d_friction * cosine
                    - d_normal * sine
                    - (friction * sine + normal * cosine) * d_angle
                )
                + d_sticking * cos_middle
                - sticking * sin_middle * d_middle
            )
            d_torque += sigma * grip * (d_whole * share + whole * d_share)
            d_torque += drag * (d_span * share + span * d_share)
            # The rear branch comes second.
            d_span, d_middle = d_tm - d_t2, 0.5 * (d_tm + d_t2)
            d_angle = d_t2 + d_span * centroid + rear * d_centroid
        d_sigma = -d_lift / lift
        derivatives.append((arm * (d_torque + twist * d_sigma), width * (d_push + push * d_sigma)))
    # Load, cohesion, tan(phi) and K act on the sums; a rotation turns lift into push.
    by_load = 1.0 / (width * lift)
    derivatives.append((arm * twist * by_load, width * push * by_load))
    for d_lift, d_push, d_torque in (
        (c_lift, c_push, R * c_torque),
        (sigma * f_lift, sigma * f_push, sigma * R * f_torque),
        (
            sigma * mu * kf_lift + cohesion * kc_lift,
            sigma * mu * kf_push + cohesion * kc_push,
            R * (sigma * mu * kf_torque + cohesion * kc_torque),
        ),
        (thrust, -unit_load, 0.0),
    ):
        d_sigma = -d_lift / lift
        derivatives.append((arm * (d_torque + twist * d_sigma), width * (d_push + push * d_sigma)))
    return (arm * (twist * sigma + drag * c_torque), width * thrust), derivatives
