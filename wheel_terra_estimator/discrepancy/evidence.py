# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Evidence of a fitted hypothesis: Laplace's method with truncated priors.

Around the fit the model is linear in u ~ N(0, I), so that the marginal likelihood of the cells is
Gaussian for every amplitude of the structural error and every factor on the noise. Bounds enter as
the share of the posterior inside them over the share of the prior.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr, logsumexp

from wheel_terra_estimator.discrepancy.fitting import Fit
from wheel_terra_estimator.discrepancy.problem import Problem

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Floor:
    """One assumption on the structural error: amplitude per quantity and its prior.

    ``unexplained`` marks amplitudes beyond a model-error floor: a smooth misfit that wants a name.
    """

    amplitude: tuple[float, float, float]
    log_prior: float
    unexplained: bool

    @property
    def largest(self) -> float:
        """Greatest share of the range."""
        return max(self.amplitude)


@dataclass(frozen=True)
class Posterior:
    """Linear posterior of one hypothesis for every floor.

    Attributes
    ----------
    log_evidence : numpy.ndarray
        (F,) without the prior of the floor.
    mean : numpy.ndarray
        (F, P) of u.
    covariance : numpy.ndarray
        (F, P, P).
    noise_factor : numpy.ndarray
        (F, 3) most probable factor on the noise.
    """

    log_evidence: FloatArray
    mean: FloatArray
    covariance: FloatArray
    noise_factor: FloatArray


def evidence(
    problem: Problem,
    fitted: Fit,
    floors: tuple[Floor, ...],
    noise_freedom: FloatArray,
) -> Posterior:
    """Return the evidence of a fit for every floor.

    Parameters
    ----------
    noise_freedom : numpy.ndarray
        (3,) degrees of freedom with which the noise of each quantity is known (inf = given).
    """
    jacobian = fitted.jacobian
    target = fitted.residual + jacobian @ fitted.u
    count, p = len(floors), len(fitted.u)
    factor = np.ones((count, 3))
    unknown = np.isfinite(noise_freedom)
    passes = 4 if unknown.any() else 1
    penalty = np.zeros(count)
    for turn in range(passes):
        variance = np.array(
            [problem.variance(f.amplitude, k) for f, k in zip(floors, factor, strict=True)]
        )
        weighted = jacobian[None] / variance[:, :, None]
        precision = np.swapaxes(weighted, 1, 2) @ jacobian + np.eye(p)
        right = (target / variance) @ jacobian
        covariance = np.linalg.inv(precision)
        mean = np.einsum('fpq,fq->fp', covariance, right)
        if turn < passes - 1:
            factor = _noise_factor(
                problem, target, jacobian, mean, covariance, variance, factor, noise_freedom
            )
    log_det = np.linalg.slogdet(precision)[1]
    value = -0.5 * (
        np.log(variance).sum(axis=1)
        + (target**2 / variance).sum(axis=1)
        - (right * mean).sum(axis=1)
        + log_det
        + problem.size * np.log(2.0 * np.pi)
    )
    value -= problem.log_std
    if unknown.any():
        known = noise_freedom[unknown]
        square = factor[:, unknown] ** 2
        # log density of a scaled inverse chi-square in ln(factor^2), relative to its mode.
        penalty = (0.5 * known * (-np.log(square) - 1.0 / square + 1.0)).sum(axis=1)
    value += penalty + _truncation(fitted, mean, covariance)
    return Posterior(value, mean, covariance, factor)


def _noise_factor(
    problem: Problem,
    target: FloatArray,
    jacobian: FloatArray,
    mean: FloatArray,
    covariance: FloatArray,
    variance: FloatArray,
    factor: FloatArray,
    noise_freedom: FloatArray,
) -> FloatArray:
    """One step of expectation maximisation for the factor on the noise of each quantity."""
    left = target[None] - mean @ jacobian.T
    spread = np.einsum('mp,fpq,mq->fm', jacobian, covariance, jacobian)
    new = factor.copy()
    for q in range(3):
        mine = problem.block == q
        if not np.isfinite(noise_freedom[q]) or not mine.any():
            continue
        k2 = factor[:, q][:, None] ** 2
        share = k2 / variance[:, mine]
        # Expected square of the noise part of each axis: the rest of the variance is the floor's.
        noise = share**2 * (left[:, mine] ** 2 + spread[:, mine]) + k2 * (1.0 - share)
        freedom = noise_freedom[q]
        new[:, q] = np.sqrt((freedom + noise.sum(axis=1)) / (freedom + mine.sum()))
    return np.clip(new, 0.3, 4.0)


def _truncation(fitted: Fit, mean: FloatArray, covariance: FloatArray) -> FloatArray:
    """Log of posterior mass over prior mass inside the bounds of the effects' coordinates."""
    total = np.zeros(len(mean))
    for index, c in enumerate(fitted.coordinates):
        if c.owner == 'soil':
            continue
        std = np.sqrt(covariance[:, index, index])
        a, b = (c.lower - mean[:, index]) / std, (c.upper - mean[:, index]) / std
        # log(Phi(b) - Phi(a)) on the side where it does not cancel.
        swap = a > 0.0
        a, b = np.where(swap, -b, a), np.where(swap, -a, b)
        high, low = log_ndtr(b), log_ndtr(a)
        total += high + np.log1p(-np.exp(np.minimum(low - high, -1e-12)))
        total -= c.log_prior_mass
    return total


def marginal(posterior: Posterior, floors: tuple[Floor, ...]) -> float:
    """Return the log evidence with the floor integrated out."""
    return float(logsumexp(posterior.log_evidence + np.array([f.log_prior for f in floors])))
