# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Sudden changes of the torques: the slip may change before the next reference tells.

A wheel that locks or comes free makes the others work. By how much the body's speed may change
widens the prediction of the speed with the
wheels (process-noise inflation), not the covariance, so that the accelerometer still bounds the
speed of a fast rover.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from math import isnan
from typing import NamedTuple

from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.rover import Rover, SensorFigures
from wheel_terra_estimator.estimation.scalars import NAN, gain_of

Floats = tuple[float, ...]


@dataclass(frozen=True)
class TorqueChangeTuning:
    """Tuned on simulated drives, seeds 1000 to 1019."""

    effort_fast: float = 0.15  # time constants of the torques' two means [s]
    effort_slow: float = 1.0
    effort_noise: float = 1.5
    """Deviations of one mean torque that are no change: 3 of the difference of the two means, which
    is half as noisy."""
    effort_gain: float = 0.5  # of the change of torque that is one of slip
    most_effort_slip: float = 0.4
    least_slope: float = 0.1  # of the traction curve, over which a change is taken [-]


class EffortState(NamedTuple):
    """Sum of the torques over load times radius: fast and slow mean, when."""

    fast: float = NAN
    slow: float = NAN
    time: float = 0.0  # [s]


class TorqueChange(Component[EffortState]):
    """Notes a sudden change of the torques of all wheels that carry."""

    def __init__(
        self,
        rover: Rover,
        sensors: SensorFigures,
        tuning: TorqueChangeTuning = TorqueChangeTuning(),
    ) -> None:
        super().__init__(EffortState())
        self._radius, self._tuning = rover.shear_radius, tuning
        self._noise = sensors.torque_std

    def update(
        self,
        time: float,
        rolling: Sequence[int],
        unloaded: Sequence[bool],
        *,
        torque: Floats,
        rims: Floats,
        loads: Floats,
        traction_slope: float,
    ) -> float:
        """Return the change of slip that a change of the torques may bring [-].

        Parameters
        ----------
        time : float
            [s].
        rolling : sequence of int
            Wheels that turn and whose torque was read.
        unloaded : sequence of bool
            Wheels that carry nothing.
        torque, rims, loads : tuple of float
            Of all wheels [N m], [m/s], [N]; nan = unknown.
        traction_slope : float
            Of the traction curve [-]; 0 = unknown.
        """
        if len(rolling) < 2:
            # Torques were read, but there is no sum of them.
            if not all(isnan(value) for value in torque):
                self.state = self.state._replace(fast=NAN, slow=NAN)
            return 0.0
        tuning = self._tuning
        fast, slow, before = self.state
        self.state = self.state._replace(time=time)
        carrying = [i for i in rolling if not unloaded[i]]
        weight = sum(loads[i] * self._radius[i] for i in carrying)
        if weight <= 0.0:
            return 0.0
        effort = sum(math.copysign(torque[i], torque[i] * rims[i]) for i in carrying) / weight
        dt = time - before
        if isnan(fast) or dt <= 0.0:
            self.state = EffortState(effort, effort, time)
            return 0.0
        fast += gain_of(dt, tuning.effort_fast) * (effort - fast)
        slow += gain_of(dt, tuning.effort_slow) * (effort - slow)
        self.state = EffortState(fast, slow, time)
        noise = self._noise * math.sqrt(len(carrying)) / weight
        excess = abs(fast - slow) - tuning.effort_noise * noise
        if excess <= 0.0 or traction_slope <= 0.0:
            return 0.0
        slip = tuning.effort_gain * excess / max(traction_slope, tuning.least_slope)
        return min(slip, tuning.most_effort_slip)
