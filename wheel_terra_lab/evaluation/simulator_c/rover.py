# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Rovers of simulator C: four to eight wheels, 2 to 900 kg, drawn anew for every seed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wheel_terra_lab.evaluation.simulator_c.contact import Rims

FloatArray = NDArray[np.float64]

_RADIUS_OF_MASS = 0.052  # wheel radius of a rover of 1 kg, growing with the cube root [m]


@dataclass(frozen=True)
class Family:
    """A kind of rover that is drawn from."""

    wheels: int
    mass: tuple[float, float]  # [kg]
    suspension: str  # springs or rocker_bogie
    steering: str  # skid, front, all
    tyres: bool = False  # rubber, no lugs


FAMILIES = {
    'four_skid': Family(4, (12.0, 130.0), 'springs', 'skid'),
    'four_tyres': Family(4, (20.0, 200.0), 'springs', 'skid', tyres=True),
    'four_front': Family(4, (20.0, 300.0), 'springs', 'front'),
    'four_all': Family(4, (15.0, 150.0), 'springs', 'all'),
    'six_rocker': Family(6, (8.0, 250.0), 'rocker_bogie', 'all'),
    'six_rocker_skid': Family(6, (6.0, 60.0), 'rocker_bogie', 'skid'),
    'six_skid': Family(6, (30.0, 400.0), 'springs', 'skid'),
    'six_light': Family(6, (2.0, 3.0), 'rocker_bogie', 'skid'),
    'eight_light': Family(8, (2.0, 4.0), 'springs', 'skid'),
    'eight_skid': Family(8, (40.0, 500.0), 'springs', 'skid'),
    'four_heavy': Family(4, (600.0, 900.0), 'springs', 'front'),
    'six_heavy': Family(6, (600.0, 900.0), 'springs', 'skid'),
}


@dataclass(frozen=True)
class Motors:
    """Speed-controlled drives, (n,) or one for all, at the wheel."""

    inertia: FloatArray  # of wheel and rotor [kg m^2]
    gain: FloatArray  # of the controller [N m s/rad]
    integral: FloatArray  # [N m/rad]
    limit: FloatArray  # of the torque at standstill [N m]
    no_load_rate: float  # [rad/s]


@dataclass(frozen=True)
class Rover:
    """A rover as it is; what its file states of it is another matter. Arrays (n,) over wheels."""

    family: Family
    x: FloatArray  # hubs before the centre of the wheelbase [m]
    y: FloatArray
    rims: Rims
    lug_count: FloatArray
    mass: float
    gravity: float
    centre: tuple[float, float, float]  # of gravity: x, y, and height above the ground [m]
    yaw_inertia: float  # [kg m^2]
    spring: FloatArray  # stiffness at each wheel [N/m]
    modes: FloatArray  # (n, k) height of each wheel per freedom of chassis and suspension
    bogie_height: float  # of the pivot above the ground [m]
    motors: Motors
    speed: float  # it usually drives at [m/s]

    @property
    def count(self) -> int:
        """Number of wheels."""
        return len(self.x)

    @property
    def mean_load(self) -> float:
        """Weight per wheel on level ground [N]."""
        return self.mass * self.gravity / self.count

    @property
    def steered(self) -> NDArray[np.bool_]:
        """Which wheels steer: all, those ahead of the centre, or the outer axles of a rocker."""
        if self.family.steering == 'skid':
            return np.zeros(self.count, dtype=bool)
        if self.family.steering == 'front':
            return np.asarray(self.x > 0.4 * self.x.max())
        return np.asarray(np.abs(self.x) > 0.4 * self.x.max())


def draw_rover(rng: np.random.Generator, family: Family, gravity: float) -> Rover:
    """Return a rover of a family."""
    mass = float(np.exp(rng.uniform(*np.log(family.mass))))
    radius = _RADIUS_OF_MASS * mass ** (1.0 / 3.0) * rng.uniform(0.85, 1.2)
    radius *= (4.0 / family.wheels) ** 0.25
    n, axles = family.wheels, family.wheels // 2
    width = radius * rng.uniform(0.5, 1.1)
    lug = 0.0 if family.tyres else radius * rng.choice([0.0, rng.uniform(0.02, 0.12)], p=[0.2, 0.8])
    pitch = radius * rng.uniform(2.25, 3.2)  # between axles
    place = (np.arange(axles)[::-1] - 0.5 * (axles - 1)) * pitch
    if axles == 3:
        place[1] += rng.uniform(-0.1, 0.1) * pitch
    track = max(pitch * (axles - 1) * rng.uniform(0.7, 1.1), 2.5 * width)
    x, y = np.repeat(place, 2), np.tile([0.5 * track, -0.5 * track], axles)
    base = x.max() - x.min()
    centre = (
        float(rng.uniform(-0.07, 0.07) * base),
        float(rng.uniform(-0.02, 0.02) * track),
        float(radius * rng.uniform(1.3, 2.4)),
    )
    full = np.full(n, 1.0)
    grip = 1.0 if lug > 0.03 * radius or family.tyres else rng.uniform(0.7, 0.9)
    speed = float(np.exp(rng.uniform(np.log(0.25), np.log(2.0))) * radius)
    return Rover(
        family=family,
        x=x,
        y=y,
        rims=Rims(
            radius=radius * full,
            width=width * full,
            lug_height=lug * full,
            shear_radius=(radius + rng.uniform(0.4, 0.95) * lug) * full,
            grip=grip * full,
        ),
        lug_count=np.round(rng.uniform(10, 26)) * full,
        mass=mass,
        gravity=gravity,
        centre=centre,
        yaw_inertia=mass * (base**2 + track**2) / 12.0 * rng.uniform(0.8, 1.3),
        spring=mass * gravity / n / (radius * rng.uniform(0.05, 0.2)) * full,
        modes=_modes(rng, family, x, y),
        bogie_height=float(radius * rng.uniform(0.9, 1.3)),
        motors=_motors(rng, mass * gravity / n, radius, mass, n, speed),
        speed=speed,
    )


