# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Where the discs of bed, walls and wheel are, before the engine sees them.

Frame: x up the slope, y normal to it, the floor at y = 0, the low end wall at x = 0.
"""

from __future__ import annotations

import math

import numpy as np

from wheel_terra_lab.soilbin.case import Bed, BinWheel, Case

WALL_HEIGHT = 0.3  # [m], well above the bed: grains must not leave on a steep slope
LUG_DISC = 0.0025  # [m], Table 5


def row_counts(bed: Bed) -> list[int]:
    """Return the discs of each row: staggered rows, the odd ones one disc shorter.

    28 rows of 250 and 249 give the paper's 6986 elements, 40 rows its 9980, and 40 rows
    in a bin of 1.6 m its 15980 (inferred from the counts, not stated there).
    """
    rows = max(1, round(bed.rows / bed.grain_scale))
    full = int(bed.length / (bed.pitch * bed.grain_scale) + 1e-6)
    return [full - row % 2 for row in range(rows)]


def regolith_density(depth: np.ndarray) -> np.ndarray:
    """Return the density [kg/m^3] at a depth [m] (Nakashima et al. 2010, equation 6)."""
    depth_cm = 100 * np.asarray(depth)
    return 1890.0 * (depth_cm + 1.69) / (depth_cm + 2.9)


def bed_discs(case: Case) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return centres (n, 2) [m], diameters (n,) [m] and masses (n,) [kg] before settling."""
    bed = case.bed
    random = np.random.default_rng(bed.seed)
    pitch = bed.pitch * bed.grain_scale
    counts = row_counts(bed)
    rise = pitch * math.sqrt(3) / 2
    if bed.arrangement == 'random':
        rise = pitch * 1.1  # loose rows, shaken below: no lattice is left after the fall
    x = np.concatenate([(np.arange(n) + 0.5 * (1 + k % 2)) * pitch for k, n in enumerate(counts)])
    y = np.concatenate([np.full(n, 0.5 * pitch + k * rise) for k, n in enumerate(counts)])
    diameters = random.choice(case.grain_diameters, size=x.size)
    if bed.arrangement == 'random':
        slack = 0.5 * (pitch - diameters)
        x = x + random.uniform(-1, 1, x.size) * slack
        y = y + random.uniform(-1, 1, x.size) * (slack + 0.05 * pitch)
    if case.grains.density > 0:
        density = np.full(x.size, case.grains.density)
    else:
        density = regolith_density(y.max() - y)
    mass = density * case.wheel.width * math.pi / 4 * diameters**2
    return np.column_stack([x, y]), diameters, mass


def wall_discs(case: Case) -> tuple[np.ndarray, float]:
    """Return centres (n, 2) [m] of floor and end walls, and their diameter [m]."""
    diameter = LUG_DISC * case.bed.grain_scale
    length = case.bed.length
    along = np.arange(0.5 * diameter, length, diameter)
    up = np.arange(-0.5 * diameter, WALL_HEIGHT, diameter)
    floor = np.column_stack([along, np.full(along.size, -0.5 * diameter)])
    low = np.column_stack([np.full(up.size, -0.5 * diameter), up])
    high = np.column_stack([np.full(up.size, length + 0.5 * diameter), up])
    return np.concatenate([floor, low, high]), diameter


def lug_discs(wheel: BinWheel, phase: float) -> np.ndarray:
    """Return centres (n, 2) [m] of the lug discs about the axle; one lug points to `phase`.

    Each lug is a block of discs of 2.5 mm: 2 x 4 for a lug of 5 x 10 mm.
    """
    across = max(1, round(wheel.lug_thickness / LUG_DISC))
    up = max(1, round(wheel.lug_height / LUG_DISC))
    radial = wheel.rim_radius + (np.arange(up) + 0.5) * wheel.lug_height / up
    lateral = (np.arange(across) - 0.5 * (across - 1)) * LUG_DISC
    radial, lateral = (grid.ravel() for grid in np.meshgrid(radial, lateral))
    angle = phase + 2 * math.pi * np.arange(wheel.lug_count)[:, None] / max(1, wheel.lug_count)
    x = radial * np.cos(angle) - lateral * np.sin(angle)
    y = radial * np.sin(angle) + lateral * np.cos(angle)
    return np.column_stack([x.ravel(), y.ravel()])


def touching_height(
    start: float, rim_radius: float, lugs: np.ndarray, centres: np.ndarray, radii: np.ndarray
) -> float:
    """Return the axle height [m] at which the wheel just touches the bed.

    Parameters: axle position along the bed [m], rim radius [m], lug disc centres about the
    axle (n, 2) [m], grain centres (m, 2) [m] and radii (m,) [m].
    """
    heights = [-math.inf]
    elements = [((0.0, 0.0), rim_radius), *((tuple(lug), 0.5 * LUG_DISC) for lug in lugs)]
    for (x, y), radius in elements:
        reach = radii + radius
        offset = centres[:, 0] - (start + x)
        near = np.abs(offset) < reach
        if near.any():
            rise = np.sqrt(reach[near] ** 2 - offset[near] ** 2)
            heights.append(float(np.max(centres[near, 1] + rise)) - y)
    return max(heights)


def surface_height(centres: np.ndarray, radii: np.ndarray, low: float, high: float) -> float:
    """Return the mean height [m] of the bed's surface between two positions along it [m]."""
    width = 4 * float(np.mean(radii))
    edges = np.arange(low, high + width, width)
    column = np.digitize(centres[:, 0], edges)
    top = centres[:, 1] + radii
    tops = [top[column == k].max() for k in range(1, edges.size) if (column == k).any()]
    return float(np.mean(tops))
