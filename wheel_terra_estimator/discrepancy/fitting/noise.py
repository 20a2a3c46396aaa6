# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Noise of the cells: as stated, from repeated rows, or estimated beside a smooth misfit.

And the robust pass: cells that neither model, effect nor a smooth error can explain.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.special import bdtrc, chdtrc

from wheel_terra_estimator.arrays import MAD_TO_STD, BoolArray, FloatArray
from wheel_terra_estimator.discrepancy.fitting.evidence import log_sum
from wheel_terra_estimator.discrepancy.fitting.gauss_newton import Fit
from wheel_terra_estimator.discrepancy.fitting.problem import (
    OUTLIER_FACTOR,
    Problem,
    over_covariance,
)
from wheel_terra_estimator.discrepancy.result import Noise
from wheel_terra_estimator.discrepancy.tables.steady_table import (
    INPUT_COLUMNS,
    QUANTITIES,
    SteadyTable,
)

ENOUGH_REPEATS = 6  # degrees of freedom from which repeats alone set the noise
_WILD = 3.0  # times the usual scatter: more of the worst repeats is a wild reading
SCATTER_CHANCE = 1e-3  # below which repeated rows do not have the stated noise
# Amplitudes of the smooth misfit that compete while the noise is estimated: whatever is smooth,
# effects included, must not be counted as noise.
_SMOOTH = (0.01, 0.03, 0.1, 0.3, 1.0)
_USUAL, _SPREAD = 0.02, 1.2  # of the range; width of the log in a weak prior
# Factors on a guess, and on what is stated: readings scatter by no less than that, and seldom by
# twice as much. Width of the log of the latter.
_FACTORS, _STATED, _TRUST = np.geomspace(0.005, 15.0, 90), np.geomspace(1.0, 2.0, 30), 0.3
_LEAST = 1e-4  # of the range: noise below it is a matter of rounding
# A few smooth rows, read off a figure or averaged, hide by how much they are off: an estimate is at
# least what it would be if so many cells more were off by the usual noise.
_UNSEEN = 4.0
_CLEARLY = 3.0  # nats by which noise of another shape must be more likely


def stated_noise(
    table: SteadyTable, scale: FloatArray, apart: FloatArray, reference: BoolArray | None = None
) -> Noise:
    """Return the stated deviations, those of repeats that scatter by more, a guess for the rest.

    ``apart``: (N,) rows of other numbers do not repeat one another; a ``reference`` has its own.
    """
    std, origin = table.stated_std.copy(), dict[str, str]()
    repeatability, scatter = dict[str, tuple[float, int]](), dict[str, tuple[float, int]]()
    theirs = np.zeros(len(table), dtype=bool) if reference is None else reference
    for q, quantity in enumerate(QUANTITIES):
        here = np.isfinite(table.measured[:, q])
        if not here.any():
            continue
        pooled, count = repeats(table, q, 2.0 * apart + theirs)
        if count:
            repeatability[quantity] = pooled, count
        given = here & np.isfinite(std[:, q])
        origin[quantity], guess = 'estimated', _USUAL * scale[q]
        if count >= ENOUGH_REPEATS:
            origin[quantity], guess = 'repeats', max(pooled, _LEAST * scale[q])
        if given.any():
            # Cells without a stated deviation take the median of the stated ones.
            origin[quantity], guess = 'given', float(np.median(std[given, q]))
        std[here & ~given, q] = guess
        for whose, rows in (('', here & ~theirs), (' of the reference', here & theirs)):
            if not (rows.any() and count):
                continue
            times, own = repeats(table.select(rows), q, apart[rows], std[rows, q])
            if given.any() and own:
                scatter[quantity + whose] = times, own
            # An instrument's noise is not all that repeated runs scatter by: beds do as well.
            wider = own >= ENOUGH_REPEATS and chdtrc(own, own * times**2) < SCATTER_CHANCE
            if wider or (own >= ENOUGH_REPEATS and not given.any() and theirs.any()):
                std[rows, q] *= times
                origin[quantity] = 'repeats'
    return Noise(std, origin, repeatability, scatter)


def repeats(
    table: SteadyTable, quantity: int, apart: FloatArray, stated: FloatArray | None = None
) -> tuple[float, int]:
    """Return the pooled deviation of rows with equal inputs, and its degrees of freedom.

    Over the ``stated`` deviations (N,), where given: a single wild reading is then no noise.
    """
    inputs = [values for name, values in table.columns.items() if name in INPUT_COLUMNS]
    keys = np.round(np.nan_to_num(np.column_stack([*inputs, apart])), 9)
    _, group = np.unique(keys, axis=0, return_inverse=True)
    group = np.ravel(group)
    values = table.measured[:, quantity]
    squares = list[tuple[float, int]]()
    for g in range(group.max() + 1):
        mine = values[(group == g) & np.isfinite(values)]
        if len(mine) > 1:
            # The median resists an outlier among three or more repeats.
            centre = np.median(mine) if len(mine) > 2 else mine.mean()
            spread = MAD_TO_STD * float(np.median(np.abs(mine - np.median(mine))))
            clip = (5.0 * spread) ** 2 if spread else np.inf
            each = np.minimum((mine - centre) ** 2, clip)
            if stated is not None:
                each /= stated[(group == g) & np.isfinite(values)] ** 2
            squares.append((float(each.sum()), len(mine) - 1))
    if stated is not None and len(squares) > 1:
        worst, count = max(squares)
        squares.remove((worst, count))
        usual = sum(square for square, _ in squares) / sum(n for _, n in squares)
        squares.append((min(worst, _WILD**2 * count * usual), count))
    freedom = sum(count for _, count in squares)
    total = sum(square for square, _ in squares)
    return (math.sqrt(total / freedom), freedom) if freedom else (math.nan, 0)


