# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Forces of the soil on wheels whose sinkage is given: the reference quadrature off its balance.

The stress distribution, the shear and all effects are those of the reference model. What differs
is what is known: there the load balance finds the sinkage, here the sinkage is a state and the
load balance finds by which factor the normal stress exceeds the bearing strength of the soil at
that sinkage (``support_ratio``). At 1 the two agree; above 1 the wheel is sinking.

Lateral motion shears the soil too: the shear displacement is a vector, the shear stress of Janosi
and Hanamoto acts along it. Where ``rover.contact_law`` of the truth names another law, the ground
is of that one.
"""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from typing import NamedTuple

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.terramechanics import effects as effect_catalogue
from wheel_terra_estimator.terramechanics.conditioned import contacts_as_built
from wheel_terra_estimator.terramechanics.contact_law import (
    PER_CUBIC_METRE,
    RESISTIVE_FORCE,
    WONG_REECE,
    plate_scale,
    reece_effects,
    reece_soil,
    rim_integrals,
)
from wheel_terra_estimator.terramechanics.effects import EffectSettings
from wheel_terra_estimator.terramechanics.kinematics import speed_ratio
from wheel_terra_estimator.terramechanics.quadrature import stressed
from wheel_terra_estimator.terramechanics.soil import Soil
from wheel_terra_estimator.terramechanics.stresses import shear_displacement
from wheel_terra_estimator.terramechanics.terms import Terms, set_angles
from wheel_terra_estimator.terramechanics.wheel import Wheel

NODES = 6
"""Gauss-Legendre nodes on each side of the angle of greatest stress."""
LEAST_SUPPORT = 0.05
"""Floor of the support ratio: cohesion alone never carries the whole wheel."""
LEAST_ANGLE = 0.01
"""Least entrance angle [rad]; the balance is singular at 0."""
LEAST_SLIP = -0.999  # a locked wheel has -1, where v/(r w) is infinite [-]


class SunkWheels(NamedTuple):
    """Wheels in the soil, seen in the direction of travel; (n,) unless stated otherwise."""

    # Name of ``terrain.SOIL_QUANTITIES`` -> factor on the base soil below the wheels
    factors: Mapping[str, FloatArray]
    depth: FloatArray  # of the stressed contact, r (1 - cos t1) [m]
    slip: FloatArray  # (..., n) slip ratio, positive when driving [-]
    side_slip: FloatArray  # (..., n) lateral slip velocity over the larger of rim and ground speed
    load: FloatArray  # [N]
    rim_speed: FloatArray  # [m/s]
    slope: FloatArray  # [rad]
    pass_number: FloatArray  # 1 on virgin soil, more where other wheels ran before


class SoilForces(NamedTuple):
    """What the soil does to the wheels; shape of the points, in the direction of travel."""

    # ``pull``, ``side_force``: net longitudinal and lateral force on the wheel [N]
    pull: FloatArray
    side_force: FloatArray
    torque: FloatArray  # drive torque that holds the wheel against the soil [N m]
    support_ratio: FloatArray  # normal stress over the bearing strength at this sinkage [-]
    sinkage_exponent: FloatArray  # N after the effects [-]
    contact_angle: FloatArray  # entrance minus leaving angle [rad]
    leaving_angle: FloatArray  # leaving angle, negative behind the hub [rad]
    # Sinkage beyond the depth of the stressed contact, from digging and support of lugs [m]
    lug_sinkage: FloatArray

    def first(self) -> SoilForces:
        """Return the entry 0 of the first axis of every field."""
        return SoilForces(*(values[0] for values in self))


class ContactModel:
    """Soil forces of n wheels with given depths."""

    def __init__(
        self,
        wheel: Wheel,  # (n,) geometry
        soil: Soil,  # base soil; that below each wheel differs by factors
        slip_radius: FloatArray,  # (n,) radius that slip refers to [m]
        effects: Mapping[str, Mapping[str, float]],
        gravity: float,
    ) -> None:
        self._as_built = contacts_as_built(wheel, soil, gravity)
        self._soil = soil
        self._tan_friction = float(np.tan(soil.friction_angle))
        self._slip_radius = slip_radius
        self._terms = Terms(effect_catalogue.with_defaults(effects))

    def forces(self, sunk: SunkWheels) -> SoilForces:
        """Return the forces, seen in the direction of travel."""
        soil, contact = self._soil, copy(self._as_built)
        factors, slip, depth = sunk.factors, sunk.slip, sunk.depth
        ratio = speed_ratio(np.maximum(slip, LEAST_SLIP))
        contact.slip, contact.velocity_ratio = slip, ratio * self._slip_radius
        contact.normal_load = contact.stated_load = sunk.load
        contact.rim_speed, contact.slope, contact.direction = sunk.rim_speed, sunk.slope, 1.0
        contact.pass_number = sunk.pass_number
        contact.bearing_modulus = contact.bearing_modulus * factors['stiffness']
        contact.cohesion = soil.cohesion * factors['cohesion']
        contact.tan_friction = self._tan_friction * factors['friction']
        contact.shear_modulus = soil.shear_modulus * factors['shear_modulus']
        self._terms.apply('on_inputs', contact)
        contact.sinkage_exponent = soil.sinkage_exponent + factors['slip_sinkage'] * (
            contact.sinkage_exponent - soil.sinkage_exponent
        )
        entrance = np.arccos(np.clip(1.0 - depth / contact.radius, -0.5, np.cos(LEAST_ANGLE)))
        set_angles(contact, entrance, None, self._terms)
        t1, tm, t2 = contact.entrance_angle, contact.peak_angle, contact.leaving_angle
        shape = np.broadcast_shapes(np.shape(t1), np.shape(tm), np.shape(t2), np.shape(slip))
        weights, cosine, sine = map(np.asarray, stressed(contact, self._terms, NODES))
        angle = contact.angle
        shear_radius = contact.shear_radius
        along = shear_displacement(contact, sine)
        # The rim turns by (t1 - t) while the hub moves sideways.
        across = sunk.side_slip * np.maximum(ratio, 1.0) * self._slip_radius * (t1 - angle)
        sheared = np.sqrt(along * along + across * across) + 1e-12
        mobilised = weights * -np.expm1(-sheared / contact.shear_modulus) / sheared
        mobilised_along = mobilised * along
        normal = contact.normal_stress
        frictional = contact.tan_friction * normal

        # Load balance, linear in the factor on the normal stress.
        radius, width, cohesion = contact.radius, self._as_built.width, contact.cohesion
        from_cohesion = shear_radius * cohesion * (mobilised_along * sine).sum(0)
        from_stress = radius * (weights * normal * cosine).sum(0) + shear_radius * (
            mobilised_along * frictional * sine
        ).sum(0)
        support = (contact.normal_load / width - from_cohesion) / np.maximum(from_stress, 1e-9)
        support = np.maximum(support, LEAST_SUPPORT)
        strength = cohesion + support * frictional
        shear = mobilised_along * strength
        contact.drawbar_pull = width * (
            shear_radius * (shear * cosine).sum(0)
            - radius * support * (weights * normal * sine).sum(0)
        )
        contact.torque = width * shear_radius**2 * shear.sum(0)
        side_force = width * shear_radius * (mobilised * across * strength).sum(0)
        contact.sinkage = depth
        self._terms.apply('on_outputs', contact)
        return SoilForces(
            pull=np.asarray(contact.drawbar_pull),
            side_force=side_force,
            torque=np.asarray(contact.torque),
            support_ratio=support,
            sinkage_exponent=np.broadcast_to(contact.sinkage_exponent, shape),
            contact_angle=np.broadcast_to((t1 - tm) + (tm - t2), shape),
            leaving_angle=np.broadcast_to(t2, shape),
            lug_sinkage=np.broadcast_to(contact.sinkage - depth, shape),
        )


_SIDE_FRICTION = 0.36  # of the theory for a flat plate that slides [-]
_SIDE_SLIP = 0.05  # resultant slip at which half of it acts [-]


def contact_of(configuration: Configuration) -> ContactModel | ResistiveContact:
    """Return the contacts of all wheels under the law of a configuration."""
    wheels, soil = configuration.wheels, configuration.soil
    effects: EffectSettings = configuration.effects
    law, gravity = configuration.rover.contact_law, float(configuration.rover.gravity)
    if law == RESISTIVE_FORCE:
        return ResistiveContact(wheels.wheel, soil, wheels.slip_radius, gravity)
    if law == WONG_REECE:
        soil, effects = reece_soil(soil, float(wheels.width[0]), gravity), reece_effects(effects)
    return ContactModel(wheels.wheel, soil, wheels.slip_radius, effects, gravity)


class ResistiveContact:
    """Forces by resistive force theory on n wheels with given depths; as `ContactModel`.

    Of the factors on the soil stiffness counts, and friction for the stress tangential to the rim.
    The theory knows no sideways motion: Coulomb's friction acts against it.
    """

    def __init__(self, wheel: Wheel, soil: Soil, slip_radius: FloatArray, gravity: float) -> None:
        self._radius = np.asarray(wheel.radius, float)
        self._lead = slip_radius / self._radius
        width = np.asarray(wheel.width, float)
        scale = np.array([plate_scale(soil, float(b), gravity) for b in width])
        self._unit = scale * PER_CUBIC_METRE * width * self._radius**2

    def forces(self, sunk: SunkWheels) -> SoilForces:
        """Return the forces; see `ContactModel.forces`."""
        slip, load = sunk.slip, sunk.load
        cosine = np.clip(1.0 - sunk.depth / self._radius, -0.5, np.cos(LEAST_ANGLE))
        beyond = speed_ratio(np.maximum(slip, LEAST_SLIP)) * self._lead - 1.0
        entrance = np.broadcast_to(np.arccos(cosine), np.shape(beyond))
        lift, back, rub_up, rub_ahead, turn = np.moveaxis(
            rim_integrals(np.arctan2(beyond, entrance), entrance), -1, 0
        )
        unit, friction = self._unit * sunk.factors['stiffness'], sunk.factors['friction']
        carried = unit * np.maximum(lift + friction * rub_up, LEAST_SUPPORT * lift)
        support = np.maximum(load / carried, LEAST_SUPPORT)
        unit = unit * support
        slid = np.hypot(slip, sunk.side_slip) + _SIDE_SLIP
        zero = np.zeros(np.shape(beyond))
        return SoilForces(
            pull=unit * (friction * rub_ahead - back),
            side_force=_SIDE_FRICTION * friction * load * sunk.side_slip / slid,
            torque=unit * self._radius * friction * turn,
            support_ratio=support,
            sinkage_exponent=zero + 1.0,
            contact_angle=entrance,
            leaving_angle=zero,
            lug_sinkage=zero,
        )
