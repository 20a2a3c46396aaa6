# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Rows of the update from sinkage readings."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.filter.consistency import smoothed_nis
from wheel_terra_estimator.estimation.filter.ekf import GatedFilter, Row
from wheel_terra_estimator.estimation.filter.initial_state import LOAD_EXPONENT
from wheel_terra_estimator.estimation.filter.state import StateLayout
from wheel_terra_estimator.estimation.inputs.contact_sensors import SinkageSums

# Tuned on simulated drives, seeds 1000 to 1019.
_ACCEPTED_AFTER = 3
"""Rejected readings in a row from which on they are accepted: the sinkage has really changed."""
_AGE = 2.0  # up to which a reading counts as known [s]
FLOOR_VARIANCE = 1e-10  # of a reading [m^2]
_LEAST_SINKAGE = 1e-3  # [m], in the ratio of two
_STRENGTH_CHANGE = 0.5
"""Deviation of the change of strength from one ground to the next, over that of stiffness, both
[ln]. Tuned on simulator C, seeds 5000 to 5010 and 5231."""


class SinkageUpdateState(NamedTuple):
    """One entry per wheel."""

    time: tuple[float, ...]  # of the last reading that was used [s], -inf = none yet
    rejected_in_a_row: tuple[int, ...]
    rejected: int = 0  # readings of all wheels
    nis: float | None = None  # running mean; None = no reading yet


class SinkageUpdate(Component[SinkageUpdateState]):
    """Turns sinkage readings into rows of the update."""

    def __init__(self, configuration: Configuration, layout: StateLayout) -> None:
        n = layout.wheel_count
        super().__init__(SinkageUpdateState((-math.inf,) * n, (0,) * n))
        self._gate = float(configuration.filter.gate)
        self._power = float(configuration.soil.sinkage_exponent) + LOAD_EXPONENT
        self._layout = layout

    def unread(self, time: float) -> list[int]:
        """Return the indices of the wheels without a sinkage reading in the last `_AGE`."""
        return [i for i, when in enumerate(self.state.time) if time - when >= _AGE]

    def update(
        self,
        ekf: GatedFilter,
        time: float,
        sums: SinkageSums,
        reading_variance: float,
        unmodelled_std: FloatArray,
        *,
        slip_known: bool,
    ) -> list[Row]:
        """Return the rows of the readings of a cycle; repeated outliers inflate the covariance.

        `reading_variance` is that of one reading [m^2], `unmodelled_std` (n,) the deviation of the
        sinkages by slip-sinkage that the bearing law does not model [m], `slip_known` whether there
        is a reference velocity.
        """
        if not any(sums.readings):
            return []
        when, in_a_row = list(self.state.time), list(self.state.rejected_in_a_row)
        rejected, mean_nis, rows = self.state.rejected, self.state.nis, []
        for i, (total, count) in enumerate(zip(*sums, strict=True)):
            if not count:
                continue
            index = self._layout.sinkage.start + i
            if unmodelled_std[i] > 0.0:
                ekf.inflate(index, float(unmodelled_std[i]) ** 2)
            variance = reading_variance / count + FLOOR_VARIANCE
            residual = total / count - float(ekf.x[index])
            nis = residual * residual / (float(ekf.P[index, index]) + variance)
            if nis > self._gate:
                rejected += 1
                in_a_row[i] += 1
                if in_a_row[i] < _ACCEPTED_AFTER:
                    continue
                self._jump(ekf, i, residual, slip_known=slip_known)
            in_a_row[i] = 0
            mean_nis = smoothed_nis(mean_nis, min(nis, self._gate))
            when[i] = time
            jacobian = np.zeros(self._layout.size)
            jacobian[index] = 1.0
            rows.append(Row(residual, jacobian, variance))
        self.state = SinkageUpdateState(tuple(when), tuple(in_a_row), rejected, mean_nis)
        return rows

    def _jump(self, ekf: GatedFilter, wheel: int, residual: float, *, slip_known: bool) -> None:
        """Allow the sinkage of a wheel to change by a residual [m].

        Where the slip is known, slip has not done it: the wheel has come onto other ground, whose
        stiffness the sinkage shows, and whose strength is another one as well.
        """
        layout = self._layout
        index = layout.sinkage.start + wheel
        if not slip_known:
            ekf.inflate(index, residual * residual)
            return
        before = max(float(ekf.x[index]), _LEAST_SINKAGE)
        softer = self._power * math.log(max(before + residual, _LEAST_SINKAGE) / before)
        ekf.inflate_along({index: residual, layout.stiffness.start + wheel: -softer})
        ekf.inflate(layout.shear_error.start + wheel, (_STRENGTH_CHANGE * softer) ** 2)
