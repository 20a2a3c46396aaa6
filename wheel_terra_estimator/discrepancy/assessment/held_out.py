# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What the models say about rows that their fit did not see: whole groups of slip left out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wheel_terra_estimator.arrays import FloatArray, IndexArray
from wheel_terra_estimator.discrepancy.fitting.coordinates import bounds
from wheel_terra_estimator.discrepancy.fitting.gauss_newton import Fit
from wheel_terra_estimator.discrepancy.fitting.problem import Problem
from wheel_terra_estimator.discrepancy.selection.candidates import Setting
from wheel_terra_estimator.discrepancy.tables.steady_table import SteadyTable

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
    parts = [np.flatnonzero(cell_group == label) for label in np.unique(groups[groups >= 0])]
    parts = [out for out in parts if out.size]
    plain = _inverse(problem, variance)
    blocks = [plain[np.ix_(out, out)] for out in parts]
    scores = []
    for fitted in fits:
        weighted = plain @ fitted.sensitivity
        precision = fitted.sensitivity.T @ weighted + np.diag(fitted.prior)
        low_rank = np.linalg.solve(precision, weighted.T)
        target = setting.observed - problem.flat(fitted.outputs) + fitted.sensitivity @ fitted.u
        pull = plain @ target - weighted @ (low_rank @ target)
        score = 0.0
        for out, noise in zip(parts, blocks, strict=True):
            block = noise - weighted[out] @ low_rank[:, out]
            square = float(pull[out] @ np.linalg.solve(block, pull[out]))
            log_det = float(np.linalg.slogdet(block)[1])
            score += 0.5 * (log_det - square - out.size * np.log(2.0 * np.pi))
        scores.append(score)
    return scores


def hold_out(
    setting: Setting, fits: Sequence[Fit], variance: FloatArray, groups: IndexArray
) -> list[FloatArray]:
    """Return the (N, 4) predictions of every fit, each row by parameters found without its group.

    Rows of a negative group (a reference) always stay in. The parameters without a group come from
    one linear step off the full fit (exact but for the curvature of the model in that step); the
    predictions are those of the full model.
    """
    problem = setting.problem
    labels = np.unique(groups[groups >= 0])
    cell_group = groups[problem.row]
    inverse = _inverse(problem, variance)
    tasks = []
    for fitted in fits:
        target = setting.observed - problem.flat(fitted.outputs) + fitted.sensitivity @ fitted.u
        limits = bounds(fitted.coordinates)
        for label in labels:
            out = np.flatnonzero(cell_group == label)
            tasks.append((fitted, np.clip(_without(fitted, inverse, target, out), *limits)))
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


def _inverse(problem: Problem, variance: FloatArray) -> FloatArray:
    """(m, m) inverse covariance of the cells around a model without free parameters."""
    return (problem.rotation.T / variance) @ problem.rotation


def _without(fitted: Fit, inverse: FloatArray, target: FloatArray, out: IndexArray) -> FloatArray:
    """Return the parameters that the cells ask for without those at ``out``.

    The inverse covariance of the kept cells is what is left of the inverse of all when the block of
    the others is eliminated (Schur), so that no large matrix is decomposed for any group.
    """
    both = np.column_stack([fitted.sensitivity, target])
    both[out] = 0.0
    weighted = inverse @ both
    if out.size:
        weighted -= inverse[:, out] @ np.linalg.solve(inverse[np.ix_(out, out)], weighted[out])
    products = both[:, :-1].T @ weighted
    return np.asarray(np.linalg.solve(products[:, :-1] + np.diag(fitted.prior), products[:, -1]))
