# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The contact integrals of the closed form and their derivatives, as plain floats.

Everything that the on-board filter needs of one wheel hangs on eight integrals of the stress
shapes. They are computed together with their directional derivatives (forward mode, written
out), at a few microseconds; ``closed_form.forces`` is the same algebra for arrays.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from wheel_terra_estimator.terramechanics.closed_form import branch_moments, moment_spread

# (d t1, d tm, d t2, d(v/w), dN, d ln K) per unit of the direction's variable.
Direction = tuple[float, float, float, float, float, float]
_STEP = 1e-6


class BranchIntegrals(NamedTuple):
    """Integrals over the contact, per unit of peak normal stress or of cohesion.

    ``normal_*``: of the normal stress; ``friction_*``: of the normal stress times the mobilised
    share; ``cohesion_*``: of the mobilised share; ``_x`` times cos t, ``_y`` times sin t, ``_sum``
    times 1.
    """

    normal_x: float
    normal_y: float
    friction_x: float
    friction_y: float
    friction_sum: float
    cohesion_x: float
    cohesion_y: float
    cohesion_sum: float

    def turned(self) -> BranchIntegrals:
        """Return the derivative by a rotation of all stresses towards the front."""
        nx, ny, fx, fy, _, cx, cy, _ = self
        return BranchIntegrals(-ny, nx, -fy, fx, 0.0, -cy, cx, 0.0)


