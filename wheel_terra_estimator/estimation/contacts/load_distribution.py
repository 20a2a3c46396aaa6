# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Quasi-static normal load of each wheel from specific force, centre of gravity and suspension.

The soil's forces on the wheels must equal mass times specific force (that is what an accelerometer
measures), whatever the slope and the acceleration, so no attitude is needed. A wheel's load acts
ahead of its hub; the moment about the hub, M = T - F r, follows from torque and pull. With the
centre of gravity a height h above the contact points (x, y relative to it)::

    sum W_i       = m f_z
    sum W_i x_i   = -h m f_x - sum M_i      (uphill: f_x > 0, the rear wheels carry more)
    sum W_i y_i   = -h m f_y

Three equations leave n - 3 loads open; the suspension closes them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.estimation.scalars import TINY

Vector = Sequence[float] | FloatArray


@dataclass(frozen=True)
class LoadDistribution:
    """Linear map from forces to the loads of n wheels, made once per rover."""

    by_force: FloatArray  # (n, 3) loads [N] per specific force x, y, z [m/s^2]
    by_pull: FloatArray  # (n, n) per drawbar pull beyond what the specific force says [-]
    by_moment: FloatArray  # (n, n) per moment of the load about its hub [1/m]

    def loads(
        self, specific_force: Vector, pull: Vector | None = None, moment: Vector | None = None
    ) -> FloatArray:
        """Return the (n,) normal loads [N]; no wheel pulls on the ground.

        `specific_force` is x, y, z [m/s^2]; `pull` [N] and `moment`, T - F r [N m], are those of
        each wheel: by default the pull is shared evenly and the load acts below the hub. Where the
        linear map asks a wheel for a negative load, the wheel has lifted off: it gets 0 and the
        others are scaled so that the sum stays ``m f_z``.
        """
        force = np.asarray(specific_force, dtype=float)
        loads = self.by_force @ force
        if pull is not None:
            loads = loads + self.by_pull @ np.asarray(pull, dtype=float)
        if moment is not None:
            loads = loads + self.by_moment @ np.asarray(moment, dtype=float)
        if loads.min() < 0.0:
            total = loads.sum()
            loads = np.maximum(loads, 0.0)
            loads *= max(total, 0.0) / max(loads.sum(), TINY)
        return loads


class _Balance(NamedTuple):
    """Coefficients of the loads, and of force, pulls and moments on the right, of one balance."""

    loads: FloatArray  # (n,)
    force: Vector  # (3,)
    pulls: FloatArray  # (n,)
    moments: FloatArray  # (n,)


def load_distribution(
    *,
    mass: float,  # [kg]
    position: FloatArray,  # (n, 2) of the wheels, x and y in ``base_link`` [m]
    centre_of_gravity: Vector,  # x, y, z in ``base_link`` [m]
    contact_height: float,  # of the wheels' contact points, z in ``base_link`` [m]
    suspension: str,  # ``rigid``, ``rocker_bogie`` or ``shares``
    shares: Vector,  # (n,) normalised here
    rocker_pivot: Vector,  # x, z in ``base_link`` [m]
    bogie_pivot: Vector,
    bogie_wheels: str,  # ``front`` or ``rear``: which two wheels of a side hang on its bogie
) -> LoadDistribution:
    """Return the load map of a rover whose suspension was checked (``configuration.reader``).

    ``rigid``: chassis on equal springs (exact for three wheels, the compliant solution for more:
    the loads nearest to equal ones). ``rocker_bogie``: rockers coupled by a differential, one bogie
    with two wheels on each. ``shares``: fixed shares of ``m f_z``; the other two do not count.
    """
    n = len(position)
    none = np.zeros(n)
    if suspension == 'shares':
        share = np.asarray(shares, dtype=float)
        by_force = np.zeros((n, 3))
        by_force[:, 2] = mass * share / share.sum()
        return LoadDistribution(by_force, np.zeros((n, n)), np.zeros((n, n)))
    x, y = position.T
    cg_x, cg_y, cg_z = centre_of_gravity
    lever = mass * (cg_z - contact_height)
    balances = [
        _Balance(np.ones(n), (0.0, 0.0, mass), none, none),
        _Balance(x - cg_x, (-lever, 0.0, 0.0), none, np.full(n, -1.0)),
        _Balance(y - cg_y, (0.0, -lever, 0.0), none, none),
    ]
    if suspension == 'rocker_bogie':
        balances += _rocker_bogie(
            position,
            mass,
            (rocker_pivot[0], rocker_pivot[1] - contact_height),
            (bogie_pivot[0], bogie_pivot[1] - contact_height),
            bogie_wheels,
        )
    coefficients, *right = (np.array(part, dtype=float) for part in zip(*balances, strict=True))
    # Fewer equations than wheels: the least-norm solution is that of equal springs.
    solution = np.linalg.pinv(coefficients)
    return LoadDistribution(*(solution @ part for part in right))


def _rocker_bogie(
    position: FloatArray,
    mass: float,
    rocker: tuple[float, float],
    bogie: tuple[float, float],
    bogie_wheels: str,
) -> list[_Balance]:
    """Return: no moment about each bogie pivot, equal moments of left and right rocker.

    Pivots are x and height above the contact points [m]. The pulls act that far below them, each
    with the even share of ``m f_x`` plus what is beyond it.
    """
    n, x = len(position), position[:, 0]
    found = []
    difference, pull_difference, moment_difference = np.zeros(n), np.zeros(n), np.zeros(n)
    even = np.eye(n) - 1.0 / n  # pull of each wheel beyond the even share
    for sign, side in ((1.0, position[:, 1] > 0.0), (-1.0, position[:, 1] <= 0.0)):
        index = np.flatnonzero(side)
        rear_first = index[np.argsort(x[index])]
        pair = rear_first[:2] if bogie_wheels == 'rear' else rear_first[1:]
        row, on_pair = np.zeros(n), np.zeros(n)
        row[pair] = x[pair] - bogie[0]
        on_pair[pair] = 1.0
        force = (-bogie[1] * mass * len(pair) / n, 0.0, 0.0)
        found.append(_Balance(row, force, -bogie[1] * on_pair @ even, -on_pair))
        # About the rocker pivot all wheels of the side act through their positions: the bogie's
        # own balance has moved its pair to the bogie pivot.
        difference[index] = sign * (x[index] - rocker[0])
        pull_difference[index] = -sign * rocker[1]
        moment_difference[index] = -sign
    found.append(_Balance(difference, (0.0, 0.0, 0.0), pull_difference @ even, moment_difference))
    return found
