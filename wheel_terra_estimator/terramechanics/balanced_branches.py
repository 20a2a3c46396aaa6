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
    contact: Contact[float], shift: float, by_speed: Direction, by_depth: Direction
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

    # Both sides are written out, in front of the peak (_f) and behind it (_r): a loop over tuples
    # takes a third longer.
    angle_f = t1 - front * centroid
    sine_f, cosine_f = sin(angle_f), cos(angle_f)
    climb_f, pace_f = sin_1 - sine_f, R - ratio * cosine_f  # pace: -dj/dt
    x_f = (R * (t1 - angle_f) - ratio * climb_f) / modulus
    base = 1.0 / (1.0 + 0.125 * (x_f if x_f >= 0.0 else -x_f))
    power = base * base
    power *= power
    power *= power
    share_f = 1.0 - power if x_f >= 0.0 else power - 1.0
    slope_f = power * base / modulus  # d share/d j
    nearer = 0.125 / centroid
    base = 1.0 / (1.0 + nearer * (x_f if x_f >= 0.0 else -x_f))
    power = base * base
    power *= power
    even_f = 1.0 - power if x_f >= 0.0 else power - 1.0  # of cohesion, spread evenly
    by_nearer = 4.0 * power * base  # d even/d(nearer x)
    even_slope_f = by_nearer * nearer / modulus
    if shift:
        sine_f, cosine_f = (
            sine_f * cos_shift + cosine_f * sin_shift,
            cosine_f * cos_shift - sine_f * sin_shift,
        )
    middle_f = 0.5 * (t1 + tm) + shift
    sin_middle_f, cos_middle_f = sin(middle_f), cos(middle_f)
    # A branch is an arc: its resultant is a little smaller than the sum of its stresses.
    square_f = front * front
    weight_f = area * front * (1.0 - spread * square_f)
    rub_f, cling_f = R * weight_f, R * front * (1.0 - square_f / 24.0)
    rubbed_f, clung_f = rub_f * share_f, cling_f * even_f

    angle_r = t2 + rear * centroid
    sine_r, cosine_r = sin(angle_r), cos(angle_r)
    climb_r, pace_r = sin_1 - sine_r, R - ratio * cosine_r  # pace: -dj/dt
    x_r = (R * (t1 - angle_r) - ratio * climb_r) / modulus
    sign = 1.0 if x_r >= 0.0 else -1.0
    way = sign * x_r
    base = 1.0 / (1.0 + 0.0625 * way)
    power = base * base
    power *= power
    power *= power
    power *= power
    # Half the variance of j/K behind the peak, and its rates by pace and span.
    spun = pace_r * rear / modulus
    wide, by_spun = spread * spun * spun, 2.0 * spread * spun
    by_way = 0.0
    if ratio > R and wide > 0.25 * way * way:
        wide, by_spun, by_way = 0.25 * way * way, 0.0, 0.5 * way
    excess = base * (wide - 0.03125 * way * way)
    rest = power * (1.0 + excess)
    share_r = sign * (1.0 - rest)
    by_wide = -power * base
    slope_r = (power * (1.0 + 1.0625 * base * excess) + by_wide * by_way) / modulus  # d share/d j
    further = (angle_r - 0.5 * (tm + t2)) / (t1 - angle_r)
    deeper = base * way
    left = 1.0 - further * deeper
    even_r = sign * (1.0 - rest * left)
    even_slope_r = left * slope_r + rest * further * base * base / modulus
    by_wide *= sign
    turned_r, cosine_0 = ratio * sine_r, cosine_r
    if shift:
        sine_r, cosine_r = (
            sine_r * cos_shift + cosine_r * sin_shift,
            cosine_r * cos_shift - sine_r * sin_shift,
        )
    middle_r = 0.5 * (tm + t2) + shift
    sin_middle_r, cos_middle_r = sin(middle_r), cos(middle_r)
    square_r = rear * rear
    weight_r = area * rear * (1.0 - spread * square_r)
    rub_r, cling_r = R * weight_r, R * rear * (1.0 - square_r / 24.0)
    rubbed_r, clung_r = rub_r * share_r, cling_r * even_r

    # Sums per unit of peak normal stress (n), of that times tan(phi) (f) and of cohesion (c).
    n_lift = weight_f * cosine_f + weight_r * cosine_r
    n_push = weight_f * sine_f + weight_r * sine_r
    f_lift = rubbed_f * sine_f + rubbed_r * sine_r
    f_push = rubbed_f * cosine_f + rubbed_r * cosine_r
    c_lift = clung_f * sin_middle_f + clung_r * sin_middle_r
    c_push = clung_f * cos_middle_f + clung_r * cos_middle_r
    c_torque = front * even_f + rear * even_r
    f_torque = area * (front * share_f + rear * share_r)
    lift, push, twist = r * n_lift + mu * f_lift, mu * f_push - r * n_push, mu * f_torque
    unit_load = contact.normal_load / width
    sigma = (unit_load - cohesion * c_lift) / lift
    thrust = push * sigma + cohesion * c_push
    arm = width * R * R
    # What more lift takes from the peak stress, and so from pull and torque.
    push_lost, twist_lost = push / lift, twist / lift
    sheared = sigma * mu
    twisting = sheared * area

    # Lift, push and torque per unit of mobilised share, of friction (by) and of cohesion (even);
    # lift and push of all but cohesion.
    rubbing, clinging = sheared * rub_f, cohesion * cling_f
    by_lift_f, even_lift_f = rubbing * sine_f, clinging * sin_middle_f
    by_push_f, even_push_f = rubbing * cosine_f, clinging * cos_middle_f
    by_torque_f, even_torque_f = twisting * front, cohesion * front
    normal, friction = sigma * r * weight_f, rubbing * share_f
    down_f = normal * cosine_f + friction * sine_f
    along_f = friction * cosine_f - normal * sine_f
    sticking_f = clinging * even_f
    rubbing, clinging = sheared * rub_r, cohesion * cling_r
    by_lift_r, even_lift_r = rubbing * sine_r, clinging * sin_middle_r
    by_push_r, even_push_r = rubbing * cosine_r, clinging * cos_middle_r
    by_torque_r, even_torque_r = twisting * rear, cohesion * rear
    normal, friction = sigma * r * weight_r, rubbing * share_r
    down_r = normal * cosine_r + friction * sine_r
    along_r = friction * cosine_r - normal * sine_r
    sticking_r = clinging * even_r
    # By v/w and K: only the mobilised shares move.
    widened = by_wide * by_spun * cosine_0 * rear / modulus
    faster_f, faster_r = slope_f * climb_f, slope_r * climb_r + widened
    even_faster_f = even_slope_f * climb_f
    even_faster_r = even_slope_r * climb_r + widened * left
    v_lift = -faster_f * by_lift_f - faster_r * by_lift_r
    v_lift -= even_faster_f * even_lift_f + even_faster_r * even_lift_r
    v_push = -faster_f * by_push_f - faster_r * by_push_r
    v_push -= even_faster_f * even_push_f + even_faster_r * even_push_r
    v_torque = -faster_f * by_torque_f - faster_r * by_torque_r
    v_torque -= even_faster_f * even_torque_f + even_faster_r * even_torque_r
    widened = by_wide * by_spun * spun / modulus
    softer_f, softer_r = slope_f * x_f, slope_r * x_r + widened
    even_softer_f = even_slope_f * x_f
    even_softer_r = even_slope_r * x_r + widened * left
    k_lift = -softer_f * by_lift_f - softer_r * by_lift_r
    k_lift -= even_softer_f * even_lift_f + even_softer_r * even_lift_r
    k_push = -softer_f * by_push_f - softer_r * by_push_r
    k_push -= even_softer_f * even_push_f + even_softer_r * even_push_r
    k_torque = -softer_f * by_torque_f - softer_r * by_torque_r
    k_torque -= even_softer_f * even_torque_f + even_softer_r * even_torque_r

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
            grown, cohering, shearing = d_area / area, cohesion * R, sheared * d_area

            d_angle = d_t1 - d_front * centroid - front * d_centroid
            d_way = entering - pace_f * d_angle
            d_share = slope_f * d_way
            d_even = even_slope_f * d_way - by_nearer * x_f * nearer * d_centroid / centroid
            arc = spread * square_f
            growth = grown + ((1.0 - 3.0 * arc) * d_front / front - d_spread * square_f) / (
                1.0 - arc
            )
            turned = sticking_f * 0.5 * (d_t1 + d_tm)
            stretch = cohering * even_f * d_front * (1.0 - 0.125 * square_f)
            d_lift += growth * down_f + along_f * d_angle + d_share * by_lift_f
            d_lift += turned * cos_middle_f + stretch * sin_middle_f + d_even * even_lift_f
            d_push += growth * along_f - down_f * d_angle + d_share * by_push_f
            d_push += stretch * cos_middle_f - turned * sin_middle_f + d_even * even_push_f
            d_torque += d_share * by_torque_f + share_f * (shearing * front + twisting * d_front)
            d_torque += d_even * even_torque_f + even_f * cohesion * d_front

            d_angle = d_t2 + d_rear * centroid + rear * d_centroid
            d_way = entering - pace_r * d_angle
            d_spun = ((turned_r * d_angle) * rear + pace_r * d_rear) / modulus
            d_wide = by_wide * (by_spun * d_spun + (spun * spun * d_spread if by_spun else 0.0))
            d_further = d_angle - 0.5 * (d_tm + d_t2) - further * (d_t1 - d_angle)
            d_share = slope_r * d_way + d_wide
            d_even = even_slope_r * d_way + d_wide * left
            d_even += sign * rest * deeper * d_further / (t1 - angle_r)
            arc = spread * square_r
            growth = grown + ((1.0 - 3.0 * arc) * d_rear / rear - d_spread * square_r) / (1.0 - arc)
            turned = sticking_r * 0.5 * (d_tm + d_t2)
            stretch = cohering * even_r * d_rear * (1.0 - 0.125 * square_r)
            d_lift += growth * down_r + along_r * d_angle + d_share * by_lift_r
            d_lift += turned * cos_middle_r + stretch * sin_middle_r + d_even * even_lift_r
            d_push += growth * along_r - down_r * d_angle + d_share * by_push_r
            d_push += stretch * cos_middle_r - turned * sin_middle_r + d_even * even_push_r
            d_torque += d_share * by_torque_r + share_r * (shearing * rear + twisting * d_rear)
            d_torque += d_even * even_torque_r + even_r * cohesion * d_rear

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
