# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The smooth part of what a model leaves, against dense algebra of the Gaussian process."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from wheel_terra_estimator.discrepancy.assessment.structural_error import structural_error
from wheel_terra_estimator.discrepancy.fitting.evidence import Floor
from wheel_terra_estimator.discrepancy.fitting.problem import CommonError, build_problem, kernel

ROWS, KEPT = 12, 9  # the rest as if of a reference table
AMPLITUDE = (0.05, 0.2, 0.1)
RANGES = np.array([0.02, 40.0, 3.0])


@pytest.fixture(params=['own noise', 'a slip error felt by all quantities'])
def table(request):
    """Return problem, inputs, covariance of the misfit (of its length) and of the noise."""
    rng = np.random.default_rng(5)
    inputs = rng.uniform(size=(ROWS, 2))
    std = RANGES * rng.uniform(0.02, 0.06, size=(ROWS, 3))
    measured = RANGES * rng.standard_normal((ROWS, 3))
    measured[2, 1] = np.nan
    common = ()
    if request.param != 'own noise':
        slope = RANGES * rng.standard_normal((ROWS, 3))
        common = (CommonError(slope, np.full(ROWS, 0.05), np.arange(ROWS)),)
    problem = build_problem(measured, std, inputs, RANGES, common=common)
    row, quantity = problem.row, problem.quantity
    noise = np.diag(std[row, quantity] ** 2)
    for error in common:
        felt = (error.slope * error.std[:, None])[row, quantity]
        noise += np.where(row[:, None] == row[None, :], np.outer(felt, felt), 0.0)
    size = np.array(AMPLITUDE) if not common else np.full(3, max(AMPLITUDE))
    size = (size * RANGES)[quantity]
    alike = quantity[:, None] == quantity[None, :]

    def smooth(shortened):
        correlation = kernel(inputs / shortened)[np.ix_(row, row)]
        return np.where(alike, correlation, 0.0) * np.outer(size, size)

    return problem, inputs, smooth, noise


@pytest.mark.parametrize('shortened', [1.0, 0.25])
def test_mean_and_band_are_those_of_the_gaussian_process(table, shortened):
    problem, inputs, smooth, noise = table
    draw = np.random.default_rng(6).multivariate_normal
    left = draw(np.zeros(problem.size), smooth(shortened) + noise)
    fitted = SimpleNamespace(residual=problem.rotate(left))
    found = structural_error(problem, inputs, fitted, (Floor(AMPLITUDE, 0.0, False),), KEPT)
    best = max(
        (smooth(length) for length in (1.0, 0.5, 0.25)),
        key=lambda covariance: multivariate_normal(cov=covariance + noise).logpdf(left),
    )
    gain = best @ np.linalg.inv(best + noise)
    std = np.sqrt(np.diag(best - gain @ best))
    kept = problem.row < KEPT
    at = problem.row[kept], problem.quantity[kept]
    assert found.mean.shape == (KEPT, 3)
    np.testing.assert_allclose(found.residual[at], left[kept], rtol=1e-8, atol=1e-12)
    np.testing.assert_allclose(found.mean[at], (gain @ left)[kept], rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(found.std[at], std[kept], rtol=1e-6)
    assert np.isnan(found.mean[2, 1]), 'not measured'


def test_noise_alone_leaves_no_structural_error(table):
    problem, inputs, smooth, noise = table
    even = np.log(0.5)
    floors = Floor((0.0, 0.0, 0.0), even, False), Floor(AMPLITUDE, even, True)
    draw = np.random.default_rng(7).multivariate_normal
    quiet = draw(np.zeros(problem.size), noise)
    loud = draw(np.zeros(problem.size), smooth(1.0) + noise)
    for residual, expected in ((quiet, None), (loud, AMPLITUDE)):
        fitted = SimpleNamespace(residual=problem.rotate(residual))
        found = structural_error(problem, inputs, fitted, floors, ROWS)
        assert (None if found is None else found.amplitude) == expected
