# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""How fast the torque changes that the wheels need along the way: contacts change with it.

A rover without sinkage sensors sees by its torques that the ground under it becomes another one,
or that its wheels dig in.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.rover import Rover
from wheel_terra_estimator.estimation.scalars import NAN, gain_of

Floats = tuple[float, ...]
_LENGTH = 0.1
"""Rim travel over which a change is seen [m]: about a contact length."""
_SHORT = 0.025  # rim travel over which noise is smoothed before [m]


class TorqueShares(NamedTuple):
    """Torque over load times radius, smoothed over rim travel [-]; nan = none yet."""

    short: float = NAN
    long: float = NAN


class TorqueChange(Component[TorqueShares]):
    """Change of the torque of all wheels over load times radius, per rim travel."""

    def __init__(self, rover: Rover) -> None:
        super().__init__(TorqueShares())
        self._radius = np.array(rover.shear_radius)

    def update(
        self, torque: Floats, loads: Floats, turning: tuple[bool, ...], travel: float
    ) -> float:
        """Return the change [1/m]; nan where no wheel tells.

        Parameters
        ----------
        torque : tuple of float
            Readings [N m], nan = none.
        loads : tuple of float
            [N].
        turning : tuple of bool
            Wheels that turn under a load.
        travel : float
            Of the fastest rim since the last reading [m].
        """
        readings = np.array(torque)
        tells = np.array(turning) & ~np.isnan(readings)
        if not tells.any():
            return NAN
        share = abs(float(readings[tells].sum() / (np.array(loads) * self._radius)[tells].sum()))
        short, long = self.state
        if np.isnan(long):
            short = long = share
        short += gain_of(travel, _SHORT) * (share - short)
        long += gain_of(travel, _LENGTH) * (share - long)
        self.state = TorqueShares(short, long)
        return abs(short - long) / _LENGTH
