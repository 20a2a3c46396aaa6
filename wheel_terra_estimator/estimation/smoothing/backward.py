# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Backward pass over a buffer (Rauch, Tung and Striebel 1965; Särkkä 2013, algorithm 9.1).

With x, P after the last update, x', P' after the transition and x_s', P_s' smoothed there::

    G   = P F^T P'^-1
    x_s = x + G (x_s' - x')
    P_s = P + G (P_s' - P') G^T
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.estimation.smoothing.history_buffer import (
    Gaussian,
    HistoryBuffer,
    Transition,
)

_LEAST_PIVOT = 1e-7
"""Least pivot of the Cholesky factor of a correlation matrix [-]: with a smaller one its inverse is
lost in rounding."""


def smoothed_before(
    transition: Transition, later: Gaussian | None, lower: FloatArray, upper: FloatArray
) -> Gaussian:
    """Return the smoothed state before a transition of the forward pass, within bounds (size,).

    `later` is the smoothed state after it, None at a cut. Where the covariance cannot be inverted
    the filter's own state is returned.
    """
    before, F, after = transition
    if later is None:
        return before
    scale = 1.0 / np.sqrt(np.diagonal(after.covariance))
    correlation = after.covariance * np.outer(scale, scale)
    try:
        pivots = np.diagonal(np.linalg.cholesky(correlation))
    except np.linalg.LinAlgError:
        return before
    if not pivots.min() > _LEAST_PIVOT:
        return before
    crossed = (F @ before.covariance) * scale[:, None]
    gain = np.linalg.solve(correlation, crossed).T * scale
    mean = before.mean + gain @ (later.mean - after.mean)
    covariance = before.covariance + gain @ (later.covariance - after.covariance) @ gain.T
    covariance = 0.5 * (covariance + covariance.T)
    if not (np.isfinite(mean).all() and np.diagonal(covariance).min() > 0.0):
        return before
    return Gaussian(np.clip(mean, lower, upper), covariance)


def smoothed_states(
    buffer: HistoryBuffer, lower: FloatArray, upper: FloatArray
) -> Iterator[Gaussian | None]:
    """Yield the smoothed state at each position of a buffer, the last one (its length) first.

    None before a restart of the filter.
    """
    state = buffer.end
    yield state
    for position in range(len(buffer) - 1, -1, -1):
        transition = buffer.transition(position)
        state = None if transition is None else smoothed_before(transition, state, lower, upper)
        yield state
