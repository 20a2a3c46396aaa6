# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The plain ways that the package is timed against, written without any code of it."""

from __future__ import annotations

import math
from collections.abc import Collection
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.terramechanics.soil import Soil

STEEPEST_ENTRANCE = 1.4
"""Greatest entrance angle [rad] that the load balance looks at."""


def smooth_wheel(
    soil: Soil, radius: float, width: float, slip: float, load: float
) -> tuple[float, float, float]:
    """Return sinkage [m], drawbar pull [N], torque [N m] of a wheel without lugs.

    Adaptive quadrature (QUADPACK) of the stresses of Wong and Reece (1967) with the pressure law of
    Bekker and the shear law of Janosi and Hanamoto; the entrance angle by Brent's method. For a
    driving wheel, slip in [0, 1].
    """
    from scipy.integrate import quad
    from scipy.optimize import brentq

    stiffness = float(soil.cohesive_modulus / width + soil.frictional_modulus)
    exponent = float(soil.sinkage_exponent)
    tan_friction = math.tan(soil.friction_angle)

    def stresses(angle: float, entrance: float) -> tuple[float, float]:
        peak = float(soil.peak_stress_ratio) * entrance
        leaving = float(soil.leaving_angle_ratio) * entrance
        mirrored = angle
        if angle < peak:
            mirrored = entrance - (angle - leaving) / (peak - leaving) * (entrance - peak)
        depth = max(radius * (math.cos(mirrored) - math.cos(entrance)), 0.0)
        normal = stiffness * depth**exponent
        sheared = radius * (
            entrance - angle - (1.0 - slip) * (math.sin(entrance) - math.sin(angle))
        )
        strength = float(soil.cohesion) + normal * tan_friction
        return normal, strength * (1.0 - math.exp(-sheared / float(soil.shear_modulus)))

    def integral(entrance: float, part: Any) -> float:
        ends = (soil.leaving_angle_ratio * entrance, entrance)
        found = quad(
            lambda t: part(t, *stresses(t, entrance)), *ends,
            points=[soil.peak_stress_ratio * entrance],
        )  # fmt: skip
        return width * radius * float(found[0])

    def carried(entrance: float) -> float:
        return integral(entrance, lambda t, s, tau: s * math.cos(t) + tau * math.sin(t)) - load

    entrance = brentq(carried, 1e-4, STEEPEST_ENTRANCE)
    pull = integral(entrance, lambda t, s, tau: tau * math.cos(t) - s * math.sin(t))
    torque = radius * integral(entrance, lambda t, s, tau: tau)
    return radius * (1.0 - math.cos(entrance)), pull, torque


class PlainFilter:
    """A Kalman filter cycle in numpy: predict, one joint update in Joseph form, nothing else."""

    def __init__(self, mean: FloatArray, covariance: FloatArray) -> None:
        self.x, self.P = mean.copy(), covariance.copy()

    def predict(self, mean: FloatArray, F: FloatArray, Q: FloatArray) -> None:
        """Go to a predicted mean."""
        self.x = mean
        self.P = F @ self.P @ F.T + Q

    def update(self, residual: FloatArray, H: FloatArray, noise: FloatArray) -> None:
        """Fuse m readings."""
        R = np.diag(noise)
        S = H @ self.P @ H.T + R
        K = np.linalg.solve(S, H @ self.P).T
        rest = np.eye(len(self.x)) - K @ H
        self.x = self.x + K @ residual
        self.P = rest @ self.P @ rest.T + K @ R @ K.T


def read_with_rosbags(path: Path, topics: Collection[str]) -> int:
    """Read and unpack the messages of some topics of a whole bag; return how many there are."""
    from rosbags.rosbag2 import Reader

    store, count = _types(), 0
    with Reader(path) as bag:
        chosen = [connection for connection in bag.connections if connection.topic in topics]
        for connection, _, data in bag.messages(chosen):
            store.deserialize_cdr(data, connection.msgtype)
            count += 1
    return count


@cache
def _types() -> Any:
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_JAZZY)
