# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Cross-validation: predictions of rows left out of a fit by groups of slip, and their limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from wheel_terra_estimator.arrays import FloatArray, IndexArray
from wheel_terra_estimator.discrepancy.fitting.gauss_newton import Fit, fit
from wheel_terra_estimator.discrepancy.result import Curves, QuantityGap
from wheel_terra_estimator.discrepancy.selection.search import Findings
from wheel_terra_estimator.discrepancy.selection.weights import Setting
from wheel_terra_estimator.discrepancy.tables.steady_table import QUANTITIES, SteadyTable

GROUPS = 8
_REFITS = 7  # iterations of a fit without a group; it starts at the fit to all rows


def slip_groups(table: SteadyTable) -> IndexArray:
    """Return (N,) group of each row: neighbouring slips together, equal ones never separated."""
    return level_groups(table.columns['slip'], GROUPS, 3)


def level_groups(values: FloatArray, most: int, decimals: int = 9) -> IndexArray:
    """Return (N,) group of each row: neighbouring levels together, in no more than ``most``."""
    levels, rank = np.unique(np.round(values, decimals), return_inverse=True)
    return (np.ravel(rank) * min(most, len(levels)) // len(levels)).astype(np.intp)


def hold_out(
    setting: Setting, fits: Sequence[Fit], variance: FloatArray, groups: IndexArray
) -> list[FloatArray]:
    """Return the (N, 4) predictions of every fit, each row by parameters found without its group.

    Rows of a negative group (a reference) always stay in; what they show of a structural error is
    part of a prediction. Parameters are fitted again: where soil numbers lie in a bent valley or at
    a bound, one linear step ends far from the best.
    """
    problem = setting.problem
    inverse = problem.inverse(variance)
    labels = np.unique(groups[groups >= 0])
    weights = [_without(inverse, np.flatnonzero(groups[problem.row] == k)) for k in labels]
    tasks = [(fitted, kept) for fitted in fits for kept in weights]
    ends = fit(
        setting.forward,
        problem,
        [(fitted.names, fitted.coordinates) for fitted, _ in tasks],
        [fitted.u for fitted, _ in tasks],
        variance,
        np.array([fitted.angle for fitted, _ in tasks]),
        _REFITS,
        [kept for _, kept in tasks],
    )
    results = []
    for index, fitted in enumerate(fits):
        outputs = fitted.outputs.copy()
        mine = ends[index * len(labels) : (index + 1) * len(labels)]
        unseen = setting.predicted([end.outputs for end in mine], variance)
        for label, values in zip(labels, unseen, strict=True):
            outputs[groups == label] = values[groups == label]
        results.append(outputs)
    return results


def _without(inverse: FloatArray, out: IndexArray) -> FloatArray:
    """Return the inverse covariance of the cells but those at ``out``, which get zeros.

    It is what is left of the inverse of all when the block of the others is eliminated (Schur), so
    that no large matrix is decomposed for any group.
    """
    kept = inverse.copy()
    kept -= inverse[:, out] @ np.linalg.solve(inverse[np.ix_(out, out)], inverse[out])
    kept[out] = kept[:, out] = 0.0
    return kept


TOO_FAR = 2.0  # times noise and allowed model error: a channel that is off


def gaps(
    table: SteadyTable, findings: Findings, curves: Curves, allowed_error: float
) -> dict[str, QuantityGap]:
    """Return the held-out errors of each quantity; cells rejected as outliers do not count.

    ``allowed_error``: tolerated model error [share of the range].
    """
    std, measured = _cell_noise(findings)[: len(table)], kept_cells(table, findings)
    found: dict[str, QuantityGap] = {}
    for q, quantity in enumerate(QUANTITIES):
        mine = np.isfinite(measured[:, q])
        if not mine.any():
            continue
        noise = float(np.sqrt(np.mean(std[mine, q] ** 2)))
        allowed = allowed_error * findings.setting.problem.scale[q]
        found[quantity] = QuantityGap(
            before=error(curves.before, measured, q),
            refit=error(curves.held_out_refit, measured, q),
            after=error(curves.held_out_after, measured, q),
            noise=noise,
            fitted=error(curves.alone, measured, q),
            limit=TOO_FAR * float(np.hypot(noise, allowed)),
        )
    return found


def kept_cells(table: SteadyTable, findings: Findings) -> FloatArray:
    """(N, 4) measured cells of the table; nan where they were rejected."""
    measured = table.measured.copy()
    for row, column, _ in findings.outliers:
        if row < len(table):
            measured[row, column] = np.nan
    return measured


def error(outputs: FloatArray, measured: FloatArray, q: int) -> float:
    """Root mean square of what outputs leave of the cells (N, 4) of a quantity."""
    return float(np.sqrt(np.nanmean((outputs[: len(measured)] - measured)[:, q] ** 2)))


def _cell_noise(findings: Findings) -> FloatArray:
    """(N, 4) noise of the cells, with what uncertain slips and leaving angles add."""
    problem = findings.setting.problem
    std = findings.noise.std.copy()
    std[problem.row, problem.quantity] = np.sqrt((problem.unrotation**2).sum(axis=1))
    return std


def channels_off(gap: Mapping[str, QuantityGap]) -> tuple[str, ...]:
    """Return the quantities that unseen rows show to be off by more than is allowed."""
    return tuple(name for name, item in gap.items() if item.after > item.limit)
