# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Keeps the stuck warning over a restart of the estimator, until the rover has driven free.

After a restart of the node, a clock that stepped back, a failed filter or a late input that changed
its state, the estimator may have lost a warning that has been published.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.configuration.soil_file import StuckState
from wheel_terra_estimator.estimation.estimates import EstimateSet, SlipClass
from wheel_terra_estimator.estimation.scalars import NANOSECOND

_LONGEST_GAP = 1.0  # [s] between two sets of one drive, or two of their periods


class StuckMemory:
    """Keeps a warning over a restart of the estimator; `state` is the published one.

    The rover is free by ``filter.stuck_clear_slip`` and ``filter.stuck_clear_time``.
    """

    def __init__(self, configuration: Configuration) -> None:
        self.state = StuckState()
        self._restored = False
        self._before = 'a restart'
        self._free: tuple[int, int] | None = None  # stamps: since when, last seen
        self._clears_since: int | None = None  # stamp since which no sign of it is left
        self.retune(configuration)

    def retune(self, configuration: Configuration) -> None:
        """Take over other tuning."""
        self._clear_slip = float(configuration.filter.stuck_clear_slip)
        self._clear_time = float(configuration.filter.stuck_clear_time)
        rate = float(configuration.output_rate)
        self._longest_gap = max(_LONGEST_GAP, 2.0 / rate if rate > 0.0 else 0.0)

    def restore(self, state: StuckState) -> None:
        """Take over a warning from a file."""
        self.state = state
        self.begin_anew()

    def begin_anew(self) -> None:
        """Hold the warning: the estimator starts without it."""
        self._restored = self.state.stuck
        self._before = 'a restart'
        self._free = None

    def clear(self) -> None:
        """Forget the warning."""
        self.restore(StuckState())

    def follow(self, estimates: EstimateSet, *, run_again: bool = False) -> EstimateSet:
        """Return the set with the warning that holds, and remember it.

        `run_again`: a late input was fused at its own stamp since the set before.
        """
        since = self._clears_since
        cleared = since is not None and (
            (estimates.stamp - since) * NANOSECOND > self._clear_time - self._longest_gap
        )
        if estimates.stuck_clears:
            self._clears_since = estimates.stamp if since is None else since
        else:
            self._clears_since = None
        lost = self.state.stuck and not (estimates.stuck or self._restored or cleared)
        if run_again and lost:
            self.begin_anew()
            self._before = 'a late input'
        if self._restored and self._is_clear(estimates):
            self._restored = False
        if self._restored:
            age = (estimates.stamp - self.state.stamp) * NANOSECOND
            when = f' {age:.0f} s ago,' if self.state.stamp > 0 and age >= 0.0 else ''
            held = f'; rover: warned{when} before {self._before}: {self.state.reason}'
            reasons = tuple(
                reason if estimates.stuck else reason + held for reason in estimates.reasons
            )
            direction = self.state.direction
            return replace(estimates, stuck=True, stuck_direction=direction, reasons=reasons)
        if estimates.stuck != self.state.stuck:
            self.state = StuckState(
                estimates.stuck,
                estimates.stuck_reason,
                estimates.stamp,
                estimates.stuck_direction,
            )
        return estimates

    def _is_clear(self, estimates: EstimateSet) -> bool:
        """Return whether the rover has moved with little slip for long enough; rest is no proof."""
        known = estimates.slip_class != SlipClass.UNKNOWN
        free = (
            not estimates.stuck
            and bool(known.any())
            and float(np.median(np.abs(estimates.slip[known]))) < self._clear_slip
        )
        if not free:
            self._free = None
            return False
        stamp = estimates.stamp
        if self._free is None or not 0 <= (stamp - self._free[1]) * NANOSECOND <= self._longest_gap:
            self._free = stamp, stamp
        self._free = self._free[0], stamp
        return (stamp - self._free[0]) * NANOSECOND >= self._clear_time
