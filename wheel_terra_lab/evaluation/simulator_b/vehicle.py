# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Rover of a drive, and how its weight comes down on its wheels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wheel_terra_lab.evaluation.simulator_b.wheel_soil import WheelShape

FloatArray = NDArray[np.float64]

_LEAST_SHARE = 0.02
"""A wheel that the statics would lift keeps this share of the mean load."""


@dataclass(frozen=True)
class RockerBogie:
    """Pivots x, z in base_link [m]; the bogie carries the two wheels behind or before."""

    rocker: tuple[float, float]
    bogie: tuple[float, float]
    bogie_behind: bool = True


@dataclass(frozen=True)
class Vehicle:
    """The true rover: wheels front to rear, left before right; SI units."""

    mass: float
    gravity: float
    centre: tuple[float, float, float]  # of gravity, x, y, z above the ground [m]
    shape: WheelShape  # every entry (n,)
    x: FloatArray  # (n,) hubs [m]
    y: FloatArray
    suspension: RockerBogie | None  # None: rigid chassis on wheels that give way alike
    yaw_inertia: float  # [kg m^2]

    @property
    def count(self) -> int:
        """Number of wheels."""
        return len(self.x)

    @property
    def weight(self) -> float:
        """Weight [N]."""
        return self.mass * self.gravity


@dataclass(frozen=True)
class ChassisForce:
    """Specific force on the chassis in axes of the ground [m/s^2]: forward, left, up."""

    forward: float
    left: float
    up: float


def wheel_loads(
    vehicle: Vehicle,
    force: ChassisForce,  # what accelerometers in the centre of gravity would read
    pull: FloatArray,  # (n,) longitudinal forces of the soil, which act at the ground [N]
    lead: FloatArray,  # (n,) moments of the loads about the hubs: they act ahead of them [N m]
) -> FloatArray:
    """Return the loads normal to the ground (n,) [N] in quasi-static balance."""
    if vehicle.suspension is None:
        loads = _rigid(vehicle, force, lead)
    else:
        loads = _rocker_bogie(vehicle, vehicle.suspension, force, pull, lead)
    total = vehicle.mass * force.up
    loads = np.maximum(loads, _LEAST_SHARE * total / vehicle.count)
    return np.asarray(loads * total / loads.sum())


def _moments(vehicle: Vehicle, force: ChassisForce, lead: FloatArray) -> tuple[float, float, float]:
    """Return what the loads sum to: sum W, sum W x, sum W y."""
    x, y, z = vehicle.centre
    m = vehicle.mass
    return (
        m * force.up,
        m * (force.up * x - force.forward * z) - float(lead.sum()),
        m * (force.up * y - force.left * z),
    )


def _rigid(vehicle: Vehicle, force: ChassisForce, lead: FloatArray) -> FloatArray:
    """Loads that grow linearly over the plan of the rover: equally soft ground below a slab."""
    shape = np.stack([np.ones(vehicle.count), vehicle.x, vehicle.y])
    factors = np.linalg.solve(shape @ shape.T, np.array(_moments(vehicle, force, lead)))
    return np.asarray(factors @ shape)


def _rocker_bogie(
    vehicle: Vehicle, pivots: RockerBogie, force: ChassisForce, pull: FloatArray, lead: FloatArray
) -> FloatArray:
    """Six loads from six balances: total, roll, two bogies, and two rockers with a differential.

    A force (F forward, W up) at a place (x, z) turns a part about its pivot (xp, zp) by
    (z - zp) F - (x - xp) W, nose-down positive; contacts are at z = 0, ahead of the hubs. The
    differential gives each rocker half of the pitching moment of the body.
    """
    (xr, zr), (xb, zb) = pivots.rocker, pivots.bogie
    total, _, roll = _moments(vehicle, force, lead)
    cx, _, cz = vehicle.centre
    m = vehicle.mass
    # The body hangs on the rocker pivots; its moment about them, nose-down positive.
    body = -(cz - zr) * m * force.forward + (cx - xr) * m * force.up
    matrix, right = np.zeros((6, 6)), np.zeros(6)
    matrix[0], right[0] = 1.0, total
    matrix[1], right[1] = vehicle.y, roll
    row = 2
    for side in (vehicle.y > 0.0, vehicle.y < 0.0):
        wheels = np.flatnonzero(side)
        wheels = wheels[np.argsort(-vehicle.x[wheels])]
        alone, pair = (wheels[0], wheels[1:]) if pivots.bogie_behind else (wheels[2], wheels[:2])
        matrix[row, pair] = vehicle.x[pair] - xb
        right[row] = -zb * pull[pair].sum() - lead[pair].sum()
        # Rocker: its own wheel, and what the bogie brings to its pivot.
        matrix[row + 1, alone] = -(vehicle.x[alone] - xr)
        matrix[row + 1, pair] = -(xb - xr)
        right[row + 1] = -0.5 * body + zr * pull[alone] - (zb - zr) * pull[pair].sum() + lead[alone]
        row += 2
    return np.asarray(np.linalg.solve(matrix, right))
