# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Demand: required traction coefficient (pull over load), its change, and its maximum in a drive.

The sum of the pulls is mass times the specific force along the body, whatever slope and
acceleration make it (Newton). A rover that must pull more slips more within a contact length, long
before the next reference velocity shows it. So the change is fed forward into the prediction of the
speed, by the slip per demand that the filter learns (``SLIP_PER_DEMAND`` of the state).
"""

from __future__ import annotations

from math import isnan
from typing import NamedTuple

from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.scalars import NAN, gain_of

SMOOTHING_TIME = 0.3
"""Time constant of the demand [s]: less than a contact length takes, more than vibration."""
MEAN_TIME = 5.0
"""Time constant of the running means [s]: slip lags the demand by a contact length."""


class Demand(Component[float]):
    """Smoothed demand in the direction of the drive, as a share of the load [-]; nan = unknown."""

    def __init__(self) -> None:
        super().__init__(NAN)

    def update(self, demand: float, dt: float, *, settled: bool) -> float:
        """Return the change of the demand over a cycle [-]; 0 while contacts form.

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


class Climbed(NamedTuple):
    """Steepest steady climb of a drive: what a soil kept for the next one must carry."""

    demand: float = 0.0  # greatest running mean of the demand [-]
    slip: float = NAN  # its mean there [-]
    mean_demand: float = NAN  # present running means
    mean_slip: float = NAN


class SteepestClimb(Component[Climbed]):
    """Tracks mean demand and slip while a reference velocity observes the slip."""

    def __init__(self) -> None:
        super().__init__(Climbed())

    def update(self, demand: float, slip: float, dt: float) -> None:
        """Take a cycle of steady driving; nan = it was none, or the slip is not known."""
        most, its_slip, mean_demand, mean_slip = self.state
        if isnan(demand) or isnan(slip):
            self.state = Climbed(most, its_slip)
            return
        if isnan(mean_demand):
            # Of the first moment of a stretch no demand above 0 counts: it is no mean yet.
            self.state = Climbed(most, its_slip, min(demand, 0.0), slip)
            return
        gain = gain_of(dt, MEAN_TIME)
        mean_demand += gain * (demand - mean_demand)
        mean_slip += gain * (slip - mean_slip)
        if mean_demand > most:
            most, its_slip = mean_demand, mean_slip
        self.state = Climbed(most, its_slip, mean_demand, mean_slip)
