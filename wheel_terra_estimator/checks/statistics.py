# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Robust statistics of the checks, and the cross-validation of a remedy.

A remedy found on one half of a recording is applied to the other: the residual of the evidence has
to fall there, and no competing remedy may do as well.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.arrays import MAD_TO_STD, BoolArray, FloatArray

HUBER = 2.0  # residuals beyond this many deviations count less in a robust fit
ROUNDS = 8  # reweighted fits
BLOCKS = 12
"""Number of blocks of time that a standard deviation is estimated from: residuals of a drive are
correlated over seconds, rows are not independent."""
MOST_TIMES = 2_000_000  # even steps over a drive: 28 hours at 20 Hz
LONGEST_PAUSE = 3600.0  # between stamps of one drive [s]
DRIFT = 6.0  # slopes change more slowly than this [s], speeds faster
UNIFORM_STD = 1.0 / math.sqrt(12.0)  # of what lies anywhere in an interval, over its length [-]
MOST_STEPS = 200  # different values of a reading beyond which steps do not matter
SAME_VALUE = 1e-6  # share of a great value below which two values are one
OFF_A_STEP = 0.05  # distance from a multiple of a step, as a share of it
LEAST_HALF = 12  # rows of a half that something is found on, at least
LEAST_FALL = 0.7  # greatest residual with a remedy over that without, on the other half [-]
LEAST_MARGIN = 0.8  # the same over that with a competing remedy [-]


class Estimate(NamedTuple):
    """A number with one standard deviation."""

    value: float
    std: float

    def sigmas_from(self, other: float) -> float:
        """Return the distance to a number in standard deviations."""
        return abs(self.value - other) / max(self.std, 1e-12)


def even_times(time: FloatArray, step: float) -> FloatArray:
    """Return times [s] at even steps over a drive, given its increasing stamps [s]; one at least.

    Where the stamps jump by years (a clock that was set late, a damaged stamp) it is the stretch
    with the most of them.
    """
    if (time[-1] - time[0]) / step > MOST_TIMES:
        stretches = np.split(time, np.flatnonzero(np.diff(time) > LONGEST_PAUSE) + 1)
        time = max(stretches, key=len)
    end = min(float(time[-1]), float(time[0]) + MOST_TIMES * step)
    return np.asarray(time[0] + step * np.arange(max(math.ceil((end - time[0]) / step), 1)))


def robust_std(values: FloatArray) -> float:
    """Return the standard deviation that fits the middle half of the values; nan for none."""
    known = values[np.isfinite(values)]
    return float(spread(known)) if known.size else math.nan


def spread(values: FloatArray) -> Any:
    """Return the deviation of known values along the first axis, as `robust_std` does."""
    return MAD_TO_STD * _median(np.abs(values - _median(values)))


def _median(values: FloatArray) -> Any:
    """Return what numpy's does along the first axis, for few values several times as fast."""
    half = len(values) // 2
    ordered = np.partition(values, half, axis=0)
    low = ordered[half] if len(values) % 2 else ordered[:half].max(axis=0)
    return 0.5 * (low + ordered[half])


def block_fit(
    design: FloatArray, target: FloatArray, instruments: FloatArray | None = None
) -> list[Estimate]:
    """Return a robust fit whose deviations come from leaving out one block of time at a time.

    The delete-one-block jackknife (Kuensch 1989) allows for residuals that hang together in time.
    Noise of a column makes its coefficient too small, unless ``instruments`` has in its place
    another reading of the same (Wald 1940).
    """
    return block_fits(design, target[:, None], instruments)[0]


