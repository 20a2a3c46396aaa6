# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Wheel-soil contact as the filter sees it: torque and pull conditioned on load and sinkage.

With the sinkage known, the contact geometry is known, and the load balance fixes the normal
stress. Writing A, B, C for the integrals of the linearised stresses, E = 1 - exp(-j/K)::

    W = b (r A sigma + R B tau),  tau = E (c + sigma tan(phi))
    =>  tau = E (c + tan(phi) W / (b r A)) / (1 + E tan(phi) R B / (r A))
    T = b R^2 C tau,  F = b (R A tau - r B sigma)

So torque and pull depend on slip, sinkage, load and shear strength, and on no bearing parameter:
they hold in soil of unknown stiffness and while the wheel is still sinking. The bearing law says
only where the sinkage tends to; its load ratio is returned beside them.

Scalar floats throughout: for a rover's wheels a loop over ``math`` is several times faster than
numpy. The terms of the effects are those of the catalogue, the same as in the quadrature.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.filter_settings import FilterSettings
from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects import catalogue
from wheel_terra_estimator.terramechanics.maths import ScalarMaths

# Effects of a table or of an instrument that the filter does not read: loads are terrain-normal
# already, and the pull comes from specific force, not from an attitude.
_NOT_IN_FILTER = frozenset({'slope_gravity', 'pitch_bias'})
_LEAST_SINKAGE = 3e-4  # [m]; a wheel on soil is never at exactly 0, and derivatives need a contact
_LEAST_GAP = 1e-3  # [rad] between the angles of the linearised stresses


@dataclass(frozen=True)
class WheelMotion:
    """Motion and load of one wheel, seen in its direction of rolling (rim speed positive)."""

    slip: float
    velocity_ratio: float  # v / w [m]
    load: float  # [N]
    rim_speed: float  # |r w| [m/s]
    leaving_angle: float  # measured [rad], nan = not


@dataclass(slots=True)
class ContactState:
    """Geometry of a contact and what the soil gives at it, before the shear is known."""

    contact: Contact
    a: float
    b: float
    c: float
    displacement: float  # j at the angle of greatest stress [m]
    bearing_stress: float  # sigma by the bearing law [Pa]
    bearing_depth: float  # depth of the angle of greatest stress [m]


@dataclass(frozen=True)
class ContactForces:
    """Forces in the direction of rolling."""

    pull: float  # F [N]
    torque: float  # T as the sensor reads it [N m]
    bearing_load: float  # load that the bearing law carries at this sinkage [N]


