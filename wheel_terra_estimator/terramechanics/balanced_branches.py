# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Torque and pull of a balanced contact with derivatives: the inner loop of the filter.

The algebra of ``closed_form.forces`` for plain floats, with the peak stress eliminated by the load
balance and the derivatives written out (forward mode), at a few microseconds a wheel.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from wheel_terra_estimator.terramechanics.closed_form import branch_moments, moment_spread
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

    # Per branch: mobilised share of the strength at its centroid, then the sums for unit peak
    # stress (normal and friction) and for the cohesion.
    grip, drag = mu * R, cohesion * R
    lift = fixed_lift = push = fixed_push = torque_unit = fixed_torque = 0.0
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
        slope = power * base  # d share/dx
        pace = R - ratio * cosine  # -dj/dt
        sin_middle, cos_middle = math.sin(middle + shift), math.cos(middle + shift)
        if shift:
            sine, cosine = sine * cos_d + cosine * sin_d, cosine * cos_d - sine * sin_d
        # A branch is an arc: its resultant is a little smaller than the sum of its stresses.
        cut, arc = spread * span * span, 1.0 - span * span / 24.0
        whole = area * span
        weight = whole * (1.0 - cut)
        normal, friction = r * weight, grip * weight * share
        whole_sticking = drag * span * share
        sticking = whole_sticking * arc
        lift += normal * cosine + friction * sine
        push += friction * cosine - normal * sine
        torque_unit += grip * whole * share
        fixed_lift += sticking * sin_middle
        fixed_push += sticking * cos_middle
        fixed_torque += whole_sticking
        branches.append(
            (span, weight, cut, normal, friction, sticking, share, slope, x, pace, climb, sine,
             cosine, sin_middle, cos_middle)
        )  # fmt: skip
    sigma = (contact.normal_load / width - fixed_lift) / lift
    torque, pull = torque_unit * sigma + fixed_torque, push * sigma + fixed_push
    arm = width * R

    derivatives: list[Pair] = []
    for d_t1, d_tm, d_t2, d_ratio, d_exponent in directions:
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
            span, weight, cut, normal, friction, sticking, share, slope, _, pace, climb, sine,
            cosine, sin_middle, cos_middle,
        ) in branches:  # fmt: skip
            d_share = slope * (entering - pace * d_angle - climb * d_ratio) / modulus
            d_whole = d_area * span + area * d_span
            d_weight = d_whole * (1.0 - cut) - area * span * span * (
                d_spread * span + 2.0 * spread * d_span
            )
            d_normal = sigma * r * d_weight
            d_friction = sigma * grip * (d_weight * share + weight * d_share)
            square = span * span
            d_sticking = drag * (
                d_span * (1.0 - 0.125 * square) * share + span * (1.0 - square / 24.0) * d_share
            )
            normal_now, friction_now = sigma * normal, sigma * friction
            d_lift += (
                d_normal * cosine
                + d_friction * sine
                + d_sticking * sin_middle
                + (friction_now * cosine - normal_now * sine) * d_angle
                + sticking * cos_middle * d_middle
            )
            d_push += (
                d_friction * cosine
                - d_normal * sine
                + d_sticking * cos_middle
                - (friction_now * sine + normal_now * cosine) * d_angle
                - sticking * sin_middle * d_middle
            )
            d_torque += sigma * grip * (d_whole * share + area * span * d_share)
            d_torque += drag * (d_span * share + span * d_share)
            # The rear branch comes second.
            d_span, d_middle = d_tm - d_t2, 0.5 * (d_tm + d_t2)
            d_angle = d_t2 + d_span * centroid + rear * d_centroid
        d_sigma = -d_lift / lift
        derivatives.append(
            (arm * (d_torque + torque_unit * d_sigma), width * (d_push + push * d_sigma))
        )
    # Load, cohesion and tan(phi): the contact stays as it is.
    by_load = 1.0 / (width * lift)
    derivatives.append((arm * torque_unit * by_load, width * push * by_load))
    k_lift = k_push = k_torque = c_lift = c_push = c_torque = m_lift = m_push = m_torque = 0.0
    s_lift = s_push = 0.0
    for (
        span, weight, _, normal, friction, sticking, share, slope, x, _, _, sine, cosine,
        sin_middle, cos_middle,
    ) in branches:  # fmt: skip
        arc = 1.0 - span * span / 24.0
        unit = R * span * share
        c_lift += unit * arc * sin_middle
        c_push += unit * arc * cos_middle
        c_torque += unit
        unit = R * weight * share * sigma
        m_lift += unit * sine
        m_push += unit * cosine
        m_torque += R * area * span * share * sigma
        fading = -slope * x / modulus
        rubbing, clinging = sigma * grip * weight * fading, drag * span * fading
        k_lift += rubbing * sine + clinging * arc * sin_middle
        k_push += rubbing * cosine + clinging * arc * cos_middle
        k_torque += sigma * grip * area * span * fading + clinging
        friction, normal = sigma * friction, sigma * normal
        s_lift += friction * cosine - normal * sine + sticking * cos_middle
        s_push -= friction * sine + normal * cosine + sticking * sin_middle
    for d_lift, d_push, d_torque in (
        (c_lift, c_push, c_torque),
        (m_lift, m_push, m_torque),
        (k_lift, k_push, k_torque),
        (s_lift, s_push, 0.0),
    ):
        d_sigma = -d_lift / lift
        derivatives.append(
            (arm * (d_torque + torque_unit * d_sigma), width * (d_push + push * d_sigma))
        )
    return (arm * torque, width * pull), derivatives
