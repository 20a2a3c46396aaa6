# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Torque and pull of a wheel whose sinkage is known: what the on-board filter evaluates.

With the sinkage given, the load balance fixes the peak stresses, and no bearing parameter is
needed; this holds also while the sinkage still settles. Plain floats: for six wheels several
times faster than numpy.
"""

from __future__ import annotations

import math
from copy import copy
from dataclasses import astuple
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from wheel_terra_estimator.terramechanics.balanced_branches import Direction, balanced_forces
from wheel_terra_estimator.terramechanics.checks import check_range
from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects import EffectSettings, catalogue, check_settings
from wheel_terra_estimator.terramechanics.kinematics import slip_of_speed_ratio
from wheel_terra_estimator.terramechanics.maths import ScalarMaths
from wheel_terra_estimator.terramechanics.operating_points import STANDARD_GRAVITY
from wheel_terra_estimator.terramechanics.soil import Soil
from wheel_terra_estimator.terramechanics.terms import (
    PEAK_MARGIN,
    SOIL_NUMBERS,
    Terms,
    set_angles,
)
from wheel_terra_estimator.terramechanics.wheel import Wheel

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
# Least speed ratio, load [N], c [Pa], tan(phi), K [m].
_LEAST = (0.0, 1e-3, 0.0, 0.0, 1e-6)
# Smallest size of speed ratio, load, c, tan(phi), K for the finite steps through the effects.
_FLOORS = (1.0, 1.0, 100.0, 0.1, 0.01)
_BEHIND, _AHEAD = -0.5 * math.pi, 0.25 * math.pi  # of a measured leaving angle [rad]
_NOWHERE = (0.0,) * 5  # rates that are not asked for
_LARGEST_COSINE = math.cos(SMALLEST_ANGLE)
_as_built = attrgetter(
    'width',
    'lug_height',
    'lug_count',
    'lug_thickness',
    'gravity',
    'density',
    'reference_depth',
)


class Forces(NamedTuple):
    """Answer of ``ConditionedForces``.

    Attributes
    ----------
    torque, drawbar_pull : float
        [N m], [N].
    d_torque, d_pull : tuple of float
        Derivatives by ``INPUTS``.
    clamped : bool
        True where an input was outside the model (sinkage below zero or above the radius, a
        negative load, speed ratio or strength, or nan) and was clamped.
    """

    torque: float
    drawbar_pull: float
    d_torque: tuple[float, ...]
    d_pull: tuple[float, ...]
    clamped: bool


class ConditionedForces:
    """Torque and pull given slip, sinkage and load, with analytic derivatives.

    Parameters
    ----------
    wheel : Wheel
        Floats, or (n,) arrays for n wheels.
    soil : Soil
        Floats; cohesion, friction and K are given anew with each call.
    effects : mapping
        Switched-on effects.
    slip_radius : str
        ``lug_tip`` or ``rim``: radius of the rim speed in speed ratios.
    gravity : float
        [m/s^2].
    """

    def __init__(
        self,
        wheel: Wheel,
        soil: Soil,
        effects: EffectSettings | None = None,
        slip_radius: str = 'lug_tip',
        gravity: float = STANDARD_GRAVITY,
    ) -> None:
        for name in SOIL_NUMBERS:
            if np.ndim(getattr(soil, name)):
                raise ValueError(
                    f'soil {name} has shape {np.shape(getattr(soil, name))}; allowed is one number'
                )
        check_range('gravity', gravity, 0.0, unit='m/s^2', open_lower=True)
        settings, known = check_settings(effects or {}), catalogue()
        self._terms = Terms(settings)
        self._wheels = _contacts(wheel, soil, slip_radius, gravity)
        self._on_inputs = self._terms.stages['on_inputs']
        outputs = {n: values for n, values in settings.items() if known[n].on_outputs}
        self._on_sinkage = Terms(
            {n: v for n, v in outputs.items() if 'sinkage' in known[n].touches}
        ).stages['on_outputs']
        self._on_forces = Terms(
            {n: v for n, v in outputs.items() if known[n].touches - {'sinkage'}}
        ).stages['on_outputs']
        self._proportional = not self._terms.stages['on_contact']
        self._plain = self._proportional and not (self._on_inputs or self._on_sinkage)
        self._depth_of_reading = self._inverse_gain()
        self._as_built = [_as_built(contact) for contact, _ in self._wheels]
        self._motion = (0.0, 0.0, 0.0, 0.0)  # rim speed, pass, slope and direction of the call
        self._modulus = [contact.bearing_modulus for contact, _ in self._wheels]
        self._exponent = float(soil.sinkage_exponent)
        self._peak_ratio = float(soil.peak_stress_ratio)
        self._leaving_ratio = float(soil.leaving_angle_ratio)
        self._load_moves_soil = self._moves_with_load()

    def _moves_with_load(self) -> bool:
        """Whether an effect makes exponent, K or radius depend on the load."""
        found = []
        for load in (100.0, 200.0):
            self._inputs(0, (1.0, load, 0.0, 0.5, 0.01), 0.0)
            contact = self._wheels[0][0]
            found.append((contact.sinkage_exponent, contact.shear_modulus, contact.radius))
        return found[0] != found[1]

    def _inverse_gain(self) -> float:
        """Depth per sinkage as read: the terms on it are an offset and a gain, at any slip."""
        contact = copy(self._wheels[0][0])
        readings = []
        for depth in (0.0, 1.0):
            contact.sinkage = depth
            for term, parameters in self._on_sinkage:
                term(contact, parameters, ScalarMaths)
            readings.append(contact.sinkage)
        gain = readings[1] - readings[0]
        return 1.0 if abs(gain - 1.0) < _STEP else 1.0 / gain

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
        derivatives: bool = True,
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
        derivatives : bool
            False leaves them out, at half the cost: the answer's are empty.
        """
        contact, slip_radius = self._wheels[index]
        self._motion = motion = rim_speed, pass_number, slope, direction
        contact.rim_speed, contact.pass_number, contact.slope, contact.direction = motion
        given: tuple[float, ...] = (
            speed_ratio, normal_load, cohesion, tan_friction, shear_modulus
        )  # fmt: skip
        clamped = not (
            speed_ratio >= 0.0
            and normal_load >= 1e-3
            and cohesion >= 0.0
            and tan_friction >= 0.0
            and shear_modulus >= 1e-6
            and math.isfinite(sum(given) + sinkage + centroid_shift)
        )
        if clamped:
            given = tuple(
                [
                    max(v, low) if math.isfinite(v) else low
                    for v, low in zip(given, _LEAST, strict=True)
                ]
            )
            sinkage = sinkage if math.isfinite(sinkage) else 0.0
            centroid_shift = centroid_shift if math.isfinite(centroid_shift) else 0.0
        leaving: float | None = leaving_angle
        if math.isnan(leaving_angle):
            leaving = None
        elif not _BEHIND <= leaving_angle <= _AHEAD:
            leaving, clamped = min(max(leaving_angle, _BEHIND), _AHEAD), True
        if not derivatives:
            torque, pull, outside = self._alone(index, given, sinkage, leaving, centroid_shift)
            return Forces(torque, pull, (), (), clamped or outside)
        if self._plain and leaving is None:
            angle, outside = self._inputs(index, given, sinkage)
            by_angle = _set_shares(contact, angle)
            by_speed, scales = (0.0, 0.0, 0.0, slip_radius, 0.0), None
        else:
            by_speed, by_angle, scales, outside = self._chain(index, given, sinkage, leaving)
        rate = 0.0
        if not outside:
            rate = self._depth_of_reading / (contact.radius * math.sin(contact.entrance_angle))
        torque, pull, d_torque, d_pull = balanced_forces(
            contact,
            centroid_shift,
            by_speed,
            (rate, rate * by_angle[0], rate * by_angle[1], 0.0, 0.0),
        )
        if scales is not None:
            d_torque, d_pull = _scaled(d_torque, scales), _scaled(d_pull, scales)
        if self._load_moves_soil:
            by_load = self._by_load(index, given, sinkage, leaving, centroid_shift, (torque, pull))
            d_torque = (*d_torque[:2], by_load[0], *d_torque[3:])
            d_pull = (*d_pull[:2], by_load[1], *d_pull[3:])
        if direction < 0.0:
            torque, pull = -torque, -pull
            d_torque, d_pull = tuple([-d for d in d_torque]), tuple([-d for d in d_pull])
        answer = Forces(torque, pull, d_torque, d_pull, clamped or outside)
        if self._on_forces:
            return self._with_force_terms(index, answer, given, sinkage, leaving)
        return answer

    def _alone(
        self,
        index: int,
        given: tuple[float, ...],
        sinkage: float,
        leaving: float | None,
        shift: float,
    ) -> tuple[float, float, bool]:
        """Return torque and pull; whether the sinkage is outside the model."""
        contact = self._wheels[index][0]
        angle, outside = self._inputs(index, given, sinkage)
        self._place(contact, angle, leaving)
        torque, pull, _, _ = balanced_forces(contact, shift, _NOWHERE, _NOWHERE)
        if contact.direction < 0.0:
            torque, pull = -torque, -pull
        if self._on_forces:
            torque, pull = self._read(index, given, sinkage, leaving, torque, pull)
        return torque, pull, outside

    def _chain(
        self, index: int, given: tuple[float, ...], sinkage: float, leaving: float | None
    ) -> tuple[Direction, tuple[float, float], tuple[float, ...], bool]:
        """Set the contact, and take the derivatives through the effects' terms.

        One small step in all inputs at once: load, c, tan(phi) and K each depend on themselves
        alone, the angles and the exponent on speed ratio and sinkage.

        Returns
        -------
        tuple
            Rates by the speed ratio; rates of peak and leaving angle by the entrance angle; rates
            of load, c, tan(phi) and K by themselves; whether the sinkage is outside the model.
        """
        contact = self._wheels[index][0]
        u, load, cohesion, friction, modulus = given
        of_u, of_load, of_cohesion, of_friction, of_modulus = _FLOORS
        du = _STEP * (u if u > of_u else of_u)
        d_load = _STEP * (load if load > of_load else of_load)
        d_cohesion = _STEP * (cohesion if cohesion > of_cohesion else of_cohesion)
        d_friction = _STEP * (friction if friction > of_friction else of_friction)
        d_modulus = _STEP * (modulus if modulus > of_modulus else of_modulus)
        further = load if self._load_moves_soil else load + d_load  # else `_by_load` has it
        moved = (
            u + du, further, cohesion + d_cohesion, friction + d_friction, modulus + d_modulus
        )  # fmt: skip
        angle, _ = self._inputs(index, moved, sinkage)
        set_angles(contact, angle, leaving, self._terms, ScalarMaths)
        ratio_after, load_after = contact.velocity_ratio, contact.normal_load
        cohesion_after, friction_after = contact.cohesion, contact.tan_friction
        modulus_after, exponent_after = contact.shear_modulus, contact.sinkage_exponent
        peak_after, leaving_after = contact.peak_angle, contact.leaving_angle
        angle_after = angle
        angle, outside = self._inputs(index, given, sinkage)
        by_angle = self._set_angles(contact, angle, leaving)
        by_speed = (
            (angle_after - angle) / du,
            (peak_after - contact.peak_angle) / du,
            (leaving_after - contact.leaving_angle) / du,
            (ratio_after - contact.velocity_ratio) / du,
            (exponent_after - contact.sinkage_exponent) / du,
        )
        scales = (
            (load_after - contact.normal_load) / d_load,
            (cohesion_after - contact.cohesion) / d_cohesion,
            (friction_after - contact.tan_friction) / d_friction,
            (modulus_after - contact.shear_modulus) / d_modulus,
        )
        return by_speed, by_angle, scales, outside

    def _by_load(
        self,
        index: int,
        given: tuple[float, ...],
        sinkage: float,
        leaving: float | None,
        shift: float,
        base: tuple[float, float],
    ) -> tuple[float, float]:
        """Rates of torque and pull by the load where effects make the soil depend on it."""
        contact = self._wheels[index][0]
        step = _STEP * max(given[1], _FLOORS[1])
        angle, _ = self._inputs(index, (given[0], given[1] + step, *given[2:]), sinkage)
        self._place(contact, angle, leaving)
        torque, pull, _, _ = balanced_forces(contact, shift, _NOWHERE, _NOWHERE)
        return (torque - base[0]) / step, (pull - base[1]) / step

    def _place(self, contact: Contact[float], angle: float, leaving: float | None) -> None:
        """Set the angles, as `_set_angles` without the rates."""
        if self._proportional and leaving is None:
            _set_shares(contact, angle)
        else:
            set_angles(contact, angle, leaving, self._terms, ScalarMaths)

    def _set_angles(
        self, contact: Contact[float], angle: float, leaving: float | None
    ) -> tuple[float, float]:
        """Set the angles; return the rates of peak and leaving angle by the entrance angle."""
        if self._proportional and leaving is None:
            return _set_shares(contact, angle)
        set_angles(contact, angle + _STEP, leaving, self._terms, ScalarMaths)
        peak, left = contact.peak_angle, contact.leaving_angle
        set_angles(contact, angle, leaving, self._terms, ScalarMaths)
        return (peak - contact.peak_angle) / _STEP, (left - contact.leaving_angle) / _STEP

    def _inputs(self, index: int, given: tuple[float, ...], sinkage: float) -> tuple[float, bool]:
        """Set the contact to the inputs, effects done; return entrance angle and clamp flag."""
        contact, slip_radius = self._wheels[index]
        ratio = given[0]
        contact.slip = slip_of_speed_ratio(ratio, ScalarMaths)
        contact.velocity_ratio = ratio * slip_radius
        contact.normal_load = contact.stated_load = given[1]
        contact.cohesion, contact.tan_friction, contact.shear_modulus = given[2:]
        contact.radius = contact.shear_radius = contact.rim_radius
        contact.sinkage_exponent, contact.bearing_modulus = self._exponent, self._modulus[index]
        contact.peak_ratio, contact.leaving_ratio = self._peak_ratio, self._leaving_ratio
        if self._on_inputs:  # a term may have changed these in the call before
            (
                contact.width,
                contact.lug_height,
                contact.lug_count,
                contact.lug_thickness,
                contact.gravity,
                contact.density,
                contact.reference_depth,
            ) = self._as_built[index]
            contact.rim_speed, contact.pass_number, contact.slope, contact.direction = self._motion
        for term, parameters in self._on_inputs:
            term(contact, parameters, ScalarMaths)
        cosine = 1.0 - self._depth(contact, sinkage) / contact.radius
        if not cosine <= _LARGEST_COSINE:  # nan as well
            return SMALLEST_ANGLE, True
        if cosine < 0.0:
            return 0.5 * math.pi, True
        return math.acos(cosine), False

    def _depth(self, contact: Contact[float], sinkage: float) -> float:
        """Depth of the stressed contact for a sinkage as read: the terms on it undone."""
        contact.sinkage = 0.0
        for term, parameters in self._on_sinkage:
            term(contact, parameters, ScalarMaths)
        return (sinkage - contact.sinkage) * self._depth_of_reading

    def _with_force_terms(
        self,
        index: int,
        forces: Forces,
        given: tuple[float, ...],
        sinkage: float,
        leaving: float | None,
    ) -> Forces:
        """Apply the terms that act on torque and pull, and to their derivatives (finite steps)."""
        rim_radius = self._wheels[index][0].rim_radius
        soil = forces.torque, forces.drawbar_pull
        base = self._read(index, given, sinkage, leaving, *soil)
        rows = (list(forces.d_torque), list(forces.d_pull))
        # Columns of INPUTS; the last is the sinkage, the others the entries of ``given``.
        for position, column in enumerate((0, 2, 3, 4, 5, 1, 6)):
            inputs, depth, step = list(given), sinkage, _STEP
            if column == 1:
                step = _STEP * rim_radius
                depth += step
            elif column < 6:
                step = _STEP * max(given[position], _FLOORS[position])
                inputs[position] += step
            moved = self._read(
                index,
                tuple(inputs),
                depth,
                leaving,
                soil[0] + step * forces.d_torque[column],
                soil[1] + step * forces.d_pull[column],
            )
            for k in (0, 1):
                rows[k][column] = (moved[k] - base[k]) / step
        return Forces(*base, tuple(rows[0]), tuple(rows[1]), forces.clamped)

    def _read(
        self,
        index: int,
        given: tuple[float, ...],
        sinkage: float,
        leaving: float | None,
        torque: float,
        pull: float,
    ) -> tuple[float, float]:
        """Return torque and pull as the terms on them make them read."""
        contact = self._wheels[index][0]
        angle, _ = self._inputs(index, given, sinkage)
        set_angles(contact, angle, leaving, self._terms, ScalarMaths)
        contact.torque, contact.drawbar_pull = torque, pull
        for term, parameters in self._on_forces:
            term(contact, parameters, ScalarMaths)
        return contact.torque, contact.drawbar_pull


