# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Ground of a drive: slopes along and across the course, soil that varies with place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


class RandomField:
    """A smooth random function of the place with mean 0: a sum of plane waves.

    `deviation` is that over the ground, `length` [m] the distance over which it typically changes.
    """

    _WAVES = 16

    def __init__(self, generator: np.random.Generator, deviation: float, length: float) -> None:
        heading = generator.uniform(0.0, 2.0 * np.pi, self._WAVES)
        number = generator.rayleigh(1.0 / length, self._WAVES)  # spectrum of a Gaussian hill
        self._kx, self._ky = number * np.cos(heading), number * np.sin(heading)
        self._phase = generator.uniform(0.0, 2.0 * np.pi, self._WAVES)
        self._height = deviation * np.sqrt(2.0 / self._WAVES)

    def at(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the values at places (any shape) [m]."""
        x, y = np.asarray(x)[..., None], np.asarray(y)[..., None]
        return np.asarray(
            self._height * np.cos(self._kx * x + self._ky * y + self._phase).sum(axis=-1)
        )


@dataclass(frozen=True)
class Patch:
    """A stretch of other soil: factors on stiffness, cohesion and tan phi, full after `border`."""

    start: float  # along the course [m]
    end: float
    stiffness: float = 1.0
    cohesion: float = 1.0
    friction: float = 1.0
    right: float = -np.inf  # from here
    left: float = np.inf  # to there across the course [m]
    border: float = 0.15  # [m]

    def share(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return 0 outside, 1 inside, in between at its start and end."""
        inside = np.minimum(x - self.start, self.end - x) / self.border
        return np.where((y >= self.right) & (y <= self.left), np.clip(inside, 0.0, 1.0), 0.0)


@dataclass(frozen=True)
class SoilFactors:
    """Factors on the soil of a drive under each wheel (n,)."""

    stiffness: FloatArray
    cohesion: FloatArray
    friction: FloatArray  # on tan phi


@dataclass(frozen=True)
class Ground:
    """Slopes and soil of a drive; x along the course, y to its left [m]."""

    slope_position: FloatArray  # (k,) along the course, increasing [m]
    slope_angle: FloatArray  # (k,) positive uphill along the course [rad]
    side_slope: float  # positive where the ground rises to the left [rad]
    undulation: RandomField  # [rad]
    stiffness: RandomField  # of the logarithm
    friction: RandomField  # of the logarithm of tan phi
    patches: tuple[Patch, ...] = ()

    def slopes(self, x: float, y: float, heading: float) -> tuple[float, float]:
        """Return the slope ahead (positive uphill) and to the left of a rover [rad]."""
        place = np.asarray(x), np.asarray(y)
        along = float(np.interp(x, self.slope_position, self.slope_angle))
        along += float(self.undulation.at(*place))
        cosine, sine = np.cos(heading), np.sin(heading)
        return (
            along * cosine + self.side_slope * sine,
            self.side_slope * cosine - along * sine,
        )

    def soil(self, x: FloatArray, y: FloatArray) -> SoilFactors:
        """Return the factors on the soil at places (n,)."""
        stiffness = np.exp(self.stiffness.at(x, y))
        friction = np.exp(self.friction.at(x, y))
        cohesion = np.ones_like(friction)
        for patch in self.patches:
            share = patch.share(x, y)
            stiffness = stiffness * patch.stiffness**share
            friction = friction * patch.friction**share
            cohesion = cohesion * patch.cohesion**share
        return SoilFactors(stiffness, cohesion, friction)
