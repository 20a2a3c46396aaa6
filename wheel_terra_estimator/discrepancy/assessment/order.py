# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Whether residuals change along the order of the rows: with time, trial, direction of the sweep.

What changes along the rows (a bed that compacts, a sensor that warms up) is no effect of any input,
and is seen by nothing else. Each test permutes the rows, so that it needs no law of the noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.discrepancy.numbers import number, plain
from wheel_terra_estimator.discrepancy.tables.steady_table import (
    INPUT_UNITS,
    ORDER_COLUMNS,
    QUANTITIES,
    SteadyTable,
)

_DRAWS = 2000
_SEED = 11
_SURE = 0.01  # chance, the number of tests paid for, below which a change is one
_LEAST_ROWS = 8
_SAME_AS_INPUT = 0.8  # rank correlation with an input from which the two cannot be told apart
_SEQUENCES = ('row_order', 'date')


@dataclass(frozen=True)
class Change:
    """A quantity whose residuals change along a column, and the chance of that."""

    column: str
    quantity: str
    p_value: float
    strength: float

    @property
    def text(self) -> str:
        """In words."""
        chance = (
            f'chance {number(self.p_value, 1)}' if self.p_value >= 1e-3 else 'chance below 0.001'
        )
        name, column = plain(self.quantity), plain(self.column)
        if self.column in _SEQUENCES:
            how = f'neighbours correlate with {number(self.strength, 2)}'
        else:
            how = f'its values account for {number(100.0 * self.strength, 2)} % of their squares'
        return f'the residuals of {name} change along {column} ({how}; {chance})'


def changes_along_rows(table: SteadyTable, predicted: FloatArray, band: FloatArray) -> list[Change]:
    """Return where residuals change along the order of the rows.

    ``predicted``, ``band``: (N, 4) model values and standard deviations of the cells [m, N, N m].
    """
    columns = [name for name in ORDER_COLUMNS if name in table.columns]
    columns = [name for name in columns if _apart_from_inputs(table, name)]
    rng = np.random.default_rng(_SEED)
    tests = max(len(columns) * len(table.quantities), 1)
    found = []
    for column in columns:
        key = table.columns[column]
        for q, quantity in enumerate(QUANTITIES):
            mine = np.isfinite(table.measured[:, q]) & np.isfinite(key)
            if mine.sum() < _LEAST_ROWS or len(np.unique(key[mine])) < 2:
                continue
            residual = ((table.measured[:, q] - predicted[:, q]) / band[:, q])[mine]
            residual = np.clip(residual - np.median(residual), -4.0, 4.0)  # no outlier decides
            shuffled = rng.permuted(np.tile(residual, (_DRAWS, 1)), axis=1)
            every = np.vstack([residual, shuffled])
            in_sequence = column in _SEQUENCES
            values = _lag_one(every, key[mine]) if in_sequence else _between(every, key[mine])
            chance = (1.0 + float((values[1:] >= values[0]).sum())) / (1.0 + _DRAWS)
            if chance * tests < _SURE:
                found.append(Change(column, quantity, min(chance * tests, 1.0), float(values[0])))
    return found


def _apart_from_inputs(table: SteadyTable, column: str) -> bool:
    """Return whether the order is not that of an input, whose misfit it would show as well."""
    rank = _ranks(table.columns[column])
    inputs = (_ranks(table.columns[name]) for name in table.varying() if name in INPUT_UNITS)
    with np.errstate(invalid='ignore', divide='ignore'):
        return all(not abs(np.corrcoef(rank, other)[0, 1]) > _SAME_AS_INPUT for other in inputs)


def _ranks(values: FloatArray) -> FloatArray:
    known = np.nan_to_num(values, nan=float(np.nanmean(values)))
    _, place = np.unique(known, return_inverse=True)
    return np.ravel(place).astype(float)


def _lag_one(residuals: FloatArray, key: FloatArray) -> FloatArray:
    """(D,) correlation of neighbours along the key."""
    along = residuals[:, np.argsort(key, kind='stable')]
    return (along[:, 1:] * along[:, :-1]).sum(axis=1) / np.maximum((along**2).sum(axis=1), 1e-12)


def _between(residuals: FloatArray, key: FloatArray) -> FloatArray:
    """(D,) share of the squares between the groups of a key."""
    centred = residuals - residuals.mean(axis=1, keepdims=True)
    _, group = np.unique(key, return_inverse=True)
    member = (np.ravel(group)[:, None] == np.arange(group.max() + 1)[None]).astype(float)
    sums = centred @ member
    total = np.maximum((centred**2).sum(axis=1), 1e-12)
    return np.asarray((sums**2 / member.sum(axis=0)).sum(axis=1) / total)