def _contacts(
    wheel: Wheel, soil: Soil, slip_radius: str, gravity: float
) -> list[tuple[Contact[float], float]]:
    """Return, per wheel, a contact with its geometry filled in and its slip radius [m]."""
    if slip_radius not in ('lug_tip', 'rim'):
        raise ValueError(f"slip radius is {slip_radius!r}; allowed is 'lug_tip' or 'rim'")
    columns = np.broadcast_arrays(*(np.atleast_1d(np.asarray(v, float)) for v in astuple(wheel)))
    contacts = []
    blank: dict[str, float] = dict.fromkeys(Contact.__dataclass_fields__, 0.0)
    for radius, width, height, count, thickness in zip(*(c.tolist() for c in columns), strict=True):
        contact = Contact(**blank)
        contact.radius = contact.rim_radius = radius
        contact.width = width
        contact.lug_height, contact.lug_count, contact.lug_thickness = height, count, thickness
        contact.gravity, contact.density = gravity, float(soil.density)
        contact.bearing_modulus, contact.reference_depth = soil.bearing(width, gravity)
        contacts.append((contact, radius + height if slip_radius == 'lug_tip' else radius))
    return contacts


def _set_shares(contact: Contact[float], angle: float) -> tuple[float, float]:
    """Set peak and leaving angle in proportion to the entrance angle; return the two shares."""
    leaving = contact.leaving_ratio
    margin = PEAK_MARGIN * (1.0 - leaving)
    peak = contact.peak_ratio
    if peak < leaving + margin:
        peak = leaving + margin
    elif peak > 1.0 - margin:
        peak = 1.0 - margin
    contact.entrance_angle = angle
    contact.peak_angle, contact.leaving_angle = peak * angle, leaving * angle
    return peak, leaving


def _scaled(rates: tuple[float, ...], scales: tuple[float, ...]) -> tuple[float, ...]:
    """Rates by ``INPUTS``, those by load, c, tan(phi) and K times their scales."""
    by_load, by_cohesion, by_friction, by_modulus = scales
    return (
        rates[0],
        rates[1],
        rates[2] * by_load,
        rates[3] * by_cohesion,
        rates[4] * by_friction,
        rates[5] * by_modulus,
        rates[6],
    )
