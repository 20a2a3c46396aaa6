# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Algebra of the fit against the textbook's other form of the same."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from wheel_terra_estimator.discrepancy.fitting import noise as outliers
from wheel_terra_estimator.discrepancy.fitting.gauss_newton import Fit


@pytest.fixture
def rng():
    return np.random.default_rng(5)


def test_precision_is_the_inverse_of_the_conditioned_covariance(rng):
    """Bayes for a linear model, by conditioning the joint Gaussian of parameters and readings."""
    jacobian, variance = rng.standard_normal((7, 3)), rng.uniform(0.2, 4.0, 7)
    prior = rng.uniform(0.5, 2.0, 3)
    nothing = np.zeros(0)
    found = Fit(
        (), (), nothing, nothing, nothing, nothing, nothing, jacobian, variance, 0.0, prior
    ).precision()
    before = np.diag(1.0 / prior)
    seen = jacobian @ before @ jacobian.T + np.diag(variance)
    after = before - before @ jacobian.T @ np.linalg.solve(seen, jacobian @ before)
    np.testing.assert_allclose(np.linalg.inv(found), after, rtol=1e-10)


def test_inverse_covariance_is_the_inverse(rng):
    variance, jacobian = rng.uniform(0.2, 4.0, 8), rng.standard_normal((8, 2))
    whole = np.diag(variance) + jacobian @ jacobian.T
    found = outliers.inverse_covariance(variance, jacobian)
    np.testing.assert_allclose(found @ whole, np.eye(8), atol=1e-12)


def test_a_cell_set_apart_is_the_evidence_of_its_wider_noise(rng):
    """Against the densities of both hypotheses, up to the factor that they share."""
    size, std = 30, 3.0
    covariance = np.diag(np.full(size, std**2)) + 0.3 * np.ones((size, size))
    target = std * rng.standard_normal(size)
    target[4] += 9.0 * std
    problem = SimpleNamespace(
        size=size, std=np.full(size, std), row=np.arange(size), quantity=np.zeros(size, int)
    )
    score, cells = outliers._rejected_cells(problem, np.linalg.inv(covariance), target)
    assert [cell[0] for cell in cells] == [4]
    wider = covariance.copy()
    wider[4, 4] = 0.3 + (outliers.OUTLIER_FACTOR * std) ** 2
    constant = -0.5 * size * np.log(2.0 * np.pi)
    price = np.log((1.0 - outliers.SHARE) / outliers.SHARE)
    expected = multivariate_normal(np.zeros(size), wider).logpdf(target) - constant - price
    assert score == pytest.approx(float(expected))
