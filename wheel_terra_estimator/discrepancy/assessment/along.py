# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What changes along the rows: the soil of a drive, or residuals in the order of the rows.

What changes with time, trial or direction is no effect of any input; each test permutes the rows.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.discrepancy.fitting.gauss_newton import Fit
from wheel_terra_estimator.discrepancy.fitting.problem import over_covariance
from wheel_terra_estimator.discrepancy.numbers import number, plain
from wheel_terra_estimator.discrepancy.selection.weights import Setting
from wheel_terra_estimator.discrepancy.tables.steady_table import (
    INPUT_COLUMNS,
    ORDER_COLUMNS,
    QUANTITIES,
    SteadyTable,
)

# What differs most between stretches of ground; prior deviations of the difference (widened ones).
_FIELDS = ('stiffness', 'tan_friction')
_WIDTH = 3.0
_LEAST_ROWS = 4  # in a stretch and outside it
_SURE = 5.0  # nats, the choice of the stretch paid for
_TOLD = 0.05  # relative change: a smaller one is not told


class Stretch(NamedTuple):
    """A stretch whose soil differs: in words, times [s], factor on stiffness, nats gained."""

    text: str
    start: float
    end: float
    stiffness: float
    gain: float


def changed_stretch(
    table: SteadyTable, setting: Setting, fitted: Fit, variance: FloatArray
) -> Stretch | None:
    """Return the stretch that most probably has a soil of its own, if that is certain enough.

    Around the fit everything is linear: for each stretch the evidence for two more soil parameters,
    which act on its rows only, follows from the inverse covariance of the cells.
    """
    if 'time' not in table.columns:
        return None
    time, problem = table.columns['time'], setting.problem
    place = {c.name: i for i, c in enumerate(fitted.coordinates) if c.owner == 'soil'}
    columns = fitted.sensitivity[:, [place[name] for name in _FIELDS]]
    jacobian = fitted.jacobian / np.sqrt(fitted.prior)
    inverse = problem.rotation.T @ over_covariance(problem.rotation, variance, jacobian)
    target = problem.wanted - problem.flat(fitted.outputs) + fitted.sensitivity @ fitted.u
    # Sums over the cells of each time; those of a stretch are differences of running sums.
    times = np.unique(time)
    at = np.searchsorted(times, time)[problem.row]
    member = (at[None, :] == np.arange(len(times))[:, None]).astype(float)
    pull = member @ (columns * (inverse @ target)[:, None])  # (T, 2)
    pairs = np.einsum('mp,mn,nq->mnpq', columns, inverse, columns)
    mass = np.einsum('am,mnpq,bn->abpq', member, pairs, member, optimize=True)  # (T, T, 2, 2)
    rows = np.bincount(np.searchsorted(times, time), minlength=len(times))
    best, where, tried = -np.inf, (0, 0, np.zeros(2)), 0
    for first in range(len(times)):
        for last in range(first, len(times)):
            inside = int(rows[first : last + 1].sum())
            if not _LEAST_ROWS <= inside <= len(time) - _LEAST_ROWS:
                continue
            tried += 1
            part = slice(first, last + 1)
            precision = mass[part, part].sum(axis=(0, 1)) + np.eye(2) / _WIDTH**2
            force = pull[part].sum(axis=0)
            change = np.linalg.solve(precision, force)
            gain = 0.5 * float(force @ change) - 0.5 * float(np.linalg.slogdet(precision)[1])
            gain -= 2.0 * np.log(_WIDTH)
            if gain > best:
                best, where = gain, (first, last, change)
    if not tried or best - np.log(tried) < _SURE:
        return None
    first, last, change = where
    stiffness, friction = (
        float(np.exp(fitted.coordinates[place[name]].scale * x))
        for name, x in zip(_FIELDS, change, strict=True)
    )
    changes = (
        (stiffness, f'is about {number(stiffness, 2)} times as stiff'),
        (friction, f'has {number(friction, 2)} times the friction coefficient'),
    )
    said = ' and '.join(words for factor, words in changes if abs(factor - 1.0) > _TOLD)
    if not said:
        return None  # sure, and of no weight
    text = (
        f'the soil changes along the way: from {times[first]:.0f} to {times[last]:.0f} s it {said} '
        'as on the rest of the drive'
    )
    return Stretch(text, float(times[first]), float(times[last]), stiffness, best)


