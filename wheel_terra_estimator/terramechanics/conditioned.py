# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Torque and pull of a wheel whose sinkage is known: what the on-board filter evaluates.

With the sinkage given, the load balance fixes the peak stresses, and no bearing parameter is
needed; this holds also while the sinkage still settles. Plain floats: for six wheels several
times faster than numpy.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from wheel_terra_estimator.terramechanics.balanced_branches import balanced_forces
from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects import catalogue
from wheel_terra_estimator.terramechanics.maths import ScalarMaths
from wheel_terra_estimator.terramechanics.scalar_wheels import ScalarWheels
from wheel_terra_estimator.terramechanics.terms import Terms, set_angles

# Columns of the derivatives that ``ConditionedForces`` returns.
INPUTS = (
    'speed_ratio',
    'sinkage',
    'normal_load',
    'cohesion',
    'tan_friction',
    'shear_modulus',
    'centroid_shift',
)
SMALLEST_ANGLE = 2e-3  # [rad]; below, the wheel hardly touches and angles lose their meaning
_STEP = 1e-6
# Smallest size of speed ratio, load, c, tan(phi), K for the finite steps through the effects.
_FLOORS = (1.0, 1.0, 100.0, 0.1, 0.01)
_LARGEST_COSINE = math.cos(SMALLEST_ANGLE)


class Forces(NamedTuple):
    """Answer of ``ConditionedForces``.

    Attributes
    ----------
    torque, drawbar_pull : float
        [N m], [N].
    d_torque, d_pull : tuple of float
        Derivatives by ``INPUTS``.
    clamped : bool
        True where an input was outside the model (sinkage below zero or above the radius) and
        was clamped.
    """

    torque: float
    drawbar_pull: float
    d_torque: tuple[float, ...]
    d_pull: tuple[float, ...]
    clamped: bool


