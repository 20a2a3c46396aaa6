# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Is the gap real, and is the soil that closes it believable? Absolute tests of a fit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc  # scipy.stats takes longer to load than a diagnosis

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


def pulls(fitted: Fit) -> dict[str, float]:
    """Return configured number -> shift by the fit, in the deviations of its prior as stated.

    Soil numbers and parameters of effects that are on: a fit may hide what is missing in either.
    """
    return {
        c.key: c.stated * float(u)
        for c, u in zip(fitted.coordinates, fitted.u, strict=True)
        if c.role == 'believed'
    }


def largest_z_score(fitted: Fit) -> float:
    """Return the largest shift of a configured number; 0 where none is free.

    A sum over all numbers would dilute one huge shift, by which an effect outside the catalogue
    that works like another soil (friction that softens with slip) shows itself.
    """
    return max(map(abs, pulls(fitted).values()), default=0.0)
