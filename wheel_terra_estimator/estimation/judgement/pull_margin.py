# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Pull that the present soil can give each wheel beyond what the ground asks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.contacts.wheel_models import WheelModels, WheelState

Floats = tuple[float, ...]


@dataclass(frozen=True)
class MarginTuning:
    """Where and how often the greatest pull is looked for."""

    slips: tuple[float, ...] = (0.3, 0.6, 0.9)
    """Slips at which the pull is tried: traction curves are flat around their top."""
    period: float = 1.0  # [s]
    least_load: float = 1e-3  # [N]: less is in the air


class MarginState(NamedTuple):
    """Margin of each wheel [N] and when it was worked out [s]."""

    margin: Floats
    time: float = -10.0


class PullMargin(Component[MarginState]):
    """Works out the pull margins, once a second."""

    def __init__(
        self, wheel_count: int, models: WheelModels, tuning: MarginTuning = MarginTuning()
    ) -> None:
        super().__init__(MarginState((0.0,) * wheel_count))
        self._models, self._tuning = models, tuning

    def due(self, time: float) -> bool:
        """Return whether margins are to be worked out anew at a time [s]."""
        return time - self.state.time >= self._tuning.period

    def update(self, time: float, wheels: Sequence[WheelState], demand: float) -> None:
        """Work out the margins.

        Parameters
        ----------
        time : float
            [s].
        wheels : sequence of WheelState
            Of all wheels; their speed ratios do not matter.
        demand : float
            Pull that the ground asks in the direction of driving, over the load [-].
        """
        margin = [
            self._greatest_pull(i, wheel) - demand * wheel.load
            if wheel.load >= self._tuning.least_load
            else 0.0
            for i, wheel in enumerate(wheels)
        ]
        self.state = MarginState(tuple(margin), time)

    def _greatest_pull(self, i: int, wheel: WheelState) -> float:
        return max(
            self._models.pull(i, wheel._replace(speed_ratio=1.0 - slip))
            for slip in self._tuning.slips
        )
