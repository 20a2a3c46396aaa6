# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Merges measurements: those of one stamp, and those that came between two steps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np

from wheel_terra_estimator.estimation.measurements import (
    FloatArray,
    InertialReading,
    LeavingAngleReading,
    Measurement,
    ReferenceVelocity,
    SinkageReading,
    StepInputs,
    WheelOdometry,
)

LONGEST_INTERVAL = 120_000_000
"""A wheel rate stands for the time since the reading before it, at most for this long [ns]."""

_Some = TypeVar('_Some')


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
        return WheelOdometry(stamp, rate, torque), overlap
    if isinstance(before, SinkageReading):
        sinkage, overlap = _newer(before.sinkage, after.sinkage)
        return SinkageReading(stamp, sinkage), overlap
    angle, overlap = _newer(before.leaving_angle, after.leaving_angle)
    return LeavingAngleReading(stamp, angle), overlap


def _newer(before: FloatArray, after: FloatArray) -> tuple[FloatArray, bool]:
    given = ~np.isnan(after)
    return np.where(given, after, before), bool(np.any(given & ~np.isnan(before)))


class StepMerger:
    """Merges what came between two steps.

    Attributes
    ----------
    heard : numpy.ndarray
        (n,) stamp of the last rate of each wheel [ns]; a rate is the mean since then.
        Replaced, never written into, so that kept states may share it.
    """

    def __init__(self) -> None:
        self.heard: Any = None

    def merged(self, stamp: int, parts: Sequence[list[Any]]) -> StepInputs:
        """Return the inputs of a step.

        Parameters
        ----------
        stamp : int
            Time of the step [ns].
        parts : sequence of list
            Entries in the order of stamps, each with one measurement or None per channel.
        """
        odometry, inertial, sinkage, leaving, references = (
            [measurement for measurement in channel if measurement is not None]
            for channel in zip(*parts, strict=True)
        )
        reference: ReferenceVelocity | None = references[-1] if references else None
        return StepInputs(
            self._odometry(stamp, odometry),
            _single(inertial) if len(inertial) < 2 else _inertial(stamp, inertial),
            _single(sinkage)
            if len(sinkage) < 2
            else SinkageReading(stamp, _mean([s.sinkage for s in sinkage])),
            _single(leaving)
            if len(leaving) < 2
            else LeavingAngleReading(stamp, _mean([s.leaving_angle for s in leaving])),
            reference,
        )

    def _odometry(self, stamp: int, readings: list[WheelOdometry]) -> WheelOdometry | None:
        if not readings:
            return None
        first = readings[0]
        before = np.zeros(len(first.rate), dtype=np.int64) if self.heard is None else self.heard
        if len(readings) == 1:
            self.heard = np.where(np.isnan(first.rate), before, first.stamp)
            return first
        rates = np.stack([reading.rate for reading in readings])
        valid = ~np.isnan(rates)
        stamps = np.array([[reading.stamp] for reading in readings])
        last = np.maximum.accumulate(np.vstack([before[None], np.where(valid, stamps, 0)]), axis=0)
        self.heard = last[-1]
        weight = np.clip(stamps - last[:-1], 1, LONGEST_INTERVAL) * valid
        total = weight.sum(axis=0)
        mean = (weight * np.where(valid, rates, 0.0)).sum(axis=0) / np.maximum(total, 1)
        rate = np.where(total > 0, mean, np.nan)
        return WheelOdometry(stamp, rate, _mean([reading.torque for reading in readings]))


def _single(measurements: list[_Some]) -> _Some | None:
    return measurements[0] if measurements else None


def _inertial(stamp: int, readings: list[InertialReading]) -> InertialReading:
    """Return mean specific force and rate, and the newest attitude."""
    count = len(readings)
    orientations = [r.orientation for r in readings if r.orientation is not None]
    return InertialReading(
        stamp,
        np.add.reduce([reading.specific_force for reading in readings]) / count,
        np.add.reduce([reading.angular_rate for reading in readings]) / count,
        orientations[-1] if orientations else None,
    )


def _mean(rows: list[FloatArray]) -> FloatArray:
    """Return the mean of each column without nan, nan where there is nothing else."""
    values = np.stack(rows)
    valid = ~np.isnan(values)
    count = valid.sum(axis=0)
    mean = np.where(valid, values, 0.0).sum(axis=0) / np.maximum(count, 1)
    return np.where(count > 0, mean, np.nan)