class ContactModel:
    """Scalar contact model of one wheel.

    Parameters
    ----------
    configuration : Configuration
        Soil, wheels, effects.
    settings : FilterSettings
        Constants of the rover.
    wheel : int
        Index of the wheel.
    """

    def __init__(self, configuration: Configuration, settings: FilterSettings, wheel: int) -> None:
        soil, wheels = configuration.soil, configuration.wheels
        self._radius = settings.rim_radius[wheel]
        self._width = float(wheels.width[wheel])
        self._lug = (
            float(wheels.lug_height[wheel]),
            float(wheels.lug_count[wheel]),
            float(wheels.lug_thickness[wheel]),
        )
        self._pass = settings.passes[wheel]
        self._gravity = settings.gravity
        self._bearing_modulus = float(soil.cohesive_modulus / self._width + soil.frictional_modulus)
        self._exponent = float(soil.sinkage_exponent)
        self._cohesion = float(soil.cohesion)
        self._tan_friction = math.tan(float(soil.friction_angle))
        self._shear_modulus = float(soil.shear_modulus)
        self._peak_ratio = float(soil.peak_stress_ratio)
        self._leaving_ratio = float(soil.leaving_angle_ratio)
        self._density = float(soil.density)
        known = catalogue()
        self._terms: dict[str, list[tuple[Any, SimpleNamespace]]] = {
            'on_inputs': [],
            'on_contact': [],
            'on_normal_stress': [],
            'on_outputs': [],
        }
        for name, values in configuration.effects.items():
            if name in _NOT_IN_FILTER:
                continue
            for stage, terms in self._terms.items():
                term = getattr(known[name], stage)
                if term is not None:
                    terms.append((term, SimpleNamespace(**values)))

    def geometry(
        self, motion: WheelMotion, sinkage: float, centroid: float, slip_sinkage: float
    ) -> ContactState:
        """Return the contact for a sinkage [m], a centroid shift [rad] and a change of n1."""
        m = ScalarMaths
        height, count, thickness = self._lug
        c = Contact(
            motion.slip,
            motion.velocity_ratio,
            motion.load,
            motion.load,
            0.0,
            self._gravity,
            motion.rim_speed,
            1.0,
            self._pass,
            self._radius,
            self._width,
            height,
            count,
            thickness,
            self._radius,
            self._bearing_modulus,
            1.0,
            self._exponent + slip_sinkage * motion.slip,
            self._cohesion,
            self._tan_friction,
            self._shear_modulus,
            self._peak_ratio,
            self._leaving_ratio,
            self._density,
        )
        for term, values in self._terms['on_inputs']:
            term(c, values, m)
        r = c.radius
        offset = 0.0
        if self._terms['on_outputs']:
            # What lugs or a zero error add to the sinkage is no contact depth.
            for term, values in self._terms['on_outputs']:
                term(c, values, m)
            offset, c.sinkage, c.drawbar_pull, c.torque = c.sinkage, 0.0, 0.0, 0.0
        depth = min(max(sinkage - offset, _LEAST_SINKAGE), 0.95 * r)
        entrance = math.acos(1.0 - depth / r)
        c.entrance_angle = entrance
        c.peak_angle = c.peak_ratio * entrance
        if motion.leaving_angle == motion.leaving_angle:
            c.leaving_angle = motion.leaving_angle
            for term, values in self._terms['on_contact']:
                term(c, values, m)
            c.leaving_angle = motion.leaving_angle
        else:
            c.leaving_angle = c.leaving_ratio * entrance
            for term, values in self._terms['on_contact']:
                term(c, values, m)
        # The centroid is a third of the sum of the three angles: the peak takes the shift.
        leaving = min(c.leaving_angle, entrance - 3.0 * _LEAST_GAP)
        span = entrance - leaving
        peak = min(
            max(c.peak_angle + 3.0 * centroid, leaving + 0.02 * span), entrance - 0.02 * span
        )
        c.leaving_angle, c.peak_angle = leaving, peak
        cos_1, cos_m, cos_2 = math.cos(entrance), math.cos(peak), math.cos(leaving)
        sin_1, sin_m, sin_2 = math.sin(entrance), math.sin(peak), math.sin(leaving)
        rear, front = peak - leaving, entrance - peak
        a = (cos_m - cos_2) / rear + (cos_m - cos_1) / front
        b = (sin_m - sin_2) / rear + (sin_m - sin_1) / front
        displacement = c.shear_radius * front - c.velocity_ratio * (sin_1 - sin_m)
        # Where the peak lies behind the hub, the deepest soil is at the bottom.
        bearing_depth = max(r * ((cos_m if peak > 0.0 else 1.0) - cos_1), 1e-5)
        stress = c.bearing_modulus * (bearing_depth / c.reference_depth) ** c.sinkage_exponent
        if self._terms['on_normal_stress']:
            c.angle, c.normal_stress = peak, stress
            for term, values in self._terms['on_normal_stress']:
                term(c, values, m)
            stress = c.normal_stress
        return ContactState(c, a, b, 0.5 * span, displacement, stress, bearing_depth)

    def forces(
        self, state: ContactState, strength: float, modulus: float, stiffness: float
    ) -> ContactForces:
        """Return the forces for log factors on shear strength, K and stiffness."""
        c = state.contact
        ratio = state.displacement / (c.shear_modulus * math.exp(modulus))
        mobilised = -math.expm1(-abs(ratio)) * math.exp(strength)
        if ratio < 0.0:
            mobilised = -mobilised
        r, shear_radius, width = c.radius, c.shear_radius, c.width
        normal = r * state.a
        lever = shear_radius * state.b
        mobilised_friction = mobilised * c.tan_friction
        mobilised_cohesion = mobilised * c.cohesion
        denominator = max(normal + lever * mobilised_friction, 0.2 * normal)
        sigma = max((c.normal_load / width - lever * mobilised_cohesion) / denominator, 0.0)
        tau = mobilised_cohesion + sigma * mobilised_friction
        c.drawbar_pull = width * (shear_radius * state.a * tau - r * state.b * sigma)
        c.torque = width * shear_radius * shear_radius * state.c * tau
        c.sinkage = 0.0
        for term, values in self._terms['on_outputs']:
            term(c, values, ScalarMaths)
        bearing = state.bearing_stress * math.exp(stiffness)
        bearing_tau = mobilised_cohesion + bearing * mobilised_friction
        return ContactForces(
            c.drawbar_pull,
            c.torque,
            max(width * (normal * bearing + lever * bearing_tau), 0.05 * width * normal * bearing),
        )


def driving_slip(speed: float, rim_speed: float) -> float:
    """Return the contract's slip ratio for a rim speed that is positive and not at rest."""
    if speed <= rim_speed:
        return min(1.0 - speed / rim_speed, 1.0)
    return rim_speed / speed - 1.0
