# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Soils of simulator C and where they lie: borders at an angle, random fields, stones, ruts.

A soil is described by bearing capacity factors (Terzaghi, Vesic) instead of the moduli of Bekker:
``p(d) = f [(c Nc + b rho g Ng / 2)(1 - exp(-d/d0)) + rho g d Nq]`` below a strip of width b.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Ground:
    """Properties of the ground; numbers, or (n,) arrays with one entry per wheel."""

    cohesion: FloatArray | float  # c [Pa]
    friction: FloatArray | float  # tangent of the angle of internal friction [-]
    density: FloatArray | float  # rho [kg/m^3]
    bearing: FloatArray | float  # f, bearing strength over that of general shear failure [-]
    settling: FloatArray | float  # d0, depth over which bearing strength is mobilised [m]
    shear_length: FloatArray | float  # K, sliding over which shear strength is mobilised [m]
    residual: FloatArray | float  # shear strength after long sliding over its peak [-]
    softening: FloatArray | float  # share of the bearing pressure lost in sheared soil [-]
    rebound: FloatArray | float  # stiffness of unloading over the secant one of loading [-]
    digging: FloatArray | float  # soil thrown out, as a share of what lugs could carry off [-]
    heave: FloatArray | float  # soil heaped up behind the wheel, likewise [-]
    ploughing: FloatArray | float  # resistance ahead, as a share of passive earth pressure [-]

    def logarithms(self) -> FloatArray:
        """Return the logarithms of all properties, in the order of the fields."""
        return np.log(np.array([getattr(self, f.name) for f in fields(self)], dtype=float))

    @classmethod
    def from_logarithms(cls, values: FloatArray) -> Ground:
        """Return the ground of (fields, ...) logarithms."""
        return cls(*np.exp(values))


HARD = Ground(20.0, 0.85, 2000.0, 25.0, 0.05, 0.0006, 0.95, 0.001, 1.1, 1e-4, 1e-4, 1e-4)
"""Asphalt or rock under a rubber tyre; all compliance of the tyre is in the ground."""


def draw_soil(rng: np.random.Generator) -> Ground:
    """Return a natural soil from loose dry sand to loam."""
    loose = rng.uniform()  # 0 dense, 1 loose
    angle = np.radians(rng.uniform(34.0, 44.0) - 12.0 * loose)
    cohesion = np.exp(rng.uniform(np.log(60.0), np.log(2500.0))) * (1.0 - 0.5 * loose)
    return Ground(
        cohesion=float(cohesion),
        friction=float(np.tan(angle)),
        density=float(rng.uniform(1650.0, 1900.0) - 400.0 * loose),
        bearing=float(np.exp(rng.uniform(np.log(0.5), np.log(1.2)) - 0.7 * loose)),
        settling=float(np.exp(rng.uniform(np.log(0.004), np.log(0.012)) + 0.9 * loose)),
        shear_length=float(np.exp(rng.uniform(np.log(0.004), np.log(0.015)) + 0.7 * loose)),
        residual=float(rng.uniform(0.72, 0.9) + 0.1 * loose),
        softening=float(rng.uniform(0.05, 0.3) + 0.1 * loose),
        rebound=float(np.exp(rng.uniform(np.log(8.0), np.log(25.0)))),
        digging=float(rng.uniform(0.15, 0.7) + 0.2 * loose),
        heave=float(rng.uniform(0.1, 1.3)),
        ploughing=float(rng.uniform(0.05, 0.3)),
    )


def draw_soft_soil(rng: np.random.Generator, firm: Ground) -> Ground:
    """Return what the soil of a soft patch tends to: fluffy, weak in bearing and in shear."""
    return Ground(
        cohesion=float(min(rng.uniform(20.0, 150.0), 0.5 * float(firm.cohesion))),
        friction=float(firm.friction) * rng.uniform(0.62, 0.8),
        density=float(firm.density) * rng.uniform(0.75, 0.9),
        bearing=float(firm.bearing) * rng.uniform(0.4, 0.7),
        settling=float(firm.settling) * rng.uniform(1.3, 2.2),
        shear_length=float(firm.shear_length) * rng.uniform(1.3, 2.5),
        residual=float(rng.uniform(0.85, 0.98)),
        softening=float(rng.uniform(0.3, 0.5)),
        rebound=float(rng.uniform(15.0, 35.0)),
        digging=float(rng.uniform(0.4, 0.9)),
        heave=float(rng.uniform(0.3, 0.9)),
        ploughing=float(rng.uniform(0.2, 0.5)),
    )


