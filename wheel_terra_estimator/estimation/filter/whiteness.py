# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Whether the innovations of a channel scatter about zero, or lean and follow one another.

In a filter that is right they are white (Kailath 1968): no mean, no correlation of one with the
next. A mean says that something constant is not in the models (the zero of a sensor, another soil),
a correlation that something slow is not.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.filter.ekf import FloatArray
from wheel_terra_estimator.estimation.scalars import clipped, gain_of

_MEAN_TIME = 10.0  # over which the means go [s]
_LARGEST = 4.0  # deviations that one innovation counts for
_LEAST_VARIANCE = 1e-6
_TOLD_AFTER = 10  # innovations


class Innovations(NamedTuple):
    """Running means of the innovations of a channel, each over its deviation."""

    time: float = -math.inf  # of the last one [s]
    readings: int = 0
    last: float = 0.0
    mean: float = 0.0
    square: float = 0.0
    product: float = 0.0  # of one and the next

    def and_then(self, time: float, scores: Sequence[float]) -> Innovations:
        """Return the means with the innovations of a cycle, which count as one."""
        score = clipped(sum(scores) / math.sqrt(len(scores)), -_LARGEST, _LARGEST)
        readings = self.readings + 1
        gain = max(gain_of(time - self.time, _MEAN_TIME), 1.0 / readings) if self.readings else 1.0
        return Innovations(
            time,
            readings,
            score,
            self.mean + gain * (score - self.mean),
            self.square + gain * (score * score - self.square),
            self.product + gain * (score * self.last - self.product),
        )

    @property
    def lag_one(self) -> float:
        """Correlation of one innovation with the next [-]."""
        variance = max(self.square - self.mean**2, _LEAST_VARIANCE)
        return clipped((self.product - self.mean**2) / variance, -1.0, 1.0)


class WhitenessState(NamedTuple):
    """One entry per channel."""

    reference: Innovations = Innovations()
    sinkage: Innovations = Innovations()
    torque: Innovations = Innovations()
    balance: Innovations = Innovations()


class Whiteness(Component[WhitenessState]):
    """Follows the innovations of all channels."""

    def __init__(self) -> None:
        super().__init__(WhitenessState())

    def follow(self, time: float, scores: FloatArray, **counts: int) -> None:
        """Take innovations over their deviations (m,): so many of each channel, in this order."""
        first, found, values = 0, {}, scores.tolist()
        for channel, count in counts.items():
            if count:
                before: Innovations = getattr(self.state, channel)
                found[channel] = before.and_then(time, values[first : first + count])
            first += count
        self.state = self.state._replace(**found)

    def report(self) -> dict[str, float]:
        """Return mean and correlation of one with the next by channel, once there are enough."""
        report = {}
        for channel, seen in self.state._asdict().items():
            if seen.readings >= _TOLD_AFTER:
                report[f'innovation_mean_{channel}'] = round(seen.mean, 2)
                report[f'innovation_lag_one_{channel}'] = round(seen.lag_one, 2)
        return report
