# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Pull that the present soil can give each wheel beyond what the ground asks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.contacts.loads import LoadState
from wheel_terra_estimator.estimation.contacts.wheel_models import WheelModels, WheelState
from wheel_terra_estimator.estimation.filter.state import (
    CENTROID,
    MOUND,
    SHEAR_MODULUS,
    SHEAR_STRENGTH,
    StateLayout,
)
from wheel_terra_estimator.estimation.rover import SensorFigures

FloatArray = NDArray[np.float64]
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
        self,
        sensors: SensorFigures,
        layout: StateLayout,
        models: WheelModels,
        tuning: MarginTuning = MarginTuning(),
    ) -> None:
        super().__init__(MarginState((0.0,) * layout.wheel_count))
        self._layout, self._models, self._tuning = layout, models, tuning

    def update(self, time: float, x: FloatArray, loads: LoadState, direction: float) -> None:
        """Work out the margins at a time [s] where they are due.

        Parameters
        ----------
        time : float
            [s].
        x : numpy.ndarray
            (size,) state.
        loads : LoadState
            Of the wheels.
        direction : float
            Of the drive, 1 or -1; 0 counts as forward.
        """
        if time - self.state.time < self._tuning.period:
            return
        demand = (direction or 1.0) * loads.slope_share
        margin = [
            self._greatest_pull(i, x, load) - demand * load
            if load >= self._tuning.least_load
            else 0.0
            for i, load in enumerate(loads.load)
        ]
        self.state = MarginState(tuple(margin), time)

    def _greatest_pull(self, i: int, x: FloatArray, load: float) -> float:
        layout = self._layout
        state = WheelState(
            1.0,
            float(x[layout.sinkage.start + i]),
            load,
            float(x[SHEAR_STRENGTH] + x[layout.shear_error.start + i]),
            float(x[SHEAR_MODULUS]),
            float(x[CENTROID]),
            float(x[MOUND]),
        )
        return max(
            self._models.pull(i, state._replace(speed_ratio=1.0 - slip))
            for slip in self._tuning.slips
        )
