# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Steady sinkage of a wheel under load, closed form, as plain floats with derivatives."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TypeAlias

from wheel_terra_estimator.terramechanics import closed_form, stresses
from wheel_terra_estimator.terramechanics.branch_moments import BranchForces
from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.kinematics import slip_of_speed_ratio
from wheel_terra_estimator.terramechanics.maths import ScalarMaths
from wheel_terra_estimator.terramechanics.scalar_wheels import ScalarWheels
from wheel_terra_estimator.terramechanics.terms import set_angles

# Columns of the derivatives that ``SteadySinkage`` returns.
INPUTS = (
    'speed_ratio',
    'normal_load',
    'log_stiffness',
    'exponent_slope',
    'tan_friction',
    'cohesion',
    'shear_modulus',
)
_FACTOR = 20.0  # of a logarithm; beyond, the stiffness is no soil's
_LARGEST = 1.5
_SMALLEST = 2e-3
# Most steps of the load balance (two do), and where it ends: the product of two errors in a row,
# which is some ten times the next one.
_STEPS = 30
_ENOUGH = 1e-6

Load: TypeAlias = Callable[[float], float]
ThreeForces: TypeAlias = Callable[[float], tuple[float, float, float]]
_STEP = 1e-6
_SIZES = (1.0, 1.0, 1.0, 1.0, 0.1, 100.0, 0.01)


class SteadySinkage(ScalarWheels):
    """Sinkage at which a wheel comes to rest vertically, given slip, load and soil."""

    def _prepare(self) -> None:
        soil = self._soil
        self._given = (math.tan(soil.friction_angle), float(soil.cohesion), soil.shear_modulus)
        # Without effects, slip moves one number of the closed form only.
        self._prepared: list[BranchForces] = []
        if not self._settings:
            for index in range(len(self)):
                contact = self._inputs(index, (1.0, 1.0, 0.0, 0.0, *self._given))
                self._prepared.append(closed_form.proportional_forces(contact, ScalarMaths))

    def sinkage(
        self,
        index: int,
        speed_ratio: float,
        normal_load: float,
        log_stiffness: float = 0.0,
        exponent_slope: float = 0.0,
        tan_friction: float | None = None,
        cohesion: float | None = None,
        shear_modulus: float | None = None,
        *,
        rim_speed: float = math.nan,
        pass_number: float = 1.0,
    ) -> tuple[float, tuple[float, ...], bool]:
        """Steady sinkage of wheel `index`, as a sensor would read it.

        Parameters
        ----------
        speed_ratio : float
            u = v/(r w) >= 0 [-].
        normal_load : float
            [N].
        log_stiffness : float
            Both moduli are multiplied by its exponential [-].
        exponent_slope : float
            Added to the sinkage exponent times |slip|, beyond what the effects do [-].
        tan_friction, cohesion, shear_modulus : float, optional
            tan(phi) [-], c [Pa], K [m]; of the soil where not given.

        Returns
        -------
        sinkage : float
            [m].
        derivatives : tuple of float
            By ``INPUTS``.
        carried : bool
            False where the soil cannot carry the load; the sinkage is then held below the radius
            and the derivatives are 0.
        """
        friction, strength, modulus = self._given
        given = (
            max(speed_ratio, 0.0),
            max(normal_load, 1e-3),
            min(max(log_stiffness, -_FACTOR), _FACTOR),
            exponent_slope,
            max(friction if tan_friction is None else tan_friction, 0.0),
            max(strength if cohesion is None else cohesion, 0.0),
            max(modulus if shear_modulus is None else shear_modulus, 1e-6),
        )
        contact = self._wheels[index][0]
        contact.rim_speed, contact.pass_number = rim_speed, pass_number
        form = closed_form.proportional_forces(self._inputs(index, given), ScalarMaths)
        functions = load, _ = self._functions(contact, form)
        angle, _, _, carried = _balanced(form, functions, contact.normal_load)
        depth = self._depth(contact, angle)
        if not carried:
            return depth, (0.0,) * len(INPUTS), False
        balance = load(angle) - contact.normal_load
        step = _STEP * angle
        slope = (load(angle + step) - contact.normal_load - balance) / step
        deepening = (self._depth(contact, angle + step) - depth) / step
        derivatives = []
        for position, value in enumerate(given):
            moved = list(given)
            change = _STEP * max(abs(value), _SIZES[position])
            moved[position] += change
            form = closed_form.proportional_forces(self._inputs(index, tuple(moved)), ScalarMaths)
            load, _ = self._functions(contact, form)
            rise = (load(angle) - contact.normal_load - balance) / change
            shifted = (self._depth(contact, angle) - depth) / change
            derivatives.append(-rise / slope * deepening + shifted)
        return depth, tuple(derivatives), True

    def state(
        self,
        index: int,
        speed_ratio: float,
        normal_load: float,
        *,
        rim_speed: float = math.nan,
        pass_number: float = 1.0,
    ) -> tuple[float, float, float]:
        """Steady sinkage [m], drawbar pull [N] and torque [N m] in the configured soil.

        Raises
        ------
        ValueError
            For a negative speed ratio, a load that is not positive, and a load that the soil
            cannot carry.
        """
        contact, slip_radius = self._wheels[index]
        if not 0.0 <= speed_ratio < math.inf:
            raise ValueError(f'speed ratio is {speed_ratio:g}; allowed is [0, inf)')
        if not 0.0 < normal_load < math.inf:
            raise ValueError(f'normal load is {normal_load:g} N; allowed is (0, inf) N')
        if self._prepared:
            form = self._prepared[index]
            form.set_speed(speed_ratio * slip_radius)
            angle, pull, torque, carried = _balanced(form, (form.load, form.forces), normal_load)
            if not carried:
                raise _overload(normal_load, angle, form.load)
            return contact.radius * (1.0 - math.cos(angle)), pull, torque
        contact.rim_speed, contact.pass_number = rim_speed, pass_number
        self._inputs(index, (speed_ratio, normal_load, 0.0, 0.0, *self._given))
        form = closed_form.proportional_forces(contact, ScalarMaths)
        functions = self._functions(contact, form)
        angle, contact.drawbar_pull, contact.torque, carried = _balanced(
            form, functions, contact.normal_load
        )
        if not carried:
            raise _overload(contact.normal_load, angle, functions[0])
        contact.entrance_angle = angle
        contact.sinkage = contact.radius * (1.0 - math.cos(angle))
        self._terms.apply('on_outputs', contact, ScalarMaths)
        return contact.sinkage, contact.drawbar_pull, contact.torque

    def _functions(self, contact: Contact, form: BranchForces) -> tuple[Load, ThreeForces]:
        """Load, and all three forces, as functions of the entrance angle."""
        if closed_form.angles_in_proportion(self._terms):
            return form.load, form.forces

        def forces(angle: float) -> tuple[float, float, float]:
            set_angles(contact, angle, None, self._terms, ScalarMaths)
            return closed_form.forces(contact, self._terms, ScalarMaths)

        return lambda angle: forces(angle)[0], forces

    def _inputs(self, index: int, given: tuple[float, ...]) -> Contact:
        """Set the contact of a wheel to the inputs, stage ``on_inputs`` done, and return it."""
        contact, slip_radius = self._wheels[index]
        soil = self._soil
        ratio, load, log_stiffness, slope, friction, cohesion, shear_modulus = given
        contact.slip = slip_of_speed_ratio(ratio, ScalarMaths)
        contact.slope, contact.direction = 0.0, 1.0
        contact.velocity_ratio = ratio * slip_radius
        contact.normal_load = contact.stated_load = load
        contact.cohesion, contact.tan_friction, contact.shear_modulus = (
            cohesion,
            friction,
            shear_modulus,
        )
        contact.radius = contact.shear_radius = contact.rim_radius
        contact.sinkage_exponent = soil.sinkage_exponent + slope * abs(contact.slip)
        contact.peak_ratio, contact.leaving_ratio = (
            soil.peak_stress_ratio,
            soil.leaving_angle_ratio,
        )
        modulus, _ = stresses.bearing_law(
            soil.pressure_law,
            soil.cohesive_modulus,
            soil.frictional_modulus,
            contact.width,
            cohesion,
            soil.density * contact.gravity,
        )
        contact.bearing_modulus = modulus * math.exp(log_stiffness)
        self._terms.apply('on_inputs', contact, ScalarMaths)
        return contact

    def _depth(self, contact: Contact, angle: float) -> float:
        """Sinkage as a sensor reads it at an entrance angle."""
        contact.entrance_angle = angle
        contact.sinkage = contact.radius * (1.0 - math.cos(angle))
        contact.torque = contact.drawbar_pull = 0.0
        self._terms.apply('on_outputs', contact, ScalarMaths)
        return contact.sinkage


