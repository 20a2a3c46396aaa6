# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Forces of wheels whose sinkage is known: what the on-board filter evaluates.

With the sinkage given, the load balance fixes the stresses that torque and pull follow from, and no
bearing parameter is needed; this holds also while the sinkage still settles. The bearing law says
which load the soil would carry there. All wheels of a rover, and all finite steps that a derivative
takes, are one call.
"""

from __future__ import annotations

import math
from copy import copy
from dataclasses import astuple
from typing import NamedTuple

import numpy as np

from wheel_terra_estimator.arrays import FloatArray, Quantity
from wheel_terra_estimator.terramechanics import closed_form
from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects import EffectSettings, catalogue, with_defaults
from wheel_terra_estimator.terramechanics.kinematics import slip_of_speed_ratio
from wheel_terra_estimator.terramechanics.operating_points import STANDARD_GRAVITY
from wheel_terra_estimator.terramechanics.soil import Soil
from wheel_terra_estimator.terramechanics.terms import Terms, set_angles
from wheel_terra_estimator.terramechanics.wheel import Wheel

SMALLEST_ANGLE = 2e-3  # [rad]; below, the wheel hardly touches and angles lose their meaning
_LARGEST_COSINE = math.cos(SMALLEST_ANGLE)
_LEAST = {
    'speed_ratio': 0.0,
    'sinkage': -math.inf,  # bounds of the angle hold for it
    'normal_load': 1e-3,  # [N]
    'cohesion': 0.0,
    'tan_friction': 0.0,
    'shear_modulus': 1e-6,  # [m]
    'centroid_shift': -math.inf,
}
_BEHIND, _AHEAD = -0.5 * math.pi, 0.25 * math.pi  # of a measured leaving angle [rad]
_NO_GAIN = 1e-6  # a gain of the sinkage reading nearer to 1 is none


class ConditionedInputs(NamedTuple):
    """What is known of n wheels; each entry a number or an array that broadcasts to (..., n).

    Values outside the model (a negative load, strength or speed ratio, a sinkage below zero or
    above the radius, nan) count as the nearest one inside.
    """

    speed_ratio: Quantity
    """u = v/(r w) >= 0: 1 pure rolling, 0 spinning on the spot, above 1 skidding [-]."""
    sinkage: Quantity  # as measured, digging and support of the lugs included [m]
    normal_load: Quantity  # [N]
    cohesion: Quantity  # [Pa]
    tan_friction: Quantity  # [-]
    shear_modulus: Quantity  # K [m]
    centroid_shift: Quantity = 0.0
    """Rotation of the stress centroid, positive towards the front [rad]."""
    leaving_angle: Quantity | None = None
    """Measured [rad], nan = not measured; None = no wheel's is."""
    rim_speed: Quantity = math.nan  # [m/s]; nan = not known
    pass_number: Quantity = 1.0
    slope: Quantity = 0.0  # [rad]
    direction: Quantity = 1.0  # +1 or -1


class Bearing(NamedTuple):
    """Result of the bearing law at a sinkage, (..., n) each."""

    load: FloatArray  # that the soil carries [N]; not positive where the shear lifts the wheel out
    exponent: FloatArray  # N


