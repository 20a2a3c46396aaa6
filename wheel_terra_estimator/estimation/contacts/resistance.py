# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""By how much the ground resists more than before: wheels that dig themselves in.

What the torques give over their radii and the pull does not show is resistance (Bekker 1956). On
one soil it changes little; where it rises by more than a tenth of the load the wheels sink, and
they sink because they slip. So it is in five simulators of different laws; which soil a rover came
from makes the slip uncertain, not which soil it is in.
"""

from __future__ import annotations

import math
from math import isnan
from typing import NamedTuple

from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.contacts.measured_wheels import SlipOfTorque
from wheel_terra_estimator.estimation.scalars import NAN, clipped, gain_of

_SMOOTHED = 0.1  # rim travel over which the present resistance is taken [m]
_FALLING, _RISING = 1.0, 10.0
"""Rim travels with which the resistance before it follows: at once where soil becomes harder,
slowly where it becomes softer, and no slower than the mean of all since a start [m]."""
_RISE, _RISE_STD = 0.16, 0.35
"""Rise, over the load, at which two thirds of the motion are lost [-], and its spread [ln]; with
the power tuned on two foreign simulators, A, B and C, without sinkage and reference."""
_POWER = 3.0


class ResistanceState(NamedTuple):
    """Resistances over the load [-]; nan = none was seen yet."""

    present: float = NAN
    before: float = NAN
    driven: float = 0.0  # rim travel since the first [m]


class Resistance(Component[ResistanceState]):
    """Follows the resistance along the way."""

    def __init__(self) -> None:
        super().__init__(ResistanceState())

    def update(self, resistance: float, travel: float) -> None:
        """Take in a resistance over the load [-] after some rim travel [m]; nan = unknown."""
        if isnan(resistance) or isnan(travel):
            return
        present, before, driven = self.state
        if isnan(present):
            present = before = resistance
        present += gain_of(travel, _SMOOTHED) * (resistance - present)
        length = clipped(driven, _SMOOTHED, _RISING) if present > before else _FALLING
        before += gain_of(travel, length) * (present - before)
        self.state = ResistanceState(present, before, driven + travel)

    @property
    def digging(self) -> SlipOfTorque:
        """Slip of wheels that dig, as far as the resistance tells; 0 where it has not risen."""
        present, before, _ = self.state
        return slip_of_rise(0.0 if isnan(present) else max(present - before, 0.0))


def slip_of_rise(rise: float) -> SlipOfTorque:
    """Return the slip where the resistance has risen by a share of the load [-], 0 or more."""
    exponent = (rise / _RISE) ** _POWER
    kept = math.exp(-exponent)
    return SlipOfTorque(1.0 - kept, _POWER * exponent * kept * _RISE_STD)
