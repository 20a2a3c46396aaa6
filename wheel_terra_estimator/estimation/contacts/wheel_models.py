# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Wheel-soil models as the filter uses them, in scalar floats, seen in the direction of rolling.

* Torque and pull: ``terramechanics.conditioned``. With the sinkage measured, the load balance fixes
  the stresses; slip, load and shear strength are enough, and no bearing parameter enters. It holds
  in soil of unknown stiffness and while the wheel is still sinking.
* Sinkage: the bearing law says which load the soil would carry at the present sinkage; where that
  is less than the wheel's load, it sinks on.
"""

from __future__ import annotations

import math
from dataclasses import MISSING, fields
from math import isnan
from typing import NamedTuple, cast

from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.scalars import clipped
from wheel_terra_estimator.terramechanics.closed_form import coefficients, peak_stresses
from wheel_terra_estimator.terramechanics.conditioned import SMALLEST_ANGLE, ConditionedForces
from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects import EffectSettings
from wheel_terra_estimator.terramechanics.kinematics import slip_of_speed_ratio
from wheel_terra_estimator.terramechanics.maths import ScalarMaths
from wheel_terra_estimator.terramechanics.soil import Soil
from wheel_terra_estimator.terramechanics.stresses import bearing_law
from wheel_terra_estimator.terramechanics.terms import Terms, set_angles

# Effects of a table or of an instrument that the filter must not apply: loads are terrain-normal
# already, and the pull comes from specific force, not from an attitude.
_NOT_IN_FILTER = frozenset({'slope_gravity', 'pitch_bias', 'pull_zero', 'pull_gain'})
_CONTACT_INPUTS = tuple(f.name for f in fields(Contact) if f.default is MISSING)
_LEAST_BEARING = 0.05  # of the normal stress's part: cohesion alone carries no wheel
_Soil = tuple[float, float, float, float]
MOST_RATIO = 3.0
"""v/(r w) beyond which the shear is saturated: more changes nothing [-]."""
_LEAST_SINKAGE = 1e-4  # [m]
_MOST_SINKAGE = 0.95  # of the radius: the bearing law ends at the hub
_LEAST_DEPTH = 1e-6  # at the angle of greatest stress [m]
_LEAST_MODULUS = 1.0  # bearing modulus [N/m^(n+2)]


class WheelState(NamedTuple):
    """State of one turning wheel as the models take it, seen in the direction of rolling."""

    speed_ratio: float  # v/(r w) [-]
    sinkage: float  # [m]
    load: float  # [N]
    strength: float  # ln of the factor on c and tan(phi)
    shear_modulus: float  # ln of the factor on K
    centroid: float = 0.0
    """Shift of the stress centroid over the entrance angle, at all slips [-]."""
    mound: float = 0.0
    """The same for each (s - onset)+^2 / (1 - onset)^2, to the rear [-]."""
    rim_speed: float = math.nan  # |r w| [m/s], nan = not known
    leaving_angle: float = math.nan  # measured [rad], nan = not measured
    stiffness: float = 0.0  # ln of the factor on the bearing modulus
    slip_sinkage: float = 0.0  # added to n1


class WheelForces(NamedTuple):
    """Torque and pull of one wheel with their derivatives by the filter's quantities."""

    torque: float  # [N m]
    pull: float  # [N]
    d_torque: tuple[float, float, float, float, float, float]
    d_pull: tuple[float, float, float, float, float, float]
    """By v/(r w), sinkage, ln shear strength, ln K, centroid, mound."""


class Bearing(NamedTuple):
    """What the bearing law says at a sinkage."""

    load: float  # that it carries [N]
    exponent: float  # N
    log_depth: float  # ln of the depth at the peak stress over the reference depth


