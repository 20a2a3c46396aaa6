# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The model that the authors of the CMU rows publish with them, written anew for comparison.

Source: robomechanics/3d-terramechanics (MIT), commit 55a6e92, ``terramechanics/run_model.m`` with
the trench off, the side wall after Wong, soil ``K10_mini_smooth`` and the four angles that
``trench_off_smooth.mat`` has for each slip angle (tuned by them on all these rows). The
lateral force is positive against the wheel's sideways motion.
"""

from __future__ import annotations

from math import cos, pi, radians, sin, tan
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.arrays import FloatArray

RADIUS, WIDTH = 0.058, 0.050  # [m]
STIFFNESS, COHESION, SHEAR_MODULUS = 8e6, 1000.0, 0.021  # [Pa/m^N], [Pa], [m]
EXPONENT, DRIVING_GROWTH, SKID_GROWTH = 1.46, 0.01, 0.55  # [-]
WEIGHT, FRICTION = 1330.0 * 9.8, radians(29.0)  # [N/m^3], [rad]
WEDGE = pi / 4 - FRICTION / 2  # [rad]
NODES = 101
# Slip angle [deg]: peak a0 + a1 s and leaving angle b0 + b1 s, as shares of the entrance angle.
ANGLES = {
    0: (0.4120, 0.4546, -0.2243, -0.0070),
    15: (0.4481, 0.4266, -0.2379, -0.0003),
    30: (0.6156, 0.1908, -0.1648, -0.1627),
    45: (0.6727, 0.1562, -0.1902, -0.2216),
    60: (0.7642, 0.1161, -0.3597, -0.1262),
    75: (0.8401, 0.0935, -0.5193, -0.1141),
    90: (0.9189, 0.0622, -0.9997, -0.0002),
}


class Motion(NamedTuple):
    """Speeds of one row, and the angles that a skidding wheel keeps from slip 0."""

    slip_angle: int  # [deg]
    speed: float  # [m/s]
    rim_speed: float  # [m/s]
    kept: tuple[float, float] | None = None  # peak and leaving angle [rad]

    @property
    def slip(self) -> float:
        """Slip ratio by the whole speed of the hub."""
        return (self.rim_speed - self.speed) / max(self.rim_speed, self.speed)


def angles(sinkage: float, motion: Motion) -> tuple[float, float, float]:
    """Return entrance, peak and leaving angle [rad]."""
    entrance = float(np.arccos(1.0 - sinkage / RADIUS))
    if motion.slip < 0.0 and motion.kept is not None:
        return entrance, *motion.kept
    a0, a1, b0, b1 = ANGLES[motion.slip_angle]
    return entrance, entrance * (a0 + a1 * motion.slip), entrance * (b0 + b1 * motion.slip)


def forces(sinkage: float, motion: Motion) -> tuple[float, float, float]:
    """Return load, pull and lateral force [N]; no load where the peak lies before the entry."""
    tf, tm, tr = angles(sinkage, motion)
    if tm >= tf:
        return 0.0, 0.0, 0.0
    s, t = motion.slip, np.linspace(tr, tf, NODES)
    exponent = EXPONENT + (DRIVING_GROWTH * s if s >= 0.0 else -SKID_GROWTH * s)
    mirrored = np.where(t >= tm, t, tf - (t - tr) / (tm - tr) * (tf - tm))
    height = np.maximum(RADIUS * (np.cos(mirrored) - cos(tf)), 0.0)
    normal = STIFFNESS * height**exponent
    along, across = _shear(t, tf, motion)
    strength = COHESION + normal * tan(FRICTION)
    along, across = strength * along, strength * across
    flank = RADIUS * np.cos(t) * _side_wall(t, tf, tr, motion.slip_angle)
    step = t[1] - t[0]  # their sum: every node but the first
    area = RADIUS * WIDTH * step
    return (
        area * float(np.sum((normal * np.cos(t) + along * np.sin(t))[1:])),
        area * float(np.sum((along * np.cos(t) - normal * np.sin(t))[1:])),
        area * float(np.sum(across[1:])) + step * float(np.sum(flank[1:])),
    )


def _shear(t: FloatArray, tf: float, motion: Motion) -> tuple[FloatArray, FloatArray]:
    """Return mobilised shares along and across."""
    beta, rim = radians(motion.slip_angle), motion.rim_speed
    vx, vy, w = motion.speed * cos(beta), motion.speed * sin(beta), max(rim, 1e-9) / RADIUS
    if motion.slip >= 0.0:
        moved = RADIUS * (tf - t) - (np.sin(tf) - np.sin(t)) * vx / w
        speed = rim - vx * np.cos(t)
    else:
        t0 = tf + motion.slip * tf / 2.0
        swept = (sin(tf) - sin(t0)) / (tf - t0)
        ahead = vx / w * ((tf - t) * swept - (np.sin(tf) - np.sin(t)))
        behind = RADIUS * (t0 - t) - (np.sin(t0) - np.sin(t)) * vx / w
        moved = np.where(t > t0, ahead, behind)
        speed = np.where(t > t0, swept * vx, rim) - vx * np.cos(t)
    aside = (tf - t) * vy / w
    share = -np.expm1(-np.hypot(moved, aside) / SHEAR_MODULUS)
    fastest = np.maximum(np.hypot(speed, vy), 1e-12)
    return share * speed / fastest, share * vy / fastest


def _side_wall(t: FloatArray, tf: float, tr: float, slip_angle: int) -> FloatArray:
    """Return the push on the flank per length [N/m], already turned by the slip angle twice."""
    line = (np.sin(t) - sin(tr)) / (sin(tf) - sin(tr)) * (cos(tr) - cos(tf))
    depth = np.minimum(2.0 * RADIUS * np.cos(t), RADIUS * (line - cos(tr) + np.cos(t)))
    cot = 1.0 / tan(WEDGE)
    weight = 0.5 * WEIGHT * depth**2 * cot**2 * (1.0 + 0.5 * cot * tan(FRICTION))
    push = (weight + 2.0 * depth * COHESION * cot) * sin(radians(slip_angle)) ** 2
    push[np.abs(t) > pi / 2] = 0.0
    push[[0, -1]] = 0.0
    return np.asarray(push)


def sinkage_under(load: float, motion: Motion) -> float:
    """Return the sinkage that carries a load [m], to 1.5 radii as theirs."""
    low, high = 1e-4, 1.5 * RADIUS
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if forces(middle, motion)[0] < load else (low, middle)
    return middle


def predict(
    slip_angle: NDArray[np.int_], speed: FloatArray, rim_speed: FloatArray, load: FloatArray
) -> FloatArray:
    """Return (N, 3) sinkage [m], pull, lateral force [N]."""
    found = []
    for angle, v, rim, weight in zip(slip_angle.tolist(), speed, rim_speed, load, strict=True):
        rolling = Motion(angle, float(v), float(v))
        _, peak, leaving = angles(sinkage_under(float(weight), rolling), rolling)
        motion = Motion(angle, float(v), float(rim), (peak, leaving))
        sinkage = sinkage_under(float(weight), motion)
        found.append((sinkage, *forces(sinkage, motion)[1:]))
    return np.array(found)
