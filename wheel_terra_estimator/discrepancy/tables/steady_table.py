# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Rows of steady operating points, as everything after the reader sees them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

QUANTITIES = ('sinkage', 'drawbar_pull', 'torque')


UNITS = {'sinkage': 'm', 'drawbar_pull': 'N', 'torque': 'N m'}


INPUT_UNITS = {
    'slip': '-',
    'normal_load': 'N',
    'slope': 'rad',
    'wheel_radius': 'm',
    'wheel_width': 'm',
    'lug_height': 'm',
    'lug_count': '-',
    'gravity': 'm/s^2',
    'angular_velocity': 'rad/s',
    'pass_number': '-',
}


STD_COLUMNS = ('slip_std', *(f'{quantity}_std' for quantity in QUANTITIES), 'leaving_angle_std')


# When and how the rows were taken: no inputs of the model, but residuals may change along them.
ORDER_COLUMNS = ('row_order', 'trial', 'date', 'direction')


COLUMNS = (*INPUT_UNITS, *QUANTITIES, 'leaving_angle', *STD_COLUMNS, *ORDER_COLUMNS)


@dataclass(frozen=True)
class SteadyTable:
    """Checked rows of steady operating points.

    Attributes
    ----------
    name : str
        Where the rows came from, for messages.
    lines : numpy.ndarray
        (N,) line of each row in the file, the header being line 1.
    columns : mapping
        Input column -> (N,) values [SI], only those that the table has; nan = not stated.
    measured : numpy.ndarray
        (N, 3) sinkage [m], drawbar pull [N], torque [N m]; nan = not measured.
    stated_std : numpy.ndarray
        (N, 3) stated standard deviations; nan = not stated.
    slip_std : numpy.ndarray
        (N,) standard deviation of the recorded slip; 0 = exact.
    leaving_angle_std : numpy.ndarray or None
        (N,) standard deviation of the measured leaving angle [rad]; None = exact.
    corrected : numpy.ndarray or None
        (N,) rows whose readings the stated zeros and gains of the sensors (``sensors.*``) were
        taken off before, as a drive's; None = none.
    notes : tuple of str
        What the reader found odd but usable.
    """

    name: str
    lines: NDArray[np.intp]
    columns: Mapping[str, FloatArray]
    measured: FloatArray
    stated_std: FloatArray
    slip_std: FloatArray
    notes: tuple[str, ...] = ()
    leaving_angle_std: FloatArray | None = None
    corrected: NDArray[np.bool_] | None = None

    def __len__(self) -> int:
        return len(self.lines)

    @property
    def quantities(self) -> tuple[str, ...]:
        """The quantities that at least one row has."""
        return tuple(
            quantity
            for q, quantity in enumerate(QUANTITIES)
            if np.isfinite(self.measured[:, q]).any()
        )

    @property
    def true_rows(self) -> NDArray[np.bool_]:
        """(N,) rows that hold true values instead of readings."""
        return np.zeros(len(self), dtype=bool) if self.corrected is None else self.corrected

    def varying(self) -> tuple[str, ...]:
        """Return the input columns that hold more than one value."""
        found = []
        for name, values in self.columns.items():
            finite = values[np.isfinite(values)]
            if name in INPUT_UNITS and finite.size and np.ptp(finite) > 1e-9 * abs(finite).max():
                found.append(name)
        return tuple(found)

    def scaled_inputs(self) -> FloatArray:
        """(N, d) varying inputs, each scaled to a range of 1; what is not stated at its mean."""
        columns = []
        for name in self.varying():
            values = np.nan_to_num(self.columns[name], nan=float(np.nanmean(self.columns[name])))
            columns.append((values - values.min()) / np.ptp(values))
        return np.column_stack(columns) if columns else np.zeros((len(self), 0))

    def select(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> SteadyTable:
        """Return the table of these rows."""
        return SteadyTable(
            self.name,
            self.lines[rows],
            {name: values[rows] for name, values in self.columns.items()},
            self.measured[rows],
            self.stated_std[rows],
            self.slip_std[rows],
            self.notes,
            None if self.leaving_angle_std is None else self.leaving_angle_std[rows],
            None if self.corrected is None else self.corrected[rows],
        )
