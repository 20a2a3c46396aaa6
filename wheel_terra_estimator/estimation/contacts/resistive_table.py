# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Resistive force theory at a known sinkage, from a table: what the on-board filter evaluates.

The forces of a smooth wheel in units of scale, width and radius depend on two numbers alone, the
entrance angle and v/(r w). Five integrals over the rim are tabulated once and interpolated by
cubic splines.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from wheel_terra_estimator.arrays import FloatArray, Quantity
from wheel_terra_estimator.terramechanics.contact_law import rim_integrals

if TYPE_CHECKING:
    from scipy.interpolate import RectBivariateSpline


_MOTION_CELLS, _ANGLE_CELLS = 96, 24
_DEEPEST = 0.5 * math.pi  # entrance angle [rad]
_FURTHEST = 0.5 * math.pi  # of the angle whose tangent is (v/(r w) - 1) over the entrance angle
_SHALLOW = 1e-4  # entrance angle at which the limit of a shallow contact is taken [rad]
_LEAST_LIFT = 0.05  # of the lift of the normal stress: what friction may leave of it


class RimForces(NamedTuple):
    """Vertical force, and pull and torque under a vertical force of 1."""

    lift: FloatArray  # vertical force over scale, 1e6 N/m^3, width and squared radius [-]
    pull: FloatArray  # over load [-]
    torque: FloatArray  # over load and radius [-]


def rim_forces(
    ratio: Quantity, angle: Quantity, friction: Quantity = 1.0, shift: Quantity = 0.0
) -> RimForces:
    """Return the forces of smooth wheels by resistive force theory; arguments broadcast.

    Parameters
    ----------
    ratio : float or numpy.ndarray
        v/(r w) with the radius of the rim, not negative [-].
    angle : float or numpy.ndarray
        Entrance angle, above 0 and up to pi/2 [rad].
    friction : float or numpy.ndarray
        Factor on the part of the stress that is tangential to the rim; 1 is the theory [-].
    shift : float or numpy.ndarray
        Rotation of the stresses towards the front [rad].
    """
    motion = np.arctan2(np.subtract(ratio, 1.0), angle)
    motion, angle = np.broadcast_arrays(motion, angle)
    # Lift and push of the normal stress, of the tangential one, and torque.
    lift_n, push_n, lift_t, push_t, turn = (part(motion, angle, grid=False) for part in _table())
    cosine, sine = np.cos(shift), np.sin(shift)
    up, ahead = lift_n + friction * lift_t, friction * push_t - push_n
    lift = np.maximum(up * cosine + ahead * sine, _LEAST_LIFT * lift_n)
    push = ahead * cosine - up * sine
    return RimForces(lift * angle**3, push / lift, friction * turn / lift)


@lru_cache(maxsize=1)
def _table() -> tuple[RectBivariateSpline, ...]:
    """Return the five integrals over the cube of the entrance angle."""
    from scipy.interpolate import RectBivariateSpline  # late: no other contact law needs it

    motions = np.linspace(-_FURTHEST, _FURTHEST, _MOTION_CELLS + 1)
    angles = np.linspace(0.0, _DEEPEST, _ANGLE_CELLS + 1)
    least = np.maximum(angles, _SHALLOW)
    table = rim_integrals(motions[:, None], least) / least[:, None] ** 3
    return tuple(RectBivariateSpline(motions, angles, part) for part in np.moveaxis(table, -1, 0))
