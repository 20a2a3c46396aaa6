# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The gated filter against the textbook; that it stays sound over a drive: test/lab/evaluation."""

import numpy as np
import pytest

from wheel_terra_estimator.estimation.filter.ekf import GatedFilter


def make(n, seed=0):
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((n, n))
    P = A @ A.T + np.eye(n)
    wide = np.full(n, 1e9)
    return GatedFilter(rng.standard_normal(n), P, -wide, wide), P


def test_update_is_the_textbook_one():
    kalman, P = make(6)
    x = kalman.x.copy()
    rng = np.random.default_rng(1)
    H, R, residual = rng.standard_normal((3, 6)), np.array([0.5, 1.0, 2.0]), rng.standard_normal(3)
    # Information form: another way to the same answer.
    information = np.linalg.inv(P) + H.T @ np.diag(1.0 / R) @ H
    posterior = np.linalg.inv(information)
    kalman.update(residual, H, R)
    np.testing.assert_allclose(kalman.P, posterior, rtol=1e-9)
    assert kalman.x == pytest.approx(x + posterior @ H.T @ (residual / R), rel=1e-9)


def test_considered_entries_keep_mean_and_variance_but_their_doubt_counts():
    free, P = make(5)
    held, _ = make(5)
    sure, _ = make(5)
    H, R = np.array([[1.0, 0.0, 2.0, 0.0, 0.0]]), np.array([0.1])
    before = held.x.copy()
    held.update(np.array([1.0]), H, R, considered=(2,))
    assert held.x[2] == before[2]
    assert held.P[2, 2] == pytest.approx(P[2, 2])
    free.update(np.array([1.0]), H, R)
    assert held.P[0, 0] >= free.P[0, 0] - 1e-12
    sure.set(2, before[2], 1e-9)
    sure.update(np.array([1.0]), H, R)
    assert held.P[0, 0] > sure.P[0, 0]
    assert np.linalg.eigvalsh(held.P).min() > 0.0


@pytest.mark.filter_fails
def test_nan_never_stays():
    kalman, _ = make(4)
    kalman.update(np.array([np.nan]), np.ones((1, 4)), np.array([1.0]))
    assert np.isfinite(kalman.x).all()
    assert np.isfinite(kalman.P).all()
    assert kalman.restarts == 1


@pytest.mark.filterwarnings('error')
def test_readings_of_any_size_bring_no_warning_and_no_restart():
    kalman, _ = make(4)
    rng = np.random.default_rng(5)
    for size in 10.0 ** np.arange(-12, 13, 2):
        H = size * rng.standard_normal((3, 4))
        H[2] = H[1] * (1.0 + 1e-13)
        kalman.update(size * rng.standard_normal(3), H, np.array([1e-12, size, 1e-12]) * size)
    assert np.isfinite(kalman.x).all()
    assert (np.linalg.eigvalsh(kalman.P) > -1e-9).all()
    assert kalman.restarts == 0
