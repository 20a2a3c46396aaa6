# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""How far the estimates of a drive are from its truth, in a few figures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.bags.history import EstimateHistory
from wheel_terra_estimator.bags.truth import Truth, WheelTruth

FloatArray = NDArray[np.float64]

SETTLED = 10.0
"""Seconds at the start that the figures leave out [s]."""
TWO_SIDED_95 = 1.959964
"""Half width of a 95 % interval of a normal error, in standard deviations."""


@dataclass(frozen=True)
class TruthError:
    """Error of one quantity after the first seconds.

    Attributes
    ----------
    quantity : str
        Field of the estimates.
    rms, worst : float
        Over all wheels, and of the worst wheel, in the quantity's SI unit.
    worst_wheel : str
        Its name.
    coverage : float
        Share of the 95 % intervals that hold the truth.
    samples : int
        Wheel samples compared.
    """

    quantity: str
    rms: float
    worst: float
    worst_wheel: str
    coverage: float
    samples: int


def newest(history: EstimateHistory, name: str, stamp: NDArray[np.int64]) -> FloatArray:
    """Return the newest estimates (k, n) at stamps (k,) [ns]."""
    rows = np.clip(np.searchsorted(history.stamp, stamp, side='right') - 1, 0, None)
    return history.values[name][rows]


def truth_errors(history: EstimateHistory, truth: Truth | None) -> Sequence[TruthError]:
    """Compare estimates with the truth; empty where there is none."""
    if truth is None or not history.stamp.size:
        return ()
    known = (
        ('slip', truth.slip),
        ('sinkage', truth.sinkage),
        ('drawbar_pull', truth.drawbar_pull),
    )
    found = (_error(history, name, values) for name, values in known if values is not None)
    return tuple(error for error in found if error is not None)


def _error(history: EstimateHistory, name: str, truth: WheelTruth) -> TruthError | None:
    settled = (truth.stamp - history.stamp[0]) * 1e-9 > SETTLED
    settled &= truth.stamp <= history.stamp[-1]
    error = (newest(history, name, truth.stamp) - truth.value)[settled]
    if not np.isfinite(error).any():
        return None
    deviation = newest(history, f'{name}_std', truth.stamp)[settled]
    known = np.isfinite(error)
    squares = np.where(known, error, 0.0) ** 2
    each = np.sqrt(squares.sum(axis=0) / np.maximum(known.sum(axis=0), 1))
    worst = int(np.argmax(each))
    return TruthError(
        name,
        float(np.sqrt(squares.sum() / known.sum())),
        float(each[worst]),
        history.names[worst],
        float((np.abs(error) <= TWO_SIDED_95 * deviation)[known].mean()),
        int(known.sum()),
    )
