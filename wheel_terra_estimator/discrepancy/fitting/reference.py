# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A reference table: rows without the effect in question, so that common structural error cancels.

Both tables are fitted as one. Soil and structural error are shared by all rows, candidate effects
act on the rows under diagnosis only. Where a row of either table has a neighbour in the other, the
structural error found there is taken off here.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.discrepancy.fitting.gauss_newton import Fit
from wheel_terra_estimator.discrepancy.fitting.problem import Problem
from wheel_terra_estimator.discrepancy.tables.steady_table import (
    INPUT_UNITS,
    SteadyTable,
    concatenated,
)
from wheel_terra_estimator.errors import UserError

FloatArray = NDArray[np.float64]


def join(table: SteadyTable, reference: SteadyTable) -> tuple[SteadyTable, NDArray[np.bool_]]:
    """Return both tables as one, and which rows candidate effects act on.

    Raises
    ------
    UserError
        If the two share no measured quantity, or only one of them states a column.
    """
    if not set(table.quantities) & set(reference.quantities):
        raise UserError(
            f'{reference.name}: measures {", ".join(reference.quantities)}, but {table.name} '
            f'{", ".join(table.quantities)}; a reference needs a quantity of the table'
        )
    for column in set(table.columns) ^ set(reference.columns):
        if column in INPUT_UNITS or column == 'leaving_angle':
            has, lacks = (table, reference) if column in table.columns else (reference, table)
            raise UserError(
                f'{lacks.name}: no column {column!r}, which {has.name} has; state it in both'
            )
    notes = (*table.notes, f'{len(reference)} rows of {reference.name} as reference')
    joined = concatenated(table.name, (table, reference), notes)
    return joined, np.arange(len(joined)) < len(table)


def shared_error(
    problem: Problem,
    fitted: Fit,
    observed: FloatArray,
    amplitude: float,
    active: NDArray[np.bool_],
) -> FloatArray:
    """Return the structural error of the rows under diagnosis as the reference rows show it.

    Conditional mean of the smooth error given the residuals of the reference rows alone.

    Returns
    -------
    numpy.ndarray
        (N, 4), zero where nothing was measured and on the rows of the reference.
    """
    unrotate = np.linalg.inv(problem.rotation)
    noise = problem.variance(0.0)
    smooth = (unrotate * (problem.variance(amplitude) - noise)) @ unrotate.T
    total = smooth + (unrotate * noise) @ unrotate.T
    ours = active[problem.row]
    residual = observed - problem.flat(fitted.outputs)
    weights = np.linalg.solve(total[np.ix_(~ours, ~ours)], residual[~ours])
    error = np.zeros_like(fitted.outputs)
    error[problem.row[ours], problem.quantity[ours]] = smooth[np.ix_(ours, ~ours)] @ weights
    return error
