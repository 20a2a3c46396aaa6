# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Depth of the rut that each wheel meets, left by the preceding wheel.

Sinkage is measured from the undisturbed surface; a wheel that follows another one begins at the
bottom of its rut. How much of that rut stays is learned (``RUT_SHARE`` of the state).
"""

from __future__ import annotations

from typing import NamedTuple

from wheel_terra_estimator.arrays import Floats
from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.rover import Rover
from wheel_terra_estimator.estimation.scalars import gain_of

_LEAST_SPEED = 1e-3  # [m/s], for the curvature of the path
_LEAST_DISTANCE = 1e-3  # from wheel to wheel [m], for a rover with one axle


class RutState(NamedTuple):
    """Ruts that the wheels meet, one entry per wheel."""

    depth: Floats  # of the preceding wheel's rut where this wheel rolls [m]; 0 on virgin ground
    direction: float = 0.0  # of the drive: 1, -1, 0 = none yet


class Ruts(Component[RutState]):
    """Tracks the depth of the ruts that the wheels meet."""

    def __init__(self, rover: Rover) -> None:
        super().__init__(RutState((0.0,) * rover.wheel_count))
        self._rover = rover

    def advance(self, travel: float, direction: float, sinkage: Floats, curvature: float) -> None:
        """Update for a travel of the body [m] along a path of given curvature [1/m].

        `direction` is that of the drive: 1, -1, 0 = none yet; `sinkage` that of each wheel [m].
        """
        if direction == 0.0:
            return
        before, rover = self.state, self._rover
        if before.direction not in (direction, 0.0):
            # After a reversal a wheel first meets its own rut, or one as deep.
            self.state = RutState(sinkage, direction)
            return
        depths = []
        for i, leader in enumerate(rover.leader if direction > 0.0 else rover.leader_in_reverse):
            rut, distance = 0.0, 2.0 * rover.curvature_length  # virgin ground, a rover length on
            if leader is not None:
                ahead, here = rover.longitudinal[leader], rover.longitudinal[i]
                # In a turn a wheel runs beside the rut of the wheel ahead, by this share of it.
                beside = 0.5 * abs(curvature * (ahead**2 - here**2)) / rover.width[i]
                rut, distance = sinkage[leader] * max(1.0 - beside, 0.0), abs(ahead - here)
            gain = gain_of(travel, max(distance, _LEAST_DISTANCE)) if before.direction else 1.0
            depths.append(before.depth[i] + gain * (rut - before.depth[i]))
        self.state = RutState(tuple(depths), direction)


def curvature_of(speed: float, yaw_rate: float) -> float:
    """Return the curvature of the path [1/m] at a speed [m/s] and a yaw rate [rad/s]."""
    return yaw_rate / max(abs(speed), _LEAST_SPEED)
