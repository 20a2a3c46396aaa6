# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What no effect and no law explains: the smooth part of the residual, with its band.

The structural error d is the Gaussian process over the rows of ``fitting.problem``; given the
fitted model, its mean is the part of the residual that noise would not leave. It says nothing
outside the range of the rows: its mean falls back to zero there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.discrepancy.fitting.evidence import Floor
from wheel_terra_estimator.discrepancy.fitting.gauss_newton import Fit
from wheel_terra_estimator.discrepancy.fitting.problem import Problem, kernel
from wheel_terra_estimator.discrepancy.tables.steady_table import QUANTITIES

_SHORTENED = (0.5, 0.25)
"""Further factors on the lengths over which a structural error is smooth: a hump is shorter."""


@dataclass(frozen=True)
class StructuralError:
    """Smooth misfit of the fitted model at the rows of the table."""

    # Its most probable standard deviation as a share of the range of each quantity [-]
    amplitude: tuple[float, ...]
    # (N, 4) sinkage [m], drawbar pull [N], torque [N m]: measured minus model, the structural
    # error in it and its standard deviation, the parameters taken as fitted. nan = not measured.
    residual: FloatArray
    mean: FloatArray
    std: FloatArray
    beyond_law: bool = False  # True where the model is the one with the proposed law

    def to_json(self) -> dict[str, Any]:
        """Return the keys of ``report.json``; mean and deviation row by row."""
        measured = [q for q in range(len(QUANTITIES)) if np.isfinite(self.mean[:, q]).any()]
        return {
            'beyond_law': self.beyond_law,
            'quantities': {
                QUANTITIES[q]: {
                    'amplitude': self.amplitude[q],
                    'mean': self.mean[:, q].tolist(),
                    'std': self.std[:, q].tolist(),
                }
                for q in measured
            },
        }


def structural_error(
    problem: Problem,
    inputs: FloatArray,  # (N, d) inputs of the rows, each scaled to a range of 1
    fitted: Fit,
    floors: Sequence[Floor],  # amplitudes that are possible, with their prior probabilities
    rows: int,  # number of rows wanted; the rows of a reference table stand behind them
    *,
    beyond_law: bool = False,
) -> StructuralError | None:
    """Return the structural error that a fit leaves in the first rows of its table.

    In the rotated cells of `problem` covariances are diagonal: with the smooth variance s and the
    noise 1, the share s / (s + 1) of a residual is structural error, and its variance is the same.
    Returns None where the most probable amplitude is nothing.
    """
    own, (best, amplitude) = problem, _most_probable(problem, fitted.residual, floors)
    if not any(amplitude):
        return None
    cells = np.asarray(np.linalg.solve(problem.rotation, fitted.residual), dtype=float)
    for shortened in _SHORTENED:
        view = problem.under(kernel(inputs / shortened))
        value, sizes = _most_probable(view, view.rotate(cells), floors)
        if value > best:
            best, own, amplitude = value, view, sizes
    noise, variance = own.variance(0.0), own.variance(amplitude)
    share = (variance - noise) / variance
    back = np.asarray(np.linalg.inv(own.rotation), dtype=float)
    smooth = back @ (share * own.rotate(cells))
    std = np.sqrt(back**2 @ (share * noise))
    shape = (max(rows, int(problem.row.max()) + 1), len(amplitude))
    values = []
    for flat in (cells, smooth, std):
        values.append(np.full(shape, np.nan))
        values[-1][problem.row, problem.quantity] = flat
    residual, mean, deviation = (value[:rows] for value in values)
    return StructuralError(amplitude, residual, mean, deviation, beyond_law)


def _most_probable(
    problem: Problem, residual: FloatArray, floors: Sequence[Floor]
) -> tuple[float, tuple[float, ...]]:
    """Return the amplitudes under which a residual is most probable, and that probability (log)."""
    variance = problem.variance(np.array([floor.amplitude for floor in floors]))
    fits = -0.5 * (np.log(variance) + residual**2 / variance).sum(axis=1)
    fits += [floor.log_prior for floor in floors]
    best = int(np.argmax(fits))
    return float(fits[best]), floors[best].amplitude