def estimate_noise(
    noise: Noise,
    fitted: Fit,
    shapes: Sequence[FloatArray],  # (N,) noise of each row over its mean: the usual one first
    build: Callable[[FloatArray], Problem],  # the problem with deviations (N, 4)
) -> Noise:
    """Estimate the noise of what was not repeated, beside soil and a smooth misfit.

    The marginal likelihood of a smooth process, the soil's tangent space and white noise weighs the
    noise of each quantity, so that effects do not pass for noise. What was stated is known but for
    a factor.
    """
    unknown, stated = (
        [q for q, name in enumerate(QUANTITIES) if noise.origin.get(name) == origin]
        for origin in ('estimated', 'given')
    )
    best, std = dict.fromkeys(unknown, -np.inf), noise.std.copy()
    usual = {q: math.sqrt(np.nanmean(std[:, q] ** 2)) for q in unknown}
    for shape in shapes if unknown else shapes[:1]:
        guess = noise.std.copy()
        for q in unknown:
            guess[:, q] = usual[q] * shape
        problem = build(guess)
        smooth = problem.covariance(problem.roughness)
        # Soil and errors of inputs, which are no noise of a reading, however large they are.
        known = problem.covariance(1.0) - np.diag(problem.std**2)
        known += fitted.sensitivity @ fitted.sensitivity.T
        target = problem.wanted - problem.flat(fitted.outputs) + fitted.sensitivity @ fitted.u
        for q in (*unknown, *stated):
            cells = problem.quantity == q
            own, block = problem.std[cells], np.ix_(cells, cells)
            sizes = np.outer(own, own)
            part = target[cells] / own, known[block] / sizes, smooth[block] / sizes
            if q in stated:  # whose own shape stays
                likely, _ = _white_part(*part, _STATED, _TRUST)
                std[:, q] = noise.std[:, q] * _STATED[np.argmax(likely)]
                continue
            likely, counts = _white_part(*part, _FACTORS, _SPREAD)
            score = float(log_sum(likely) - np.log(own).sum())
            if score < best[q] + _CLEARLY:
                continue
            best[q] = score
            # Of few rows the most probable noise is mostly too small: the mean of its square.
            square = np.exp(likely - log_sum(likely)) @ (_FACTORS * usual[q]) ** 2
            count = max(counts[np.argmax(likely)], 2.0)
            unseen = _UNSEEN * (_USUAL * problem.scale[q]) ** 2
            weighed = (count * square + unseen) / (count + _UNSEEN)
            there = np.isfinite(noise.std[:, q])
            std[there, q] = math.sqrt(max(square, weighed)) * shape[there]
    return replace(noise, std=std)


def _white_part(
    target: FloatArray,  # (k,) cells of a quantity, as the covariances over their deviations
    known: FloatArray,  # (k, k) covariance of what is no noise
    smooth: FloatArray,  # (k, k) covariance of the smooth misfit of amplitude 1
    factors: FloatArray,
    spread: float,  # deviation of the logarithm in the prior
) -> tuple[FloatArray, FloatArray]:
    """Return the log weight of noise factors, misfits of all sizes together, and their freedom."""
    scores, counts = [], []
    for amplitude in _SMOOTH:
        values, vectors = np.linalg.eigh(known + amplitude**2 * smooth)
        power = (vectors.T @ target) ** 2
        square = factors[:, None] ** 2
        variance = np.maximum(values, 0.0)[None] + square
        scores.append(-0.5 * (np.log(variance) + power / variance).sum(axis=1))
        counts.append(((square / variance) ** 2).sum(axis=1))
    weights = log_sum(np.array(scores), axis=0)
    best = np.argmax(scores, axis=0)
    return weights - 0.5 * (np.log(factors) / spread) ** 2, np.choose(best, counts)


_ROBUST_FLOOR = 0.02  # structural error beside which outliers are sought [share of the range]
SHARE = 0.02  # prior share of outliers among the cells
# Sizes of features narrow in slip that rows may share [share of the range].
NARROW = (0.05, 0.15)
GREATEST_SHARE = 0.12  # of the cells of a table
# Cells on one side at one end of a quantity's range, this improbable by chance, are a misfit there
# (a sensor that saturates) and no outliers.
_CHANCE = 1e-5


