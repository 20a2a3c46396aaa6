# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What the models say about rows that their fit did not see: whole groups of slip left out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.discrepancy.candidates import Setting
from wheel_terra_estimator.discrepancy.fitting import Fit
from wheel_terra_estimator.discrepancy.parameters import bounds
from wheel_terra_estimator.discrepancy.table import SteadyTable

FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.intp]

GROUPS = 8


def slip_groups(table: SteadyTable) -> IndexArray:
    """Return (N,) group of each row: neighbouring slips together, equal ones never apart."""
    slip = np.round(table.columns['slip'], 3)
    levels = np.unique(slip)
    rank = np.searchsorted(levels, slip)
    return np.minimum(rank * GROUPS // max(len(levels), 1), GROUPS - 1).astype(np.intp)


@dataclass(frozen=True)
class HeldOut:
    """Predictions of each row by fits without its group.

    Attributes
    ----------
    outputs : numpy.ndarray
        (N, 3).
    log_score : float
        Sum of the log predictive densities of the groups, structural error included.
    """

    outputs: FloatArray
    log_score: float


def hold_out(
    setting: Setting, fits: list[Fit], variances: list[FloatArray], groups: IndexArray
) -> list[HeldOut]:
    """Leave each group out of each fit; rows of a negative group (a reference) always stay in.

    The parameters without a group come from one linear step off the full fit (exact but for the
    curvature of the model in that step); the predictions are those of the full model.
    """
    problem = setting.problem
    labels = np.unique(groups[groups >= 0])
    cell_group = groups[problem.row]
    tasks, scores = [], []
    unrotate = np.linalg.inv(problem.rotation)
    for fitted, variance in zip(fits, variances, strict=True):
        covariance = (unrotate * variance) @ unrotate.T
        target = setting.observed - problem.flat(fitted.outputs) + fitted.sensitivity @ fitted.u
        limits = bounds(fitted.coordinates)
        score = 0.0
        for label in labels:
            out = cell_group == label
            u = np.clip(_without(fitted, covariance, target, ~out), *limits)
            # Score: the group given all the rest, by the full covariance.
            score += _group_score(fitted, covariance, target, out)
            tasks.append((fitted, u))
        scores.append(score)
    state = setting.forward.solve(
        [fitted.coordinates for fitted, _ in tasks],
        [u for _, u in tasks],
        np.array([fitted.angle for fitted, _ in tasks]),
        jacobian=False,
    )
    results = []
    for index, score in enumerate(scores):
        outputs = np.empty_like(fits[index].outputs)
        for k, label in enumerate(labels):
            rows = groups == label
            outputs[rows] = state.outputs[index * len(labels) + k][rows]
        results.append(HeldOut(outputs, score))
    return results


def _without(
    fitted: Fit, covariance: FloatArray, target: FloatArray, kept: NDArray[np.bool_]
) -> FloatArray:
    jacobian = fitted.sensitivity[kept]
    weighted = np.linalg.solve(covariance[np.ix_(kept, kept)], jacobian)
    precision = jacobian.T @ weighted + np.diag(fitted.prior)
    return np.linalg.solve(precision, weighted.T @ target[kept])


def _group_score(
    fitted: Fit, covariance: FloatArray, target: FloatArray, out: NDArray[np.bool_]
) -> float:
    total = covariance + (fitted.sensitivity / fitted.prior) @ fitted.sensitivity.T
    across = np.linalg.solve(total[np.ix_(~out, ~out)], total[np.ix_(~out, out)])
    error = target[out] - across.T @ target[~out]
    spread = total[np.ix_(out, out)] - total[np.ix_(out, ~out)] @ across
    sign, log_det = np.linalg.slogdet(spread)
    if sign <= 0.0:
        return -np.inf
    return float(
        -0.5 * (error @ np.linalg.solve(spread, error) + log_det + len(error) * np.log(2 * np.pi))
    )
