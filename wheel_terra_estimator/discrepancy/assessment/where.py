# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Where model and measurement disagree: a scan over boxes of the inputs, calibrated."""

from __future__ import annotations

import itertools

import numpy as np

from wheel_terra_estimator.arrays import BoolArray, FloatArray
from wheel_terra_estimator.discrepancy.fitting.gauss_newton import Fit
from wheel_terra_estimator.discrepancy.fitting.problem import Problem
from wheel_terra_estimator.discrepancy.numbers import SHOWN, amount, number, plain, with_unit
from wheel_terra_estimator.discrepancy.result import InputRange, Where
from wheel_terra_estimator.discrepancy.selection.search import Findings
from wheel_terra_estimator.discrepancy.tables.steady_table import QUANTITIES, SteadyTable
from wheel_terra_estimator.frames import unit_of

_LEVELS = 7  # steps into which an input is cut
_LARGEST_SHARE = 0.7  # of the rows in a box; more is "everywhere"
_DRAWS = 400
_SEED = 7
_SURE = 0.05
_ONE_SIGN = 0.3  # below this share of the size a mean misfit is not significant


def locate(findings: Findings, variance: FloatArray) -> Where:
    """Return the region of the inputs in which the soil-refitted model is worst.

    ``variance`` is that of the rotated axes, with the floor. Rows of a reference are not looked at.
    The residuals after a refit are neither independent nor equal in size; the p-value therefore
    comes from noise drawn and refitted on the same rows (linear), under the same scan.
    """

    def own(residual: FloatArray) -> FloatArray:
        """Return (m, K) residuals without what a reference shows, in noise deviations."""
        shared = problem.shared_error(residual, ours, variance)
        return np.asarray((residual - shared) / problem.std[:, None])

    table, nothing, problem = findings.table, findings.nothing, findings.setting.problem
    ours = findings.setting.forward.active
    looked_at = np.ones(len(table), dtype=bool) if ours is None else ours
    cells = own((problem.wanted - problem.flat(nothing.outputs))[:, None])[:, 0]
    cells = np.where(problem.outlier | ~looked_at[problem.row], 0.0, cells)
    excess = dict[int, float]()
    for q in np.unique(problem.quantity).tolist():
        of = cells[(problem.quantity == q) & looked_at[problem.row]]
        excess[q] = max(float((of**2 - 1.0).sum()), 1e-9)
    total = sum(excess.values())
    shares = {QUANTITIES[q]: size / total for q, size in excess.items()}
    worst = max(excess, key=lambda q: excess[q])
    at = problem.quantity == worst
    here, values, std = problem.row[at], np.zeros(len(table)), np.zeros(len(table))
    values[here], std[here] = cells[at], problem.std[at]
    mine = looked_at & (std > 0.0)
    names = [name for name in table.varying() if np.isfinite(table.columns[name]).all()]
    boxes, sides = _boxes(table, names)
    p_value, inside, share_inside = 1.0, mine, 1.0
    box: tuple[InputRange, ...] = ()
    if len(boxes):
        counts = np.maximum(boxes @ mine, 1.0)
        score = _score(boxes @ values**2, counts)
        best = int(np.argmax(score))
        draws = own(_simulated(problem, nothing, None if ours is None else variance))
        null = np.zeros((len(table), _DRAWS))
        null[here] = draws[at]
        null[~mine] = 0.0
        strongest = _score(boxes @ null**2, counts[:, None]).max(axis=0)
        p_value = float((1 + (strongest >= score[best]).sum()) / (1 + len(strongest)))
        chosen = (boxes[best] > 0) & mine
        square = float((values**2).sum())
        share = float((values[chosen] ** 2).sum()) / max(square, 1e-12)
        # A box that holds no more than its rows' share of the gap is no region.
        if p_value < _SURE and share > 1.3 * chosen.sum() / mine.sum():
            box, inside, share_inside = sides[best], chosen, share
    std = std[inside]
    physical = values[inside] * std
    mean, size = float(np.mean(physical)), float(np.sqrt(np.mean(physical**2)))
    noise = float(np.sqrt(np.mean(std**2)))
    quantity, sentence = QUANTITIES[worst], 'no region stands out from the noise'
    if p_value < _SURE:
        sentence = _sentence(quantity, box, mean, size, noise)
    return Where(sentence, quantity, shares, box, np.flatnonzero(inside), share_inside, p_value)


