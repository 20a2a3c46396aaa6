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

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.estimation.scalars import TINY

Vector = Sequence[float] | FloatArray


@dataclass(frozen=True)
class LoadDistribution:
    """Linear map from forces to wheel loads, made once per rover.

    Attributes
    ----------
    by_force : numpy.ndarray
        (n, 3): loads [N] per specific force x, y, z [m/s^2].
    by_pull, by_moment : numpy.ndarray
        (n, n): loads per drawbar pull of each wheel [-] (beyond what the specific force says) and
        per moment of the load about its hub [1/m].
    """

    by_force: FloatArray
    by_pull: FloatArray
    by_moment: FloatArray

    def loads(
        self, specific_force: Vector, pull: Vector | None = None, moment: Vector | None = None
    ) -> FloatArray:
        """Return the (n,) normal loads [N]; no wheel pulls on the ground.

        Where the linear map asks a wheel for a negative load, the wheel has lifted off: it gets 0
        and the others are scaled so that the sum stays ``m f_z``.

        Parameters
        ----------
        specific_force : sequence of float
            x, y, z [m/s^2].
        pull, moment : sequence of float, optional
            Per wheel [N], T - F r [N m]; default: pull shared evenly, load below the hub.
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


def load_distribution(
    *,
    mass: float,
    position: FloatArray,
    centre_of_gravity: Vector,
    contact_height: float,
    suspension: str,
    shares: Vector | None = None,
    rocker_pivot: Vector | None = None,
    bogie_pivot: Vector | None = None,
    bogie_wheels: str = 'rear',
) -> LoadDistribution:
    """Return the load map of a rover.

    Parameters
    ----------
    mass : float
        Rover mass [kg].
    position : numpy.ndarray
        (n, 2) wheel positions x, y in ``base_link`` [m].
    centre_of_gravity : sequence of float
        x, y, z in ``base_link`` [m].
    contact_height : float
        z of the wheels' contact points in ``base_link`` [m].
    suspension : {'rigid', 'rocker_bogie', 'shares'}
        ``rigid``: chassis on equal springs (exact for three wheels, the compliant solution for
        more: the loads nearest to equal ones). ``rocker_bogie``: rockers coupled by a differential,
        one bogie with two wheels on each. ``shares``: fixed shares of ``m f_z``.
    shares : sequence of float, optional
        (n,) shares, normalised here.
    rocker_pivot, bogie_pivot : sequence of float, optional
        x, z of the pivots in ``base_link`` [m].
    bogie_wheels : {'front', 'rear'}
        Which two wheels of a side hang on its bogie.

    Returns
    -------
    LoadDistribution

    Raises
    ------
    ValueError
        When the suspension cannot be closed with the wheels given.
    """
    position = np.asarray(position, dtype=float)
    n = len(position)
    if suspension == 'shares':
        share = np.asarray(shares, dtype=float)
        if share.shape != (n,) or share.min() < 0.0 or share.sum() <= 0.0:
            raise ValueError(f'shares must be {n} numbers that are not negative, got {shares}')
        by_force = np.zeros((n, 3))
        by_force[:, 2] = mass * share / share.sum()
        return LoadDistribution(by_force, np.zeros((n, n)), np.zeros((n, n)))

    cg = np.asarray(centre_of_gravity, dtype=float)
    height = cg[2] - contact_height
    balances = _Balances(n)
    balances.add(np.ones(n), force=(0.0, 0.0, mass))
    balances.add(position[:, 0] - cg[0], force=(-mass * height, 0.0, 0.0), moment=np.full(n, -1.0))
    balances.add(position[:, 1] - cg[1], force=(0.0, -mass * height, 0.0))
    if suspension == 'rocker_bogie':
        if rocker_pivot is None or bogie_pivot is None:
            raise ValueError('rocker_bogie needs the positions of its rocker and bogie pivots')
        _close_rocker_bogie(
            balances,
            position,
            mass,
            (float(rocker_pivot[0]), float(rocker_pivot[1]) - contact_height),
            (float(bogie_pivot[0]), float(bogie_pivot[1]) - contact_height),
            bogie_wheels,
        )
    return balances.solve()


class _Balances:
    """Rows of the balances: coefficients of the loads, and of what stands on the right."""

    def __init__(self, count: int) -> None:
        self._count = count
        self._rows: list[FloatArray] = []
        self._force: list[FloatArray] = []
        self._pull: list[FloatArray] = []
        self._moment: list[FloatArray] = []

    def add(
        self,
        row: FloatArray,
        force: Vector = (0.0, 0.0, 0.0),
        pull: FloatArray | None = None,
        moment: FloatArray | None = None,
    ) -> None:
        zero = np.zeros(self._count)
        self._rows.append(row)
        self._force.append(np.asarray(force, dtype=float))
        self._pull.append(zero if pull is None else pull)
        self._moment.append(zero if moment is None else moment)

    def solve(self) -> LoadDistribution:
        # Fewer equations than wheels: the least-norm solution is that of equal springs.
        solution = np.linalg.pinv(np.array(self._rows))
        return LoadDistribution(
            solution @ np.array(self._force),
            solution @ np.array(self._pull),
            solution @ np.array(self._moment),
        )


def _close_rocker_bogie(
    balances: _Balances,
    position: FloatArray,
    mass: float,
    rocker: tuple[float, float],
    bogie: tuple[float, float],
    bogie_wheels: str,
) -> None:
    """Add: no moment about each bogie pivot, equal moments of left and right rocker.

    Pivots are x and height above the contact points [m]. The pulls act that far below them, each
    with the even share of ``m f_x`` plus what `pull` says beyond it.
    """
    n = len(position)
    x = position[:, 0]
    difference, pull_difference, moment_difference = np.zeros(n), np.zeros(n), np.zeros(n)
    even = np.eye(n) - 1.0 / n  # pull of each wheel beyond the even share
    for sign, side in ((1.0, position[:, 1] > 0.0), (-1.0, position[:, 1] <= 0.0)):
        index = np.flatnonzero(side)
        if len(index) != 3:
            raise ValueError(f'rocker_bogie needs three wheels on each side, got {len(index)}')
        rear_first = index[np.argsort(x[index])]
        pair = rear_first[:2] if bogie_wheels == 'rear' else rear_first[1:]
        if not x[pair].min() < bogie[0] < x[pair].max():
            raise ValueError('rocker_bogie: the bogie pivot must lie between the bogie wheels')
        row, on_pair = np.zeros(n), np.zeros(n)
        row[pair] = x[pair] - bogie[0]
        on_pair[pair] = 1.0
        balances.add(
            row,
            force=(-bogie[1] * mass * len(pair) / n, 0.0, 0.0),
            pull=-bogie[1] * on_pair @ even,
            moment=-on_pair,
        )
        # About the rocker pivot all wheels of the side act through their positions: the bogie's
        # own balance has moved its pair to the bogie pivot.
        difference[index] = sign * (x[index] - rocker[0])
        pull_difference[index] = -sign * rocker[1]
        moment_difference[index] = -sign
    balances.add(difference, pull=pull_difference @ even, moment=moment_difference)
