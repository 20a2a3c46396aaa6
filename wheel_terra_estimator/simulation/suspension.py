# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Wheel loads of the simulated rover: statics of chassis, rockers and bogies with wheel forces.

Unlike the estimator's load law this one knows the true wheel forces: pull acts below the pivots,
the contact stress acts ahead of the hub, and the body accelerates.
"""

from __future__ import annotations

import numpy as np

from wheel_terra_estimator.arrays import BoolArray, FloatArray
from wheel_terra_estimator.configuration.configuration import Configuration

LEAST_LOAD_SHARE = 0.02
"""Least load of a wheel as a share of the mean: a lifted wheel still touches the ground."""


class Suspension:
    """The suspension that a configuration describes; heights are those above the ground [m]."""

    def __init__(self, configuration: Configuration) -> None:
        wheels, rover = configuration.wheels, configuration.rover
        x, y = wheels.x, wheels.y
        ground = float(np.mean(wheels.z - wheels.radius))
        cg_x, cg_y, cg_z = rover.centre_of_gravity
        self._centre_of_gravity = cg_x, cg_y, cg_z - ground
        self._left, self._right = (y > 0.0).astype(float), (y <= 0.0).astype(float)
        self._shares: FloatArray | None = None  # (n,) given ones of the total load, no statics
        self._on_bogie: BoolArray | None = None  # (n,) wheels on a bogie
        rows = [np.ones_like(x), x, y]  # of the balances: coefficients of the loads
        if rover.suspension == 'rocker_bogie':
            rocker_x, rocker_z = rover.rocker_pivot  # of rocker, chassis and differential
            bogie_x, bogie_z = rover.bogie_pivot  # between rocker and bogie
            self._rocker_height, self._bogie_height = rocker_z - ground, bogie_z - ground
            order = -1.0 if rover.bogie_wheels == 'front' else 1.0
            self._on_bogie = np.zeros(wheels.count, dtype=bool)
            for side in (y > 0.0, y <= 0.0):
                members = np.flatnonzero(side)
                self._on_bogie[members[np.argsort(order * x[members])[:2]]] = True
            # The differential gives both rockers the same moment about their pivots.
            rows.append((self._left - self._right) * (x - rocker_x))
            arms = self._on_bogie * (x - bogie_x)
            rows += [self._left * arms, self._right * arms]
        elif rover.suspension == 'shares':
            shares = rover.load_shares
            even = np.full(wheels.count, 1 / wheels.count)
            self._shares = shares / shares.sum() if shares.any() else even
        self._solution = np.asarray(np.linalg.pinv(np.array(rows)), dtype=np.float64)

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
        if self._shares is not None:
            return self._shares * total
        cg_x, cg_y, cg_z = self._centre_of_gravity
        balance = [
            total,
            total * cg_x - mass * forward * cg_z - load_moment.sum(),
            total * cg_y - mass * left * cg_z,
        ]
        if self._on_bogie is not None:
            moment = pull * self._rocker_height + load_moment
            balance.append(-((self._left - self._right) * moment).sum())
            moment = self._on_bogie * (pull * self._bogie_height + load_moment)
            balance += [-(self._left * moment).sum(), -(self._right * moment).sum()]
        loads = self._solution @ np.array(balance)
        least = LEAST_LOAD_SHARE * total / loads.size
        if (loads < least).any():
            loads = np.maximum(loads, least)
            loads *= total / loads.sum()
        return loads
