# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""How likely the readings of a drive were to the filter, each before it saw it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.estimation.component import Component

_LN_TWO_PI = math.log(2.0 * math.pi)


class LikelihoodState(NamedTuple):
    """Sum over the readings that were fused."""

    log: float = 0.0  # natural logarithm, readings in SI units
    readings: int = 0


class Likelihood(Component[LikelihoodState]):
    """Sums ln N(innovation; 0, S) over the updates of a drive (prediction error decomposition).

    The S of a reading beyond the gate is that with which it was fused: an outlier costs by the
    logarithm of its size.
    """

    def __init__(self) -> None:
        super().__init__(LikelihoodState())

    def reset(self) -> None:
        """Go on: a new run belongs to the same drive."""

    def add(self, innovation: FloatArray, covariance: FloatArray, scale: FloatArray) -> None:
        """Take an update.

        Parameters
        ----------
        innovation, covariance : numpy.ndarray
            (m,), (m, m), in units of the deviation of each innovation.
        scale : numpy.ndarray
            (m,) what an innovation was multiplied with to be in that unit.
        """
        whole = innovation @ np.linalg.solve(covariance, innovation)
        log = -0.5 * (whole + np.linalg.slogdet(covariance)[1] + len(innovation) * _LN_TWO_PI)
        log += float(np.log(scale).sum())
        self.state = LikelihoodState(
            self.state.log + float(log), self.state.readings + len(innovation)
        )