def _balanced(
    form: BranchForces, functions: tuple[Load, ThreeForces], load: float
) -> tuple[float, float, float, bool]:
    """Entrance angle that carries a load, pull and torque there, and whether there is one.

    (force/load)^(1/(2 N + 1)) is nearly proportional to the angle: secants on it, from the
    small-angle start, and one more for all three results without another evaluation.
    """
    carried, forces = functions
    power = 1.0 / (2.0 * form.exponent + 1.0)
    last = form.small_angle(load)
    if not last < 1.2:
        last = 1.2
    force = carried(last)
    last_size = (force / load) ** power if force > 0.0 else 0.7
    angle = last / last_size
    if not _SMALLEST < angle < _LARGEST:
        angle = _SMALLEST if angle <= _SMALLEST else _LARGEST
    force, pull, torque = forces(angle)
    size = (force / load) ** power if force > 0.0 else 0.7
    for _ in range(_STEPS):
        change = size - last_size
        slope = (angle - last) / change if change else angle / size
        if not 0.2 < slope * size / angle < 5.0:
            slope = angle / size
        moved = angle + (1.0 - size) * slope
        if not _SMALLEST < moved < _LARGEST:
            moved = _SMALLEST if moved <= _SMALLEST else _LARGEST
            if moved == angle:
                return angle, pull, torque, moved == _SMALLEST
        last, last_size, last_pull, last_torque = angle, size, pull, torque
        angle = moved
        force, pull, torque = forces(angle)
        size = (force / load) ** power if force > 0.0 else 0.7
        missing = 1.0 - size
        if -_ENOUGH < missing * (1.0 - last_size) < _ENOUGH:
            share = missing / (size - last_size) if size != last_size else 0.0
            return (
                angle + share * (angle - last),
                pull + share * (pull - last_pull),
                torque + share * (torque - last_torque),
                True,
            )
    return angle, pull, torque, False


def _overload(load: float, angle: float, carried: Load) -> ValueError:
    """Return the complaint of a soil that cannot carry the load."""
    return ValueError(
        f'normal load is {load:g} N; this soil carries about {carried(angle):.3g} N at an entrance '
        f'angle of {angle:.2g} rad'
    )
