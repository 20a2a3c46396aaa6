# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Errors of each quantity on rows that the fits did not see, and what they permit."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from wheel_terra_estimator.arrays import BoolArray, FloatArray
from wheel_terra_estimator.discrepancy.result import Curves, QuantityGap
from wheel_terra_estimator.discrepancy.selection.search import Findings
from wheel_terra_estimator.discrepancy.tables.steady_table import QUANTITIES, SteadyTable

TOO_FAR = 2.0  # times noise and allowed model error: a channel that is off


def gaps(
    table: SteadyTable, findings: Findings, curves: Curves, allowed_error: float
) -> dict[str, QuantityGap]:
    """Return the held-out errors of each quantity; cells rejected as outliers do not count.

    ``allowed_error``: model error that is no reason for doubt [share of the range].
    """
    std = _cell_noise(findings)
    measured = table.measured.copy()
    for row, column, _ in findings.outliers:
        if row < len(table):
            measured[row, column] = np.nan
    found: dict[str, QuantityGap] = {}
    for q, quantity in enumerate(QUANTITIES):
        mine = np.isfinite(measured[:, q])
        if not mine.any():
            continue
        noise = float(np.sqrt(np.mean(std[: len(table)][mine, q] ** 2)))
        allowed = allowed_error * findings.setting.problem.scale[q]

        def error(values: FloatArray, q: int = q, mine: BoolArray = mine) -> float:
            return float(np.sqrt(np.mean((values - measured)[mine, q] ** 2)))

        found[quantity] = QuantityGap(
            before=error(curves.before),
            refit=error(curves.held_out_refit),
            after=error(curves.held_out_after),
            noise=noise,
            fitted=error(curves.after),
            limit=TOO_FAR * float(np.hypot(noise, allowed)),
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
