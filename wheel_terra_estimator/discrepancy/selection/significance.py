# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Is the gap real, and is the soil that closes it believable? Absolute tests of a fit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc, ndtr  # scipy.stats takes longer to load than a diagnosis

from wheel_terra_estimator.discrepancy.fitting.coordinates import SOIL_WIDTHS, WIDENING
from wheel_terra_estimator.discrepancy.fitting.gauss_newton import Fit

FloatArray = NDArray[np.float64]


def chi_square_p_value(fitted: Fit, variance: FloatArray) -> float:
    """P-value of the whole misfit, parameters and their priors integrated out.

    Under the hypothesis, residual and the soil's prior pull together are chi-square with one degree
    of freedom per cell, however many soil parameters were fitted; an effect's strength takes one.
    """
    target = fitted.residual + fitted.jacobian @ fitted.u
    weighted = fitted.jacobian / variance[:, None]
    strength = np.array([c.role == 'strength' for c in fitted.coordinates])
    precision = weighted.T @ fitted.jacobian + np.diag(np.where(strength, 1e-9, 1.0))
    right = weighted.T @ target
    square = float(target @ (target / variance) - right @ np.linalg.solve(precision, right))
    return float(chdtrc(len(target) - strength.sum(), square))


def soil_pulls(fitted: Fit) -> dict[str, float]:
    """Return soil number -> shift by the fit, in the deviations of its prior as stated."""
    return {
        c.name: WIDENING * float(u)
        for c, u in zip(fitted.coordinates, fitted.u, strict=True)
        if c.owner == 'soil'
    }


def soil_p_value(fitted: Fit) -> float:
    """P-value of the soil number that the fit pulls farthest, one of several looked at (Sidak).

    The prior is the one of the evidence: deviations as stated, or too small by ``WIDENING``. A sum
    over all numbers would dilute one huge pull, by which a stranger that works like another soil
    (friction that softens with slip) shows itself.
    """
    pulls = np.abs(list(soil_pulls(fitted).values()))
    if not pulls.size:
        return 1.0
    scales = np.array([WIDENING * width for width, _ in SOIL_WIDTHS])
    shares = np.array([share for _, share in SOIL_WIDTHS])
    one = float(shares @ (2.0 * ndtr(-pulls.max() / scales)))
    return float(-np.expm1(pulls.size * np.log1p(-min(one, 1.0 - 1e-12))))
