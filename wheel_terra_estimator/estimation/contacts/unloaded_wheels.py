# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Detection of unloaded (lifted) wheels by their torque, relative to the others."""

from __future__ import annotations

from math import isnan
from typing import NamedTuple

from wheel_terra_estimator.arrays import Floats
from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.contacts.cycle import TURN, Cycle
from wheel_terra_estimator.estimation.rover import Rover, SensorFigures
from wheel_terra_estimator.estimation.scalars import NAN, median

# Tuned on simulated drives with lifted wheels, seeds 1000 to 1019.
_HOLD = 0.3  # [s] before a wheel is called unloaded, or loaded again
_FREE_SHARE = 0.2  # of the typical torque: a wheel with less carries nothing
_LOADED_SHARE = 0.4  # with more it carries its load again
_LEAST_RIM_SHARE = 0.95  # of the typical rim speed: a slower one is held
_COMPARABLE_TORQUE = 5.0
"""Typical torque over noise and zero of the sensors above which torques can be compared [-]."""


class UnloadedState(NamedTuple):
    """Unloaded wheels, and since when each seems to have changed [s], nan = it does not."""

    unloaded: tuple[bool, ...]
    since: Floats


class UnloadedWheels(Component[UnloadedState]):
    """Detects wheels without load."""

    def __init__(self, rover: Rover, sensors: SensorFigures) -> None:
        n, self._low_rim = rover.wheel_count, rover.low_rim
        super().__init__(UnloadedState((False,) * n, (NAN,) * n))
        self._noise = sensors.torque_std + sensors.torque_zero_std

    def update(self, cycle: Cycle) -> UnloadedState:
        """Update the classification with the torques of a cycle."""
        state, torque, rims, time = self.state, cycle.torque, cycle.rims, cycle.time
        rolling = [  # and its torque was read
            i
            for i, (rim, read) in enumerate(zip(rims, torque, strict=True))
            if abs(rim) > self._low_rim and not isnan(read)
        ]
        if len(rolling) < 2:
            # One wheel cannot be compared with another.
            if not all(isnan(value) for value in torque):
                self.state = state._replace(unloaded=(False,) * len(torque))
            return self.state
        typical = median([torque[i] for i in rolling])
        typical_rim = median([rims[i] for i in rolling])
        comparable = abs(typical) > _COMPARABLE_TORQUE * self._noise
        comparable = comparable and cycle.lateral_motion < TURN
        unloaded, since = list(state.unloaded), list(state.since)
        for i in rolling:
            share = torque[i] / typical if comparable else 1.0
            turns = rims[i] * typical_rim > _LEAST_RIM_SHARE * typical_rim**2
            free = abs(share) < _FREE_SHARE and turns
            if unloaded[i]:
                free = not comparable or share < _LOADED_SHARE
            if free == unloaded[i]:
                since[i] = NAN
            elif isnan(since[i]):
                since[i] = time
            elif time - since[i] > _HOLD:
                unloaded[i], since[i] = free, NAN
        self.state = UnloadedState(tuple(unloaded), tuple(since))
        return self.state
