# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Resistive force theory of a wheel in the plane: one scale is all it knows of a soil.

Each small plate of the wheel meets a stress that grows with its depth and depends on its tilt and
on the direction in which it moves, as if the others were not there (Li, Zhang and Goldman 2013,
Science 339:1408, doi 10.1126/science.1229163). Dry grains without cohesion, slow motion.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.terramechanics.checks import check_range
from wheel_terra_estimator.terramechanics.kinematics import speed_ratio
from wheel_terra_estimator.terramechanics.load_balance import solve_entrance_angle
from wheel_terra_estimator.terramechanics.model import OUTSIDE_VALIDITY, OVERLOADED, SteadyState
from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints

# Generic Fourier coefficients of the stress per depth [N/cm^3] (the paper's supplement, table S3).
_A00, _A10, _B11, _B01, _B_11 = 0.206, 0.169, 0.212, 0.358, 0.055
_C11, _C01, _C_11, _D10 = -0.124, 0.253, 0.007, 0.088
PER_CUBIC_METRE = 1e6  # [N/m^3] per [N/cm^3]
_NODES = 24  # on the rim
_START = 0.3  # first guess of the entrance angle [rad]


def stress_maps(tilt: Any, direction: Any) -> tuple[Any, Any]:
    """Vertical and horizontal stress per depth on a plate of the generic medium [N/cm^3].

    ``tilt``: of the plate from the horizontal, positive where it rises towards +x [rad].
    ``direction``: of its motion, from +x, positive downwards, in [-pi, pi] [rad]. Returns the
    upward stress, and the one towards -x (against a motion towards +x).
    """
    # The maps are measured for motion towards +x; the other half is its mirror image.
    back = np.cos(direction) < 0.0
    sign = np.where(back, -1.0, 1.0)
    tilt, direction = sign * tilt, np.where(back, np.pi - np.asarray(direction), direction)
    ahead, behind = 2.0 * tilt + direction, direction - 2.0 * tilt
    up = _A00 + _A10 * np.cos(2.0 * tilt) + _B11 * np.sin(ahead) + _B01 * np.sin(direction)
    along = _C11 * np.cos(ahead) + _C01 * np.cos(direction) + _C_11 * np.cos(behind)
    return up + _B_11 * np.sin(behind), sign * (along + _D10 * np.sin(2.0 * tilt))


class ResistiveForce:
    """Steady wheel-soil contact by resistive force theory.

    The leading side of the rim carries. Lugs are left out, and a wheel that has some is outside the
    validity: thirty plates summed as the theory has it, each in the wake of the last, pull more
    than the load (HIT wheel, lugs of 10 mm).

    ``scale``: stress over that of the generic medium [-]. ``strict``: True: a soil that cannot
    carry the load raises ``ValueError``; False: the point is clamped at a sinkage of one radius and
    flagged.
    """

    def __init__(self, scale: float, *, strict: bool = True) -> None:
        check_range('scale of the resistive stress', scale, 0.0, open_lower=True)
        self.scale, self.strict = scale, strict

    def steady_state(self, points: OperatingPoints) -> SteadyState:
        """Solve the load balance and return sinkage, drawbar pull and torque.

        Raises ValueError where a wheel slides sideways, the slip refers to a shear radius (this law
        has none), or `strict` and the soil cannot carry a load.
        """
        if np.any(points.slip_angle) or np.nan_to_num(points.lateral_speed_ratio).any():
            raise ValueError(
                'the law resistive_force holds in the plane of the wheel; leave the slip angle at 0'
            )
        if points.slip_radius == 'shear':
            raise ValueError("the law resistive_force has no shear radius; slip_radius 'rim'")
        load = np.asarray(points.normal_load, float)
        angle, carries = solve_entrance_angle(
            lambda angles: self.forces(points, angles)[0], load, np.full(len(points), _START)
        )
        if self.strict and not carries.all():
            worst = int(np.flatnonzero(~carries)[0])
            raise ValueError(f'normal load is {load[worst]:g} N (entry {worst}): too much to carry')
        _, pull, torque = self.forces(points, angle)
        direction = np.where(points.angular_velocity < 0.0, -1.0, 1.0)
        none = np.zeros(len(points))
        flags = np.where(carries, 0, OVERLOADED)
        outside = (np.abs(points.slip) > 0.95) | (np.asarray(points.wheel.lug_height) > 0.0)
        flags = flags + np.where(outside, OUTSIDE_VALIDITY, 0)
        return SteadyState(
            np.asarray(points.wheel.radius) * (1.0 - np.cos(angle)),
            direction * pull,
            direction * torque,
            angle,
            none,
            none,
            none,
            flags,
        )

    def forces(
        self, points: OperatingPoints, entrance_angle: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Load [N], pull [N] and torque [N m] at given entrance angles (..., N) [rad]."""
        wheel = points.wheel
        radius, height = np.asarray(wheel.radius, float), np.asarray(wheel.lug_height, float)
        slip_radius = radius + (height if points.slip_radius == 'lug_tip' else 0.0)
        beyond = speed_ratio(points.slip) * slip_radius / radius - 1.0
        lift, push_back, rub_up, rub_ahead, turn = np.moveaxis(
            rim_integrals(np.arctan2(beyond, entrance_angle), entrance_angle), -1, 0
        )
        factor = self.scale * PER_CUBIC_METRE * np.asarray(wheel.width, float) * radius**2
        return factor * (lift + rub_up), factor * (rub_ahead - push_back), factor * radius * turn


def rim_integrals(motion: FloatArray, entrance_angle: FloatArray) -> FloatArray:
    """Integrate the generic stress over the leading side of a rim of radius 1 m and width 1 m.

    ``motion``: angle whose tangent is (v/(r w) - 1) over the entrance angle [rad].
    ``entrance_angle``: [rad]. Returns (..., 5): lift of the stress normal to the rim and what it
    pushes back; lift, push ahead and torque of the tangential stress [N/cm^3].
    """
    x, w = np.polynomial.legendre.leggauss(_NODES)
    motion, whole = (v[..., None] for v in np.broadcast_arrays(motion, entrance_angle))
    angle = whole * 0.5 * (x + 1.0)
    cosine, sine = np.cos(angle), np.sin(angle)
    # Velocity of a plate, ahead and down, both times cos(motion).
    ahead = np.cos(motion) * (1.0 - cosine) + whole * np.sin(motion)
    up, against = stress_maps(angle, np.arctan2(np.cos(motion) * sine, ahead))
    depth = (cosine - np.cos(whole)) * (whole * 0.5 * w)
    normal, along = (up * cosine + against * sine) * depth, (up * sine - against * cosine) * depth
    parts = normal * cosine, normal * sine, along * sine, along * cosine, along
    return np.stack([part.sum(-1) for part in parts], -1)