def branch_integrals(
    entrance_angle: float,
    peak_angle: float,
    leaving_angle: float,
    shear_radius: float,
    velocity_ratio: float,
    exponent: float,
    shear_modulus: float,
    shift: float,
    directions: Sequence[Direction],
) -> tuple[BranchIntegrals, list[BranchIntegrals]]:
    """Return the integrals and, for each direction, their derivatives.

    Parameters
    ----------
    entrance_angle, peak_angle, leaving_angle : float
        t1 > tm > t2 [rad].
    shear_radius, velocity_ratio : float
        R and v/w [m].
    exponent : float
        Sinkage exponent N [-].
    shear_modulus : float
        K [m].
    shift : float
        Rotation of the stresses towards the front [rad].
    directions : sequence of tuple
        Rates of (t1, tm, t2, v/w, N, ln K).
    """
    t1, tm, t2 = entrance_angle, peak_angle, leaving_angle
    front, rear, total = t1 - tm, tm - t2, t1 + tm
    skew = front / total
    area, centroid = branch_moments(exponent, skew)
    spread = 0.5 * moment_spread(exponent)
    sin_1, cos_1 = math.sin(t1), math.cos(t1)

    # Front branch.
    angle_f = t1 - front * centroid
    sin_j, cos_j = math.sin(angle_f), math.cos(angle_f)
    x = (shear_radius * (t1 - angle_f) - velocity_ratio * (sin_1 - sin_j)) / shear_modulus
    y = 1.0 / (1.0 + 0.125 * abs(x))
    power = (y * y) ** 4
    share_f = 1.0 - power if x >= 0.0 else power - 1.0
    slope_f = power * y / shear_modulus
    level_f, sin_f, cos_f, x_f = cos_j, sin_j, cos_j, x
    middle = t1 - 0.5 * front + shift
    sin_mf, cos_mf = math.sin(middle), math.cos(middle)

    # Rear branch.
    angle_r = t2 + rear * centroid
    sin_j, cos_j = math.sin(angle_r), math.cos(angle_r)
    x = (shear_radius * (t1 - angle_r) - velocity_ratio * (sin_1 - sin_j)) / shear_modulus
    y = 1.0 / (1.0 + 0.0625 * abs(x))
    power = (y * y) ** 8
    share_r = 1.0 - power if x >= 0.0 else power - 1.0
    slope_r = power * y / shear_modulus
    level_r, sin_r, cos_r, x_r = cos_j, sin_j, cos_j, x
    middle = tm - 0.5 * rear + shift
    sin_mr, cos_mr = math.sin(middle), math.cos(middle)

    if shift:
        sin_d, cos_d = math.sin(shift), math.cos(shift)
        sin_f, cos_f = sin_f * cos_d + cos_f * sin_d, cos_f * cos_d - sin_f * sin_d
        sin_r, cos_r = sin_r * cos_d + cos_r * sin_d, cos_r * cos_d - sin_r * sin_d

    weight_f = area * front * (1.0 - spread * front * front)
    weight_r = area * rear * (1.0 - spread * rear * rear)
    rub_f, rub_r = weight_f * share_f, weight_r * share_r
    grip_f, grip_r = front * share_f, rear * share_r
    value = BranchIntegrals(
        weight_f * cos_f + weight_r * cos_r,
        weight_f * sin_f + weight_r * sin_r,
        rub_f * cos_f + rub_r * cos_r,
        rub_f * sin_f + rub_r * sin_r,
        rub_f + rub_r,
        grip_f * cos_mf + grip_r * cos_mr,
        grip_f * sin_mf + grip_r * sin_mr,
        grip_f + grip_r,
    )

    derivatives = []
    for d_t1, d_tm, d_t2, d_ratio, d_exponent, d_log_k in directions:
        d_front, d_rear = d_t1 - d_tm, d_tm - d_t2
        d_skew = (d_front - skew * (d_t1 + d_tm)) / total
        d_area = d_centroid = d_spread = 0.0
        if abs(d_skew) > 1e-12 or d_exponent:
            moved_area, moved_centroid = branch_moments(
                exponent + _STEP * d_exponent, skew + _STEP * d_skew
            )
            d_area, d_centroid = (moved_area - area) / _STEP, (moved_centroid - centroid) / _STEP
            if d_exponent:
                moved_spread = 0.5 * moment_spread(exponent + _STEP * d_exponent)
                d_spread = (moved_spread - spread) / _STEP
        d_angle_f = d_t1 - d_front * centroid - front * d_centroid
        d_angle_r = d_t2 + d_rear * centroid + rear * d_centroid
        base = (shear_radius - velocity_ratio * cos_1) * d_t1
        d_share_f = slope_f * (
            base
            - (shear_radius - velocity_ratio * level_f) * d_angle_f
            - d_ratio * (sin_1 - math.sin(angle_f))
            - x_f * shear_modulus * d_log_k
        )
        d_share_r = slope_r * (
            base
            - (shear_radius - velocity_ratio * level_r) * d_angle_r
            - d_ratio * (sin_1 - math.sin(angle_r))
            - x_r * shear_modulus * d_log_k
        )
        cut_f, cut_r = spread * front * front, spread * rear * rear
        d_weight_f = (d_area * front + area * d_front) * (1.0 - cut_f) - area * front * front * (
            d_spread * front + 2.0 * spread * d_front
        )
        d_weight_r = (d_area * rear + area * d_rear) * (1.0 - cut_r) - area * rear * rear * (
            d_spread * rear + 2.0 * spread * d_rear
        )
        d_rub_f = d_weight_f * share_f + weight_f * d_share_f
        d_rub_r = d_weight_r * share_r + weight_r * d_share_r
        d_grip_f = d_front * share_f + front * d_share_f
        d_grip_r = d_rear * share_r + rear * d_share_r
        d_mid_f, d_mid_r = 0.5 * (d_t1 + d_tm), 0.5 * (d_tm + d_t2)
        derivatives.append(
            BranchIntegrals(
                d_weight_f * cos_f
                + d_weight_r * cos_r
                - weight_f * sin_f * d_angle_f
                - weight_r * sin_r * d_angle_r,
                d_weight_f * sin_f
                + d_weight_r * sin_r
                + weight_f * cos_f * d_angle_f
                + weight_r * cos_r * d_angle_r,
                d_rub_f * cos_f
                + d_rub_r * cos_r
                - rub_f * sin_f * d_angle_f
                - rub_r * sin_r * d_angle_r,
                d_rub_f * sin_f
                + d_rub_r * sin_r
                + rub_f * cos_f * d_angle_f
                + rub_r * cos_r * d_angle_r,
                d_rub_f + d_rub_r,
                d_grip_f * cos_mf
                + d_grip_r * cos_mr
                - grip_f * sin_mf * d_mid_f
                - grip_r * sin_mr * d_mid_r,
                d_grip_f * sin_mf
                + d_grip_r * sin_mr
                + grip_f * cos_mf * d_mid_f
                + grip_r * cos_mr * d_mid_r,
                d_grip_f + d_grip_r,
            )
        )
    return value, derivatives