def _motors(
    rng: np.random.Generator, load: float, radius: float, mass: float, n: int, speed: float
) -> Motors:
    full = np.ones(n)
    limit = load * radius * rng.uniform(1.3, 2.5)
    gain = limit / (speed / radius) * rng.uniform(0.5, 3.0)
    return Motors(
        inertia=mass / n * radius**2 * rng.uniform(0.1, 0.6) * full,
        gain=gain * full,
        integral=gain * rng.uniform(1.0, 5.0) * full,
        limit=limit * full,
        no_load_rate=float(rng.uniform(5.0, 9.0)),
    )


def _modes(rng: np.random.Generator, family: Family, x: FloatArray, y: FloatArray) -> FloatArray:
    """Return the height of each wheel per unit of each freedom.

    Springs: heave, pitch and roll of the chassis. Rocker-bogie: height of the left and right
    rocker pivot, angle of the rockers, angle of the bogies; a differential between the rockers.
    """
    if family.suspension == 'springs':
        return np.stack([np.ones_like(x), x, y], axis=1)
    reach = x.max()
    pivot = reach * rng.uniform(0.05, 0.25)
    bogie = 0.5 * (x[2] + x[4]) + reach * rng.uniform(-0.05, 0.05)
    front = x > 0.5 * reach
    rocker = np.where(front, x - pivot, bogie - pivot)
    swing = np.where(front, 0.0, x - bogie)
    left = (y > 0.0).astype(float)
    columns = [a * side for a in (np.ones_like(x), rocker, swing) for side in (left, 1.0 - left)]
    return np.stack(columns, axis=1)


class Suspension:
    """Loads of the wheels, and attitude of the chassis, from balance of forces and moments."""

    def __init__(self, rover: Rover) -> None:
        self._rover = rover
        self._bogies = rover.modes.shape[1] == 6
        self._solved = self._solve(rover.spring)
        modes, y = rover.modes, rover.y
        if self._bogies:
            self._pivot = float(rover.x[0] - modes[0, 2])
            self._bogie = float(rover.x[2] - modes[2, 4])
            self._track = float(y[0] - y[1])

    def _solve(self, spring: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        modes = self._rover.modes
        weighted = spring[:, None] * modes
        inverse = np.linalg.pinv(modes.T @ weighted)
        by_moment = weighted @ inverse
        return np.diag(spring) - by_moment @ weighted.T, by_moment, inverse, weighted.T

    def loads(
        self,
        heights: FloatArray,  # (n,) of the bottoms of the wheels along the normal [m]
        force: FloatArray,  # (3,) gravity and inertia at the centre of gravity: x, y, down [N]
        bogie_pull: FloatArray,  # (2,) of the wheels of the left and right bogie [N]
        lead: FloatArray,  # (n,) moments of the loads about the hubs: they act ahead of them [N m]
    ) -> tuple[FloatArray, tuple[float, float]]:
        """Return (n,) loads [N] and the sines of pitch (nose up) and roll (left side up)."""
        moments = self._moments(force, bogie_pull, lead)
        by_height, by_moment, inverse, transfer = self._solved
        loads = by_height @ heights + by_moment @ moments
        freedoms = inverse @ (transfer @ heights - moments)
        if loads.min() < 0.0:
            lifted = loads < 0.0
            if not self._bogies and lifted.sum() < len(loads) - 2:
                spring = np.where(lifted, 1e-6, 1.0) * self._rover.spring
                by_height, by_moment, *_ = self._solve(spring)
                loads = by_height @ heights + by_moment @ moments
            loads = np.maximum(loads, 0.0)
            loads *= force[2] / max(loads.sum(), 1e-6)
        return loads, self._attitude(freedoms)

    def _moments(self, force: FloatArray, bogie_pull: FloatArray, lead: FloatArray) -> FloatArray:
        """Return the generalised loads: sums over the wheels of load times mode."""
        x, y, height = self._rover.centre
        along = force[2] * x + height * force[0] - lead.sum()
        across = force[2] * y + height * force[1]
        if not self._bogies:
            return np.array([force[2], along, across])
        sides = 0.5 * force[2] + np.array([1.0, -1.0]) * across / self._track
        bogies = -self._rover.bogie_height * bogie_pull - [lead[2::2].sum(), lead[3::2].sum()]
        rockers = 0.5 * (along - self._pivot * force[2]) - bogies
        return np.concatenate([sides, rockers, bogies])

    def _attitude(self, freedoms: FloatArray) -> tuple[float, float]:
        if not self._bogies:
            return float(freedoms[1]), float(freedoms[2])
        return (
            float(0.5 * (freedoms[2] + freedoms[3])),
            float((freedoms[0] - freedoms[1]) / self._track),
        )
