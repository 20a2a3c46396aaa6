# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Slip classes with hysteresis and dwell, judged on the slip distribution.

A class change needs evidence that outlasts the dwell: the probability (Gaussian slip with the
filter's standard deviation) that |s| lies beyond the border moved by half the hysteresis must
exceed one half for the whole dwell time, or a larger probability for a shorter time. So a well
known slip switches after the dwell, a badly known one needs a larger excess.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from wheel_terra_estimator.estimation.estimates import SlipClass


@dataclass
class ClassState:
    """What one wheel's classifier remembers."""

    current: int = int(SlipClass.UNKNOWN)
    candidate: int = int(SlipClass.UNKNOWN)
    since: float = 0.0  # [s], start of the candidate's run


def instantaneous_class(slip: float, borders: Sequence[float]) -> int:
    """Return the class 0..3 of a slip ratio; a border belongs to the class below it."""
    magnitude = abs(slip)
    for index, border in enumerate(borders):
        if magnitude <= border:
            return index
    return len(borders)


class SlipClassifier:
    """Classes of all wheels of a rover.

    Parameters
    ----------
    wheel_count : int
        Number of wheels.
    borders : sequence of float
        Upper bounds of the classes low, moderate, high, increasing.
    hysteresis : float
        Width of the band [-] that |s| must cross to leave a class.
    dwell : float
        Time [s] for which the new class must hold.
    """

    def __init__(
        self, wheel_count: int, borders: Sequence[float], hysteresis: float, dwell: float
    ) -> None:
        self._borders = tuple(borders)
        self._half_band = 0.5 * hysteresis
        self._dwell = dwell
        self._states = [ClassState() for _ in range(wheel_count)]

    def update(
        self, wheel: int, time: float, slip: float, slip_std: float, sliding_back: bool
    ) -> int:
        """Return the class of a wheel after a new estimate at ``time`` [s]."""
        state = self._states[wheel]
        target = self._target(state.current, slip, slip_std, sliding_back)
        if state.current == SlipClass.UNKNOWN:
            state.current = state.candidate = target
            state.since = time
        elif target == state.current:
            state.candidate, state.since = target, time
        else:
            if target != state.candidate:
                # A run towards higher (or lower) classes goes on when it skips a class.
                same_way = (target > state.current) == (state.candidate > state.current)
                if state.candidate == state.current or not same_way:
                    state.since = time
                state.candidate = target
            if time - state.since >= self._dwell - 1e-9:
                state.current, state.since = target, time
        return state.current

    def unknown(self, wheel: int) -> int:
        """Mark a wheel as unknown (at rest or without valid input)."""
        self._states[wheel] = ClassState()
        return int(SlipClass.UNKNOWN)

    def _target(self, current: int, slip: float, slip_std: float, sliding_back: bool) -> int:
        top = len(self._borders)
        if sliding_back:
            return top
        if current == SlipClass.UNKNOWN:
            return instantaneous_class(slip, self._borders)
        magnitude = abs(slip)
        # Far from knowing the slip, stay: the band grows with the deviation, up to half a class.
        band = self._half_band + min(0.25 * max(slip_std - 0.05, 0.0), 0.1)
        target = current
        while target < top and magnitude > self._borders[target] + band:
            target += 1
        while target > 0 and magnitude <= self._borders[target - 1] - band:
            target -= 1
        return target

    def snapshot(self) -> tuple[tuple[int, int, float], ...]:
        """Return the memory of all wheels."""
        return tuple((s.current, s.candidate, s.since) for s in self._states)

    def restore(self, memory: tuple[tuple[int, int, float], ...]) -> None:
        """Go back to a snapshot."""
        self._states = [ClassState(*entry) for entry in memory]


def exceedance_probability(slip: float, slip_std: float, border: float) -> float:
    """Return the probability that a driving slip exceeds a border [-]."""
    return 0.5 * math.erfc((border - slip) / (math.sqrt(2.0) * max(slip_std, 1e-6)))
