# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Quasi-static normal load of each wheel from specific force, centre of gravity and suspension.

The soil's forces on the wheels must equal mass times specific force (that is what an accelerometer
measures), whatever the slope and the acceleration, so no attitude is needed. With contact points a
height h below the centre of gravity, the moment about it gives (x, y relative to it)::

    sum W_i     = m f_z
    sum W_i x_i = -h m f_x      (uphill: f_x > 0, the rear wheels carry more)
    sum W_i y_i = -h m f_y

Three equations leave n - 3 loads open; the suspension closes them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Vector = Sequence[float] | FloatArray


@dataclass(frozen=True)
class LoadDistribution:
    """Linear map from specific force to wheel loads, made once per rover.

    Attributes
    ----------
    matrix : numpy.ndarray
        (n, 3): loads [N] per specific force x, y, z [m/s^2].
    """

    matrix: FloatArray

    def loads(self, specific_force: Vector) -> FloatArray:
        """Return the (n,) normal loads [N]; no wheel pulls on the ground.

        Where the linear map asks a wheel for a negative load, the wheel has lifted off: it gets 0
        and the others are scaled so that the sum stays ``m f_z``.
        """
        loads = self.matrix @ np.asarray(specific_force, dtype=float)
        if loads.min() < 0.0:
            total = loads.sum()
            loads = np.maximum(loads, 0.0)
            loads *= max(total, 0.0) / max(loads.sum(), 1e-12)
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
        matrix = np.zeros((n, 3))
        matrix[:, 2] = mass * share / share.sum()
        return LoadDistribution(matrix)

    cg = np.asarray(centre_of_gravity, dtype=float)
    x, y = position[:, 0] - cg[0], position[:, 1] - cg[1]
    height = cg[2] - contact_height
    rows = [np.ones(n), x, y]
    sides = [
        mass * np.array([0.0, 0.0, 1.0]),
        mass * np.array([-height, 0.0, 0.0]),
        mass * np.array([0.0, -height, 0.0]),
    ]
    if suspension == 'rocker_bogie':
        if rocker_pivot is None or bogie_pivot is None:
            raise ValueError('rocker_bogie needs the positions of its rocker and bogie pivots')
        _close_rocker_bogie(
            rows,
            sides,
            position,
            contact_height,
            np.asarray(rocker_pivot, dtype=float),
            np.asarray(bogie_pivot, dtype=float),
            bogie_wheels,
        )
    # Fewer equations than wheels: the least-norm solution is that of equal springs.
    return LoadDistribution(np.linalg.pinv(np.array(rows)) @ np.array(sides))


def _close_rocker_bogie(
    rows: list[FloatArray],
    sides: list[FloatArray],
    position: FloatArray,
    contact_height: float,
    rocker: FloatArray,
    bogie: FloatArray,
    bogie_wheels: str,
) -> None:
    """Add: no moment about each bogie pivot, equal moments of left and right rocker.

    The pulls act below the pivots and turn the bogie; they enter as load times ``f_x / f_z``, which
    is bilinear. To stay linear the arm is taken at equal loads: the bogie carries the share of its
    wheels, so its pull is that share of ``m f_x``.
    """
    n = len(position)
    arm_x = position[:, 0]
    left = position[:, 1] > 0.0
    mass = sides[0][2]
    difference = np.zeros(n)
    for side in (left, ~left):
        index = np.flatnonzero(side)
        if len(index) != 3:
            raise ValueError(f'rocker_bogie needs three wheels on each side, got {len(index)}')
        rear_first = index[np.argsort(arm_x[index])]
        pair = rear_first[:2] if bogie_wheels == 'rear' else rear_first[1:]
        if not arm_x[pair].min() < bogie[0] < arm_x[pair].max():
            raise ValueError('rocker_bogie: the bogie pivot must lie between the bogie wheels')
        row = np.zeros(n)
        row[pair] = arm_x[pair] - bogie[0]
        rows.append(row)
        pull_share = len(pair) / n
        sides.append(mass * np.array([-(bogie[1] - contact_height) * pull_share, 0.0, 0.0]))
        sign = 1.0 if side is left else -1.0
        # Rocker: its single wheel at its own arm, the bogie's wheels at the bogie pivot.
        difference[index] = sign * (arm_x[index] - rocker[0])
        difference[pair] = sign * (bogie[0] - rocker[0])
    rows.append(difference)
    sides.append(np.zeros(3))
