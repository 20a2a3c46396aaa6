# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Alternative laws of the wheel-soil contact: operating points in, sinkage and forces out."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeAlias

import numpy as np

from wheel_terra_estimator.arrays import FloatArray, Quantity
from wheel_terra_estimator.terramechanics.checks import check_range
from wheel_terra_estimator.terramechanics.effects import EffectSettings
from wheel_terra_estimator.terramechanics.kinematics import STEADY_SLIP, speed_ratio
from wheel_terra_estimator.terramechanics.load_balance import solve_entrance_angle
from wheel_terra_estimator.terramechanics.model import (
    OUTSIDE_VALIDITY,
    OVERLOADED,
    SteadyState,
    WheelSoilModel,
)
from wheel_terra_estimator.terramechanics.operating_points import STANDARD_GRAVITY, OperatingPoints
from wheel_terra_estimator.terramechanics.soil import Soil

# Generic Fourier coefficients of the stress per depth [N/cm^3] (the paper's supplement, table S3).
_A00, _A10, _B11, _B01, _B_11 = 0.206, 0.169, 0.212, 0.358, 0.055
_C11, _C01, _C_11, _D10 = -0.124, 0.253, 0.007, 0.088
PER_CUBIC_METRE = 1e6  # [N/m^3] per [N/cm^3]
_NODES = 24  # on the rim
_START = 0.3  # first guess of the entrance angle [rad]


def stress_maps(tilt: Quantity, direction: Quantity) -> tuple[FloatArray, FloatArray]:
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
    """Steady wheel-soil contact by resistive force theory, with one scale as the only soil number.

    Each small plate of the wheel meets a stress that grows with its depth and depends on its tilt
    and on the direction in which it moves, as if the others were not there (Li, Zhang and Goldman
    2013, Science 339:1408, doi 10.1126/science.1229163). Dry grains without cohesion, slow motion,
    in the plane of the wheel.

    The leading side of the rim carries. Lugs are left out, and a wheel that has some is outside the
    validity: thirty plates summed as the theory has it, each in the wake of the last, pull more
    than the load (HIT wheel, lugs of 10 mm).

    ``scale``: stress over that of the generic medium [-].
    """

    def __init__(self, scale: float) -> None:
        check_range('scale of the resistive stress', scale, 0.0, open_lower=True)
        self.scale = scale

    def steady_state(self, points: OperatingPoints) -> SteadyState:
        """Solve the load balance and return sinkage, drawbar pull and torque.

        Where the soil cannot carry the load, they are those at a sinkage of one radius, flagged.
        Raises ValueError where a wheel slides sideways.
        """
        if np.any(points.slip_angle) or np.nan_to_num(points.lateral_speed_ratio).any():
            raise ValueError(
                'the law resistive_force holds in the plane of the wheel; leave the slip angle at 0'
            )
        load = np.asarray(points.normal_load, float)
        angle, carries = solve_entrance_angle(
            lambda angles: self.forces(points, angles)[0], load, np.full(len(points), _START)
        )
        _, pull, torque = self.forces(points, angle)
        direction = np.where(points.angular_velocity < 0.0, -1.0, 1.0)
        none = np.zeros(len(points))
        flags = np.where(carries, 0, OVERLOADED)
        outside = (np.abs(points.slip) > STEADY_SLIP) | (np.asarray(points.wheel.lug_height) > 0.0)
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
    ``entrance_angle``: [rad]. Returns (..., 5): lift and backward push of the stress normal to the
    rim; lift, forward push and torque of the tangential stress [N/cm^3].
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


LAWS = 'bekker_wong_janosi', 'wong_reece', 'resistive_force'
BEKKER_WONG_JANOSI, WONG_REECE, RESISTIVE_FORCE = LAWS
# Shift of the peak stress with slip where none is configured; loose sand: Wong and Reece 1967,
# J. Terramechanics 4(1), 81-98 (doi 10.1016/0022-4898(67)90105-X).
PEAK_SHIFT = 0.32
PLATE_DEPTH = 0.02  # at which the resistive stress is that of the soil's plate test [m]


ContactLaw: TypeAlias = WheelSoilModel | ResistiveForce


def contact_law(
    name: str,
    soil: Soil,  # floats
    # Switched-on effects, a ``learned_closure`` among them; ``resistive_force`` has none
    effects: EffectSettings,
    # Width at which the laws have the same pressure [m]: that at which ``wong_reece`` converts
    # Bekker's moduli, and of the plate that gives ``resistive_force`` its scale
    width: float,
    gravity: float = STANDARD_GRAVITY,  # at which the soil's numbers hold [m/s^2]
) -> ContactLaw:
    """Return a law for the soil as configured; it flags loads that the soil cannot carry.

    Raises ValueError for an unknown name.
    """
    if name == BEKKER_WONG_JANOSI:
        return WheelSoilModel(soil, effects, 'closed_form')
    if name == WONG_REECE:
        reece = reece_soil(soil, width, gravity)
        return WheelSoilModel(reece, reece_effects(effects), 'quadrature')
    if name == RESISTIVE_FORCE:
        return ResistiveForce(plate_scale(soil, width, gravity))
    raise ValueError(f'contact law is {name!r}; allowed is one of {LAWS}')


def reece_effects(effects: EffectSettings) -> EffectSettings:
    """Return the effects with the shift of the peak stress on, Wong and Reece's where it is off."""
    if 'stress_peak_shift' in {key.partition(':')[0] for key in effects}:
        return effects
    return {**effects, 'stress_peak_shift': {'c2': PEAK_SHIFT, 'skid': 0.0}}


def reece_soil(soil: Soil, width: float, gravity: float) -> Soil:
    """Return the soil with Reece's pressure c kc' + rho g b kphi', the same at this width [m]."""
    if soil.pressure_law == 'reece':
        return soil
    pressure, _ = soil.bearing(width, gravity)
    modulus = pressure * width**soil.sinkage_exponent / (soil.density * gravity * width)
    return replace(soil, cohesive_modulus=0.0, frictional_modulus=modulus, pressure_law='reece')


def plate_scale(soil: Soil, width: float, gravity: float = STANDARD_GRAVITY) -> float:
    """Scale of the resistive stress with which a flat plate meets the soil's pressure [-]."""
    modulus, depth = soil.bearing(width, gravity)
    pressure = modulus * (PLATE_DEPTH / depth) ** soil.sinkage_exponent
    generic = PER_CUBIC_METRE * float(stress_maps(0.0, 0.5 * np.pi)[0]) * PLATE_DEPTH
    return float(pressure) / generic