def block_fits(
    design: FloatArray, targets: FloatArray, instruments: FloatArray | None = None
) -> list[list[Estimate]]:
    """Return what `block_fit` does for each column of the targets (k, n)."""
    # Rows are quicker to sort and to multiply than columns.
    instruments = np.ascontiguousarray((design if instruments is None else instruments).T)
    targets = np.ascontiguousarray(targets.T)
    whole, weight = _huber(design, targets, instruments)
    edges = np.linspace(0, len(design), BLOCKS + 1).astype(int)[:, None]
    rows = edges[:-1] + np.arange(np.diff(edges, axis=0).max())  # of each block, or beyond it
    there, rows = rows < edges[1:], np.minimum(rows, len(design) - 1)
    weighted = np.moveaxis((instruments * weight[:, None])[..., rows] * there, 2, 0)
    normals = weighted @ design[rows][:, None]
    rights = _times(weighted, np.moveaxis(targets[:, rows], 1, 0))
    left_out = _solve(normals.sum(axis=0) - normals, rights.sum(axis=0) - rights)
    scatter = ((left_out - left_out.mean(axis=0)) ** 2).sum(axis=0)
    std = np.sqrt((BLOCKS - 1) / BLOCKS * scatter)
    return [
        [Estimate(float(v), float(s)) for v, s in zip(*fit, strict=True)]
        for fit in zip(whole, std, strict=True)
    ]


