# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Pull margin of each wheel: greatest pull on the present soil less the required pull."""

from __future__ import annotations

import numpy as np

from wheel_terra_estimator.arrays import Floats
from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.contacts.loads import LEAST_LOAD
from wheel_terra_estimator.estimation.contacts.wheel_models import WheelModels, WheelStates

_SLIPS = (0.3, 0.6, 0.9)
"""Slips whose greatest pull counts [-]: traction curves are flat around their maximum."""


class PullMargin(Component[Floats]):
    """Works out the pull margin of each wheel [N]."""

    def __init__(self, wheel_count: int, models: WheelModels) -> None:
        super().__init__((0.0,) * wheel_count)
        self._models = models

    def update(self, wheels: WheelStates, demand: float) -> None:
        """Compute the margins of all wheels; their speed ratios are not used.

        `demand` is the required traction coefficient in the direction of the drive [-].
        """
        ratios = 1.0 - np.array(_SLIPS)
        _, pull = self._models.torque_and_pull(wheels._replace(speed_ratio=ratios[:, None]))
        margin = pull.max(axis=0) - demand * wheels.load
        margin = np.where(wheels.load >= LEAST_LOAD, margin, 0.0)
        self.state = tuple(margin.tolist())
