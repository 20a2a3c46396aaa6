# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Wheel loads of the simulated rover: statics of chassis, rockers and bogies with wheel forces.

Unlike the estimator's load law this one knows the true wheel forces: pull acts below the pivots,
the contact stress acts ahead of the hub, and the body accelerates.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from wheel_terra_estimator.arrays import BoolArray, FloatArray
from wheel_terra_estimator.configuration.configuration import Configuration

LEAST_LOAD_SHARE = 0.02
"""Least load of a wheel as a share of the mean: a lifted wheel still touches the ground."""


class Pivots(NamedTuple):
    """Joints of rockers and bogies: x and height above the ground [m]."""

    rocker: tuple[float, float]  # to which chassis and differential are fixed
    bogie: tuple[float, float]  # between rocker and bogie
    on_bogie: BoolArray  # (n,) wheels on a bogie


@dataclass(frozen=True)
class Suspension:
    """Geometry that decides the wheel loads; frame: ``base_link`` shifted down to the ground."""

    # ``x``, ``y``: (n,) wheel hubs [m]
    x: FloatArray
    y: FloatArray
    centre_of_gravity: FloatArray  # (3,) x, y and height above the ground [m]
    pivots: Pivots | None = None
    shares: FloatArray | None = None  # (n,) given shares of the total load, in place of statics

    @cached_property
    def _sides(self) -> tuple[FloatArray, FloatArray]:
        return (self.y > 0).astype(float), (self.y <= 0).astype(float)

    @cached_property
    def _solution(self) -> FloatArray:
        """Loads by the balances: the inverse of the coefficients of the loads, one row each."""
        left, right = self._sides
        rows = [np.ones_like(self.x), self.x, self.y]
        if self.pivots is not None:
            # The differential gives both rockers the same moment about their pivots.
            rows.append((left - right) * (self.x - self.pivots.rocker[0]))
            arms = self.pivots.on_bogie * (self.x - self.pivots.bogie[0])
            rows += [left * arms, right * arms]
        return np.asarray(np.linalg.pinv(np.array(rows)), dtype=np.float64)

    def normal_loads(
        self, mass: float, specific_force: FloatArray, pull: FloatArray, load_moment: FloatArray
    ) -> FloatArray:
        """Return the loads perpendicular to the ground.

        With fewer balances than wheels (no pivots named) the loads are those of least norm: a rigid
        frame on ground that yields evenly. Returns (n,) loads [N], none below ``LEAST_LOAD_SHARE``
        of their mean.

        ``specific_force``: (3,) forward, left, up in the frame of the ground below the rover
        [m/s^2]. ``pull``: (n,) longitudinal force of the soil [N]. ``load_moment``: (n,) moment of
        the load about the hub, positive where it acts ahead of it [N m].
        """
        forward, left, up = specific_force
        total = mass * up
        if self.shares is not None:
            return self.shares * total
        cg_x, cg_y, cg_z = self.centre_of_gravity
        balance = [
            total,
            total * cg_x - mass * forward * cg_z - load_moment.sum(),
            total * cg_y - mass * left * cg_z,
        ]
        on_left, on_right = self._sides
        if self.pivots is not None:
            moment = pull * self.pivots.rocker[1] + load_moment
            balance.append(-((on_left - on_right) * moment).sum())
            moment = self.pivots.on_bogie * (pull * self.pivots.bogie[1] + load_moment)
            balance += [-(on_left * moment).sum(), -(on_right * moment).sum()]
        loads = self._solution @ np.array(balance)
        least = LEAST_LOAD_SHARE * total / loads.size
        if (loads < least).any():
            loads = np.maximum(loads, least)
            loads *= total / loads.sum()
        return loads


def suspension_of(configuration: Configuration) -> Suspension:
    """Return the suspension that a configuration describes, heights taken from the wheel rims."""
    wheels, rover = configuration.wheels, configuration.rover
    ground = float(np.mean(wheels.z - wheels.radius))
    cg_x, cg_y, cg_z = rover.centre_of_gravity
    pivots = shares = None
    if rover.suspension == 'rocker_bogie':
        rocker = (float(rover.rocker_pivot[0]), float(rover.rocker_pivot[1]) - ground)
        bogie = (float(rover.bogie_pivot[0]), float(rover.bogie_pivot[1]) - ground)
        order = -1.0 if rover.bogie_wheels == 'front' else 1.0
        on_bogie = np.zeros(wheels.count, dtype=bool)
        for side in (wheels.y > 0.0, wheels.y <= 0.0):
            members = np.flatnonzero(side)
            on_bogie[members[np.argsort(order * wheels.x[members])[:2]]] = True
        pivots = Pivots(rocker, bogie, on_bogie)
    elif rover.suspension == 'shares':
        shares = rover.load_shares
        shares = shares / shares.sum() if shares.any() else np.full(wheels.count, 1 / wheels.count)
    return Suspension(
        x=wheels.x,
        y=wheels.y,
        centre_of_gravity=np.array([cg_x, cg_y, cg_z - ground]),
        pivots=pivots,
        shares=shares,
    )
