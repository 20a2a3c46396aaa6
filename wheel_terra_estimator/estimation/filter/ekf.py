# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Extended Kalman filter with considered states, kept symmetric, positive and finite.

filterpy holds the state and predicts. The update is written here: covariance in Joseph form, a gain
of zero for considered entries (Schmidt), a Cholesky factorisation in place of an inverse. Callers
gate a reading before it is fused, and pass residual and Jacobian from one evaluation of the models.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter
from scipy.linalg.lapack import dposv

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.estimation.smoothing.history_buffer import Gaussian, HistoryBuffer

_LEAST_VARIANCE = 1e-30  # of an innovation, in its own unit squared
_LEAST_SHARE = 1e-9  # of the reading's own variance in that of its innovation
_LEAST_DIAGONAL = 1e-14  # of the covariance


class Row(NamedTuple):
    """One scalar measurement, linearised: z - h(x), Jacobian dh/dx (n,), variance of z."""

    residual: float
    jacobian: FloatArray
    variance: float


class FilterMemory(NamedTuple):
    """What a filter goes back to: arrays that nobody changes."""

    mean: FloatArray
    covariance: FloatArray
    restarts: int


class GatedFilter(ExtendedKalmanFilter):
    """State ``x`` (n,) and covariance ``P`` (n, n). What changes them makes new arrays.

    The physical `bounds`, lower and upper (n,), are enforced after each update. A `buffer` keeps
    the transitions of the state for a smoother.
    """

    x: FloatArray
    P: FloatArray

    def __init__(
        self, mean: FloatArray, covariance: FloatArray, lower: FloatArray, upper: FloatArray
    ) -> None:
        super().__init__(dim_x=len(mean), dim_z=1)
        self.x, self.P = mean.copy(), covariance.copy()
        self._start = FilterMemory(mean.copy(), covariance.copy(), 0)
        self.bounds = lower, upper
        self.restarts = 0
        self.buffer: HistoryBuffer | None = None

    def reset(self) -> None:
        """Go back to the start; restarts count from 0."""
        if self.buffer is not None:
            self.buffer.cut()
        self.state = self._start

    def predict_x(self, u: float = 0) -> None:
        """Take the predicted mean."""
        self.x = self._predicted

    def predict(self, mean: FloatArray, transition: FloatArray, noise: FloatArray) -> None:
        """Go to a predicted mean with transition matrix F and process noise Q."""
        before = self.state
        self._predicted, self.F, self.Q = mean, transition, noise
        super().predict()
        self._enforce_bounds()
        self._keep_transition(before, transition)

    def update(
        self, residual: FloatArray, H: FloatArray, noise: FloatArray, considered: Sequence[int] = ()
    ) -> None:
        """Fuse m readings: residual z - h(x) (m,), H (m, n), variances (m,).

        Entries that are `considered` (Schmidt) keep mean and variance; their uncertainty counts in
        the innovation covariance.
        """
        # Each innovation is scaled to variance 1, so that their covariance can be factorised
        # whatever the units. A noise share below the floor would be lost in rounding.
        HP = H @ self.P
        variance = np.einsum('ij,ij->i', HP, H) + noise
        scale = 1.0 / np.sqrt(np.maximum(variance, _LEAST_VARIANCE))
        column = scale[:, None]
        share = np.maximum(noise * scale * scale, _LEAST_SHARE)
        H, HP = H * column, HP * column
        S = HP @ H.T
        S.flat[:: len(share) + 1] += share
        _, gain, fails = dposv(S, HP)
        K = gain.T if not fails else np.linalg.solve(S, HP).T
        if considered:
            K[list(considered)] = 0.0
        I_KH = self._I - K @ H
        self.x = self.x + K @ (residual * scale)
        P = I_KH @ self.P @ I_KH.T + (K * share) @ K.T
        self.P = 0.5 * (P + P.T)
        self._enforce_bounds()

    def fuse(self, rows: Sequence[Row], considered: Sequence[int] = ()) -> None:
        """Fuse rows in one update; without rows nothing happens."""
        if rows:
            residuals, jacobians, variances = zip(*rows, strict=True)
            self.update(np.array(residuals), np.array(jacobians), np.array(variances), considered)

    def set(self, index: int, value: float, variance: float) -> None:
        """Set one entry to a value known from elsewhere, without correlations."""
        before, keep = self.state, self._I.copy()
        keep[index, index] = 0.0
        mean, covariance = keep @ before.mean, keep @ before.covariance @ keep
        mean[index], covariance[index, index] = value, variance
        self.state = before._replace(mean=mean, covariance=covariance)
        self._keep_transition(before, keep)

    def inflate(self, index: int, variance: float) -> None:
        """Add variance to one entry."""
        self.inflate_along({index: math.sqrt(variance)})

    def inflate_along(self, deviations: Mapping[int, float]) -> None:
        """Add one and the same error to some entries, with its deviation of each."""
        before, entries = self.state, list(deviations)
        self.P = before.covariance.copy()
        stds = np.array(list(deviations.values()))
        self.P[np.ix_(entries, entries)] += stds[:, None] * stds
        self._keep_transition(before, self._I)

    @property
    def state(self) -> FilterMemory:
        """Mean, covariance and the count of restarts."""
        return FilterMemory(self.x, self.P, self.restarts)

    @state.setter
    def state(self, memory: FilterMemory) -> None:
        self.x, self.P, self.restarts = memory

    def _keep_transition(self, before: FilterMemory, transition: FloatArray) -> None:
        if self.buffer is not None:
            after = Gaussian(self.x, self.P)
            self.buffer.add(Gaussian(before.mean, before.covariance), transition, after)

    def _enforce_bounds(self) -> None:
        """Keep mean and covariance finite, within their bounds and positive."""
        x, entries = self.x, self.P.ravel('K')
        # One sum of squares finds nan and inf in either.
        if not math.isfinite(x.dot(x) + entries.dot(entries)):
            self.x = x = np.where(np.isfinite(x), x, 0.0)
            self.P = self._start.covariance.copy()
            entries = self.P.ravel('K')
            self.restarts += 1
            if self.buffer is not None:
                self.buffer.cut()
        lower, upper = self.bounds
        np.minimum(np.maximum(x, lower, out=x), upper, out=x)
        diagonal = entries[:: len(x) + 1]
        if np.minimum.reduce(diagonal) <= 0.0:
            np.maximum(diagonal, _LEAST_DIAGONAL, out=diagonal)


def chi_square_gate(residual: float, variance: float, gate: float) -> float:
    """Return the variance to be added so that residual^2 / variance does not exceed the gate."""
    return max(residual * residual / gate - variance, 0.0)
