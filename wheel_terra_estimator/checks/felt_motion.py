# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Starts, stops and curves of the wheels as the accelerometer feels them: which way it points."""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.checks.evidence import Evidence
from wheel_terra_estimator.checks.statistics import (
    DRIFT,
    Estimate,
    block_fit,
    moving_mean,
    without_drift,
)

Complex: TypeAlias = NDArray[np.complex128]

LEAST_YAW = math.radians(12.0)  # yaw that starts and stops tell, at least [rad]
YAW_SIGMAS = 4.0
FELT = (
    0.4,
    2.5,
)  # what is felt along an axis over what wheels and gyro say; else it is another [-]
FELT_BLOCKS = 10  # parts of a drive that a deviation comes from


def _motions(evidence: Evidence, drift: float) -> tuple[Complex, Complex] | None:
    """Return what wheels and gyro say that is felt, and what is (k,) [m/s^2]; None without an IMU.

    Along x the acceleration of starts and stops, along y that of curves, as complex numbers; what
    changes more slowly than over ``drift`` [s] is the slope.
    """
    if evidence.force is None or evidence.gyro is None or evidence.time.size < 100:
        return None
    period = evidence.period
    width = max(round(0.4 / period), 1)
    speed = moving_mean(evidence.rim, width)
    curve = speed * moving_mean(evidence.gyro[:, 2], width)
    motion = without_drift(np.gradient(speed, period) + 1j * curve, period, drift)
    along, across = (moving_mean(column, width) for column in evidence.force[:, :2].T)
    seen = without_drift(along + 1j * across, period, drift)
    return motion, seen


def felt_senses(evidence: Evidence) -> list[int]:
    """Return how starts and curves are felt along x and y: 1 as wheels and gyro say, -1 against.

    0 is not clear. An IMU that is turned feels both alike; no rotation reverses one of them.
    """
    both = _motions(evidence, DRIFT)
    if both is None:
        return [0, 0]
    motion, seen = both
    pairs = (motion.real, seen.real), (motion.imag, seen.imag)
    fits = [block_fit(wheels[:, None], felt)[0] for wheels, felt in pairs]
    clear = [FELT[0] < abs(f.value) < FELT[1] and f.sigmas_from(0.0) > YAW_SIGMAS for f in fits]
    return [int(np.sign(f.value)) * there for f, there in zip(fits, clear, strict=True)]


def felt_yaw(evidence: Evidence, drift: float = DRIFT) -> Estimate | None:
    """Return the angle by which a motion is felt turned [rad]; None where it is not clear."""
    both = _motions(evidence, drift)
    if both is None:
        return None
    motion, seen = both
    energy = np.cumsum(np.abs(motion) ** 2)
    edges = np.searchsorted(energy, np.linspace(0.0, energy[-1], FELT_BLOCKS + 1)[1:-1])
    blocks = zip(np.split(motion, edges), np.split(seen, edges), strict=True)
    parts = np.array([np.vdot(wheels, felt) for wheels, felt in blocks])
    total = parts.sum()
    spread = float(np.linalg.norm(parts - total / parts.size))
    if not 0.5 * energy[-1] < abs(total) < 2.0 * energy[-1] or abs(total) < 3.0 * spread:
        return None
    aside = (parts * np.conj(total)).imag / abs(total) ** 2  # along it they differ without a turn
    return Estimate(float(np.angle(total)), float(np.linalg.norm(aside)))