def find_outliers(
    problem: Problem, fitted: Fit, amplitude: FloatArray | float, narrow: FloatArray
) -> list[tuple[int, int, float]]:
    """Return (row, quantity, deviation) of the cells to be rejected, worst first.

    One at a time, the cell that gains most from a twelve times larger noise is rejected, predicted
    from all others. A hump or a ripple in slip that all loads share competes with outliers.

    ``problem`` has no cell rejected. Beside a small structural error one of ``amplitude`` is tried,
    (4,) per quantity [share of the range]; ``narrow`` (N, N) comes from `slip_features`.
    """
    jacobian = problem.rotation @ fitted.sensitivity / np.sqrt(fitted.prior)
    target = problem.wanted - problem.flat(fitted.outputs) + fitted.sensitivity @ fitted.u
    sizes: list[FloatArray | float] = [_ROBUST_FLOOR]
    if np.max(amplitude) > _ROBUST_FLOOR:
        sizes.append(np.maximum(amplitude, _ROBUST_FLOOR))
    best, found, chosen = -np.inf, [], None
    for variance in map(problem.variance, sizes):
        inverse = problem.rotation.T @ over_covariance(problem.rotation, variance, jacobian)
        score, cells = _rejected_cells(problem, inverse, target)
        if score > best:
            best, found, chosen = score, cells, inverse
    counts = np.bincount([q for _, q, _ in found], minlength=3)
    if chosen is None or not narrow.any():
        return _scattered(problem, found)
    # Several cells of one quantity: outliers, or a feature that they share?
    plain = np.linalg.inv(chosen)
    for quantity, amplitude in itertools.product(np.flatnonzero(counts >= 2), NARROW):
        size = amplitude * problem.scale[quantity] * (problem.quantity == quantity)
        shared = narrow[np.ix_(problem.row, problem.row)] * np.outer(size, size)
        inverse = np.asarray(np.linalg.inv(plain + shared), dtype=float)
        score, cells = _rejected_cells(problem, inverse, target)
        if score > best:
            best, found = score, cells
    return _scattered(problem, found)


def _scattered(
    problem: Problem, found: list[tuple[int, int, float]]
) -> list[tuple[int, int, float]]:
    """Return the cells without those of a quantity that lie together at one end of its range.

    Outliers are few, fall on both sides and anywhere: the chance of the count (binomial), of equal
    signs, and of all of them among the outermost cells are independent.
    """
    kept = []
    for quantity in sorted({cell[1] for cell in found}):
        mine = [cell for cell in found if cell[1] == quantity]
        here = problem.quantity == quantity
        count, total = len(mine), int(here.sum())
        signs = {cell[2] > 0.0 for cell in mine}
        if count > 1 and len(signs) == 1:
            # An outlier moves its own cell to an end of the range: ranks are of what was due.
            due, rows, std = problem.observed[here], problem.row[here], problem.std[here]
            for row, _, deviation in mine:
                due = np.where(rows == row, due - deviation * std, due)
            places = np.flatnonzero(np.isin(rows[np.argsort(due)], [cell[0] for cell in mine]))
            outermost = min(int(places.max()) + 1, total - int(places.min()))
            chance = float(bdtrc(count - 1, total, SHARE)) * 0.5 ** (count - 1)
            chance *= 2.0 * math.comb(outermost, count) / math.comb(total, count)
            if chance < _CHANCE:
                continue
        kept += mine
    return [cell for cell in found if cell in kept]


def _rejected_cells(
    problem: Problem, inverse: FloatArray, target: FloatArray
) -> tuple[float, list[tuple[int, int, float]]]:
    """Set cells apart greedily; return the log evidence of the result and the cells."""
    extra = (OUTLIER_FACTOR**2 - 1.0) * problem.std**2
    price = np.log((1.0 - SHARE) / SHARE)
    score = 0.5 * (np.linalg.slogdet(inverse)[1] - float(target @ inverse @ target))
    found: list[tuple[int, int, float]] = []
    apart = np.zeros(problem.size, dtype=bool)
    # A cell that a free parameter takes whole tells nothing; rounding may then end below zero.
    least = 1e-9 / problem.std**2
    for _ in range(int(GREATEST_SHARE * problem.size)):
        own = 1.0 / np.maximum(np.diag(inverse), least)
        error = (inverse @ target) * own
        gain = 0.5 * error**2 * (1.0 / own - 1.0 / (own + extra))
        gain -= 0.5 * np.log1p(extra / own)
        gain[apart] = -np.inf
        worst = int(np.argmax(gain))
        if gain[worst] < price:
            break
        score += float(gain[worst]) - price
        apart[worst] = True
        deviation = float(error[worst] / problem.std[worst])
        found.append((int(problem.row[worst]), int(problem.quantity[worst]), deviation))
        column = inverse[:, worst].copy()
        share = extra[worst] / (1.0 + extra[worst] / own[worst])
        inverse = inverse - share * np.outer(column, column)
    return score, found
