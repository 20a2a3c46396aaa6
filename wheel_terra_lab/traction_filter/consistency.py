# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Whether the innovations of each channel are as large as the filter foresees."""

from __future__ import annotations

from typing import NamedTuple

from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.scalars import NAN

_GAIN = 0.05  # of the mean per reading: it goes over the last 20
_LARGEST = 100.0  # that enters the mean: one outlier does not fill it
_RIGHT = 1.0
"""Normalised innovation squared (NIS) of a scalar reading, on average, in a filter that is right
(Bar-Shalom, Li and Kirubarajan 2001, section 5.4)."""


class Means(NamedTuple):
    """Running mean of the NIS by channel; nan = nothing was read."""

    sinkage: float = NAN
    reference: float = NAN
    torque: float = NAN
    balance: float = NAN


class Consistency(Component[Means]):
    """Follows the NIS of each channel."""

    def __init__(self) -> None:
        super().__init__(Means())

    def note(self, **nis: float) -> None:
        """Take the NIS of readings by channel; nan = none came."""
        means = {}
        for channel, value in nis.items():
            if value == value:
                before = getattr(self.state, channel)
                before = before if before == before else _RIGHT
                means[channel] = before + _GAIN * (min(float(value), _LARGEST) - before)
        self.state = self.state._replace(**means)

    def report(self) -> dict[str, float]:
        """Return the means by key of diagnostics."""
        found = self.state._asdict().items()
        return {f'nis_{name}': round(mean, 3) for name, mean in found if mean == mean}
