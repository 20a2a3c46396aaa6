# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""When the estimator steps and when a set is due, by stamps alone.

A set is due at the first wheel odometry at or after each multiple of 1 / output_rate, counted from
the run's first stamp. The estimator steps on a finer grid where sets are rare, so that the numbers
at a stamp do not depend on how often they are asked for, and what came between two steps is merged
(see ``merging``): the cost follows from the grid, not from the rates of the inputs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from wheel_terra_estimator.estimation.scalars import SECOND

LEAST_STEP_RATE = 20.0  # [Hz] at which a rover's speed and slip are followed
LONGEST_STEP = 120_000_000
"""Without wheel odometry to end it, a step ends after this time [ns]."""


@dataclass(frozen=True)
class TimeSettings:
    """Durations [ns] and rates of the timeline: the parameters of the same names."""

    output_rate: float  # [Hz], 0 = a set at every stamp of the wheel odometry
    max_lag: int  # below 0 = as learned
    clock_step: int
    history: int
    silence: int
    heartbeat: int  # period
    reference_period: int  # 0 = every reference velocity is used
    rerun_rate: float  # repeated steps per second of stamps [Hz], 0 = any number


class StepGrid:
    """Multiples of the periods of steps and sets, in whole nanoseconds as stamps are.

    `output_rate`: sets per second [Hz]; 0: a step and a set at every stamp.
    """

    def __init__(self, output_rate: float) -> None:
        self.every_stamp = output_rate <= 0.0
        rate = output_rate or LEAST_STEP_RATE
        self._steps_per_set = max(math.ceil(LEAST_STEP_RATE / rate - 1e-9), 1)
        self.step_rate = rate * self._steps_per_set
        self._steps, seconds = self.step_rate.as_integer_ratio()
        self._nanoseconds = seconds * SECOND  # of so many steps

    def step_index(self, elapsed: int) -> int:
        """Return the last multiple of the step's period at or before a time [ns] of the run."""
        # The greatest k with floor(k * period) <= elapsed, that is k * period < elapsed + 1.
        return ((elapsed + 1) * self._steps - 1) // self._nanoseconds

    def set_index(self, elapsed: int) -> int:
        """Return the last multiple of the set's period at or before a time [ns] of the run."""
        return self.step_index(elapsed) // self._steps_per_set
