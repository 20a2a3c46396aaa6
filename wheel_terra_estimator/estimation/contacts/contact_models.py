# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The wheel models of the contact law that ``rover.contact_law`` names."""

from __future__ import annotations

import math

from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.contacts.wheel_models import (
    MOST_RATIO,
    Bearing,
    WheelForces,
    WheelModels,
    WheelState,
)
from wheel_terra_estimator.estimation.scalars import clipped
from wheel_terra_estimator.terramechanics.conditioned import SMALLEST_ANGLE
from wheel_terra_estimator.terramechanics.contact_law import (
    RESISTIVE_FORCE,
    WONG_REECE,
    plate_scale,
    reece_effects,
    reece_soil,
)
from wheel_terra_estimator.terramechanics.kinematics import slip_of_speed_ratio
from wheel_terra_estimator.terramechanics.maths import ScalarMaths
from wheel_terra_estimator.terramechanics.resistive_force import PER_CUBIC_METRE
from wheel_terra_estimator.terramechanics.resistive_table import RimForces, rim_forces


def contact_models(configuration: Configuration) -> WheelModels:
    """Return the models of all wheels under the configured contact law."""
    law, soil, effects = configuration.rover.contact_law, configuration.soil, configuration.effects
    if law == RESISTIVE_FORCE:
        return ResistiveForceModels(configuration)
    if law == WONG_REECE:
        width, gravity = float(configuration.wheels.width[0]), float(configuration.rover.gravity)
        return WheelModels(configuration, reece_soil(soil, width, gravity), reece_effects(effects))
    return WheelModels(configuration, soil, effects)


class ResistiveForceModels(WheelModels):
    """Models by resistive force theory, without effects; see `WheelModels` for the methods.

    The sinkage is measured and the load given, so that the scale of the stress cancels in torque
    and pull. The learned strength is a factor on the stress tangential to the rim, 1 in the theory;
    K has no part. Stiffness and slip-sinkage act on the load that the law carries at a sinkage.

    Parameters
    ----------
    configuration : Configuration
        Soil (its pressure on a plate gives the scale) and wheels.
    """

    def __init__(self, configuration: Configuration) -> None:
        super().__init__(configuration, configuration.soil, {})
        gravity = float(configuration.rover.gravity)
        self._unit = [
            plate_scale(configuration.soil, width, gravity) * PER_CUBIC_METRE * width * radius**2
            for width, radius in zip(configuration.wheels.width, self._radius, strict=True)
        ]

    def forces(self, wheel: int, state: WheelState) -> WheelForces:  # noqa: D102
        rim, radius, load = self._rim_forces(wheel, state), self._radius[wheel], state.load
        high, depth, angle = self._contact(
            wheel, clipped(state.speed_ratio, 0.0, MOST_RATIO), state.sinkage
        )
        within = 0.0 <= state.speed_ratio <= MOST_RATIO
        # The shift of the stresses is (centroid - mound high^2) times the entrance angle.
        shift = state.centroid - state.mound * high * high
        by_ratio = 2.0 * state.mound * high / self._mound_span * angle if within else 0.0
        by_depth = 0.0
        if depth == state.sinkage and angle > SMALLEST_ANGLE:
            by_depth = 1.0 / (radius * math.sin(angle))
        scale = self._slip_radius[wheel] / radius if within else 0.0
        t, f = (
            (
                unit * (d[0] * scale + d[3] * by_ratio),
                unit * (d[1] + d[3] * shift) * by_depth,
                unit * d[2],
                0.0,
                unit * d[3] * angle,
                -unit * d[3] * angle * high * high,
            )
            for d, unit in ((rim.d_torque, load * radius), (rim.d_pull, load))
        )
        return WheelForces(rim.torque * load * radius, rim.pull * load, t, f)

    def pull(self, wheel: int, state: WheelState) -> float:  # noqa: D102
        return self._rim_forces(wheel, state).pull * state.load

    def bearing(self, wheel: int, state: WheelState) -> Bearing:  # noqa: D102
        rim = self._rim_forces(wheel, state._replace(centroid=0.0, mound=0.0))
        _, depth, _ = self._contact(wheel, 1.0, state.sinkage)
        softer = state.slip_sinkage * abs(slip_of_speed_ratio(state.speed_ratio, ScalarMaths))
        # As in a law with the exponent 1, to which slip adds.
        factor = self._unit[wheel] * math.exp(state.stiffness) * depth**softer
        return Bearing(factor * rim.lift, 1.0 + softer, math.log(depth))

    def bearing_and_slower(  # noqa: D102
        self, wheel: int, state: WheelState, step: float
    ) -> tuple[Bearing, Bearing]:
        slower = state._replace(speed_ratio=state.speed_ratio - step)
        return self.bearing(wheel, state), self.bearing(wheel, slower)

    def _rim_forces(self, wheel: int, state: WheelState) -> RimForces:
        within = clipped(state.speed_ratio, 0.0, MOST_RATIO)
        high, _, angle = self._contact(wheel, within, state.sinkage)
        return rim_forces(
            within * self._slip_radius[wheel] / self._radius[wheel],
            max(angle, SMALLEST_ANGLE),
            math.exp(state.strength),
            (state.centroid - state.mound * high * high) * angle,
        )
