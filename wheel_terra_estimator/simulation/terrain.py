# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Ground of the simulated drive: slope along x, side slope along y, soil that changes in both.

Coordinates lie in the surface: x is the distance along the main direction, y to its left [m].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wheel_terra_estimator.arrays import FloatArray

GRID = 0.02
"""Distance of the kept points of slope, height and soil variation [m]."""


@dataclass(frozen=True)
class Patch:
    """A rectangle of ground whose soil differs from the base soil by factors."""

    # ``start``, ``end``: extent along x [m]
    start: float
    end: float
    # ``right``, ``left``: extent along y [m]
    right: float
    left: float
    factors: dict[str, float]  # factor for each soil quantity named in ``SOIL_QUANTITIES``


SOIL_QUANTITIES = ('stiffness', 'cohesion', 'friction', 'shear_modulus', 'slip_sinkage')
"""Factors of a patch or a variation; ``friction`` scales the tangent of the friction angle."""


def smooth_noise(random: np.random.Generator, count: int, correlation_length: float) -> FloatArray:
    """Return ``count`` grid values of a unit normal process with the given correlation length."""
    width = max(correlation_length / GRID, 1.0)
    reach = int(4 * width)
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / width) ** 2)
    kernel /= np.sqrt((kernel**2).sum())
    return np.convolve(random.standard_normal(count + 2 * reach), kernel, mode='valid')


@dataclass(frozen=True)
class Ground:
    """What a terrain is made of."""

    # ``slope_position``, ``slope_angle``: (k,) knots of the slope along x [m], [rad], positive
    # uphill; linear between
    slope_position: FloatArray
    slope_angle: FloatArray
    side_slope: float  # slope along y [rad], positive when the left side is higher
    patches: list[Patch]  # later ones lie over earlier ones
    border: float  # length over which the soil changes at the border of a patch [m]
    base_factors: dict[str, float]  # of the whole ground (the error of the nominal soil)
    # Standard deviation [rad] and correlation length [m] of the slope's unevenness
    undulation: float
    undulation_length: float
    # Standard deviation of the logarithm and correlation length [m] of the stiffness, drawn for the
    # left and the right half of the ground
    patchiness: float
    patchiness_length: float
    extent: tuple[float, float]  # least and greatest x [m]; beyond, the values of the ends hold


class Terrain:
    """Slope, height and soil factors at any point; ``random`` draws the unevenness."""

    def __init__(self, ground: Ground, random: np.random.Generator) -> None:
        self._x = np.arange(ground.extent[0], ground.extent[1] + GRID, GRID)
        slope = np.interp(self._x, ground.slope_position, ground.slope_angle)
        slope += ground.undulation * smooth_noise(random, slope.size, ground.undulation_length)
        self._sin_slope = np.sin(slope)
        height = np.cumsum(self._sin_slope) * GRID
        self._height = height - np.interp(0.0, self._x, height)
        self._patchiness = ground.patchiness * np.stack(
            [smooth_noise(random, slope.size, ground.patchiness_length) for _ in range(2)]
        )
        self.sine_of_side_slope = float(np.sin(ground.side_slope))  # along y
        self._patches = ground.patches
        self._border = ground.border
        self._base = np.array([ground.base_factors.get(name, 1.0) for name in SOIL_QUANTITIES])

    def sine_of_slope(self, x: FloatArray) -> FloatArray:
        """Return the sine of the slope along x at ``x``."""
        return np.interp(x, self._x, self._sin_slope)

    def height(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the height of the surface [m]."""
        beyond = np.where(
            x < self._x[0],
            (x - self._x[0]) * self._sin_slope[0],
            np.where(x > self._x[-1], (x - self._x[-1]) * self._sin_slope[-1], 0.0),
        )
        return np.interp(x, self._x, self._height) + beyond + self.sine_of_side_slope * y

    def soil_factors(self, x: FloatArray, y: FloatArray) -> dict[str, FloatArray]:
        """Return the factor of each of ``SOIL_QUANTITIES`` at the points, shape of ``x``."""
        logarithms = np.zeros((len(SOIL_QUANTITIES), x.size))
        for patch in self._patches:
            inside = (
                self._step(x - patch.start)
                * self._step(patch.end - x)
                * self._step(y - patch.right)
                * self._step(patch.left - y)
            )
            there = np.log([patch.factors.get(name, 1.0) for name in SOIL_QUANTITIES])
            logarithms += inside * (there[:, None] - logarithms)
        left = np.interp(x, self._x, self._patchiness[0])
        right = np.interp(x, self._x, self._patchiness[1])
        logarithms[0] += np.where(y > 0.0, left, right)
        factors = self._base[:, None] * np.exp(logarithms)
        return dict(zip(SOIL_QUANTITIES, factors, strict=True))

    def _step(self, distance: FloatArray) -> FloatArray:
        """Rise smoothly from 0 to 1 over the width of a border around ``distance`` = 0."""
        part = np.clip(0.5 + distance / self._border, 0.0, 1.0)
        return part * part * (3.0 - 2.0 * part)
