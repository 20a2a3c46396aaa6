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
"""The same without a torque: the wheel may carry its share of the slope, or nothing."""


class StationaryPull(NamedTuple):
    """Pull of a wheel that does not turn under a load."""

    expected: float  # by its torque, else the wheel's share of the slope [N]
    std: float  # of `expected` [N]


class StationaryWheels:
    """Pulls of wheels for which the models of a turning wheel do not hold."""

    def __init__(
        self, rover: Rover, sensors: SensorFigures, layout: StateLayout, models: WheelModels
    ) -> None:
        self._rover, self._layout, self._models = rover, layout, models
        self._gain_std = sensors.torque_gain_std

    def update(
        self, x: FloatArray, speed_std: float, cycle: Cycle
    ) -> tuple[tuple[float, ...], list[StationaryPull | None]]:
        """Return the pulls of a cycle at a state `x` (size,), and what to expect of each wheel.

        `speed_std` is the deviation of the body's speed [m/s]. Pulls are [N], nan where no torque
        is known; None stands for a wheel that turns.
        """
        loads, share = cycle.loads, cycle.loads.slope_share
        by_torque = [
            not (turns or isnan(rim) or isnan(torque)) and load >= LEAST_LOAD
            for turns, rim, torque, load in zip(
                cycle.turns, cycle.rims, cycle.torque, loads.load, strict=True
            )
        ]
        pulls = [NAN] * len(by_torque)
        if any(by_torque):
            pulls = np.where(by_torque, self._pulls(x, speed_std, cycle), NAN).tolist()
        return tuple(pulls), [
            None if turns else self.expectation(pull, load, share, cycle.lateral_motion)
            for turns, pull, load in zip(cycle.turns, pulls, loads.load, strict=True)
        ]

    def _pulls(self, x: FloatArray, speed_std: float, cycle: Cycle) -> FloatArray:
        """Return the pulls of wheels that stand, from their torques, (n,) [N]; nan without one.

        A locked wheel slides, one that creeps beside faster ones spins: its shear is saturated, and
        torque gives the pull whatever the strength of the soil. Where its hub stands too, torque
        and pull balance about the hub. A torque that drives a wheel which is dragged is not the
        soil's: its drive is jammed.
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
        pull = forces.pull + gain * (direction * torques - forces.torque)
        most = MOST_DRAG * loads
        # Where no wheel turns faster than the uncertainty of the speed, the rover comes to rest.
        standing = all(abs(rim) < least_speed for rim in known(cycle.rims))
        limit = max(rover.rest_speed, least_speed) if standing else rover.rest_speed
        stands = np.abs(speed) < limit
        return np.where(stands & ~creeps, held, direction * np.clip(pull, -most, most))

    def expectation(
        self, pull: float, load: float, slope_share: float, lateral_motion: float
    ) -> StationaryPull:
        """Return what to expect of a wheel that gives `pull` [N], nan = unknown."""
        if isnan(pull):
            return StationaryPull(load * slope_share, _IDLE_STD * load)
        # In turns it is pushed sideways, too.
        share = _DRAGGED_STD + self._gain_std + min(lateral_motion, 1.0)
        return StationaryPull(pull, share * load)
