# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The wheel models of the contact law that ``rover.contact_law`` names.

Resistive force theory is interpolated. The forces of a smooth wheel in units of scale, width and
radius depend on two numbers alone, the entrance angle and v/(r w): five integrals over the rim are
tabulated once over both, and read by cubic splines.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from wheel_terra_estimator.arrays import FloatArray, Quantity
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.contacts.wheel_models import (
    LEAST_BEARING,
    LEAST_SINKAGE,
    MOST_RATIO,
    WheelModels,
    WheelStates,
)
from wheel_terra_estimator.terramechanics.conditioned import SMALLEST_ANGLE, Bearing
from wheel_terra_estimator.terramechanics.contact_law import (
    PER_CUBIC_METRE,
    RESISTIVE_FORCE,
    WONG_REECE,
    plate_scale,
    reece_effects,
    reece_soil,
    rim_integrals,
)
from wheel_terra_estimator.terramechanics.kinematics import slip_of_speed_ratio

_MOTION_CELLS, _ANGLE_CELLS = 96, 24
_DEEPEST = 0.5 * math.pi  # entrance angle [rad]
_FURTHEST = 0.5 * math.pi  # of the angle whose tangent is (v/(r w) - 1) over the entrance angle
_SHALLOW = 1e-4  # entrance angle at which the limit of a shallow contact is taken [rad]


class RimForces(NamedTuple):
    """Vertical force, and pull and torque under a vertical force of 1."""

    lift: FloatArray  # vertical force over scale, 1e6 N/m^3, width and squared radius [-]
    pull: FloatArray  # over load [-]
    torque: FloatArray  # over load and radius [-]


def rim_forces(
    ratio: Quantity,  # v/(r w) with the radius of the rim, not negative [-]
    angle: Quantity,  # of entrance, above 0 and up to pi/2 [rad]
    friction: Quantity = 1.0,  # factor on the tangential part of the stress; 1 is the theory [-]
    shift: Quantity = 0.0,  # rotation of the stresses towards the front [rad]
) -> RimForces:
    """Return the forces of smooth wheels by resistive force theory; arguments broadcast."""
    motion = np.arctan2(np.subtract(ratio, 1.0), angle)
    motion, angle = np.broadcast_arrays(motion, angle)
    # Lift and push of the normal stress, of the tangential one, and torque.
    lift_n, push_n, lift_t, push_t, turn = (part(motion, angle, grid=False) for part in _table())
    cosine, sine = np.cos(shift), np.sin(shift)
    up, ahead = lift_n + friction * lift_t, friction * push_t - push_n
    lift = np.maximum(up * cosine + ahead * sine, LEAST_BEARING * lift_n)
    push = ahead * cosine - up * sine
    return RimForces(lift * angle**3, push / lift, friction * turn / lift)


@lru_cache(maxsize=1)
def _table() -> tuple[Any, ...]:
    """Return the five integrals over the cube of the entrance angle."""
    from scipy.interpolate import RectBivariateSpline  # late: no other contact law needs it

    motions = np.linspace(-_FURTHEST, _FURTHEST, _MOTION_CELLS + 1)
    angles = np.linspace(0.0, _DEEPEST, _ANGLE_CELLS + 1)
    least = np.maximum(angles, _SHALLOW)
    table = rim_integrals(motions[:, None], least) / least[:, None] ** 3
    return tuple(RectBivariateSpline(motions, angles, part) for part in np.moveaxis(table, -1, 0))


_LUG_EFFECTS = frozenset({'lug_shear_radius', 'grouser_thrust'})
_SHEARED_LUGS = {'lug_shear_radius': {'lam': 0.5}}
"""Where no file says at which radius lugs shear: half way up (Ding et al. 2010). At the rim a wheel
that rolls on the tips of its lugs would brake."""


def contact_models(configuration: Configuration) -> WheelModels:
    """Return the models of all wheels under the configured contact law."""
    law, soil, effects = configuration.rover.contact_law, configuration.soil, configuration.effects
    if not _LUG_EFFECTS & effects.keys():
        effects = effects | _SHEARED_LUGS
    if law == RESISTIVE_FORCE:
        return ResistiveForceModels(configuration)
    if law == WONG_REECE:
        width, gravity = float(configuration.wheels.width[0]), float(configuration.rover.gravity)
        return WheelModels(configuration, reece_soil(soil, width, gravity), reece_effects(effects))
    return WheelModels(configuration, soil, effects)


class ResistiveForceModels(WheelModels):
    """Models by resistive force theory, without effects; see `WheelModels` for the methods.

    With sinkage and load given, the scale of the stress cancels in torque and pull. The learned
    strength is a factor on the stress tangential to the rim, 1 in the theory; K has no effect.
    Stiffness and slip-sinkage act on the load that the law carries at a sinkage; its scale is that
    of the configured soil's pressure on a plate.
    """

    def __init__(self, configuration: Configuration) -> None:
        super().__init__(configuration, configuration.soil, {})
        gravity = float(configuration.rover.gravity)
        width = np.array(configuration.wheels.width, float)
        scale = np.array([plate_scale(configuration.soil, w, gravity) for w in width.tolist()])
        self._unit = scale * PER_CUBIC_METRE * width * self._radius**2

    def torque_and_pull(self, states: WheelStates) -> tuple[FloatArray, FloatArray]:  # noqa: D102
        rim = self._rim_forces(states)
        return rim.torque * states.load * self._radius, rim.pull * states.load

    def bearing(self, states: WheelStates) -> Bearing:  # noqa: D102
        rim = self._rim_forces(states._replace(centroid=0.0))
        depth = np.minimum(np.maximum(states.sinkage, LEAST_SINKAGE), self._radius)
        softer = states.slip_sinkage * np.abs(slip_of_speed_ratio(states.speed_ratio))
        # As in a law with the exponent 1, to which slip adds.
        factor = self._unit * np.exp(states.stiffness) * depth**softer
        return Bearing(factor * rim.lift, 1.0 + softer)

    def _rim_forces(self, states: WheelStates) -> RimForces:
        within = np.minimum(np.maximum(states.speed_ratio, 0.0), MOST_RATIO)
        return rim_forces(
            within * self._slip_radius / self._radius,
            np.maximum(self._entrance_angle(states.sinkage), SMALLEST_ANGLE),
            np.exp(states.strength),
            self._shift(states, within),
        )
