# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Merges measurements: those of one stamp, and those that came between two steps."""

from __future__ import annotations

from collections.abc import Sequence
from math import isnan, nan
from typing import Any, TypeAlias

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.estimation.measurements import (
    InertialReading,
    InertialVariance,
    Measurement,
    StepInputs,
    WheelOdometry,
)

LONGEST_INTERVAL = 120_000_000
"""A wheel rate stands for the time since the reading before it, at most for this long [ns]."""


def same(one: Measurement, other: Measurement) -> bool:
    """Return whether two measurements of a kind hold the same numbers."""
    for a, b in zip(vars(one).values(), vars(other).values(), strict=True):
        if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
            if not np.array_equal(a, b, equal_nan=True):
                return False
        elif a is not b and (a is None or b is None or a != b):
            return False
    return True


def merge_wheels(before: Any, after: Any) -> tuple[Any, bool]:
    """Merge two readings of the same stamp; the later arrival wins wheel by wheel."""
    stamp = before.stamp
    if isinstance(before, WheelOdometry):
        rate, overlap = _newer(before.rate, after.rate)
        torque, _ = _newer(before.torque, after.torque)
        steering = _newest([before.steering, after.steering])
        return WheelOdometry(stamp, rate, torque, steering), overlap
    values, overlap = _newer(_values(before), _values(after))
    return type(before)(stamp, values), overlap


def _values(reading: Any) -> FloatArray:
    """Return the (n,) values of a reading that has nothing else beside its stamp."""
    _, values = vars(reading).values()
    return np.asarray(values)


def _newer(before: FloatArray, after: FloatArray) -> tuple[FloatArray, bool]:
    given = ~np.isnan(after)
    return np.where(given, after, before), bool(np.any(given & ~np.isnan(before)))


LastMeasured: TypeAlias = 'tuple[int, ...] | None'
"""Stamp of the last rate of each wheel [ns], None = none yet; a rate is the mean since then."""


def merge_step(
    stamp: int, parts: Sequence[list[Any]], measured: LastMeasured
) -> tuple[StepInputs, LastMeasured]:
    """Return the inputs of a step, merged from what came since the last one, and `measured` anew.

    `parts` are entries in the order of stamps, each with one measurement or None per channel. Plain
    floats, which beat numpy for a few readings.
    """
    odometry, inertial, *wheels, references = (
        [measurement for measurement in channel if measurement is not None]
        for channel in zip(*parts, strict=True)
    )
    rates, measured = _odometry(stamp, odometry, measured)
    merged: list[Any] = [rates]
    for readings in (inertial, *wheels):
        if len(readings) < 2:
            merged.append(readings[0] if readings else None)
        elif readings is inertial:
            merged.append(_inertial(stamp, inertial))
        else:
            mean = _mean([_values(reading) for reading in readings])
            merged.append(type(readings[0])(stamp, mean))
    merged.append(references[-1] if references else None)
    return StepInputs(*merged), measured


def _odometry(
    stamp: int, readings: list[WheelOdometry], before: LastMeasured
) -> tuple[WheelOdometry | None, LastMeasured]:
    if not readings:
        return None, before
    count = len(readings[0].rate)
    measured = list(before or (0,) * count)
    total, weighted = [0] * count, [0.0] * count
    for reading in readings:
        now = reading.stamp
        for i, rate in enumerate(reading.rate.tolist()):
            if not isnan(rate):
                weight = min(max(now - measured[i], 1), LONGEST_INTERVAL)
                total[i] += weight
                weighted[i] += weight * rate
                measured[i] = now
    if len(readings) == 1:
        return readings[0], tuple(measured)
    mean = [w / t if t else nan for w, t in zip(weighted, total, strict=True)]
    merged = WheelOdometry(
        stamp,
        np.array(mean),
        _mean([reading.torque for reading in readings]),
        _newest([reading.steering for reading in readings]),
    )
    return merged, tuple(measured)


def _newest(rows: list[FloatArray | None]) -> FloatArray | None:
    """Return the last value of each column that is not nan; None where no row is there."""
    there = [row for row in rows if row is not None]
    if not there:
        return None
    newest = there[0]
    for row in there[1:]:
        newest = np.where(np.isnan(row), newest, row)
    return newest


def _inertial(stamp: int, readings: list[InertialReading]) -> InertialReading:
    """Return mean specific force and rate, the newest attitude, and the first variances stated."""
    orientations = [r.orientation for r in readings if r.orientation is not None]
    stated = [next(filter(None, c), 0.0) for c in zip(*(r.variance for r in readings), strict=True)]
    return InertialReading(
        stamp,
        _mean([reading.specific_force for reading in readings]),
        _mean([reading.angular_rate for reading in readings]),
        orientations[-1] if orientations else None,
        InertialVariance(*stated),
    )


def _mean(rows: list[FloatArray]) -> FloatArray:
    """Return the mean of each column without nan, nan where there is nothing else."""
    size = len(rows[0])
    count, total = [0] * size, [0.0] * size
    for row in rows:
        for i, value in enumerate(row.tolist()):
            if not isnan(value):
                count[i] += 1
                total[i] += value
    return np.array([t / c if c else nan for t, c in zip(total, count, strict=True)])