class ConditionedForces:
    """Torque and pull given slip, sinkage and load; load given slip and sinkage."""

    def __init__(
        self,
        wheel: Wheel,  # floats, or (n,) arrays for n wheels
        soil: Soil,  # floats; cohesion, friction and K are given anew with each call
        effects: EffectSettings | None = None,  # switched-on effects
        # ``lug_tip`` or ``rim``: radius of the rim speed in speed ratios
        slip_radius: str = 'lug_tip',
        gravity: float = STANDARD_GRAVITY,
    ) -> None:
        settings, known = with_defaults(effects or {}), catalogue()
        self._terms = Terms(settings)
        outputs = {n: values for n, values in settings.items() if known[n].on_outputs}
        self._on_sinkage = Terms(
            {n: v for n, v in outputs.items() if 'sinkage' in known[n].touches}
        )
        self._on_forces = Terms(
            {n: v for n, v in outputs.items() if known[n].touches - {'sinkage'}}
        )
        self._as_built = contacts_as_built(wheel, soil, gravity)
        lugs = self._as_built.lug_height if slip_radius == 'lug_tip' else 0.0
        self._slip_radius = self._as_built.radius + lugs
        self._depth_of_reading = self._inverse_gain()

    def _inverse_gain(self) -> float:
        """Depth per sinkage as read: the terms on it are an offset and a gain, at any slip."""
        contact = copy(self._as_built)
        readings = []
        for depth in (0.0, 1.0):
            contact.sinkage = np.full_like(contact.radius, depth)
            self._on_sinkage.apply('on_outputs', contact)
            readings.append(float(np.ravel(contact.sinkage)[0]))
        gain = readings[1] - readings[0]
        return 1.0 if abs(gain - 1.0) < _NO_GAIN else 1.0 / gain

    def forces(self, inputs: ConditionedInputs) -> tuple[FloatArray, FloatArray]:
        """Return torque [N m] and pull [N] of all wheels, positive forward, (..., n) each."""
        inputs = _within_the_model(inputs)
        contact = self._contact(inputs, copy(self._as_built))
        angle = contact.entrance_angle
        form = closed_form.BranchForces(
            contact, contact.peak_angle / angle, contact.leaving_angle / angle
        )
        pull, torque = form.balanced(angle, contact.normal_load, inputs.centroid_shift)
        contact.torque, contact.drawbar_pull = contact.direction * torque, contact.direction * pull
        self._on_forces.apply('on_outputs', contact)
        return np.asarray(contact.torque), np.asarray(contact.drawbar_pull)

    def bearing(
        self,
        inputs: ConditionedInputs,
        modulus_factor: Quantity = 1.0,  # on the bearing modulus [-]
        exponent_change: Quantity = 0.0,  # added to the sinkage exponent [-]
    ) -> Bearing:
        """Return the load that the bearing law carries at the sinkages, whatever the load is.

        The centroid shift has no part in it.
        """
        contact = copy(self._as_built)
        contact.bearing_modulus = contact.bearing_modulus * modulus_factor
        contact.sinkage_exponent = contact.sinkage_exponent + exponent_change
        contact = self._contact(_within_the_model(inputs), contact)
        load, _, _ = closed_form.forces(contact, self._terms)
        return Bearing(np.asarray(load), np.asarray(contact.sinkage_exponent))

    def _contact(self, inputs: ConditionedInputs, contact: Contact) -> Contact:
        """Return contacts as built with the inputs, the terms on these done, and the angles."""
        contact.slip = slip_of_speed_ratio(inputs.speed_ratio)
        contact.velocity_ratio = inputs.speed_ratio * self._slip_radius
        contact.normal_load = contact.stated_load = inputs.normal_load
        contact.cohesion, contact.tan_friction = inputs.cohesion, inputs.tan_friction
        contact.shear_modulus = inputs.shear_modulus
        contact.rim_speed, contact.pass_number = inputs.rim_speed, inputs.pass_number
        contact.slope, contact.direction = inputs.slope, inputs.direction
        self._terms.apply('on_inputs', contact)
        contact.sinkage = 0.0 * contact.slip
        self._on_sinkage.apply('on_outputs', contact)
        depth = (inputs.sinkage - contact.sinkage) * self._depth_of_reading
        cosine = np.maximum(np.minimum(1.0 - depth / contact.radius, _LARGEST_COSINE), 0.0)
        set_angles(contact, np.arccos(cosine), inputs.leaving_angle, self._terms)
        return contact


def _within_the_model(inputs: ConditionedInputs) -> ConditionedInputs:
    """Return inputs that the model takes: nan and values beyond the bounds as the nearest."""
    numbers = {name: getattr(inputs, name) for name in _LEAST}
    with np.errstate(invalid='ignore'):
        total = np.add.reduce(sum(numbers.values()), axis=None)
    if not math.isfinite(total):
        numbers = {
            name: np.where(np.isfinite(value), value, max(_LEAST[name], 0.0))
            for name, value in numbers.items()
        }
    for name, least in _LEAST.items():
        if least > -math.inf:
            numbers[name] = np.maximum(numbers[name], least)
    leaving = inputs.leaving_angle
    if leaving is not None:
        leaving = np.minimum(np.maximum(leaving, _BEHIND), _AHEAD)
    return inputs._replace(leaving_angle=leaving, **numbers)


def contacts_as_built(wheel: Wheel, soil: Soil, gravity: float) -> Contact:
    """Return the contacts of all wheels with geometry and soil filled in, (n,) each."""
    radius, width, height, count, thickness = np.broadcast_arrays(
        *(np.atleast_1d(np.asarray(value, float)) for value in astuple(wheel))
    )
    for column in (radius, width, height, count, thickness):
        column.flags.writeable = False  # a term changes its own contact, never these
    contact: Contact = Contact(**dict.fromkeys(Contact.__dataclass_fields__, 0.0))
    contact.radius = contact.shear_radius = contact.rim_radius = radius
    contact.width, contact.rim_share = width, 1.0
    contact.lug_height, contact.lug_count, contact.lug_thickness = height, count, thickness
    contact.gravity, contact.density = gravity, float(soil.density)
    contact.bearing_modulus, contact.reference_depth = soil.bearing(width, gravity)
    contact.sinkage_exponent = float(soil.sinkage_exponent)
    contact.peak_ratio = float(soil.peak_stress_ratio)
    contact.leaving_ratio = float(soil.leaving_angle_ratio)
    return contact