def bearing_terms(
    ground: Ground, width: FloatArray | float, gravity: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return capacity at the surface [Pa], its growth with depth [Pa/m] and ``settling`` [m]."""
    tangent = np.asarray(ground.friction, dtype=float)
    nq = np.exp(np.pi * tangent) * (tangent + np.hypot(1.0, tangent)) ** 2
    weight = np.asarray(ground.density) * gravity
    capacity = np.asarray(ground.cohesion) * (nq - 1.0) / tangent
    capacity = capacity + weight * width * (nq + 1.0) * tangent  # Vesic: Ng = 2 (Nq + 1) tan phi
    factor = np.asarray(ground.bearing)
    return factor * capacity, factor * weight * nq, np.asarray(ground.settling, dtype=float)


def pressure(terms: tuple[FloatArray, FloatArray, FloatArray], depth: FloatArray) -> FloatArray:
    """Return the bearing pressure [Pa] at a depth [m] of virgin loading."""
    capacity, growth, settling = terms
    return np.asarray(capacity * -np.expm1(-depth / settling) + growth * depth)


@dataclass(frozen=True)
class Patch:
    """Soft ground between two parallel borders that need not be square to the way.

    ``start`` and ``length`` are measured along the normal of the borders, ``angle`` turns it to
    the left; ``ramp`` is the width of the first border, over which the ground changes [m].
    """

    start: float
    length: float
    angle: float = 0.0
    ramp: float = 0.03
    amount: float = 1.0  # 0: none, 1: all of the soft soil, above: softer than that

    def share(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return how much of the patch's soil there is at places."""
        along = x * np.cos(self.angle) + y * np.sin(self.angle) - self.start
        rising = _smooth(along / self.ramp)
        falling = _smooth((along - self.length) / min(self.ramp, 0.3))
        return np.asarray(self.amount * (rising - falling))


def _smooth(u: FloatArray) -> FloatArray:
    u = np.clip(u, 0.0, 1.0)
    return np.asarray(u * u * (3.0 - 2.0 * u))


class RandomField:
    """A Gaussian field of unit variance: a sum of plane waves of random length and direction."""

    def __init__(self, rng: np.random.Generator, shortest: float, longest: float) -> None:
        waves = 24
        length = np.exp(rng.uniform(np.log(shortest), np.log(longest), waves))
        heading = rng.uniform(0.0, 2.0 * np.pi, waves)
        self._kx = 2.0 * np.pi / length * np.cos(heading)
        self._ky = 2.0 * np.pi / length * np.sin(heading)
        self._phase = rng.uniform(0.0, 2.0 * np.pi, waves)
        self._gain = np.sqrt(2.0 / waves)

    def at(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the field at places (...,)."""
        phase = np.multiply.outer(x, self._kx) + np.multiply.outer(y, self._ky) + self._phase
        return np.asarray(self._gain * np.cos(phase).sum(axis=-1))


@dataclass(frozen=True)
class Stone:
    """A smooth stone on the way of one wheel; with negative height, a hole."""

    x: float
    y: float
    height: float
    length: float  # half of it, along and across [m]

    def share(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return 0 beside the stone, 1 on its top."""
        distance = np.hypot(x - self.x, y - self.y) / self.length
        return _smooth(1.0 - distance)


@dataclass
class Land:
    """All that the wheels meet: heights and properties by place; ruts are kept as they form."""

    base: Ground
    soft: Ground
    rng: np.random.Generator
    slope: float = 0.0  # tangent, uphill along x behind `slope_start`
    slope_start: float = 0.0
    slope_ramp: float = 1.0
    cross_slope: float = 0.0  # tangent, rising to the left
    roughness: float = 0.003  # of the height [m]
    variation: float = 0.1  # of the logarithm of the strength
    patch: Patch | None = None
    stones: tuple[Stone, ...] = ()
    hard: bool = False
    cell: float = 0.05
    _ruts: dict[tuple[int, int], float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._height_field = RandomField(self.rng, 0.6, 4.0)
        self._strength_field = RandomField(self.rng, 0.3, 5.0)
        self._shear_field = RandomField(self.rng, 0.5, 8.0)
        self._logs = [g.logarithms()[:, None] for g in (self.base, self.soft, HARD)]

    def height(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the height of the undisturbed ground [m]."""
        run = np.clip(x - self.slope_start, 0.0, None)
        ramp = self.slope_ramp
        rise = np.where(run < ramp, run**2 / (2.0 * ramp), run - 0.5 * ramp)
        total = self.slope * rise + self.cross_slope * y
        total = total + self.roughness * self._height_field.at(x, y)
        for stone in self.stones:
            total = total + stone.height * stone.share(x, y)
        return np.asarray(total)

    def at(self, x: FloatArray, y: FloatArray) -> Ground:
        """Return the properties of the ground below wheels (n,)."""
        base, soft, hard = self._logs
        if self.hard:
            return Ground.from_logarithms(np.repeat(hard, len(x), axis=1))
        share = self.patch.share(x, y) if self.patch else np.zeros(len(x))
        values = base + share * (soft - base)
        values[3] += 2.0 * self.variation * self._strength_field.at(x, y)
        values[1] += 0.5 * self.variation * self._shear_field.at(x, y)
        values[0] += 2.0 * self.variation * self._shear_field.at(x, y)
        for stone in self.stones:
            if stone.height > 0.0:
                values += _smooth(4.0 * stone.share(x, y)) * (hard - values)
        return Ground.from_logarithms(values)

    def rut(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the depth of the ruts at places (n,) [m]."""
        keys = zip(
            (x // self.cell).astype(int).tolist(),
            (y // self.cell).astype(int).tolist(),
            strict=True,
        )
        return np.array([self._ruts.get(key, 0.0) for key in keys])

    def leave_rut(self, x: FloatArray, y: FloatArray, depth: FloatArray) -> None:
        """Keep the ruts that wheels have left at places (n,)."""
        ruts = self._ruts
        keys = zip(
            (x // self.cell).astype(int).tolist(),
            (y // self.cell).astype(int).tolist(),
            strict=True,
        )
        for key, value in zip(keys, depth.tolist(), strict=True):
            if value > ruts.get(key, 0.0):
                ruts[key] = value
