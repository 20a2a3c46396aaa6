# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Does the soil change along a drive? A stretch of it with a soil of its own, weighed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.discrepancy.fitting.gauss_newton import Fit
from wheel_terra_estimator.discrepancy.fitting.outliers import inverse_covariance
from wheel_terra_estimator.discrepancy.numbers import number
from wheel_terra_estimator.discrepancy.selection.weights import Setting
from wheel_terra_estimator.discrepancy.tables.steady_table import SteadyTable

# What differs most between stretches of ground; prior deviations of the difference (widened ones).
_FIELDS = ('stiffness', 'tan_friction')
_WIDTH = 3.0
_LEAST_ROWS = 4  # in a stretch and outside it
_SURE = 5.0  # nats, the choice of the stretch paid for


@dataclass(frozen=True)
class Stretch:
    """A stretch whose soil differs: times [s], factors there over elsewhere, nats gained."""

    start: float
    end: float
    stiffness: float
    friction: float
    gain: float

    @property
    def text(self) -> str:
        """In words."""
        grip = ''
        if abs(self.friction - 1.0) > 0.05:
            grip = f' and has {number(self.friction, 2)} times the friction coefficient'
        return (
            f'the soil changes along the way: from {self.start:.0f} to {self.end:.0f} s it is '
            f'about {number(self.stiffness, 2)} times as stiff{grip} as on the rest of the drive'
        )


def changed_stretch(
    table: SteadyTable, setting: Setting, fitted: Fit, variance: FloatArray
) -> Stretch | None:
    """Return the stretch that most wants a soil of its own, if the rows are sure of one.

    Around the fit everything is linear: for each stretch the evidence for two more soil parameters,
    which act on its rows only, follows from the inverse covariance of the cells.
    """
    if 'time' not in table.columns:
        return None
    time, problem = table.columns['time'], setting.problem
    place = {c.name: i for i, c in enumerate(fitted.coordinates) if c.owner == 'soil'}
    columns = fitted.sensitivity[:, [place[name] for name in _FIELDS]]
    inverse = inverse_covariance(variance, fitted.jacobian / np.sqrt(fitted.prior))
    inverse = problem.rotation.T @ inverse @ problem.rotation
    target = setting.observed - problem.flat(fitted.outputs) + fitted.sensitivity @ fitted.u
    # Sums over the cells of each time; those of a stretch are differences of running sums.
    times = np.unique(time)
    at = np.searchsorted(times, time)[problem.row]
    member = (at[None, :] == np.arange(len(times))[:, None]).astype(float)
    pull = member @ (columns * (inverse @ target)[:, None])  # (T, 2)
    pairs = np.einsum('mp,mn,nq->mnpq', columns, inverse, columns)
    mass = np.einsum('am,mnpq,bn->abpq', member, pairs, member, optimize=True)  # (T, T, 2, 2)
    rows = np.bincount(np.searchsorted(times, time), minlength=len(times))
    best: Stretch | None = None
    tried = 0
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
            if best is None or gain > best.gain:
                stiffness, friction = (
                    float(np.exp(fitted.coordinates[place[name]].scale * x))
                    for name, x in zip(_FIELDS, change, strict=True)
                )
                best = Stretch(float(times[first]), float(times[last]), stiffness, friction, gain)
    if best is None or best.gain - np.log(tried) < _SURE:
        return None
    return best