def _huber(
    design: FloatArray, targets: FloatArray, instruments: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return coefficients (n, p) and weights (n, k) for targets (n, k), instruments (p, k)."""
    weight: FloatArray = np.ones(targets.shape)
    coefficients: FloatArray = np.zeros((len(targets), design.shape[1]))
    for _ in range(ROUNDS):
        weighted = instruments * weight[:, None]
        coefficients = _solve(weighted @ design, _times(weighted, targets))
        residual = targets - coefficients @ design.T
        scale = np.maximum(spread(residual.T), 1e-12)[:, None]
        weight = 1.0 / np.maximum(np.abs(residual) / (HUBER * scale), 1.0)
    return coefficients, weight


def _times(weighted: FloatArray, targets: FloatArray) -> FloatArray:
    """Return the products (..., p) of weighted instruments (..., p, k) and targets (..., k)."""
    return np.asarray((weighted @ targets[..., None])[..., 0])


def _solve(normal: FloatArray, right: FloatArray) -> FloatArray:
    """Solve normal equations (..., p, p) after scaling; a column of zeros gets coefficient 0."""
    size = np.sqrt(np.maximum(np.abs(np.diagonal(normal, axis1=-2, axis2=-1)), 1e-300))
    scaled = normal / (size[..., :, None] * size[..., None, :]) + 1e-12 * np.eye(size.shape[-1])
    return np.asarray(np.linalg.solve(scaled, (right / size)[..., None])[..., 0] / size)


def moving_mean(values: NDArray[Any], width: int) -> NDArray[Any]:
    """Return the mean of (k,) values over so many rows around each, mirrored at the ends.

    Of a record that is shorter, over as many rows as there are.
    """
    from scipy.ndimage import uniform_filter1d  # heavy

    width = max(min(width, values.size), 1)
    return np.asarray(uniform_filter1d(values, width))


def without_drift(values: NDArray[Any], period: float) -> NDArray[Any]:
    """Return values less their mean over `DRIFT`: slopes change more slowly than speeds."""
    values = values - values.mean()  # a zero of the sensor makes no steps at the ends
    return np.asarray(values - moving_mean(values, max(round(DRIFT / period), 3)))


def bend_noise(values: FloatArray) -> float:
    """Return the noise of (k,) even readings of something smooth, by their second differences."""
    return robust_std(np.diff(values, 2, axis=0).ravel()) / math.sqrt(6.0)


def spike_height(values: FloatArray) -> FloatArray:
    """Return how far values (k, n) lie above, or below, both their neighbours; 0 for others."""
    steps = np.diff(np.pad(values, ((1, 1), (0, 0)), constant_values=np.nan), axis=0)
    off = np.minimum(np.abs(steps[:-1]), np.abs(steps[1:]))
    return np.nan_to_num(off * (steps[:-1] * steps[1:] < 0.0))


def runs(same: BoolArray) -> list[tuple[int, int]]:
    """Return (first, last) row of each stretch in which none of (k - 1,) steps is a change."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], same, [False]]).astype(int)))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def correlation(first: FloatArray, second: FloatArray) -> float:
    """Return the correlation of two series about zero, 0 where one of them is zero."""
    size = float(np.sqrt((first @ first) * (second @ second)))
    return float(first @ second / size) if size > 0.0 else 0.0


def confidence(sigmas: float) -> float:
    """Return the probability that a normal error is smaller than this; at most 0.999."""
    return min(math.erf(abs(sigmas) / math.sqrt(2.0)), 0.999)


def integrated(time: FloatArray, rate: FloatArray) -> FloatArray:
    """Return the integral (k,) of a rate from the first of its times [s] on."""
    return np.cumsum(rate * np.diff(time, prepend=time[0]))


def probability(log_odds: float) -> float:
    """Return the probability that has these odds [ln]."""
    return 1.0 / (1.0 + math.exp(-min(max(log_odds, -50.0), 50.0)))


def averaged(
    time: FloatArray, values: FloatArray, at: FloatArray, width: float | FloatArray
) -> FloatArray:
    """Return the means of (k, p) values over windows ``[at - width, at]`` [s].

    A window without a sample has the interpolated value at its middle.
    """
    order = np.argsort(time, kind='stable')
    time, values = time[order], values[order]
    total = np.vstack([np.zeros(values.shape[1]), np.cumsum(values, axis=0)])
    first = np.searchsorted(time, at - width, side='right')
    last = np.searchsorted(time, at, side='right')
    count = (last - first)[:, None]
    mean = (total[last] - total[first]) / np.maximum(count, 1)
    middle = np.column_stack([np.interp(at - 0.5 * width, time, column) for column in values.T])
    return np.where(count > 0, mean, middle)


def step_of(values: FloatArray) -> float:
    """Return the number that values (k,) are multiples of; 0 where they are not."""
    sizes = np.abs(values[values != 0.0])
    if not sizes.size:
        return 0.0
    same = SAME_VALUE * float(np.quantile(sizes, 0.9))  # the greatest may be an outlier
    distinct = np.unique(np.round(np.abs(values) / same)) * same
    if not 1 < len(distinct) <= min(MOST_STEPS, values.size / 4):
        return 0.0
    step = float(np.quantile(np.diff(distinct), 0.1, method='lower'))
    for _ in range(2):  # refined by all multiples
        count = np.round(values / step)
        step = float(values @ count / (count @ count))
    fits = np.abs(values / step - np.round(values / step)) < OFF_A_STEP
    return step if float(np.mean(fits)) > 0.95 else 0.0


# Trials -------------------------------------------------------------------------------------------


class Trial(NamedTuple):
    """Residuals without a remedy, with it, and with the best competing one, on the other half."""

    before: float
    after: float
    competing: float = math.inf

    @property
    def falls(self) -> bool:
        """Whether the remedy helps."""
        return self.after < LEAST_FALL * self.before

    @property
    def passes(self) -> bool:
        """Whether the remedy helps and no competing one does as well."""
        return self.falls and self.after < LEAST_MARGIN * self.competing

    def words(self, what: str, unit: str) -> str:
        """Return what the trial showed, to be put behind a finding."""
        unit = f' {unit}' if unit else ''
        return f' ({what} {self.before:.3g}{unit}, corrected {self.after:.3g}, on the other half)'


def halves(energy: FloatArray) -> tuple[slice, slice]:
    """Return two stretches of rows that hold as much of an energy (k,) each."""
    total = np.cumsum(energy)
    middle = int(np.searchsorted(total, 0.5 * total[-1])) + 1 if total.size else 0
    return slice(0, middle), slice(middle, total.size)


def tried(fit: Callable[[slice], float], nothing: float, energy: FloatArray) -> Trial:
    """Fit a number on each half of some rows and return what it leaves on the other, the worse one.

    ``nothing`` is the number that changes nothing, ``energy`` (k,) the information of each row.
    """
    parts = halves(energy)
    if min(part.stop - part.start for part in parts) < LEAST_HALF:
        return Trial(0.0, math.inf)
    first, second = (fit(part) for part in parts)
    distance = abs(second - first)
    return worst([Trial(abs(second - nothing), distance), Trial(abs(first - nothing), distance)])


def worst(trials: Sequence[Trial]) -> Trial:
    """Return the trial, of those on the halves, in which the remedy helped least."""
    return max(trials, key=lambda t: t.after / max(min(t.before, t.competing), 1e-12))
