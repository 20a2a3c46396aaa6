# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What the sensors of a wheel read where the model says what is true: ``gain * true + zero``."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wheel_terra_estimator.arrays import BoolArray, FloatArray
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.terramechanics.effects.base import OUTPUTS
from wheel_terra_estimator.terramechanics.model import SteadyState


@dataclass(frozen=True)
class Readings:
    """Stated gains and zeros of sinkage [m], drawbar pull [N] and torque [N m]."""

    # ``gain``, ``zero``: (3,), or (N, 3) where rows differ
    gain: FloatArray
    zero: FloatArray

    @classmethod
    def of(cls, configuration: Configuration, wheel: int = 0) -> Readings:
        """Return the errors that ``sensors.*`` states for one wheel; of the pull it states none."""
        sensors = configuration.sensors
        return cls(
            np.array([sensors.sinkage_gain[wheel], 1.0, sensors.torque_gain[wheel]]),
            np.array([sensors.sinkage_zero[wheel], 0.0, sensors.torque_zero[wheel]]),
        )

    def true_on(self, rows: BoolArray) -> Readings:
        """Return (N, 3) errors, none on the given rows: theirs were taken off before."""
        true = rows[:, None]
        return Readings(np.where(true, 1.0, self.gain), np.where(true, 0.0, self.zero))

    def read(self, true: FloatArray) -> FloatArray:
        """Return the readings of true values; quantities on the last axis."""
        return true * self.gain + self.zero

    def of_answer(self, state: SteadyState) -> dict[str, FloatArray]:
        """Return the readings (N,) of each of `OUTPUTS` where the model gives an answer."""
        true = np.column_stack([getattr(state, name) for name in OUTPUTS])
        return dict(zip(OUTPUTS, self.read(true).T, strict=True))