class WheelModels:
    """Contact models of all wheels of a rover.

    Parameters
    ----------
    configuration : Configuration
        Wheels.
    soil, effects
        As the contact law takes them; see `contact_models`.
    """

    def __init__(self, configuration: Configuration, soil: Soil, effects: EffectSettings) -> None:
        wheels = configuration.wheels
        effects = {k: v for k, v in effects.items() if k not in _NOT_IN_FILTER}
        gravity = float(configuration.rover.gravity)
        self._forces = ConditionedForces(
            wheels.wheel, soil, effects, configuration.slip_radius, gravity
        )
        self._terms = Terms(effects)
        self._on_inputs = self._terms.stages['on_inputs']
        self._on_outputs = self._terms.stages['on_outputs']
        self._cohesion = float(soil.cohesion)
        self._tan_friction = math.tan(float(soil.friction_angle))
        self._shear_modulus = float(soil.shear_modulus)
        self._exponent = float(soil.sinkage_exponent)
        self._peak_ratio = float(soil.peak_stress_ratio)
        self._leaving_ratio = float(soil.leaving_angle_ratio)
        # Slip above which soil may pile up behind a wheel, whether the effect is configured or not.
        onset = cast('float', configuration.flat()['effects.soil_mound.onset'])
        self._mound_span = 1.0 - onset
        self._passes = [float(p) for p in wheels.passes]
        self._slip_radius = [float(r) for r in wheels.slip_radius]
        self._radius = [float(r) for r in wheels.radius]
        self._modulus = []
        self._contacts = []
        for i in range(wheels.count):
            width = float(wheels.width[i])
            modulus, depth = bearing_law(
                soil.pressure_law,
                float(soil.cohesive_modulus),
                float(soil.frictional_modulus),
                width,
                self._cohesion,
                float(soil.density) * gravity,
            )
            contact = Contact(**dict.fromkeys(_CONTACT_INPUTS, 0.0))
            contact.gravity = gravity
            contact.radius = contact.rim_radius = float(wheels.radius[i])
            contact.width = width
            contact.lug_height = float(wheels.lug_height[i])
            contact.lug_count = float(wheels.lug_count[i])
            contact.density = float(soil.density)
            contact.reference_depth = depth
            contact.pass_number = self._passes[i]
            contact.direction = 1.0
            self._contacts.append(contact)
            self._modulus.append(max(modulus, _LEAST_MODULUS))

    def forces(self, wheel: int, state: WheelState) -> WheelForces:
        """Return torque and pull of a wheel with their derivatives.

        Parameters
        ----------
        wheel : int
            Index.
        state : WheelState
            Its state; stiffness and slip-sinkage have no part in it.

        Notes
        -----
        Where the speed opposes the rim the forces are those of slip 1, and they tell nothing of the
        speed: the shear is saturated.
        """
        ratio, sinkage, load, strength, modulus, centroid, mound, rim_speed, leaving_angle = state[
            :9
        ]
        factor = math.exp(strength)
        cohesion, friction = self._cohesion * factor, self._tan_friction * factor
        shear_modulus = self._shear_modulus * math.exp(modulus)
        span = self._mound_span
        within = clipped(ratio, 0.0, MOST_RATIO)
        high, depth, angle = self._contact(wheel, within, sinkage)
        shift = centroid - mound * high * high
        by_depth = shift / (self._radius[wheel] * math.sin(angle)) if depth == sinkage else 0.0
        torque, pull, d_torque, d_pull, _ = self._forces.forces(
            wheel,
            within,
            sinkage,
            load,
            cohesion,
            friction,
            shear_modulus,
            shift * angle,
            leaving_angle=leaving_angle,
            rim_speed=rim_speed,
            pass_number=self._passes[wheel],
        )
        by_ratio = 2.0 * mound * high / span * angle
        t, f = (
            (
                d[0] + d[6] * by_ratio if ratio >= 0.0 else 0.0,
                d[1] + d[6] * by_depth,
                d[3] * cohesion + d[4] * friction,
                d[5] * shear_modulus,
                d[6] * angle,
                -d[6] * angle * high * high,
            )
            for d in (d_torque, d_pull)
        )
        return WheelForces(torque, pull, t, f)

    def pull(self, wheel: int, state: WheelState) -> float:
        """Return the pull of `forces` alone [N], at half the cost."""
        _, cohesion, friction, shear_modulus = self._soil_under(wheel, state)
        within = clipped(state.speed_ratio, 0.0, MOST_RATIO)
        high, _, angle = self._contact(wheel, within, state.sinkage)
        return self._forces.forces(
            wheel,
            within,
            state.sinkage,
            state.load,
            cohesion,
            friction,
            shear_modulus,
            (state.centroid - state.mound * high * high) * angle,
            leaving_angle=state.leaving_angle,
            rim_speed=state.rim_speed,
            pass_number=self._passes[wheel],
            derivatives=False,
        ).drawbar_pull

    def _contact(self, wheel: int, ratio: float, sinkage: float) -> tuple[float, float, float]:
        """Return (s - onset)+ / (1 - onset), the sinkage in its bounds and the entrance angle."""
        radius, span = self._radius[wheel], self._mound_span
        depth = clipped(sinkage, _LEAST_SINKAGE, radius)
        return max(span - ratio, 0.0) / span, depth, math.acos(1.0 - depth / radius)

    def bearing(self, wheel: int, state: WheelState) -> Bearing:
        """Return the load that the bearing law carries at the sinkage of a wheel.

        Parameters
        ----------
        wheel : int
            Index.
        state : WheelState
            Its state; centroid, mound and rim speed have no part in it.
        """
        soil = self._soil_under(wheel, state)
        return self._bearing_at(wheel, state, state.speed_ratio, soil)

    def bearing_and_slower(
        self, wheel: int, state: WheelState, step: float
    ) -> tuple[Bearing, Bearing]:
        """Return `bearing` at a state, and where v/(r w) is less by a step."""
        soil = self._soil_under(wheel, state)
        return (
            self._bearing_at(wheel, state, state.speed_ratio, soil),
            self._bearing_at(wheel, state, state.speed_ratio - step, soil),
        )

    def _soil_under(self, wheel: int, state: WheelState) -> _Soil:
        """Return bearing modulus, c [Pa], tan(phi) and K [m], what is learned included."""
        factor = math.exp(state.strength)
        return (
            self._modulus[wheel] * math.exp(state.stiffness),
            self._cohesion * factor,
            self._tan_friction * factor,
            self._shear_modulus * math.exp(state.shear_modulus),
        )

    def _bearing_at(self, wheel: int, state: WheelState, ratio: float, soil: _Soil) -> Bearing:
        sinkage, load, leaving = state.sinkage, state.load, state.leaving_angle
        c, m = self._contacts[wheel], ScalarMaths
        slip = slip_of_speed_ratio(ratio, m)
        c.slip = slip
        c.velocity_ratio = clipped(ratio, 0.0, MOST_RATIO) * self._slip_radius[wheel]
        c.normal_load = c.stated_load = load
        c.rim_speed = math.nan
        c.radius = c.shear_radius = c.rim_radius
        c.sinkage_exponent = self._exponent + state.slip_sinkage * abs(slip)
        c.bearing_modulus, c.cohesion, c.tan_friction, c.shear_modulus = soil
        c.peak_ratio, c.leaving_ratio = self._peak_ratio, self._leaving_ratio
        for term, values in self._on_inputs:
            term(c, values, m)
        c.sinkage = c.drawbar_pull = c.torque = c.entrance_angle = 0.0
        for term, values in self._on_outputs:
            term(c, values, m)
        depth = clipped(sinkage - c.sinkage, 0.0, _MOST_SINKAGE * c.radius)
        entrance = max(math.acos(1.0 - depth / c.radius), 10.0 * SMALLEST_ANGLE)
        set_angles(c, entrance, None if isnan(leaving) else leaving, self._terms, m)
        a, b, _ = coefficients(c.entrance_angle, c.peak_angle, c.leaving_angle, m)
        sigma, tau = peak_stresses(c, self._terms, m)
        peak_depth = c.radius * (math.cos(c.peak_angle) - math.cos(c.entrance_angle))
        log_depth = math.log(max(peak_depth, _LEAST_DEPTH) / c.reference_depth)
        normal = c.width * c.radius * a * sigma
        carried = normal + c.width * c.shear_radius * b * tau
        return Bearing(max(carried, _LEAST_BEARING * normal), c.sinkage_exponent, log_depth)
