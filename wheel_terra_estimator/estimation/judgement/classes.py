# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Slip classes with hysteresis and dwell.

A class changes when |s| has been beyond its border by half the hysteresis for the whole dwell time.
The less the slip is known, the farther beyond it must be.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from wheel_terra_estimator.estimation.estimates import SlipClass

UNKNOWN = int(SlipClass.UNKNOWN)
_TIME_ROUNDING = 1e-9  # [s]
_KNOWN_STD = 0.05  # deviation up to which a slip is well known; tuned, seeds 1000 to 1019
_BAND_PER_STD, _WIDEST_BAND = 0.25, 0.1  # band added for each deviation beyond, at most
_GUESS_STD, _BAND_PER_GUESS = 0.25, 2.0
"""Deviation from which a slip is a guess, and what of it must lie beyond the border of a higher
class: nobody is told of high slip by a guess."""
_LEAST_STD = 1e-6


class ClassState(NamedTuple):
    """What is remembered of one wheel's class."""

    current: int = UNKNOWN
    candidate: int = UNKNOWN
    since: float = 0.0  # [s], start of the candidate's run


def instantaneous_class(slip: float, borders: Sequence[float]) -> int:
    """Return the class 0..3 of a slip ratio; a border belongs to the class below it."""
    magnitude = abs(slip)
    for index, border in enumerate(borders):
        if magnitude <= border:
            return index
    return len(borders)


class SlipClassifier:
    """Rules by which the class of a wheel changes.

    Parameters
    ----------
    borders : sequence of float
        Upper bounds of the classes low, moderate, high, increasing.
    hysteresis : float
        Width of the band [-] that |s| must cross to leave a class.
    dwell : float
        Time [s] for which the new class must hold.
    """

    def __init__(self, borders: Sequence[float], hysteresis: float, dwell: float) -> None:
        self._borders = tuple(borders)
        self._half_band = 0.5 * hysteresis
        self._dwell = dwell

    def update(
        self, state: ClassState, time: float, slip: float, slip_std: float, sliding_back: bool
    ) -> ClassState:
        """Return the class of a wheel after a new estimate of its slip.

        Parameters
        ----------
        state : ClassState
            Before.
        time : float
            [s].
        slip, slip_std : float
            Estimate and standard deviation [-].
        sliding_back : bool
            Whether the wheel moves against its own turning.
        """
        current, candidate, since = state
        target = self._target(current, slip, slip_std, sliding_back)
        if current == UNKNOWN:
            return self._first_class(state, time, target)
        if target == current:
            return ClassState(current, target, time)
        if target != candidate:
            # A run towards higher (or lower) classes goes on when it skips a class.
            same_way = (target > current) == (candidate > current)
            if candidate == current or not same_way:
                since = time
        if time - since >= self._dwell - _TIME_ROUNDING:
            return ClassState(target, target, time)
        return ClassState(current, target, since)

    def _first_class(self, state: ClassState, time: float, target: int) -> ClassState:
        """Return the first class of a wheel: the highest one only after the dwell time.

        Where wheels begin to turn, the first rim speed comes before the body's speed has followed,
        which looks like spinning on the spot.
        """
        if target < len(self._borders):
            return ClassState(target, target, time)
        since = state.since if state.candidate == target else time
        proven = time - since >= self._dwell - _TIME_ROUNDING
        return ClassState(target if proven else UNKNOWN, target, since)

    def _target(self, current: int, slip: float, slip_std: float, sliding_back: bool) -> int:
        top = len(self._borders)
        if sliding_back:
            return top
        if current == UNKNOWN:
            return instantaneous_class(slip, self._borders)
        magnitude = abs(slip)
        # Far from knowing the slip, stay: the band grows with the deviation, up to half a class.
        doubt = _BAND_PER_STD * max(slip_std - _KNOWN_STD, 0.0)
        band = self._half_band + min(doubt, _WIDEST_BAND)
        target = current
        rising = band + _BAND_PER_GUESS * max(slip_std - _GUESS_STD, 0.0)
        while target < top and magnitude > self._borders[target] + rising:
            target += 1
        while target > 0 and magnitude <= self._borders[target - 1] - band:
            target -= 1
        return target


def exceedance_probability(slip: float, slip_std: float, border: float) -> float:
    """Return the probability that a driving slip exceeds a border [-]."""
    return 0.5 * math.erfc((border - slip) / (math.sqrt(2.0) * max(slip_std, _LEAST_STD)))
