# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Errors of each quantity on rows that the fits did not see, and what they permit."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.discrepancy.result import Curves, QuantityGap
from wheel_terra_estimator.discrepancy.selection.search import Findings
from wheel_terra_estimator.discrepancy.tables.steady_table import QUANTITIES, SteadyTable

_DRAWS = 1000
_SEED = 5
TOO_FAR = 2.0  # times noise and allowed model error: a channel that is off


def gaps(
    table: SteadyTable, findings: Findings, curves: Curves, floor: float, allowed_error: float
) -> dict[str, QuantityGap]:
    """Return the held-out errors of each quantity; cells rejected as outliers do not count.

    ``floor``, ``allowed_error``: model-error floor in use, and model error that is no reason for
    doubt [share of the range].
    """
    std = _cell_noise(findings)
    measured = table.measured.copy()
    for row, column, _ in findings.outliers:
        if row < len(table):
            measured[row, column] = np.nan
    rng = np.random.default_rng(_SEED)
    found: dict[str, QuantityGap] = {}
    for q, quantity in enumerate(QUANTITIES):
        mine = np.isfinite(measured[:, q])
        if not mine.any():
            continue
        count = int(mine.sum())
        errors = {
            'before': (curves.before - measured)[mine, q] ** 2,
            'refit': (curves.held_out_refit - measured)[mine, q] ** 2,
            'after': (curves.held_out_after - measured)[mine, q] ** 2,
            'fitted': (curves.after - measured)[mine, q] ** 2,
        }
        noise = float(np.sqrt(np.mean(std[: len(table)][mine, q] ** 2)))
        scale = findings.setting.problem.scale[q]
        shrink = low = high = None
        if findings.selection is not None and not np.array_equal(errors['refit'], errors['after']):
            known = noise**2
            shrink = _shrink(errors['refit'].mean(), errors['after'].mean(), known)
            rows = rng.integers(0, count, (_DRAWS, count))
            refit, after = errors['refit'][rows].mean(axis=1), errors['after'][rows].mean(axis=1)
            draws = [_shrink(a, b, known) for a, b in zip(refit, after, strict=True)]
            values = np.array([d for d in draws if d is not None])
            if shrink is not None and len(values) > _DRAWS // 2:
                low, high = (float(v) for v in np.quantile(values, (0.05, 0.95)))
        found[quantity] = QuantityGap(
            float(np.sqrt(errors['before'].mean())),
            float(np.sqrt(errors['refit'].mean())),
            float(np.sqrt(errors['after'].mean())),
            noise,
            float(floor * scale),
            count,
            float(np.sqrt(errors['fitted'].mean())),
            TOO_FAR * float(np.hypot(noise, allowed_error * scale)),
            shrink,
            low,
            high,
        )
    return found


def _cell_noise(findings: Findings) -> FloatArray:
    """(N, 4) noise of the cells, with what uncertain slips and leaving angles add."""
    problem = findings.setting.problem
    std = findings.noise.std.copy()
    cells = problem.std
    if (problem.block < 0).any():
        cells = np.sqrt((np.linalg.inv(problem.rotation) ** 2).sum(axis=1))
    std[problem.row, problem.quantity] = cells
    return std


def channels_off(gap: Mapping[str, QuantityGap]) -> tuple[str, ...]:
    """Return the quantities that unseen rows show to be off by more than is allowed."""
    return tuple(name for name, item in gap.items() if item.after > item.limit)


def _shrink(refit: float, after: float, known: float) -> float | None:
    """Share of the excess error that went away; None where the refit left no excess."""
    excess = refit - known
    if excess <= 0.25 * known:
        return None
    return float(1.0 - np.sqrt(max(after - known, 0.0) / excess))
