# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The measured cells, their noise and the model-error floor in coordinates where both are diagonal.

Cell i: y_i = f_i(u) + d_i + e_i with noise e_i ~ N(0, std_i^2) and a smooth structural error d,
a Gaussian process over the inputs of the table whose standard deviation is a share `a` of the range
of the quantity. In the eigenbasis of std^-1 K std^-1 the covariance for every `a` is diagonal, so
that all amplitudes cost one decomposition.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from wheel_terra_estimator.arrays import BoolArray, FloatArray, IndexArray

# Structural errors are smooth over about a third of the range of an input, with slower parts.
_LENGTHS = (0.35, 1.0)
# A hump or a ripple in slip that all loads, slopes and wheels share is no outlier either.
_SLIP_LENGTH, _OTHER_LENGTH = 0.08, 3.0
# A cell rejected as an outlier is taken to have this many times its noise.
OUTLIER_FACTOR = 12.0


@dataclass(frozen=True)
class Problem:
    """Cells of a table in whitened, rotated coordinates."""

    observed: FloatArray  # (m,) measured values
    # (m,) values that the model has to match: moved along the slip where this is latent
    wanted: FloatArray
    # (m,) indices of each cell
    row: IndexArray
    quantity: IndexArray
    std: FloatArray  # (m,) noise standard deviation, inflated for outliers
    outlier: BoolArray  # (m,) bool
    scale: FloatArray  # (3,) range of each quantity: the unit of the floor
    rotation: FloatArray  # (m, m), by which (m,) or (m, P) cells are whitened and rotated
    # (m,) variance of the floor along each rotated axis at amplitude 1, in noise variances
    roughness: FloatArray
    # (m,) quantity to which each rotated axis belongs; -1 where slip errors mix them
    block: IndexArray
    log_std: float  # sum of the logarithms of the noise (half the log determinant at amplitude 0)
    rows: int  # N

    @property
    def size(self) -> int:
        """Number of cells."""
        return len(self.observed)

    @cached_property
    def unrotation(self) -> FloatArray:
        """(m, m) back from the rotated axes to the cells."""
        return np.asarray(np.linalg.inv(self.rotation), dtype=float)

    def covariance(self, variance: FloatArray | float) -> FloatArray:
        """Return the (m, m) covariance of the cells by variances (m,) of the rotated axes."""
        return np.asarray((self.unrotation * variance) @ self.unrotation.T)

    def inverse(self, variance: FloatArray) -> FloatArray:
        """Return the inverse of that covariance."""
        return np.asarray((self.rotation.T / variance) @ self.rotation)

    def flat(self, values: FloatArray) -> FloatArray:
        """Take the measured cells of an (N, 4, ...) array: (m, ...)."""
        return values[self.row, self.quantity]

    def residual(self, outputs: FloatArray) -> FloatArray:
        """Return what (N, 4) outputs leave of the cells, whitened and rotated."""
        return self.rotation @ (self.wanted - self.flat(outputs))

    @property
    def moved(self) -> FloatArray:
        """(N, 4) ``wanted`` less the readings; 0 where not measured."""
        shift = np.zeros((self.rows, len(self.scale)))
        shift[self.row, self.quantity] = self.wanted - self.observed
        return shift

    def shared_error(
        self, residual: FloatArray, ours: BoolArray | None, variance: FloatArray
    ) -> FloatArray:
        """Return the structural error (m, ...) of our rows as a reference shows it, elsewhere zero.

        Conditional mean of the smooth error given the residuals (m, ...) of the other rows alone;
        ``ours`` is (N,), None without a reference. ``variance``: of the rotated axes, with a floor.
        """
        error = np.zeros_like(residual)
        if ours is None:
            return error
        here = ours[self.row]
        smooth = self.covariance(variance - self.variance(0.0))
        total = self.covariance(variance)
        weights = np.linalg.solve(total[np.ix_(~here, ~here)], residual[~here])
        error[here] = smooth[np.ix_(here, ~here)] @ weights
        return error

    def variance(self, amplitude: ArrayLike) -> FloatArray:
        """Return (m,) variances of the rotated axes.

        ``amplitude``: share of the range; (4,) per quantity, or (F, 4) for (F, m) variances.
        """
        a = np.atleast_1d(np.asarray(amplitude, dtype=float))
        if (self.block < 0).any():
            a = a.max(axis=-1, keepdims=True)
        elif a.shape[-1] > 1:
            a = a[..., self.block]
        return np.asarray(1.0 + a**2 * self.roughness)