class ConditionedForces(ScalarWheels):
    """Torque and pull given slip, sinkage and load, with analytic derivatives.

    Parameters are those of ``ScalarWheels``; cohesion, friction and shear modulus of the soil are
    given anew with each call.
    """

    def _prepare(self) -> None:
        known = catalogue()
        self._on_inputs = self._terms.stages['on_inputs']
        outputs = {n: values for n, values in self._settings.items() if known[n].on_outputs}
        self._on_sinkage = Terms(
            {n: v for n, v in outputs.items() if 'sinkage' in known[n].touches}
        ).stages['on_outputs']
        self._on_forces = Terms(
            {n: v for n, v in outputs.items() if known[n].touches - {'sinkage'}}
        ).stages['on_outputs']
        self._plain = not (self._on_inputs or self._on_sinkage or self._terms.stages['on_contact'])
        soil = self._soil
        self._exponent = float(soil.sinkage_exponent)
        self._peak_ratio = float(soil.peak_stress_ratio)
        self._leaving_ratio = float(soil.leaving_angle_ratio)

    def forces(
        self,
        index: int,
        speed_ratio: float,
        sinkage: float,
        normal_load: float,
        cohesion: float,
        tan_friction: float,
        shear_modulus: float,
        centroid_shift: float = 0.0,
        *,
        leaving_angle: float = math.nan,
        rim_speed: float = math.nan,
        pass_number: float = 1.0,
        slope: float = 0.0,
        direction: float = 1.0,
    ) -> Forces:
        """Torque and pull of wheel `index`, positive forward; travel along `direction`.

        Parameters
        ----------
        speed_ratio : float
            u = v/(r w) >= 0: 1 pure rolling, 0 spinning on the spot, above 1 skidding [-].
        sinkage : float
            As measured, digging and support of the lugs included [m].
        normal_load : float
            [N].
        cohesion, tan_friction, shear_modulus : float
            c [Pa], tan(phi) [-], K [m].
        centroid_shift : float
            Rotation of the stress centroid, positive towards the front [rad].
        leaving_angle, rim_speed, pass_number, slope, direction
            As in ``OperatingPoints``; nan = not known; direction is +1 or -1.
        """
        contact, slip_radius = self._wheels[index]
        contact.rim_speed, contact.pass_number = rim_speed, pass_number
        contact.slope, contact.direction = slope, direction
        given = (
            max(speed_ratio, 0.0),
            max(normal_load, 1e-3),
            max(cohesion, 0.0),
            max(tan_friction, 0.0),
            max(shear_modulus, 1e-6),
        )
        leaving = None if math.isnan(leaving_angle) else leaving_angle
        rates, angle_rate, clamped = self._set(contact, given, slip_radius, sinkage, leaving)
        sink_rate = 0.0 if clamped else 1.0 / (contact.radius * math.sin(contact.entrance_angle))
        by_ratio, by_load, by_cohesion, by_friction, by_modulus, by_angle, by_exponent = rates
        (torque, pull), rows = balanced_forces(
            contact,
            centroid_shift,
            (
                (*by_angle, by_ratio, by_exponent),
                (sink_rate, sink_rate * angle_rate[0], sink_rate * angle_rate[1], 0.0, 0.0),
            ),
        )
        if not self._plain:
            scales = (1.0, 1.0, by_load, by_cohesion, by_friction, by_modulus, 1.0)
            rows = [(a * scale, b * scale) for (a, b), scale in zip(rows, scales, strict=True)]
        d_torque, d_pull = zip(*rows, strict=True)
        if direction < 0.0:
            torque, pull = -torque, -pull
            d_torque, d_pull = tuple(-d for d in d_torque), tuple(-d for d in d_pull)
        if self._on_forces:
            return self._with_force_terms(
                contact,
                Forces(torque, pull, d_torque, d_pull, clamped),
                given,
                slip_radius,
                sinkage,
                leaving,
            )
        return Forces(torque, pull, d_torque, d_pull, clamped)

    def _set(
        self,
        contact: Contact,
        given: tuple[float, ...],
        slip_radius: float,
        sinkage: float,
        leaving: float | None,
    ) -> tuple[tuple, tuple[float, float], bool]:
        """Set the contact, and take the derivatives through the effects' terms.

        One small step in all inputs at once: load, c, tan(phi) and K each depend on themselves
        alone, the angles and the exponent on speed ratio and sinkage.
        """
        if self._plain and leaving is None:
            t1, clamped = self._inputs(contact, given, slip_radius, sinkage)
            set_angles(contact, t1, None, self._terms, ScalarMaths)
            rates = (slip_radius, 1.0, 1.0, 1.0, 1.0, (0.0, 0.0, 0.0), 0.0)
            return rates, (self._peak_ratio, self._leaving_ratio), clamped
        moved = tuple(
            [value + _STEP * max(value, floor) for value, floor in zip(given, _FLOORS, strict=True)]
        )
        t1, _ = self._inputs(contact, moved, slip_radius, sinkage)
        set_angles(contact, t1, leaving, self._terms, ScalarMaths)
        after = _chain(contact)
        t1, clamped = self._inputs(contact, given, slip_radius, sinkage)
        set_angles(contact, t1 + _STEP, leaving, self._terms, ScalarMaths)
        peak, left = contact.peak_angle, contact.leaving_angle
        set_angles(contact, t1, leaving, self._terms, ScalarMaths)
        before = _chain(contact)
        angle_rate = ((peak - contact.peak_angle) / _STEP, (left - contact.leaving_angle) / _STEP)
        steps = [m - g for m, g in zip(moved, given, strict=True)]
        steps += [steps[0]] * 4
        rate = [(a - b) / s for a, b, s in zip(after, before, steps, strict=True)]
        return (*rate[:5], tuple(rate[5:8]), rate[8]), angle_rate, clamped

    def _inputs(
        self, contact: Contact, given: tuple[float, ...], slip_radius: float, sinkage: float
    ) -> tuple[float, bool]:
        """Set the contact to the inputs, effects done; return entrance angle and clamp flag."""
        ratio = given[0]
        contact.slip = 1.0 - ratio if ratio <= 1.0 else 1.0 / ratio - 1.0
        contact.velocity_ratio = ratio * slip_radius
        contact.normal_load = contact.stated_load = given[1]
        contact.cohesion, contact.tan_friction, contact.shear_modulus = given[2:]
        contact.shear_radius, contact.sinkage_exponent = contact.radius, self._exponent
        contact.peak_ratio, contact.leaving_ratio = self._peak_ratio, self._leaving_ratio
        for term, parameters in self._on_inputs:
            term(contact, parameters, ScalarMaths)
        contact.sinkage = 0.0
        for term, parameters in self._on_sinkage:
            term(contact, parameters, ScalarMaths)
        cosine = 1.0 - (sinkage - contact.sinkage) / contact.radius
        if cosine > _LARGEST_COSINE:
            return SMALLEST_ANGLE, True
        if cosine < 0.0:
            return 0.5 * math.pi, True
        return math.acos(cosine), False

    def _with_force_terms(
        self,
        contact: Contact,
        forces: Forces,
        given: tuple[float, ...],
        slip_radius: float,
        sinkage: float,
        leaving: float | None,
    ) -> Forces:
        """Add the terms that act on torque and pull, and their derivatives (finite steps)."""

        def added(inputs: tuple[float, ...], depth: float) -> tuple[float, float]:
            t1, _ = self._inputs(contact, inputs, slip_radius, depth)
            set_angles(contact, t1, leaving, self._terms, ScalarMaths)
            contact.torque = contact.drawbar_pull = 0.0
            for term, parameters in self._on_forces:
                term(contact, parameters, ScalarMaths)
            return contact.torque, contact.drawbar_pull

        base = added(given, sinkage)
        rows = (list(forces.d_torque), list(forces.d_pull))
        # Columns of INPUTS; the last is the sinkage, the others the entries of ``given``.
        for position, column in enumerate((0, 2, 3, 4, 5, 1)):
            inputs, depth = list(given), sinkage
            if column == 1:
                step = _STEP * contact.radius
                depth += step
            else:
                step = _STEP * max(given[position], _FLOORS[position])
                inputs[position] += step
            moved = added(tuple(inputs), depth)
            for k in (0, 1):
                rows[k][column] += (moved[k] - base[k]) / step
        return Forces(
            forces.torque + base[0],
            forces.drawbar_pull + base[1],
            tuple(rows[0]),
            tuple(rows[1]),
            forces.clamped,
        )


def _chain(contact: Contact) -> tuple[float, ...]:
    """Return what the inputs became: v/w, load, c, tan(phi), K, the three angles, exponent."""
    return (
        contact.velocity_ratio,
        contact.normal_load,
        contact.cohesion,
        contact.tan_friction,
        contact.shear_modulus,
        contact.entrance_angle,
        contact.peak_angle,
        contact.leaving_angle,
        contact.sinkage_exponent,
    )
