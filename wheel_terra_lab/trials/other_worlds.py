# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Two wheels whose soil shares no closure with the package: nothing of its catalogue is the truth.

``hump``: a bearing pressure that saturates with depth (form of Kacigin and Guskov 1968), one smooth
bell of normal stress between entrance and exit, and shear that rises to a hump and falls to a
residual strength (Wong and Preston-Thomas 1983). ``resistive``: granular resistive force theory,
plates that are pushed through a bed, each with a stress that grows with depth and depends on its
attitude and direction (Li, Zhang and Goldman 2013, doi 10.1126/science.1229163, table S2).

Both take slip as recorded at the tips of the lugs and give sinkage of the rim, pull and torque.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wheel_terra_lab.trials.truth import FloatArray, Rows, TrueSoil, v_over_w

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(48)
_HALVINGS = 40
_DEEPEST = 1.3  # entrance angle up to which a balance is looked for [rad]

# Generic coefficients of the resistive stresses: cos and sin of 2 pi (m beta/pi + n gamma/2 pi).
_A = {(0, 0): 0.206, (1, 0): 0.169}
_B = {(1, 1): 0.212, (0, 1): 0.358, (-1, 1): 0.055}
_C = {(1, 1): -0.124, (0, 1): 0.253, (-1, 1): 0.007}
_D = {(1, 0): 0.088}


@dataclass(frozen=True)
class World:
    """A truth model: the soil that plate and shear tests in it would give, and its wheel."""

    soil: Callable[[np.random.Generator], tuple[TrueSoil, object]]
    solve: Callable[[Rows, object], Rows]


@dataclass(frozen=True)
class HumpSoil:
    """Bearing strength [Pa] and stiffness [Pa/m], peak and residual friction, distances [m]."""

    strength: float
    stiffness: float
    peak: float
    residual: float
    hump: float
    cohesion: float
    exit_share: float


@dataclass(frozen=True)
class ResistiveSoil:
    """Scale of the resistive stresses [Pa/m] and the share of the rim behind the hub in contact."""

    scale: float
    exit_share: float


def resistive_stress(
    beta: FloatArray,  # attitude of the plate from the horizontal, in -pi/2..pi/2 [rad]
    gamma: FloatArray,  # direction of its motion, positive into the bed, in -pi/2..pi/2 [rad]
) -> tuple[FloatArray, FloatArray]:
    """Return horizontal and vertical stress per depth, at a scale of 1 [N/cm^3 in the source]."""

    def phase(m: int, n: int) -> FloatArray:
        return 2.0 * np.pi * (m * beta / np.pi + n * gamma / (2.0 * np.pi))

    up = sum((a * np.cos(phase(*k)) for k, a in _A.items()), np.zeros_like(beta))
    up = sum((b * np.sin(phase(*k)) for k, b in _B.items()), up)
    back = sum((c * np.cos(phase(*k)) for k, c in _C.items()), np.zeros_like(beta))
    back = sum((d * np.sin(phase(*k)) for k, d in _D.items()), back)
    return back, up


def _resistive_forces(
    t1: float, row: dict[str, float], soil: ResistiveSoil
) -> tuple[float, float, float]:
    """Load, pull and torque of a rim of plates with entrance angle t1."""
    radius, advance = row['wheel_radius'], row['advance']
    t2 = -soil.exit_share * t1
    theta = 0.5 * (t1 + t2) + 0.5 * (t1 - t2) * _NODES
    depth = radius * (np.cos(theta) - np.cos(t1))
    # Velocity per wheel rate: x forward, z up; the plate lies along the tangent of the rim.
    across = advance - radius * np.cos(theta)
    down = -(-radius * np.sin(theta))
    gamma = np.arctan2(down, np.abs(across))
    # Towards +x the plate's front is its right side: mirrored where it moves back.
    side = np.sign(across)
    beta = np.clip(-side * theta, -0.5 * np.pi, 0.5 * np.pi)
    back, up = resistive_stress(beta, gamma)
    along = -side * back * soil.scale * depth
    lift = up * soil.scale * depth
    area = 0.5 * (t1 - t2) * _WEIGHTS * radius * row['wheel_width']
    load, pull = float(area @ lift), float(area @ along)
    torque = float(area @ (radius * (along * np.cos(theta) + lift * np.sin(theta))))
    return load, pull, torque


def hump_share(way: FloatArray, residual: float) -> FloatArray:
    """Share of the peak strength at a shear displacement in units of the hump's: 1 at 1."""
    rise = 1.0 + (1.0 / (residual * (1.0 - np.exp(-1.0))) - 1.0) * np.exp(1.0 - way)
    return np.asarray(residual * rise * (1.0 - np.exp(-way)))


