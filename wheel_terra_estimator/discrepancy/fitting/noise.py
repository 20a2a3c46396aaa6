# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Noise of the cells: as stated, from repeated rows, or estimated beside a smooth misfit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.discrepancy.fitting.gauss_newton import Fit
from wheel_terra_estimator.discrepancy.fitting.problem import Problem
from wheel_terra_estimator.discrepancy.result import Noise
from wheel_terra_estimator.discrepancy.tables.steady_table import (
    INPUT_UNITS,
    QUANTITIES,
    SteadyTable,
)

ENOUGH_REPEATS = 6  # degrees of freedom from which repeats alone set the noise
# Amplitudes of the smooth misfit that compete while the noise is estimated: whatever is smooth,
# effects included, must not be counted as noise.
_SMOOTH = (0.01, 0.03, 0.1, 0.3, 1.0)
_FIRST_GUESS = 0.01  # of the range
_USUAL, _SPREAD = 1.5, 1.2  # weak prior of the factor on the guess: centre, width of its log
_LEAST = 1e-4  # of the range: noise below it is a matter of rounding
# A few smooth rows, read off a figure or averaged, hide by how much they are off: an estimate is at
# least what it would be if so many cells more were off by this share of the range.
_UNSEEN, _UNSEEN_NOISE = 4.0, 0.02


def stated_noise(table: SteadyTable, scale: FloatArray) -> Noise:
    """Return the stated deviations, those from repeats, and a first guess for the rest."""
    std = table.stated_std.copy()
    origin: dict[str, str] = {}
    repeatability: dict[str, tuple[float, int]] = {}
    for q, quantity in enumerate(QUANTITIES):
        here = np.isfinite(table.measured[:, q])
        if not here.any():
            continue
        pooled, count = repeats(table, q)
        if count:
            repeatability[quantity] = pooled, count
        stated = here & np.isfinite(std[:, q])
        if stated.any():
            # Cells without a stated deviation take the median of the stated ones.
            std[here & ~stated, q] = np.median(std[stated, q])
            origin[quantity] = 'given'
            continue
        if count >= ENOUGH_REPEATS:
            std[here, q] = max(pooled, _LEAST * scale[q])
            origin[quantity] = 'repeats'
        else:
            std[here, q] = _FIRST_GUESS * scale[q]
            origin[quantity] = 'estimated'
    return Noise(std, origin, repeatability)


def repeats(table: SteadyTable, quantity: int) -> tuple[float, int]:
    """Return the pooled deviation of rows with equal inputs, and its degrees of freedom."""
    inputs = [values for name, values in table.columns.items() if name in INPUT_UNITS]
    keys = np.round(np.nan_to_num(np.column_stack(inputs)), 9)
    _, group = np.unique(keys, axis=0, return_inverse=True)
    group = np.ravel(group)
    values = table.measured[:, quantity]
    square, freedom = 0.0, 0
    for g in range(group.max() + 1):
        mine = values[(group == g) & np.isfinite(values)]
        if len(mine) > 1:
            # The median resists an outlier among three or more repeats.
            centre = np.median(mine) if len(mine) > 2 else mine.mean()
            square += float(np.minimum((mine - centre) ** 2, _clip(mine)).sum())
            freedom += len(mine) - 1
    return (float(np.sqrt(square / freedom)), freedom) if freedom else (np.nan, 0)


def _clip(values: FloatArray) -> float:
    spread = 1.4826 * float(np.median(np.abs(values - np.median(values))))
    return np.inf if spread == 0.0 else (5.0 * spread) ** 2


def estimate_noise(noise: Noise, fitted: Fit, problem: Problem, observed: FloatArray) -> Noise:
    """Estimate what was neither stated nor repeated, beside soil and a smooth misfit.

    The marginal likelihood of a Gaussian process (any amplitude) plus the soil's tangent space plus
    white noise is maximised over the noise of each quantity, so that effects do not pass for noise.
    ``problem`` was built with ``noise``; ``observed`` are its (m,) cells.
    """
    unknown = [q for q in range(len(QUANTITIES)) if noise.origin.get(QUANTITIES[q]) == 'estimated']
    if not unknown:
        return noise
    here = fitted.within(problem, observed)
    target = here.residual + here.jacobian @ here.u
    std = noise.std.copy()
    for q in unknown:
        mine = problem.block == q
        if not mine.any():
            mine = problem.quantity == q  # slip errors mix the axes: the cells stand for them
        value, count = _white_part(
            target[mine], here.jacobian[mine], problem.roughness[mine], _LEAST / _FIRST_GUESS
        )
        std[:, q] *= value
        unseen = _UNSEEN * (_UNSEEN_NOISE * problem.scale[q]) ** 2
        weighed = (count * std[:, q] ** 2 + unseen) / (count + _UNSEEN)
        std[:, q] = np.maximum(std[:, q], np.sqrt(weighed))
    return replace(noise, std=std)


def _white_part(
    target: FloatArray, jacobian: FloatArray, roughness: FloatArray, least: float
) -> tuple[float, float]:
    """Return the most probable noise factor and its degrees of freedom."""
    factors = np.geomspace(least, 30.0, 90)
    best, chosen = -np.inf, (1.0, 0.0)
    outer = jacobian @ jacobian.T
    for amplitude in _SMOOTH:
        smooth = outer + np.diag(amplitude**2 * roughness)
        values, vectors = np.linalg.eigh(smooth)
        power = (vectors.T @ target) ** 2
        variance = np.maximum(values, 0.0)[None] + factors[:, None] ** 2
        score = -0.5 * (np.log(variance) + power / variance).sum(axis=1)
        score -= 0.5 * (np.log(factors / _USUAL) / _SPREAD) ** 2
        top = int(np.argmax(score))
        if score[top] > best:
            share = factors[top] ** 2 / variance[top]
            best, chosen = float(score[top]), (float(factors[top]), float((share**2).sum()))
    return chosen[0], max(chosen[1], 2.0)
