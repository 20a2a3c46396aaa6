# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The most that the ground asked of a drive, and the slip at which the soil gave it."""

from __future__ import annotations

from math import isnan
from typing import NamedTuple

from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.scalars import NAN, gain_of

MEAN_TIME = 5.0
"""Of the running means [s]: slip follows what is asked a contact length later."""


class Climbed(NamedTuple):
    """What a soil that is kept has to carry."""

    demand: float = 0.0  # the greatest mean of what was asked, as a share of the load [-]
    slip: float = NAN  # its mean there [-]
    mean_demand: float = NAN  # present running means
    mean_slip: float = NAN


class SteepestClimb(Component[Climbed]):
    """Follows what is asked and the slip while a reference velocity tells the slip."""

    def __init__(self) -> None:
        super().__init__(Climbed())

    def update(self, demand: float, slip: float, dt: float) -> None:
        """Take a cycle of steady driving; nan = it was none, or the slip is not told."""
        most, its_slip, mean_demand, mean_slip = self.state
        if isnan(demand) or isnan(slip):
            self.state = Climbed(most, its_slip)
            return
        if isnan(mean_demand):
            # The first moment of a stretch is no mean.
            self.state = Climbed(most, its_slip, min(demand, 0.0), slip)
            return
        gain = gain_of(dt, MEAN_TIME)
        mean_demand += gain * (demand - mean_demand)
        mean_slip += gain * (slip - mean_slip)
        if mean_demand > most:
            most, its_slip = mean_demand, mean_slip
        self.state = Climbed(most, its_slip, mean_demand, mean_slip)
