# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Pull of wheels that stand while the rover moves or pulls: locked, jammed or held."""

from __future__ import annotations

from math import isnan
from typing import NamedTuple

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.estimation.contacts.cycle import TURN, Cycle
from wheel_terra_estimator.estimation.contacts.loads import LEAST_LOAD
from wheel_terra_estimator.estimation.contacts.wheel_models import (
    STRENGTH,
    WheelModels,
    WheelStates,
)
from wheel_terra_estimator.estimation.filter.state import (
    CENTROID,
    SHEAR_MODULUS,
    SHEAR_STRENGTH,
    SPEED,
    StateLayout,
)
from wheel_terra_estimator.estimation.rover import Rover, SensorFigures
from wheel_terra_estimator.estimation.scalars import NAN, known

# Tuned on simulated drives with locked wheels, seeds 1000 to 1019, unless said otherwise.
_SLIDING_RATIO = 3.0
"""v/(r w) taken for a locked wheel: its shear is saturated long before [-]."""
_SLIDING_DEVIATIONS = 2.0  # of the speed, from which a rover slides on wheels that stand
MOST_DRAG = 2.0  # of the load: friction and the soil pushed ahead
_DRAGGED_STD = 0.1
"""Deviation of a dragged wheel's pull over its load, besides torque gain and turning [-]."""
_IDLE_STD = 0.3
"""The same without a torque: the wheel may be dragged, roll unseen beside a dead encoder, or carry
its share of the slope, or nothing."""


class StationaryPull(NamedTuple):
    """Pull of a wheel that does not turn under a load."""

    expected: float  # by its torque, else from its share of the slope half-way to a drag [N]
    std: float  # of `expected` [N]
    unread: bool = False  # whether it may be dragged, and no torque tells


class StationaryWheels:
    """Pulls of wheels for which the models of a turning wheel do not hold."""

    def __init__(
        self, rover: Rover, sensors: SensorFigures, layout: StateLayout, models: WheelModels
    ) -> None:
        self._rover, self._layout, self._models = rover, layout, models
        self._gain_std = sensors.torque_gain_std

    def update(self, x: FloatArray, speed_std: float, cycle: Cycle) -> list[StationaryPull | None]:
        """Return what to expect of each wheel at a state `x` (size,); None for one that turns.

        `speed_std` is the deviation of the body's speed [m/s].
        """
        loads, n = cycle.loads, len(cycle.rims)
        pulls = self._pulls(x, speed_std, cycle).tolist() if not all(cycle.turns) else [NAN] * n
        expected: list[StationaryPull | None] = [None] * n
        for i, (load, rim) in enumerate(zip(loads.load, cycle.rims, strict=True)):
            if not cycle.turns[i]:
                stands = not isnan(rim) and load >= LEAST_LOAD
                expected[i] = self.expectation(
                    pulls[i] if stands else NAN,
                    load,
                    loads.slope_share,
                    cycle.lateral_motion,
                    unread=stands and isnan(cycle.torque[i]),
                )
        return expected

    def _pulls(self, x: FloatArray, speed_std: float, cycle: Cycle) -> FloatArray:
        """Return the pulls of wheels that stand, from their torques, (n,) [N].

        A locked wheel slides, one that creeps beside faster ones spins: its shear is saturated, and
        torque gives the pull whatever the strength of the soil; without a torque it is that of the
        models. Where its hub stands too, torque and pull balance about the hub; nan without one. A
        torque that drives a wheel which is dragged is not the soil's: its drive is jammed.
        """
        rover, torques, loads = self._rover, np.array(cycle.torque), np.array(cycle.loads.load)
        speed = cycle.headings.speeds(float(x[SPEED]), cycle.yaw_rate)
        held = np.clip(torques / np.array(rover.shear_radius), -loads, loads)
        rims, least_speed = np.array(cycle.rims), _SLIDING_DEVIATIONS * speed_std
        # It turns on beside faster ones, and its hub is no faster than its rim.
        creeps = np.abs(rims) > rover.rest_speed
        creeps &= rims * cycle.yaw_compensated.typical > 0.0
        creeps &= np.abs(speed) < np.maximum(np.abs(rims), least_speed)
        direction = np.where(np.where(creeps, rims, speed) > 0.0, 1.0, -1.0)
        forces = self._models.forces(
            WheelStates(
                np.where(creeps, 0.0, _SLIDING_RATIO),
                x[self._layout.sinkage],
                loads,
                float(x[SHEAR_STRENGTH]),
                float(x[SHEAR_MODULUS]),
                float(x[CENTROID]),
            )
        )
        by_torque, by_pull = forces.d_torque[STRENGTH], forces.d_pull[STRENGTH]
        jammed = (direction * torques > 0.0) & ~creeps & (cycle.lateral_motion < TURN)
        usable = (by_torque != 0.0) & ~jammed
        gain = np.where(usable, by_pull / np.where(usable, by_torque, 1.0), 0.0)
        excess = np.where(np.isnan(torques), 0.0, direction * torques - forces.torque)
        pull = forces.pull + gain * excess
        most = MOST_DRAG * loads
        # Where no wheel turns faster than the uncertainty of the speed, the rover comes to rest.
        standing = all(abs(rim) < least_speed for rim in known(cycle.rims))
        limit = max(rover.rest_speed, least_speed) if standing else rover.rest_speed
        stands = np.abs(speed) < limit
        return np.where(stands & ~creeps, held, direction * np.clip(pull, -most, most))

    def expectation(
        self,
        pull: float,
        load: float,
        slope_share: float,
        lateral_motion: float,
        *,
        unread: bool = False,
    ) -> StationaryPull:
        """Return what to expect of a wheel that gives `pull` [N], nan = unknown.

        One whose torque is `unread` is dragged, or rolls beside a dead encoder: half-way.
        """
        if isnan(pull) or unread:
            own = load * slope_share
            half = 0.0 if isnan(pull) else 0.5 * (pull - own)
            return StationaryPull(own + half, max(_IDLE_STD * load, abs(half)), unread)
        # In turns it is pushed sideways, too.
        share = _DRAGGED_STD + self._gain_std + min(lateral_motion, 1.0)
        return StationaryPull(pull, share * load)
