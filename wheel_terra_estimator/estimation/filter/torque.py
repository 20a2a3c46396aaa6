# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Rows of the update from drive torques."""

from __future__ import annotations

from math import isnan

import numpy as np

from wheel_terra_estimator.arrays import FloatArray, Floats
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.contacts.cycle import Cycle
from wheel_terra_estimator.estimation.contacts.linearisation import ContactForces
from wheel_terra_estimator.estimation.filter.consistency import SAME_GROUND, excess, smoothed_nis
from wheel_terra_estimator.estimation.filter.ekf import GatedFilter, Row, chi_square_gate
from wheel_terra_estimator.estimation.filter.state import StateLayout
from wheel_terra_estimator.estimation.rover import Rover

_FLOOR_VARIANCE = 1e-6  # [N^2 m^2]
_SPREAD_STD = 0.025
"""Deviation of the torques from one another beyond the models, over their mean [-]: each wheel has
its own load and ground. Tuned without references on simulators A, B and C."""
_SPREAD_LENGTH = 5.0  # rim travel over which that difference lasts [m]
_GAIN = 0.1  # of the running mean of a wheel's NIS, per reading [-]
_LEAST_COMPARED = 2  # torques that can differ from one another


class TorqueUpdate(Component['tuple[float | None, ...]']):
    """Turns the torques of turning wheels into rows of the update.

    Keeps the running mean of the NIS of each wheel, None = no torque yet: a torque that disagrees
    with the model for long, by a stone or a failing drive, gets a greater variance. A change of
    soil looks like an outlier, so a row beyond the gate is down-weighted, not rejected.
    """

    def __init__(self, configuration: Configuration, rover: Rover, layout: StateLayout) -> None:
        super().__init__((None,) * layout.wheel_count)
        self._gate = float(configuration.filter.gate)
        self._zeros = layout.torque_zero
        # Entries of the zeros in the rows, as index arrays made once.
        columns = np.arange(layout.size)[layout.torque_zero]
        self._ones = (np.arange(len(columns)), columns)
        self._none = (0.0,) * layout.wheel_count
        self._load_std = rover.load_std

    @property
    def nis(self) -> float | None:
        """Mean of the NIS of the wheels; None = no torque yet."""
        known = [nis for nis in self.state if nis is not None]
        return sum(known) / len(known) if known else None

    def zeros(self, mean: FloatArray) -> Floats:
        """Return the zeros of the sensors in a state [N m]."""
        return tuple(mean[self._zeros].tolist()) or self._none

    def update(
        self,
        ekf: GatedFilter,
        forces: ContactForces,
        cycle: Cycle,
        *,
        variance: float,
        model_variance: float,
        repeats: float,
    ) -> list[Row]:
        """Return the rows of the torques of a cycle.

        Without a reference velocity the slip follows the mean of the torques, and hardly their
        differences. The forces are those at the state of the filter; `variance` is that of a
        reading [N^2 m^2], `model_variance` the relative one of the shear model [-]; the errors of
        `repeats` cycles are one and the same (same ground).
        """
        rows, means = [], list(self.state)
        H, zeros = forces.torque_rows.copy(), self.zeros(ekf.x)
        H[self._ones] = 1.0
        priors = np.einsum('ij,ij->i', H @ ekf.P, H).tolist()
        models, noises = forces.torque.tolist(), forces.torque_noise.tolist()
        for i, reading in enumerate(cycle.torque):
            if isnan(reading) or not cycle.turns[i]:
                continue
            model = models[i]
            noise = variance + (self._load_std * model) ** 2 + _FLOOR_VARIANCE
            total = repeats * noise + model_variance * model**2
            total += noises[i] ** 2
            residual, expected = reading - zeros[i] - model, priors[i] + total
            means[i] = mean = smoothed_nis(means[i], residual * residual / expected, _GAIN)
            gate = chi_square_gate(residual, expected, self._gate)
            rows.append(Row(residual, H[i], total * excess(mean) ** 2 + gate))
        self.state = tuple(means)
        if cycle.reference_known or len(rows) < _LEAST_COMPARED:
            return rows
        return _independent(rows, _SPREAD_STD * float(np.abs(forces.torque).mean()), repeats)


def _independent(rows: list[Row], spread: float, repeats: float) -> list[Row]:
    """Return the rows with a lasting `spread` [N m] about their mean, whitened to variances of 1.

    The spread adds no variance to the mean of all torques.
    """
    residuals, jacobians, variances = zip(*rows, strict=True)
    n, lasting = len(rows), spread**2 * repeats * _SPREAD_LENGTH / SAME_GROUND
    root = np.linalg.cholesky(np.diag(variances) + lasting * (np.eye(n) - 1.0 / n))
    whole = np.linalg.solve(root, np.column_stack([residuals, jacobians]))
    return [Row(float(row[0]), row[1:], 1.0) for row in whole]
