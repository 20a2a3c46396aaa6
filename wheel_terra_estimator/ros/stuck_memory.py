# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The stuck warning of the run before: it stands until the rover has driven free of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wheel_terra_estimator.configuration.soil_file import StuckState
from wheel_terra_estimator.estimation.estimates import EstimateSet, SlipClass

_SECOND = 1e-9


class StuckMemory:
    """Keeps a warning over a restart of the node.

    Parameters
    ----------
    state : StuckState
        As it was written before.
    clear_slip, clear_time : float
        ``filter.stuck_clear_slip`` [-] and ``filter.stuck_clear_time`` [s].
    """

    def __init__(self, state: StuckState, clear_slip: float, clear_time: float) -> None:
        self.state = state
        self._restored = state.stuck
        self._clear_slip = clear_slip
        self._clear_time = clear_time
        self._clear_since: int | None = None

    def follow(self, estimates: EstimateSet) -> EstimateSet:
        """Return the set with the warning that stands; take it over."""
        if self._restored:
            if self._is_clear(estimates):
                self._restored = False
            elif not estimates.stuck:
                age = max((estimates.stamp - self.state.stamp) * _SECOND, 0.0)
                words = f'rover: warned {age:.0f} s ago, before a restart: {self.state.reason}'
                estimates = replace(
                    estimates,
                    stuck=True,
                    reasons=tuple(f'{reason}; {words}' for reason in estimates.reasons),
                )
        if estimates.stuck != self.state.stuck:
            self.state = StuckState(estimates.stuck, stuck_reason(estimates), estimates.stamp)
        return estimates

    def clear(self) -> None:
        """Forget the warning."""
        self.state = StuckState()
        self._restored = False

    def _is_clear(self, estimates: EstimateSet) -> bool:
        """Whether the rover has moved with little slip for long enough; rest proves nothing."""
        known = estimates.slip_class != SlipClass.UNKNOWN
        free = (
            not estimates.stuck
            and bool(known.any())
            and float(np.median(np.abs(estimates.slip[known]))) < self._clear_slip
        )
        if not free:
            self._clear_since = None
            return False
        if self._clear_since is None:
            self._clear_since = estimates.stamp
        return (estimates.stamp - self._clear_since) * _SECOND >= self._clear_time


def stuck_reason(estimates: EstimateSet) -> str:
    """Return why the warning stands, in words."""
    for reason in estimates.reasons:
        _, mark, words = reason.partition('rover: ')
        if mark:
            return words
    return 'entrapment under way or close ahead' if estimates.stuck else 'moving freely'
