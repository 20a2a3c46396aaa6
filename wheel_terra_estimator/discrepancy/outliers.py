# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The robust pass: cells that neither model, effect nor a smooth error can explain."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.discrepancy.fitting import Fit
from wheel_terra_estimator.discrepancy.problem import OUTLIER_FACTOR, Problem

FloatArray = NDArray[np.float64]

SHARE = 0.02  # prior share of outliers among the cells
NARROW = 0.12  # size of features narrow in slip that rows share [share of the range]
GREATEST_SHARE = 0.12  # of the cells of a table


def find_outliers(
    problem: Problem,
    fitted: Fit,
    variance: FloatArray,
    observed: FloatArray,
    narrow: FloatArray,
) -> list[tuple[int, int, float]]:
    """Return (row, quantity, deviation) of the cells to be set apart, worst first.

    Each cell is predicted from all others (soil, effects and a smooth error free); one at a time,
    the cell that gains most from a twelve times larger noise is set apart.

    Parameters
    ----------
    problem : Problem
        Built without any cell set apart.
    fitted : Fit
        Its linearisation.
    variance : numpy.ndarray
        (m,) of the rotated axes, wide enough for a structural error.
    observed : numpy.ndarray
        (m,) cells that the fit was asked to match.
    narrow : numpy.ndarray
        (N, N) correlation of features narrow in slip that rows share (see ``slip_features``).
    """
    outputs = problem.flat(fitted.outputs)
    jacobian = problem.rotate(fitted.sensitivity) / np.sqrt(fitted.prior)
    residual = observed - outputs
    inverse = problem.rotation.T @ inverse_covariance(variance, jacobian) @ problem.rotation
    if narrow.any():
        inverse = np.linalg.inv(np.linalg.inv(inverse) + _shared_features(problem, narrow))
    target = residual + fitted.sensitivity @ fitted.u
    extra = (OUTLIER_FACTOR**2 - 1.0) * problem.std**2
    found: list[tuple[int, int, float]] = []
    apart = np.zeros(problem.size, dtype=bool)
    for _ in range(int(GREATEST_SHARE * problem.size)):
        diagonal = np.diag(inverse)
        error = (inverse @ target) / diagonal
        own = 1.0 / diagonal
        gain = 0.5 * error**2 * (1.0 / own - 1.0 / (own + extra))
        gain -= 0.5 * np.log1p(extra / own)
        gain[apart] = -np.inf
        worst = int(np.argmax(gain))
        if gain[worst] < np.log((1.0 - SHARE) / SHARE):
            break
        apart[worst] = True
        deviation = float(error[worst] / problem.std[worst])
        found.append((int(problem.row[worst]), int(problem.quantity[worst]), deviation))
        column = inverse[:, worst].copy()
        share = extra[worst] / (1.0 + extra[worst] * diagonal[worst])
        inverse = inverse - share * np.outer(column, column)
    return found


def _shared_features(problem: Problem, narrow: FloatArray) -> FloatArray:
    """(m, m) covariance of the cells by features that are narrow in slip."""
    scale = NARROW * problem.scale[problem.quantity]
    same = problem.quantity[:, None] == problem.quantity[None, :]
    correlation = narrow[np.ix_(problem.row, problem.row)]
    return np.where(same, correlation * np.outer(scale, scale), 0.0)


def inverse_covariance(variance: FloatArray, jacobian: FloatArray) -> FloatArray:
    """Invert diag(variance) + J J' for an (m, P) J with few columns (Woodbury)."""
    weighted = jacobian / variance[:, None]
    precision = jacobian.T @ weighted + np.eye(jacobian.shape[1])
    return np.diag(1.0 / variance) - weighted @ np.linalg.solve(precision, weighted.T)
