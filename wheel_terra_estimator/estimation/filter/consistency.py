# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Whether innovations are as large as foreseen, and how many cycles see the same ground."""

from __future__ import annotations

from wheel_terra_estimator.estimation.scalars import TINY, clipped, known

_KEEP, _GAIN = 0.95, 0.05  # of the mean per reading: it goes over the last 20
_LARGEST = 100.0  # NIS that enters the mean: one outlier does not fill it
CONSISTENT = 1.0
"""Normalised innovation squared (NIS) of a scalar reading, on average, in a filter that is right
(Bar-Shalom, Li and Kirubarajan 2001, section 5.4)."""
SAME_GROUND = 0.15
"""Rim travel over which the errors of the models are the same [m]; tuned on seeds 1000, 1001."""
_MOST_CYCLES = 100.0


def smoothed_nis(mean: float | None, nis: float) -> float:
    """Return the running mean of the NIS of a channel; None = nothing was read before."""
    old = CONSISTENT if mean is None else mean
    return _KEEP * old + _GAIN * min(nis, _LARGEST)


def excess(mean_nis: float | None) -> float:
    """Return by how much innovations are larger than foreseen, 1 = not at all (Birge 1932)."""
    return CONSISTENT if mean_nis is None else max(mean_nis, CONSISTENT)


def correlated_cycles(rims: tuple[float, ...], dt: float) -> float:
    """Return how many cycles of length `dt` [s] are one piece of information.

    Taken as many, each linearised anew at its own noisy state, they leave T(s) = const no ridge:
    strength, K and slip run along it to anywhere (the inconsistency known from EKF-SLAM, Julier and
    Uhlmann 2001).
    """
    travel = dt * max((abs(rim) for rim in known(rims)), default=0.0)
    return clipped(SAME_GROUND / max(travel, TINY), 1.0, _MOST_CYCLES)
