# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Consistency of innovations (NIS), and number of cycles with correlated model errors."""

from __future__ import annotations

from wheel_terra_estimator.estimation.scalars import TINY, clipped, known

_GAIN = 0.05  # of the running mean, per reading: a memory of 20 readings [-]
_LARGEST = 100.0  # limit of one NIS in the mean, for outliers [-]
CONSISTENT = 1.0
"""Mean of the normalised innovation squared (NIS) of scalar readings in a consistent filter [-]
(Bar-Shalom, Li and Kirubarajan 2001, section 5.4)."""
SAME_GROUND = 0.15
"""Rim travel over which model errors are fully correlated [m]; tuned on seeds 1000 and 1001."""
_MOST_CYCLES = 100.0


def smoothed_nis(mean: float | None, nis: float, gain: float = _GAIN) -> float:
    """Return the running mean of the NIS of a channel; None = no reading before."""
    old = CONSISTENT if mean is None else mean
    return (1.0 - gain) * old + gain * min(nis, _LARGEST)


def excess(mean_nis: float | None) -> float:
    """Return the mean NIS (observed over predicted variance), at least 1 (Birge 1932)."""
    return CONSISTENT if mean_nis is None else max(mean_nis, CONSISTENT)


def correlated_cycles(rims: tuple[float, ...], dt: float) -> float:
    """Return how many cycles of length `dt` [s] share one model error, that of the same ground.

    Fused as independent readings, each linearised at another noisy state, they would give spurious
    information along the unobservable direction T(s) = const, and strength, K and slip would drift
    along it (the inconsistency of EKF-SLAM, Julier and Uhlmann 2001).
    """
    travel = dt * max((abs(rim) for rim in known(rims)), default=0.0)
    return clipped(SAME_GROUND / max(travel, TINY), 1.0, _MOST_CYCLES)
