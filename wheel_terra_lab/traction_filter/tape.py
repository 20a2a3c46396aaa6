# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What the forward pass keeps for the backward pass of the smoother."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter
from numpy.typing import NDArray

from wheel_terra_estimator.estimation.judgement.slip import BodyMotion
from wheel_terra_estimator.estimation.smoothing.spool import Spool
from wheel_terra_estimator.estimation.smoothing.tape import Gaussian

FloatArray = NDArray[np.float64]
_LEAST_VARIANCE = 1e-12  # of any entry, so that a covariance has an inverse


class Prediction(NamedTuple):
    """Step of a filter from its last update on."""

    F: FloatArray
    state: Gaussian

    @classmethod
    def of(cls, ekf: ExtendedKalmanFilter) -> Prediction:
        """Return that of a filter that has just predicted."""
        return cls(ekf.F, Gaussian(ekf.x.copy(), ekf.P + _LEAST_VARIANCE * np.eye(len(ekf.x))))


class Evidence(NamedTuple):
    """What a cycle was solved from, besides curve, sinkage and references."""

    time: float  # [s]
    memory: Any  # of the estimator at the end of the cycle
    parts: tuple[Any, ...]  # snapshots
    rims: Any
    load: FloatArray  # (n,) [N]


class Cycle(NamedTuple):
    """One cycle of the forward pass; both filters are those of curve and sinkage."""

    predicted: tuple[Prediction, Prediction]
    updated: tuple[Gaussian, Gaussian]
    walked: float  # variance that the slip held by references gained by its walk
    evidence: Evidence


class Instant(NamedTuple):
    """What was judged at a stamp."""

    stamp: int  # [ns]
    time: float  # [s]
    cycle: int  # index of the last cycle before it
    body: BodyMotion
    rims: tuple[float, ...]  # [m/s], nan = unknown


class DriveTape:
    """Cycles and instants of a drive in the order of their stamps.

    It is a part of the estimator like any other: where the estimator goes back to an earlier state
    for a late input, the tape is wound back with it.
    """

    def __init__(self) -> None:
        self.cycles: Spool[Cycle | None] = Spool()  # None: the filter was started anew
        self.instants: Spool[Instant] = Spool()

    def cut(self) -> None:
        """Keep that a run begins: nothing of what follows is carried back."""
        self.cycles.append(None)

    def reset(self) -> None:
        """Leave everything: a new run of the same recording goes on behind the cut."""

    def snapshot(self) -> tuple[int, int]:
        """Return how far the tape is."""
        return len(self.cycles), len(self.instants)

    def restore(self, snapshot: tuple[int, int]) -> None:
        """Wind the tape back."""
        self.cycles.truncate(snapshot[0])
        self.instants.truncate(snapshot[1])