@dataclass(frozen=True)
class CommonError:
    """Error of an input, common to all quantities of the rows that share the reading."""

    slope: FloatArray  # (N, 4) derivative of the quantities by the input
    std: FloatArray  # (N,) standard deviation of the input
    group: IndexArray  # (N,) rows of the same number share one reading


def over_covariance(
    vectors: FloatArray, variance: FloatArray, jacobian: FloatArray, prior: FloatArray | float = 1.0
) -> FloatArray:
    """Multiply (m, ...) vectors by the inverse of diag(variance) + J diag(1 / prior) J'.

    J is (m, P) with few columns, ``prior`` the precision of its parameters (Woodbury).
    """
    weighted = jacobian / variance[:, None]
    precision = weighted.T @ jacobian + np.eye(jacobian.shape[1]) * prior
    scaled = (vectors.T / variance).T
    return np.asarray(scaled - weighted @ np.linalg.solve(precision, weighted.T @ vectors))


def kernel(inputs: FloatArray) -> FloatArray:
    """(N, N) correlation of a structural error between rows.

    The (N, d) inputs are each scaled to a range of 1; d may be 0.
    """
    square = ((inputs[:, None, :] - inputs[None, :, :]) ** 2).sum(axis=-1)
    # Among many inputs all rows are far apart: lengths grow, or smooth would mean white.
    square /= max(1.0, 0.5 * inputs.shape[1])
    return np.mean([np.exp(-0.5 * square / length**2) for length in _LENGTHS], axis=0)


def slip_features(inputs: FloatArray, slip: int | None) -> FloatArray:
    """(N, N) correlation of a misfit that is narrow in slip and shared along all other inputs.

    ``slip``: column of the slip in `inputs`; without it, or without another input, nothing can be
    shared and the result is zero.
    """
    if slip is None or inputs.shape[1] < 2:
        return np.zeros((len(inputs), len(inputs)))
    lengths = np.full(inputs.shape[1], _OTHER_LENGTH)
    lengths[slip] = _SLIP_LENGTH
    scaled = inputs / lengths
    return np.exp(-0.5 * ((scaled[:, None, :] - scaled[None, :, :]) ** 2).sum(axis=-1))


def build_problem(
    # ``measured``, ``std``: (N, 4); nan = not measured
    measured: FloatArray,
    std: FloatArray,
    inputs: FloatArray,  # (N, d) inputs for the floor, scaled to a range of 1
    scale: FloatArray,  # (4,) range of each quantity
    outliers: Sequence[tuple[int, int]] = (),  # cells rejected
    # Errors of inputs (slip, leaving angle), common to the quantities of a row
    common: Sequence[CommonError] = (),
    moved: FloatArray | None = None,  # (N, 4) of the differences of model and readings
    group: FloatArray | None = None,  # (N,) rows of other numbers share no structural error
) -> Problem:
    """Return the problem of an (N, 4) table."""
    row, quantity = np.nonzero(np.isfinite(measured))
    deviation = std[row, quantity].copy()
    apart = np.zeros(len(row), dtype=bool)
    for r, q in outliers:
        apart |= (row == r) & (quantity == q)
    deviation[apart] *= OUTLIER_FACTOR
    correlation = kernel(inputs)
    if group is not None:
        correlation = correlation * (group[:, None] == group[None, :])
    m = len(row)
    noise = np.diag(deviation**2)
    for error in common:
        size = error.slope[row, quantity] * error.std[row]
        together = error.group[row][:, None] == error.group[row][None, :]
        noise += np.where(together, np.outer(size, size), 0.0)
    # Structural errors of the quantities are independent, and their noise unless inputs err.
    alike = quantity[:, None] == quantity[None, :]
    sizes = np.outer(scale[quantity], scale[quantity])
    smooth = np.where(alike, correlation[np.ix_(row, row)] * sizes, 0.0)
    block = np.full(m, -1, dtype=np.intp) if common else quantity
    rotation, roughness, log_std = np.zeros((m, m)), np.empty(m), 0.0
    for part in np.unique(block):
        mine = np.flatnonzero(block == part)
        square = np.ix_(mine, mine)
        lower = np.linalg.cholesky(noise[square])
        whitening = np.linalg.inv(lower)
        values, vectors = np.linalg.eigh(whitening @ smooth[square] @ whitening.T)
        rotation[square], roughness[mine] = vectors.T @ whitening, np.maximum(values, 0.0)
        log_std += float(np.log(np.diag(lower)).sum())
    observed = measured[row, quantity]
    return Problem(
        observed,
        observed if moved is None else observed + moved[row, quantity],
        row,
        quantity,
        deviation,
        apart,
        scale,
        rotation,
        roughness,
        block,
        log_std,
        len(measured),
    )
