# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Resistive force theory at a known sinkage, from a table: what the on-board filter evaluates.

The forces of a smooth wheel in units of scale, width and radius depend on two numbers alone, the
entrance angle and v/(r w). Five integrals over the rim are tabulated once and interpolated by
cubics.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.terramechanics.resistive_force import rim_integrals

FloatArray = NDArray[np.float64]

_MOTION_CELLS, _ANGLE_CELLS = 96, 24
_DEEPEST = 0.5 * math.pi  # entrance angle [rad]
_FURTHEST = 0.5 * math.pi  # of the angle whose tangent is (v/(r w) - 1) over the entrance angle
_SHALLOW = 1e-4  # entrance angle at which the limit of a shallow contact is taken [rad]
_LEAST_LIFT = 0.05  # of the lift of the normal stress: what friction may leave of it


class RimForces(NamedTuple):
    """Vertical force, and pull and torque under a vertical force of 1, with derivatives.

    Attributes
    ----------
    lift : float
        Vertical force over scale, 1e6 N/m^3, width and squared radius [-].
    pull, torque : float
        Pull over load; torque over load and radius [-].
    d_pull, d_torque : tuple of float
        By v/(r w), entrance angle [rad], ln of the friction factor, shift [rad].
    """

    lift: float
    pull: float
    torque: float
    d_pull: tuple[float, ...]
    d_torque: tuple[float, ...]


def rim_forces(ratio: float, angle: float, friction: float = 1.0, shift: float = 0.0) -> RimForces:
    """Return the forces of a smooth wheel by resistive force theory.

    Parameters
    ----------
    ratio : float
        v/(r w) with the radius of the rim, not negative [-].
    angle : float
        Entrance angle, above 0 and up to pi/2 [rad].
    friction : float
        Factor on the part of the stress that is tangential to the rim; 1 is the theory [-].
    shift : float
        Rotation of the stresses towards the front [rad].
    """
    values, by_ratio, by_angle = _integrals(ratio, angle)
    return _balanced(values, (by_ratio, by_angle), friction, shift, angle)


def _balanced(
    values: list[float],
    slopes: tuple[list[float], list[float]],
    friction: float,
    shift: float,
    angle: float,
) -> RimForces:
    """Combine the integrals: lift and push of the normal stress, of the tangential one, torque."""
    lift_n, push_n, lift_t, push_t, turn = values
    cosine, sine = math.cos(shift), math.sin(shift)
    up, ahead = lift_n + friction * lift_t, friction * push_t - push_n
    lift, push = up * cosine + ahead * sine, ahead * cosine - up * sine
    least = _LEAST_LIFT * lift_n
    held = lift < least
    lift = least if held else lift
    pull, torque = push / lift, friction * turn / lift
    d_pull, d_torque = [], []
    rates = [
        (d[0] + friction * d[2], friction * d[3] - d[1], friction * d[4], d[0]) for d in slopes
    ]
    rates.append((friction * lift_t, friction * push_t, friction * turn, 0.0))
    for d_up, d_ahead, d_turn, d_lift_n in rates:
        d_lift = _LEAST_LIFT * d_lift_n if held else d_up * cosine + d_ahead * sine
        d_push = d_ahead * cosine - d_up * sine
        d_pull.append((d_push - pull * d_lift) / lift)
        d_torque.append((d_turn - torque * d_lift) / lift)
    d_lift = 0.0 if held else push
    d_pull.append((-(up * cosine + ahead * sine) - pull * d_lift) / lift)
    d_torque.append(-torque * d_lift / lift)
    return RimForces(lift * angle**3, pull, torque, tuple(d_pull), tuple(d_torque))


def _integrals(ratio: float, angle: float) -> tuple[list[float], list[float], list[float]]:
    """Return the five integrals over the cube of the angle, and their slopes by ratio and angle."""
    table, steps = _table()
    beyond = ratio - 1.0
    x = (math.atan2(beyond, angle) + _FURTHEST) / steps[0]
    y = angle / steps[1]
    i, j = min(int(x), _MOTION_CELLS - 1), min(int(y), _ANGLE_CELLS - 1)
    patch = table[i : i + 4, j : j + 4].reshape(4, -1)
    rows = (np.array(_cubic(x - i)) @ patch).reshape(2, 4, -1)
    (value, by_y), (by_x, _) = (np.array(_cubic(y - j)) @ rows).tolist()
    square = angle * angle + beyond * beyond
    x_by_ratio, x_by_angle = angle / square / steps[0], -beyond / square / steps[0]
    by_angle = [a * x_by_angle + b / steps[1] for a, b in zip(by_x, by_y, strict=True)]
    return value, [a * x_by_ratio for a in by_x], by_angle


def _cubic(t: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Weights of four neighbours at a share t of the middle cell, and their rates (Catmull-Rom)."""
    s = t * t
    return (
        (
            0.5 * t * (2.0 * t - s - 1.0),
            0.5 * (2.0 + s * (3.0 * t - 5.0)),
            0.5 * t * (1.0 + 4.0 * t - 3.0 * s),
            0.5 * s * (t - 1.0),
        ),
        (
            0.5 * (4.0 * t - 3.0 * s - 1.0),
            0.5 * t * (9.0 * t - 10.0),
            0.5 * (1.0 + 8.0 * t - 9.0 * s),
            0.5 * t * (3.0 * t - 2.0),
        ),
    )


@lru_cache(maxsize=1)
def _table() -> tuple[FloatArray, tuple[float, float]]:
    """Return the integrals on the grid with a margin of one node, and its two steps."""
    motions = np.linspace(-_FURTHEST, _FURTHEST, _MOTION_CELLS + 1)
    angles = np.maximum(np.linspace(0.0, _DEEPEST, _ANGLE_CELLS + 1), _SHALLOW)
    table = rim_integrals(motions[:, None], angles) / angles[:, None] ** 3
    for axis in (0, 1):
        first, last = (np.take(table, picks, axis) for picks in ([0, 1, 2], [-1, -2, -3]))
        margin = np.array([3.0, -3.0, 1.0]).reshape(3, *(1,) * (2 - axis))
        ends = [(margin * end).sum(axis, keepdims=True) for end in (first, last)]
        table = np.concatenate([ends[0], table, ends[1]], axis)
    return table, (2.0 * _FURTHEST / _MOTION_CELLS, _DEEPEST / _ANGLE_CELLS)
