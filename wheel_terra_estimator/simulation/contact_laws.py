# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Ground whose contact law is the one that ``rover.contact_law`` of the truth names."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.simulation.contact import (
    LEAST_ANGLE,
    LEAST_SUPPORT,
    ContactModel,
    SoilForces,
)
from wheel_terra_estimator.terramechanics.contact_law import (
    RESISTIVE_FORCE,
    WONG_REECE,
    plate_scale,
    reece_effects,
    reece_soil,
)
from wheel_terra_estimator.terramechanics.effects import EffectSettings
from wheel_terra_estimator.terramechanics.kinematics import speed_ratio
from wheel_terra_estimator.terramechanics.resistive_force import PER_CUBIC_METRE, rim_integrals
from wheel_terra_estimator.terramechanics.soil import Soil
from wheel_terra_estimator.terramechanics.wheel import Wheel

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

    def forces(
        self,
        factors: Mapping[str, FloatArray],
        depth: FloatArray,
        slip: FloatArray,
        side_slip: FloatArray,
        load: FloatArray,
        rim_speed: FloatArray,
        slope: FloatArray,
        pass_number: FloatArray,
    ) -> SoilForces:
        """Return the forces; see `ContactModel.forces`."""
        cosine = np.clip(1.0 - depth / self._radius, -0.5, np.cos(LEAST_ANGLE))
        beyond = speed_ratio(np.maximum(slip, -0.999)) * self._lead - 1.0
        entrance = np.broadcast_to(np.arccos(cosine), np.shape(beyond))
        lift, back, rub_up, rub_ahead, turn = np.moveaxis(
            rim_integrals(np.arctan2(beyond, entrance), entrance), -1, 0
        )
        unit, friction = self._unit * factors['stiffness'], factors['friction']
        carried = unit * np.maximum(lift + friction * rub_up, LEAST_SUPPORT * lift)
        support = np.maximum(load / carried, LEAST_SUPPORT)
        unit = unit * support
        slid = np.hypot(slip, side_slip) + _SIDE_SLIP
        zero = np.zeros(np.shape(beyond))
        return SoilForces(
            pull=unit * (friction * rub_ahead - back),
            side_force=_SIDE_FRICTION * friction * load * side_slip / slid,
            torque=unit * self._radius * friction * turn,
            support_ratio=support,
            sinkage_exponent=zero + 1.0,
            contact_angle=entrance,
            leaving_angle=zero,
            lug_sinkage=zero,
        )