def _hump_forces(t1: float, row: dict[str, float], soil: HumpSoil) -> tuple[float, float, float]:
    """Load, pull and torque of a wheel under one bell of normal stress."""
    radius, advance = row['wheel_radius'], row['advance']
    t2 = -soil.exit_share * t1
    theta = 0.5 * (t1 + t2) + 0.5 * (t1 - t2) * _NODES
    depth = radius * (1.0 - np.cos(t1))
    greatest = soil.strength * np.tanh(soil.stiffness * depth / soil.strength)
    place = (theta - t2) / (t1 - t2)
    normal = greatest * np.sin(np.pi * place) ** 1.3 * (0.8 + 0.4 * place)
    slid = radius * (t1 - theta) - advance * (np.sin(t1) - np.sin(theta))
    way = np.abs(slid) / soil.hump
    shear = (soil.cohesion + normal * soil.peak) * hump_share(way, soil.residual / soil.peak)
    shear = shear * np.sign(slid)
    area = 0.5 * (t1 - t2) * _WEIGHTS * radius * row['wheel_width']
    load = float(area @ (normal * np.cos(theta) + shear * np.sin(theta)))
    pull = float(area @ (shear * np.cos(theta) - normal * np.sin(theta)))
    return load, pull, float(area @ shear) * radius


def _solved(forces: Callable[..., tuple[float, float, float]]) -> Callable[[Rows, object], Rows]:
    def solve(rows: Rows, soil: object) -> Rows:
        tip = rows['wheel_radius'] + rows['lug_height']
        columns = {**rows, 'advance': v_over_w(rows['slip'], tip)}
        found = []
        for k, load in enumerate(rows['normal_load']):
            row = {key: float(values[k]) for key, values in columns.items()}
            low, high = 1e-3, _DEEPEST
            if forces(high, row, soil)[0] < load:
                found.append((np.nan, np.nan, np.nan))
                continue
            for _ in range(_HALVINGS):
                middle = 0.5 * (low + high)
                carried = forces(middle, row, soil)[0]
                low, high = (middle, high) if carried < load else (low, middle)
            _, pull, torque = forces(low, row, soil)
            found.append((row['wheel_radius'] * (1.0 - np.cos(low)), pull, torque))
        sinkage, pull, torque = np.array(found).T
        return {'sinkage': sinkage, 'drawbar_pull': pull, 'torque': torque}

    return solve


def _hump_soil(rng: np.random.Generator) -> tuple[TrueSoil, object]:
    stiffness = float(np.exp(rng.uniform(np.log(6e5), np.log(2.5e6))))
    peak, share = float(np.tan(np.radians(rng.uniform(30, 40)))), float(rng.uniform(0.6, 0.85))
    hump, exit_share = float(rng.uniform(0.006, 0.02)), float(rng.uniform(0.1, 0.35))
    cohesion = float(rng.uniform(100, 600))
    strength = float(rng.uniform(15e3, 40e3))
    truth = HumpSoil(strength, stiffness, peak, share * peak, hump, cohesion, exit_share)
    # A plate test to 30 mm read as k z^n, a shear box read as Janosi's law.
    z = np.linspace(0.003, 0.03, 12)
    exponent, logarithm = np.polyfit(
        np.log(z), np.log(strength * np.tanh(stiffness * z / strength)), 1
    )
    return TrueSoil(
        frictional_modulus=float(np.exp(logarithm)),
        sinkage_exponent=float(exponent),
        friction_angle=float(np.arctan(0.5 * (1.0 + share) * peak)),
        shear_modulus=0.5 * hump,
        cohesion=cohesion,
        peak_stress_ratio=0.42,
        leaving_angle_ratio=-exit_share,
        cohesive_modulus=1e3,
    ), truth


def _resistive_soil(rng: np.random.Generator) -> tuple[TrueSoil, object]:
    truth = ResistiveSoil(float(np.exp(rng.uniform(np.log(8e5), np.log(4e6)))), 0.25)
    _, up = resistive_stress(np.zeros(1), np.full(1, 0.5 * np.pi))
    return TrueSoil(
        frictional_modulus=float(up[0]) * truth.scale,  # a flat plate pushed straight down
        sinkage_exponent=1.0,
        friction_angle=float(np.radians(rng.uniform(26, 33))),
        shear_modulus=float(rng.uniform(0.005, 0.015)),
        cohesion=100.0,
        peak_stress_ratio=0.42,
        leaving_angle_ratio=-truth.exit_share,
        cohesive_modulus=1e3,
    ), truth


WORLDS = {
    'hump': World(_hump_soil, _solved(_hump_forces)),
    'resistive': World(_resistive_soil, _solved(_resistive_forces)),
}
