# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What the models say about rows that their fit did not see: whole groups of slip left out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.discrepancy.candidates import Setting
from wheel_terra_estimator.discrepancy.fitting import Fit
from wheel_terra_estimator.discrepancy.outliers import inverse_covariance
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


def log_scores(
    setting: Setting, fits: Sequence[Fit], variance: FloatArray, groups: IndexArray
) -> list[float]:
    """Return the sum of the log predictive densities of the groups, each given all the rest.

    Around the fit everything is Gaussian, so that blocks of the inverse covariance suffice.
    """
    problem = setting.problem
    cell_group = groups[problem.row]
    scores = []
    for fitted in fits:
        jacobian = fitted.jacobian / np.sqrt(fitted.prior)
        inverse = problem.rotation.T @ inverse_covariance(variance, jacobian) @ problem.rotation
        target = setting.observed - problem.flat(fitted.outputs) + fitted.sensitivity @ fitted.u
        pull = inverse @ target
        score = 0.0
        for label in _labels(groups):
            out = np.flatnonzero(cell_group == label)
            if not out.size:
                continue
            block = inverse[np.ix_(out, out)]
            square = float(pull[out] @ np.linalg.solve(block, pull[out]))
            log_det = float(np.linalg.slogdet(block)[1])
            score += 0.5 * (log_det - square - out.size * np.log(2.0 * np.pi))
        scores.append(score)
    return scores


def hold_out(
    setting: Setting, fits: Sequence[Fit], variance: FloatArray, groups: IndexArray
) -> list[FloatArray]:
    """Return the (N, 3) predictions of every fit, each row by parameters found without its group.

    Rows of a negative group (a reference) always stay in. The parameters without a group come from
    one linear step off the full fit (exact but for the curvature of the model in that step); the
    predictions are those of the full model.
    """
    problem = setting.problem
    labels = _labels(groups)
    cell_group = groups[problem.row]
    unrotate = np.linalg.inv(problem.rotation)
    covariance = (unrotate * variance) @ unrotate.T
    tasks = []
    for fitted in fits:
        target = setting.observed - problem.flat(fitted.outputs) + fitted.sensitivity @ fitted.u
        limits = bounds(fitted.coordinates)
        for label in labels:
            kept = cell_group != label
            tasks.append((fitted, np.clip(_without(fitted, covariance, target, kept), *limits)))
    state = setting.forward.solve(
        [fitted.coordinates for fitted, _ in tasks],
        [u for _, u in tasks],
        np.array([fitted.angle for fitted, _ in tasks]),
        jacobian=False,
    )
    results = []
    for index, fitted in enumerate(fits):
        outputs = fitted.outputs.copy()
        for k, label in enumerate(labels):
            rows = groups == label
            outputs[rows] = state.outputs[index * len(labels) + k][rows]
        results.append(outputs)
    return results


def _labels(groups: IndexArray) -> IndexArray:
    return np.unique(groups[groups >= 0])


def _without(
    fitted: Fit, covariance: FloatArray, target: FloatArray, kept: NDArray[np.bool_]
) -> FloatArray:
    """Return the parameters that the kept cells ask for."""
    jacobian = fitted.sensitivity[kept]
    weighted = np.linalg.solve(covariance[np.ix_(kept, kept)], jacobian)
    precision = jacobian.T @ weighted + np.diag(fitted.prior)
    return np.asarray(np.linalg.solve(precision, weighted.T @ target[kept]))
