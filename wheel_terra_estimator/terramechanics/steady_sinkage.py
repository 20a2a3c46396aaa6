# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Steady sinkage of a wheel under load, closed form, as plain floats with derivatives."""

from __future__ import annotations

import math

from wheel_terra_estimator.terramechanics import closed_form, stresses
from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects import EffectSettings, check_settings
from wheel_terra_estimator.terramechanics.maths import ScalarMaths
from wheel_terra_estimator.terramechanics.operating_points import STANDARD_GRAVITY
from wheel_terra_estimator.terramechanics.scalar_wheels import scalar_contacts
from wheel_terra_estimator.terramechanics.soil import Soil
from wheel_terra_estimator.terramechanics.terms import Terms, set_angles
from wheel_terra_estimator.terramechanics.wheel import Wheel

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
# Newton steps on logarithms after the explicit start: one leaves an error of some 0.1 % in depth.
_STEPS = 1
_LARGEST = 1.5
_SMALLEST = 2e-3
_STEP = 1e-6
_SIZES = (1.0, 1.0, 1.0, 1.0, 0.1, 100.0, 0.01)


class SteadySinkage:
    """Sinkage at which a wheel comes to rest vertically, given slip, load and soil.

    Parameters
    ----------
    wheel : Wheel
        Floats, or (n,) arrays for n wheels.
    soil : Soil
        Floats.
    effects : mapping
        Switched-on effects.
    slip_radius : str
        ``lug_tip`` or ``rim``.
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
        self._terms = Terms(check_settings(effects or {}))
        self._soil = soil
        self._wheels = scalar_contacts(wheel, soil, slip_radius, gravity)

    def __len__(self) -> int:
        return len(self._wheels)

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
            Added to the sinkage exponent times slip, beyond what the effects do [-].
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
        soil = self._soil
        given = (
            max(speed_ratio, 0.0),
            max(normal_load, 1e-3),
            log_stiffness,
            exponent_slope,
            max(math.tan(soil.friction_angle) if tan_friction is None else tan_friction, 0.0),
            max(soil.cohesion if cohesion is None else cohesion, 0.0),
            max(soil.shear_modulus if shear_modulus is None else shear_modulus, 1e-6),
        )
        contact, angle = self._balanced(index, given, rim_speed, pass_number)
        balance = self._balance(contact, angle)
        depth, lift = self._depth(contact, angle)
        if angle >= _LARGEST or abs(balance) > 0.05 * contact.normal_load:
            return depth, (0.0,) * len(INPUTS), False
        step = _STEP * angle
        slope = (self._balance(contact, angle + step) - balance) / step
        deepening = contact.radius * math.sin(angle)
        derivatives = []
        for position, value in enumerate(given):
            moved_inputs = list(given)
            change = _STEP * max(abs(value), _SIZES[position])
            moved_inputs[position] += change
            self._inputs(index, tuple(moved_inputs))
            rise = (self._balance(contact, angle) - balance) / change
            lifted = (self._depth(contact, angle)[1] - lift) / change
            derivatives.append(-rise / slope * deepening + lifted)
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
        """Steady sinkage [m], drawbar pull [N] and torque [N m] in the configured soil."""
        soil = self._soil
        given = (
            max(speed_ratio, 0.0),
            max(normal_load, 1e-3),
            0.0,
            0.0,
            math.tan(soil.friction_angle),
            soil.cohesion,
            soil.shear_modulus,
        )
        contact, angle = self._balanced(index, given, rim_speed, pass_number)
        set_angles(contact, angle, None, self._terms, ScalarMaths)
        _, contact.drawbar_pull, contact.torque = closed_form.forces(
            contact, self._terms, ScalarMaths
        )
        contact.sinkage = contact.radius * (1.0 - math.cos(angle))
        self._terms.apply('on_outputs', contact, ScalarMaths)
        return contact.sinkage, contact.drawbar_pull, contact.torque

    def _balanced(
        self, index: int, given: tuple[float, ...], rim_speed: float, pass_number: float
    ) -> tuple[Contact, float]:
        """Set the contact of a wheel and find its entrance angle."""
        contact = self._wheels[index][0]
        contact.rim_speed, contact.pass_number = rim_speed, pass_number
        contact.slope, contact.direction = 0.0, 1.0
        self._inputs(index, given)
        angle = self._explicit_angle(contact)
        for _ in range(_STEPS):
            force, moved = self._carried(contact, angle), self._carried(contact, angle * 1.001)
            if force <= 0.0 or moved <= force:
                angle = min(1.5 * angle, _LARGEST)
                continue
            power = 0.001 / math.log(moved / force)
            ratio = (contact.normal_load / force) ** min(power, 1.0)
            angle = min(max(angle * ratio, _SMALLEST), _LARGEST)
        return contact, angle

    def _inputs(self, index: int, given: tuple[float, ...]) -> None:
        """Set the contact of a wheel to the inputs, stage ``on_inputs`` done."""
        contact, slip_radius = self._wheels[index]
        soil = self._soil
        ratio, load, log_stiffness, slope, friction, cohesion, shear_modulus = given
        contact.slip = 1.0 - ratio if ratio <= 1.0 else 1.0 / ratio - 1.0
        contact.velocity_ratio = ratio * slip_radius
        contact.normal_load = contact.stated_load = load
        contact.cohesion, contact.tan_friction, contact.shear_modulus = (
            cohesion,
            friction,
            shear_modulus,
        )
        contact.shear_radius = contact.radius
        contact.sinkage_exponent = soil.sinkage_exponent + slope * contact.slip
        contact.peak_ratio, contact.leaving_ratio = (
            soil.peak_stress_ratio,
            soil.leaving_angle_ratio,
        )
        if soil.pressure_law == 'reece':
            modulus = stresses.reece_modulus(
                soil.cohesive_modulus,
                soil.frictional_modulus,
                contact.width,
                cohesion,
                soil.density * contact.gravity,
            )
        else:
            modulus = stresses.bekker_modulus(
                soil.cohesive_modulus, soil.frictional_modulus, contact.width
            )
        contact.bearing_modulus = modulus * math.exp(log_stiffness)
        self._terms.apply('on_inputs', contact, ScalarMaths)

    def _explicit_angle(self, contact: Contact) -> float:
        """Entrance angle by small angles, the shear counted with half its share."""
        n, q = contact.sinkage_exponent, contact.peak_ratio
        area = closed_form.branch_moments(n, (1.0 - q) / (1.0 + q))[0]
        span = 1.0 - contact.leaving_ratio
        rise = 0.5 * contact.radius * max(1.0 - q * q, 0.05) / contact.reference_depth
        unit = contact.width * contact.radius * area * span * contact.bearing_modulus * rise**n
        angle = (contact.normal_load / unit) ** (1.0 / (2.0 * n + 1.0))
        lean = (1.0 + q + contact.leaving_ratio) / 3.0 * angle
        share = max(contact.slip, 0.0) ** 0.5
        helped = 1.0 + share * contact.tan_friction * lean
        return min(max(angle * helped ** (-1.0 / (2.0 * n + 1.0)), _SMALLEST), 1.2)

    def _carried(self, contact: Contact, angle: float) -> float:
        set_angles(contact, angle, None, self._terms, ScalarMaths)
        return closed_form.forces(contact, self._terms, ScalarMaths)[0]

    def _balance(self, contact: Contact, angle: float) -> float:
        return self._carried(contact, angle) - contact.normal_load

    def _depth(self, contact: Contact, angle: float) -> tuple[float, float]:
        """Sinkage as read, and the part of it that the effects add."""
        contact.entrance_angle = angle
        contact.sinkage = contact.torque = contact.drawbar_pull = 0.0
        self._terms.apply('on_outputs', contact, ScalarMaths)
        return contact.radius * (1.0 - math.cos(angle)) + contact.sinkage, contact.sinkage
