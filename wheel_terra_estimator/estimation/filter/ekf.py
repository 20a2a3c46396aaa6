# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Extended Kalman filter with considered states, kept symmetric, positive and finite.

filterpy holds the state and predicts. The update is written here: covariance in Joseph form, a gain
of zero for considered entries (Schmidt), a Cholesky factorisation in place of an inverse. Callers
gate a reading before it is fused, and pass residual and Jacobian from one evaluation of the models.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
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


class _SchmidtFilter(ExtendedKalmanFilter):
    """filterpy's filter with a prediction worked out by the caller, and considered entries."""

    x: FloatArray
    P: FloatArray
    predicted: FloatArray

    def predict_x(self, u: float = 0) -> None:
        """Take the predicted mean."""
        self.x = self.predicted

    def fuse(
        self,
        residual: FloatArray,
        H: FloatArray,
        HP: FloatArray,
        noise: FloatArray,
        considered: Sequence[int],
    ) -> None:
        """Fuse m readings with independent noise: z - h(x) (m,), H, H P (m, n), variances (m,)."""
        S = HP @ H.T
        S.flat[:: len(noise) + 1] += noise
        _, gain, fails = dposv(S, HP)
        K = gain.T if not fails else np.linalg.solve(S, HP).T
        if considered:
            K[list(considered)] = 0.0
        I_KH = self._I - K @ H
        self.x = self.x + K @ residual
        self.P = I_KH @ self.P @ I_KH.T + (K * noise) @ K.T
        self.y, self.S, self.K = residual, S, K


class GatedFilter:
    """State, covariance, gates and counters. What changes them makes new arrays.

    Parameters
    ----------
    mean, covariance : numpy.ndarray
        (n,) and (n, n) start.
    lower, upper : numpy.ndarray
        (n,) physical bounds of the state, enforced after each update.

    Attributes
    ----------
    buffer : HistoryBuffer or None
        Keeps the transitions of the state for a smoother.
    """

    def __init__(
        self, mean: FloatArray, covariance: FloatArray, lower: FloatArray, upper: FloatArray
    ) -> None:
        size = len(mean)
        self._ekf = _SchmidtFilter(dim_x=size, dim_z=1)
        self._ekf.x = mean.copy()
        self._ekf.P = covariance.copy()
        self._start = FilterMemory(mean.copy(), covariance.copy(), 0)
        self._lower, self._upper = lower, upper
        self._identity = np.eye(size)
        self.restarts = 0
        self.buffer: HistoryBuffer | None = None

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper bounds of the state, (n,) each."""
        return self._lower, self._upper

    def reset(self) -> None:
        """Go back to the start; restarts count from 0."""
        if self.buffer is not None:
            self.buffer.cut()
        self.state = self._start

    @property
    def mean(self) -> FloatArray:
        """(n,) state."""
        return self._ekf.x

    @property
    def covariance(self) -> FloatArray:
        """(n, n) covariance."""
        return self._ekf.P

    def predict(self, mean: FloatArray, transition: FloatArray, noise: FloatArray) -> None:
        """Go to a predicted mean with transition matrix F and process noise Q."""
        before, ekf = self.state, self._ekf
        ekf.predicted, ekf.F, ekf.Q = mean, transition, noise
        ekf.predict()
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
        HP = H @ self._ekf.P
        variance = np.einsum('ij,ij->i', HP, H) + noise
        scale = 1.0 / np.sqrt(np.maximum(variance, _LEAST_VARIANCE))
        column = scale[:, None]
        share = np.maximum(noise * scale * scale, _LEAST_SHARE)
        ekf = self._ekf
        ekf.fuse(residual * scale, H * column, HP * column, share, considered)
        ekf.P = 0.5 * (ekf.P + ekf.P.T)
        self._enforce_bounds()

    def fuse(self, rows: Sequence[Row], considered: Sequence[int] = ()) -> None:
        """Fuse rows in one update; without rows nothing happens."""
        if rows:
            residuals, jacobians, variances = zip(*rows, strict=True)
            self.update(np.array(residuals), np.array(jacobians), np.array(variances), considered)

    def set(self, index: int, value: float, variance: float) -> None:
        """Set one entry to a value known from elsewhere, without correlations."""
        before, keep = self.state, self._identity.copy()
        keep[index, index] = 0.0
        mean, covariance = keep @ before.mean, keep @ before.covariance @ keep
        mean[index], covariance[index, index] = value, variance
        self.state = before._replace(mean=mean, covariance=covariance)
        self._keep_transition(before, keep)

    def inflate(self, index: int, variance: float) -> None:
        """Add variance to one entry."""
        before = self.state
        covariance = before.covariance.copy()
        covariance[index, index] += variance
        self._ekf.P = covariance
        self._keep_transition(before, self._identity)

    @property
    def state(self) -> FilterMemory:
        """Mean, covariance and the count of restarts."""
        return FilterMemory(self._ekf.x, self._ekf.P, self.restarts)

    @state.setter
    def state(self, memory: FilterMemory) -> None:
        self._ekf.x, self._ekf.P, self.restarts = memory

    def _keep_transition(self, before: FilterMemory, transition: FloatArray) -> None:
        if self.buffer is not None:
            after = Gaussian(self._ekf.x, self._ekf.P)
            self.buffer.add(Gaussian(before.mean, before.covariance), transition, after)

    def _enforce_bounds(self) -> None:
        """Keep mean and covariance finite, within their bounds and positive."""
        ekf = self._ekf
        x, entries = ekf.x, ekf.P.ravel('K')
        # One sum of squares finds nan and inf in either.
        if not math.isfinite(x.dot(x) + entries.dot(entries)):
            ekf.x = x = np.where(np.isfinite(x), x, 0.0)
            ekf.P = self._start.covariance.copy()
            entries = ekf.P.ravel('K')
            self.restarts += 1
            if self.buffer is not None:
                self.buffer.cut()
        np.minimum(np.maximum(x, self._lower, out=x), self._upper, out=x)
        diagonal = entries[:: len(x) + 1]
        if np.minimum.reduce(diagonal) <= 0.0:
            np.maximum(diagonal, _LEAST_DIAGONAL, out=diagonal)


def chi_square_gate(residual: float, variance: float, gate: float) -> float:
    """Return the variance to be added so that residual^2 / variance does not exceed the gate."""
    return max(residual * residual / gate - variance, 0.0)
