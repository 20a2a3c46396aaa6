# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""How many cycles see the same ground, and so the same errors of the models."""

from __future__ import annotations

from wheel_terra_estimator.estimation.scalars import TINY, clipped, known

SAME_GROUND = 0.15
"""Rim travel over which the errors of the models are the same [m]; tuned on seeds 1000, 1001."""
_MOST = 100.0


def correlated_cycles(rims: tuple[float, ...], dt: float) -> float:
    """Return how many cycles of length `dt` [s] are one piece of information.

    Taken as many, each linearised anew at its own noisy state, they leave T(s) = const no ridge:
    strength, K and slip run along it to anywhere (the inconsistency known from EKF-SLAM, Julier and
    Uhlmann 2001).
    """
    travel = dt * max((abs(rim) for rim in known(rims)), default=0.0)
    return clipped(SAME_GROUND / max(travel, TINY), 1.0, _MOST)
