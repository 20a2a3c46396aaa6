# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Slip classes of the published slips, with hysteresis and dwell time.

A class lasts until the published |s| has been outside of it, by half the hysteresis, for the dwell
time; then it becomes that of |s|. After *unknown* it is that of |s| at once, except for the highest
class, which needs the dwell time: when wheels start, their speed rises before that of the body. A
class is unknown where a wheel is not judged (at rest, no rate) or where the deviation of its slip
exceeds ``filter.class_std``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import isnan
from typing import NamedTuple

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.estimates import EstimateSet, SlipClass
from wheel_terra_estimator.estimation.scalars import NAN, NANOSECOND, TIME_ROUNDING

UNKNOWN = int(SlipClass.UNKNOWN)


class ClassState(NamedTuple):
    """Class of one wheel, and how long |s| has been outside of it."""

    current: int = UNKNOWN
    outside_since: float = NAN  # [s], since when |s| has been outside of it; nan = it is inside


def instantaneous_class(slip: float, borders: Sequence[float]) -> int:
    """Return the class 0..3 of a slip ratio; a border belongs to the class below it."""
    magnitude = abs(slip)
    for index, border in enumerate(borders):
        if magnitude <= border:
            return index
    return len(borders)


class SlipClassifier:
    """Rules by which the class of a wheel changes.

    `borders` are the upper bounds of the classes low, moderate and high, increasing. |s| leaves a
    class by crossing a band of the width `hysteresis` [-] for the time `dwell` [s].
    """

    def __init__(self, borders: Sequence[float], hysteresis: float, dwell: float) -> None:
        self._borders = tuple(borders)
        self._half_band = 0.5 * hysteresis
        self._dwell = dwell

    def update(self, state: ClassState, time: float, slip: float) -> ClassState:
        """Return the class of a wheel that is judged, at a time [s], from its published slip."""
        current, outside_since = state
        borders, magnitude, target = self._borders, abs(slip), current
        if current == UNKNOWN:
            target = instantaneous_class(slip, borders)
            if target < len(borders):
                return ClassState(target)
        else:
            while target < len(borders) and magnitude > borders[target] + self._half_band:
                target += 1
            while target > 0 and magnitude <= borders[target - 1] - self._half_band:
                target -= 1
            if target == current:
                return ClassState(current)
        since = time if isnan(outside_since) else outside_since
        if time - since >= self._dwell - TIME_ROUNDING:
            return ClassState(target)
        return ClassState(current, since)


class PublishedClasses:
    """Sets the classes of the estimates of a drive, in the order in which they are published."""

    def __init__(self, configuration: Configuration) -> None:
        self._count = configuration.wheels.count
        self.reset()
        self.retune(configuration)

    def retune(self, configuration: Configuration) -> None:
        """Take over other tuning."""
        figures = configuration.filter
        self._classifier = SlipClassifier(
            [float(border) for border in figures.class_thresholds],
            float(figures.class_hysteresis),
            float(figures.class_dwell),
        )
        self._most_std = float(figures.class_std)

    def reset(self) -> None:
        """Forget the classes: a new run begins."""
        self._states = [ClassState()] * self._count
        self._outlook: FloatArray | None = None  # as published last, (3, n)

    def follow(self, estimates: EstimateSet) -> EstimateSet:
        """Return a set with the classes that follow from its slips and those before it.

        A wheel whose class is unknown in the set given stays so, and keeps its last outlook; under
        a warning so does a wheel whose slip is too uncertain for a class. A driving wheel of class
        *stuck* has no rim travel and no time left.
        """
        time = estimates.stamp * NANOSECOND
        update, most_std = self._classifier.update, self._most_std
        self._states = [
            ClassState() if given == UNKNOWN or std > most_std else update(state, time, slip)
            for state, given, slip, std in zip(
                self._states,
                estimates.slip_class.tolist(),
                estimates.slip.tolist(),
                estimates.slip_std.tolist(),
                strict=True,
            )
        ]
        classes = np.array([state.current for state in self._states], dtype=np.uint8)
        stuck = (classes == SlipClass.STUCK) & (estimates.slip > 0.0)
        outlook = np.array(
            [estimates.rim_travel_left, estimates.time_to_stuck, estimates.stuck_probability]
        )
        outlook[:2, stuck] = 0.0
        if self._outlook is not None:
            given = classes if estimates.stuck else estimates.slip_class
            stalls = estimates.stuck_probability >= 1.0  # a wheel that is known to stand
            outlook = np.where((given == UNKNOWN) & ~stalls, self._outlook, outlook)
        self._outlook = outlook
        return replace(
            estimates,
            slip_class=classes,
            rim_travel_left=outlook[0],
            time_to_stuck=outlook[1],
            stuck_probability=outlook[2],
        )
