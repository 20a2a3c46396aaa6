# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What the ground asks of the wheels, and how it changes: the slip follows at once.

The sum of the pulls is mass times the specific force along the body, whatever slope and
acceleration make it (Newton). A rover that must pull more slips more, in the next contact length
and not at the next reference velocity, so the change is fed forward into the prediction of the
speed, with a gain that the reference velocities teach.
"""

from __future__ import annotations

from math import isnan

from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.scalars import NAN, gain_of

SMOOTHING_TIME = 0.3
"""Time constant of the demand [s]: less than a contact length takes, more than vibration."""


class Demand(Component[float]):
    """Smoothed demand in the direction of the drive, as a share of the load [-]; nan = unknown."""

    def __init__(self) -> None:
        super().__init__(NAN)

    def update(self, demand: float, dt: float, *, settled: bool) -> float:
        """Return the change of the demand over a cycle [-]; 0 where the contacts form anew.

        `demand` is the present one, in the direction of the drive; nan = not measured. Until the
        contacts are `settled`, slip and demand belong to no steady curve.
        """
        if isnan(demand):
            return 0.0
        if isnan(self.state) or not settled:
            self.state = demand
            return 0.0
        change = gain_of(dt, SMOOTHING_TIME) * (demand - self.state)
        self.state += change
        return change
