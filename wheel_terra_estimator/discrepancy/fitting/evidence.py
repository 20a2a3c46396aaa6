# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Evidence of a fitted hypothesis: Laplace's method with truncated priors.

Around the fit the model is linear in u ~ N(0, I), so that the marginal likelihood of the cells is
Gaussian for every amplitude of the structural error. Bounds enter as
the share of the posterior inside them over the share of the prior.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import log_ndtr

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.discrepancy.fitting.coordinates import (
    BELIEVED_WIDTHS,
    EFFECT_SCALES,
    EFFECT_SHARES,
)
from wheel_terra_estimator.discrepancy.fitting.gauss_newton import Fit
from wheel_terra_estimator.discrepancy.fitting.problem import Problem


@dataclass(frozen=True)
class Floor:
    """One assumption on the structural error: amplitude per quantity and its prior.

    ``unexplained`` marks amplitudes beyond a model-error floor: a smooth misfit that wants a name.
    """

    amplitude: tuple[float, ...]
    log_prior: float
    unexplained: bool

    @property
    def largest(self) -> float:
        """Greatest share of the range."""
        return max(self.amplitude)


def log_sum(values: FloatArray, axis: int | None = None) -> FloatArray:
    """Return the logarithm of a sum of exponentials, minus infinity for none.

    SciPy's takes many times as long.
    """
    return np.logaddexp.reduce(values, axis=axis)


def evidence(problem: Problem, fitted: Fit, floors: tuple[Floor, ...]) -> FloatArray:
    """Return the (F,) log of evidence and prior of every floor, for a fit.

    The evidence is the mean over soil as good as stated or worse, and effects small or large.
    """
    jacobian = fitted.jacobian
    target = fitted.residual + jacobian @ fitted.u
    amplitude = np.array([floor.amplitude for floor in floors])
    variance = problem.variance(amplitude)
    weighted = jacobian[None] / variance[:, :, None]
    information = np.swapaxes(weighted, 1, 2) @ jacobian  # (F, P, P)
    right = (target / variance) @ jacobian
    priors, weights = _prior_precisions(fitted)  # (S, P), (S,)
    precision = information[None] + priors[:, None, :, None] * np.eye(len(fitted.u))
    covariance = np.asarray(np.linalg.inv(precision), dtype=float)
    mean = np.einsum('sfpq,fq->sfp', covariance, right)
    # Not as a difference of two large numbers: beside next to no noise little of it would be right.
    left = target - mean @ jacobian.T
    value = -0.5 * (
        np.log(variance).sum(axis=1)
        + (left**2 / variance).sum(axis=2)
        + (priors[:, None] * mean**2).sum(axis=2)
        + np.linalg.slogdet(precision)[1]
        - np.log(priors).sum(axis=1)[:, None]
        + problem.size * np.log(2.0 * np.pi)
    )
    value -= problem.log_std
    value += _truncation(fitted, mean, covariance, priors)
    log_evidence = log_sum(value + np.log(weights)[:, None], axis=0)
    return log_evidence + [f.log_prior for f in floors]


def _prior_precisions(fitted: Fit) -> tuple[FloatArray, FloatArray]:
    """(S, P) prior precisions of u for all combinations of scales; (S,) their shares."""
    believed = np.array([c.role == 'believed' for c in fitted.coordinates])
    strength = np.array([c.role == 'strength' for c in fitted.coordinates])
    sizes = list(zip(EFFECT_SCALES, EFFECT_SHARES, strict=True)) if strength.any() else [(1.0, 1.0)]
    combinations, weights = [], []
    for width, share in BELIEVED_WIDTHS:
        for size, part in sizes:
            scale = np.where(believed, width, np.where(strength, size, 1.0))
            combinations.append(scale**-2)
            weights.append(share * part)
    return np.array(combinations), np.array(weights)


def _truncation(
    fitted: Fit, mean: FloatArray, covariance: FloatArray, priors: FloatArray
) -> FloatArray:
    """Log of posterior over prior mass inside the bounds of the effects' coordinates: (S, F)."""
    total = np.zeros(mean.shape[:2])
    for index, c in enumerate(fitted.coordinates):
        if c.owner == 'soil':
            continue
        std = np.sqrt(covariance[..., index, index])
        inside = _log_mass((c.lower - mean[..., index]) / std, (c.upper - mean[..., index]) / std)
        own = np.sqrt(priors[:, index])
        total += inside - _log_mass(c.lower * own, c.upper * own)[:, None]
    return total


def _log_mass(a: FloatArray, b: FloatArray) -> FloatArray:
    """Log of the standard normal's mass between a and b, on the side where it does not cancel."""
    swap = a > 0.0
    low, high = log_ndtr(np.where(swap, -b, a)), log_ndtr(np.where(swap, -a, b))
    return high + np.log1p(-np.exp(np.minimum(low - high, -1e-12)))