_DRAWS = 5000
_SEED = 11
_CHANCE = 0.01  # chance, the number of tests paid for, below which a change is one
_FEWEST_ROWS = 8
_SAME_AS_INPUT = 0.8  # rank correlation with an input from which the two cannot be separated
_SEQUENCES = ('row_order', 'date')


@dataclass(frozen=True)
class Change:
    """A quantity whose residuals change along a column, and the chance of that."""

    column: str
    quantity: str
    p_value: float
    strength: float
    drift: bool = False  # ``strength`` is the correlation with the order, else that of neighbours

    @property
    def text(self) -> str:
        """In words."""
        chance = (
            f'chance {number(self.p_value, 1)}' if self.p_value >= 1e-3 else 'chance below 0.001'
        )
        name, column = plain(self.quantity), plain(self.column)
        if self.drift:
            how = f'a drift: their correlation with it is {number(self.strength, 2)}'
        elif self.column in _SEQUENCES:
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
    tried = {name: (_lag_one, _drift) if name in _SEQUENCES else (_between,) for name in columns}
    tests = max(sum(map(len, tried.values())) * len(table.quantities), 1)
    found = []
    for column, statistics in tried.items():
        key = table.columns[column]
        for q, quantity in enumerate(QUANTITIES):
            mine = np.isfinite(table.measured[:, q]) & np.isfinite(key)
            if mine.sum() < _FEWEST_ROWS or len(np.unique(key[mine])) < 2:
                continue
            residual = ((table.measured[:, q] - predicted[:, q]) / band[:, q])[mine]
            residual = np.clip(residual - np.median(residual), -4.0, 4.0)  # no outlier decides
            shuffled = rng.permuted(np.tile(residual, (_DRAWS, 1)), axis=1)
            every = np.vstack([residual, shuffled])
            changes = list[Change]()
            for statistic in statistics:
                values = statistic(every, key[mine])
                drift = statistic is _drift  # of either sign
                size = np.abs(values) if drift else values
                chance = tests * (1.0 + float((size[1:] >= size[0]).sum())) / (1.0 + _DRAWS)
                changes.append(Change(column, quantity, min(chance, 1.0), float(values[0]), drift))
            likeliest = min(changes, key=lambda change: change.p_value)
            if likeliest.p_value < _CHANCE:
                found.append(likeliest)
    return found


def _apart_from_inputs(table: SteadyTable, column: str) -> bool:
    """Return whether the order is not that of an input, whose misfit it would show as well."""
    rank = _ranks(table.columns[column])
    inputs = (_ranks(table.columns[name]) for name in table.varying() if name in INPUT_COLUMNS)
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


def _drift(residuals: FloatArray, key: FloatArray) -> FloatArray:
    """(D,) correlation with the rank of the key."""
    rank, centred = _ranks(key), residuals - residuals.mean(axis=1, keepdims=True)
    rank = rank - rank.mean()
    size = np.sqrt((centred**2).sum(axis=1) * (rank**2).sum())
    return centred @ rank / np.maximum(size, 1e-12)


def _between(residuals: FloatArray, key: FloatArray) -> FloatArray:
    """(D,) share of the squares between the groups of a key."""
    centred = residuals - residuals.mean(axis=1, keepdims=True)
    _, group = np.unique(key, return_inverse=True)
    member = (np.ravel(group)[:, None] == np.arange(group.max() + 1)[None]).astype(float)
    sums = centred @ member
    total = np.maximum((centred**2).sum(axis=1), 1e-12)
    return np.asarray((sums**2 / member.sum(axis=0)).sum(axis=1) / total)
