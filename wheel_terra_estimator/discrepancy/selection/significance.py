# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Is the gap real? Two tests of "the soil alone explains these rows", calibrated by simulation."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc, ndtr  # scipy.stats takes longer to load than a diagnosis

from wheel_terra_estimator.discrepancy.fitting.coordinates import SOIL_WIDTHS, WIDENING
from wheel_terra_estimator.discrepancy.fitting.gauss_newton import Fit
from wheel_terra_estimator.discrepancy.selection.signatures import Signature, against_soil

FloatArray = NDArray[np.float64]

_DRAWS = 20000
_SEED = 20261121  # the same table gives the same report


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


def scan_p_value(
    nothing: Fit, variance: FloatArray, signatures: Mapping[str, Signature], one_sided: set[str]
) -> float:
    """P-value of the strongest agreement with any effect's signature, among all effects.

    A goodness-of-fit test is blind to a small but systematic misfit; this one looks along the
    signatures, and its null distribution (parametric bootstrap of the soil refit) contains the
    choice among them.

    Parameters
    ----------
    one_sided : set of str
        Effects whose strength has one sign only.
    """
    names = [name for name, s in signatures.items() if s.distance > 1e-6]
    if not names:
        return 1.0
    changes = np.column_stack([signatures[name].change for name in names])
    # Score of each signature, soil integrated out: linear in the data, so that its joint null
    # distribution is a Gaussian of as many dimensions as there are effects.
    forms = against_soil(nothing, variance, changes)
    spread = changes.T @ forms
    std = np.sqrt(np.diag(spread))
    target = nothing.residual + nothing.jacobian @ nothing.u
    observed = forms.T @ target / std
    sided = np.array([name in one_sided for name in names])
    values, vectors = np.linalg.eigh(spread / np.outer(std, std))
    rng = np.random.default_rng(_SEED)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    draws = rng.standard_normal((_DRAWS, len(names))) @ root.T
    strongest = _strength(draws, sided).max(axis=1)
    exceeding = int((strongest >= _strength(observed, sided).max()).sum())
    return (exceeding + 1) / (_DRAWS + 1)


def _strength(forms: FloatArray, one_sided: NDArray[np.bool_]) -> FloatArray:
    return np.where(one_sided, forms, np.abs(forms))