def _boxes(table: SteadyTable, names: list[str]) -> tuple[FloatArray, list[tuple[InputRange, ...]]]:
    """Return (boxes, N) membership and the sides of each box: one input, or slip and another."""
    intervals: dict[str, list[tuple[BoolArray, InputRange]]] = {}
    for name in names:
        values = table.columns[name]
        levels = np.unique(values)
        if len(levels) > _LEVELS:
            levels = np.unique(np.quantile(values, np.linspace(0.0, 1.0, _LEVELS + 1)))
            edges = list(itertools.combinations(levels, 2))
        else:
            edges = list(itertools.combinations_with_replacement(levels, 2))
        found = []
        for low, high in edges:
            member = (values >= low - 1e-12) & (values <= high + 1e-12)
            if 2 <= member.sum() <= _LARGEST_SHARE * len(values):
                found.append((member, InputRange(name, float(low), float(high), unit_of(name))))
        intervals[name] = found
    boxes: list[BoolArray] = []
    sides: list[tuple[InputRange, ...]] = []
    for name in names:
        for member, side in intervals[name]:
            boxes.append(member)
            sides.append((side,))
    for first, second in itertools.combinations(names, 2):
        if 'slip' not in (first, second):
            continue
        for (a, side_a), (b, side_b) in itertools.product(intervals[first], intervals[second]):
            both = a & b
            if both.sum() >= 3:
                boxes.append(both)
                sides.append((side_a, side_b))
    return np.array(boxes, dtype=float).reshape(len(boxes), len(table)), sides


def _score(square: FloatArray, count: FloatArray) -> FloatArray:
    """Return how far a box's squared misfit exceeds the noise: log likelihood ratio of a scale."""
    ratio = np.maximum(square / count, 1.0)
    return 0.5 * count * (ratio - 1.0 - np.log(ratio))


def _simulated(problem: Problem, nothing: Fit, variance: FloatArray | None) -> FloatArray:
    """(m, draws) residuals of a refit without any effect but the error shared with a reference."""
    rng = np.random.default_rng(_SEED)
    jacobian = nothing.sensitivity / problem.std[:, None]
    noise = rng.standard_normal((problem.size, _DRAWS))
    if variance is not None:
        error = np.sqrt(variance - problem.variance(0.0))[:, None] * rng.standard_normal(
            noise.shape
        )
        noise += problem.unrotation @ error / problem.std[:, None]
    precision = jacobian.T @ jacobian + np.diag(nothing.prior)
    left = noise - jacobian @ np.linalg.solve(precision, jacobian.T @ noise)
    return np.asarray(left * problem.std[:, None])


def _sentence(
    quantity: str, box: tuple[InputRange, ...], mean: float, size: float, noise: float
) -> str:
    """Return where the misfit is, its sign and its size."""
    one_sign = abs(mean) > _ONE_SIGN * size
    whole = 'everywhere alike' if one_sign else 'over the whole table'
    where = ' and '.join(map(_text, box)) or whole
    value, signed = (mean, 'on average ') if one_sign else (size, 'of both signs there, ')
    return (
        f'{plain(quantity)} is worst, {where}: measured minus model is {signed}'
        f'{amount(quantity, value)} {SHOWN[quantity][1]}{" there" if one_sign else ""} '
        f'({value / noise:+.1f} noise standard deviations{"" if one_sign else " in size"})'
    )


def _text(side: InputRange) -> str:
    ends = dict.fromkeys((number(side.low), number(side.high)))
    return with_unit(f'at {side.input} {" to ".join(ends)}', side.unit)
