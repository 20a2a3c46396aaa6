# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Rows of steady operating points, as everything after the reader sees them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from wheel_terra_estimator.arrays import BoolArray, FloatArray, IndexArray
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints
from wheel_terra_estimator.terramechanics.wheel import Wheel

QUANTITIES = ('sinkage', 'drawbar_pull', 'torque', 'lateral_force')
ONE_OF = QUANTITIES[:3]  # of which each row has at least one
INPUT_COLUMNS = (
    *('slip', 'normal_load', 'slope', 'slip_angle'),
    *('wheel_radius', 'wheel_width', 'lug_height', 'lug_count'),
    *('gravity', 'angular_velocity', 'pass_number'),
)
STD_COLUMNS = ('slip_std', *(f'{quantity}_std' for quantity in QUANTITIES), 'leaving_angle_std')
# When and how the rows were taken: no inputs of the model, but residuals may change along them.
ORDER_COLUMNS = ('row_order', 'trial', 'date', 'direction')
COLUMNS = (*INPUT_COLUMNS, *QUANTITIES, 'leaving_angle', *STD_COLUMNS, *ORDER_COLUMNS)
ON_ONE_BED = ('slip', 'pass_number')  # inputs that change within a sweep
_LEAST_ROWS = 3  # of a sweep, in the mean
_DRIFTS = 0.05  # odds beforehand that soil drifts while a table is taken; assumed, as an effect's
_APART = 0.05  # of the range, between loads (...) of two sweeps


class Ground(NamedTuple):
    """How soil differs between rows: (N,) shares of a deviation common to rows of one number."""

    share: FloatArray
    number: IndexArray
    odds: float = 0.25  # that soil differs so, beforehand; assumed


@dataclass(frozen=True)
class SteadyTable:
    """Checked rows of steady operating points."""

    name: str  # where the rows came from, for messages
    lines: IndexArray  # (N,) line of each row in the file, the header being line 1
    # Input column -> (N,) values [SI], only those that the table has; nan = not stated
    columns: Mapping[str, FloatArray]
    measured: FloatArray  # (N, 4) of `QUANTITIES` [m, N, N m, N]; nan = not measured
    stated_std: FloatArray  # (N, 4) stated standard deviations; nan = not stated
    slip_std: FloatArray  # (N,) standard deviation of the recorded slip; 0 = exact
    # (N,) standard deviation of the measured leaving angle [rad]; 0 = exact
    leaving_angle_std: FloatArray
    # (N,) rows that hold true values instead of readings: the stated zeros and gains of the
    # sensors (``sensors.*``) were taken off before, as of a drive's
    true_rows: BoolArray
    notes: tuple[str, ...] = ()  # what the reader found odd but usable
    # Column -> factor to SI of the unit in its title; 1 without one
    units: Mapping[str, float] = field(default_factory=dict)

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

    def varying(self) -> tuple[str, ...]:
        """Return the input columns that hold more than one value."""
        found = []
        for name, values in self.columns.items():
            finite = values[np.isfinite(values)]
            if name in INPUT_COLUMNS and finite.size and np.ptp(finite) > 1e-9 * abs(finite).max():
                found.append(name)
        return tuple(found)

    def sweeps(self) -> IndexArray | None:
        """(N,) sweep of each row, alike but for the slip (and of one trial); None without several.

        Each sweep has a bed of its own: what differs between them may be the bed.
        """
        inputs = zip(self.varying(), self.scaled_inputs().T, strict=True)
        keys = [column for name, column in inputs if name not in ON_ONE_BED]
        levels = np.column_stack([self.trials(), *map(_level, keys)])
        sweep = np.ravel(np.unique(levels, axis=0, return_inverse=True)[1])
        return sweep if 0 < sweep.max() < len(self) / _LEAST_ROWS else None

    def grounds(self) -> dict[str, Ground]:
        """Return what may have soil of its own: row, sweep, day; or drift, along the rows as taken.

        In a drive each wheel rolls in each window on soil of its own.
        """
        every = np.ones(len(self))
        if self.true_rows.any():
            return {'row': Ground(every, np.arange(len(self)))}
        dates, sweep = np.nan_to_num(self.columns.get('date', 0.0 * every)), self.sweeps()
        day = np.ravel(np.unique(np.floor(dates), return_inverse=True)[1])
        several = 0 < day.max() < len(self) / _LEAST_ROWS
        return {
            **({} if sweep is None else {'sweep': Ground(every, sweep)}),
            **({'day': Ground(every, day)} if several else {}),
            'drift': self.drift(),
        }

    def drift(self, reference: SteadyTable | None = None) -> Ground:
        """Return soil that drifts from row to row, as they were taken; of each table by itself."""
        parts = [self] if reference is None else [self, reference]
        ranks = [part.columns.get('row_order', part.lines).argsort().argsort() for part in parts]
        share = np.concatenate([rank / rank.max() - 0.5 for rank in ranks])
        return Ground(share, np.repeat(np.arange(len(parts)), list(map(len, parts))), _DRIFTS)

    def trials(self) -> FloatArray:
        """(N,) number of the trial of each row: each has a bed of its own; all 0 if not stated."""
        return _level(np.nan_to_num(self.columns.get('trial', np.zeros(len(self)))))

    def scaled_inputs(self) -> FloatArray:
        """(N, d) varying inputs, each scaled to a range of 1; missing values at their mean."""
        columns = []
        for name in self.varying():
            values = np.nan_to_num(self.columns[name], nan=float(np.nanmean(self.columns[name])))
            columns.append((values - values.min()) / np.ptp(values))
        return np.column_stack(columns) if columns else np.zeros((len(self), 0))

    def select(self, rows: IndexArray | BoolArray) -> SteadyTable:
        """Return the table of these rows."""
        return replace(
            self,
            columns={name: values[rows] for name, values in self.columns.items()},
            **{name: getattr(self, name)[rows] for name in _BY_ROW},
        )


def _level(values: FloatArray) -> FloatArray:
    """Return the place of each value among the distinct ones."""
    order, place = np.argsort(values), np.zeros(len(values))
    place[order[1:]] = np.cumsum(np.diff(values[order]) > _APART)
    return place


_BY_ROW = ('lines', 'measured', 'stated_std', 'slip_std', 'leaving_angle_std', 'true_rows')


def concatenated(name: str, parts: Sequence[SteadyTable], notes: tuple[str, ...]) -> SteadyTable:
    """Return the rows of all tables; a column that one does not have is not stated there."""
    names = dict.fromkeys(key for part in parts for key in part.columns if key != 'time')

    def column(part: SteadyTable, key: str) -> FloatArray:
        return part.columns.get(key, np.full(len(part), np.nan))

    def same(key: str, unit: float) -> bool:
        return all(part.units.get(key, unit) == unit for part in parts)

    return SteadyTable(
        name,
        columns={key: np.concatenate([column(part, key) for part in parts]) for key in names},
        notes=notes,
        units={c: u for p in parts for c, u in p.units.items() if same(c, u)},
        **{key: np.concatenate([getattr(part, key) for part in parts]) for key in _BY_ROW},
    )


def new_rows(table: SteadyTable, earlier: Sequence[SteadyTable]) -> SteadyTable:
    """Return the table without rows that have all inputs and readings of one of earlier tables."""
    whole = concatenated(table.name, [*earlier, table], table.notes)
    inputs = [values for key, values in whole.columns.items() if key in INPUT_COLUMNS]
    cells = np.nan_to_num(np.column_stack([*inputs, whole.measured]), nan=np.inf)
    rows = list(map(tuple, cells.tolist()))
    known = set(rows[: -len(table)])
    kept = np.array([row not in known for row in rows[-len(table) :]])
    if kept.all():
        return table
    names = ', '.join(part.name for part in earlier)
    note = f'{np.sum(~kept)} rows are exact copies of rows of {names} and add nothing'
    return replace(table.select(kept), notes=(*table.notes, note))


WHEEL = {
    'wheel_radius': 'radius',
    'wheel_width': 'width',
    'lug_height': 'lug_height',
    'lug_count': 'lug_count',
}
"""Column -> the field of `Wheel`."""
_USUAL = {
    'slope': 0.0,
    'angular_velocity': np.nan,
    'pass_number': 1.0,
    'leaving_angle': np.nan,
    'slip_angle': 0.0,
}


def operating_points(
    columns: Mapping[str, FloatArray], configuration: Configuration, source: str, wheel: int = 0
) -> OperatingPoints:
    """Return rows as operating points.

    ``columns``: input column -> (N,) values [SI], nan = not stated; slip and normal load at least.
    Wheel (number ``wheel`` of the rover) and gravity that they do not state are those of the
    configuration. Raises UserError if neither states the wheel, or a value is out of range; it
    names ``source``.
    """
    count, wheels = len(columns['slip']), configuration.wheels

    def filled(name: str, default: float) -> FloatArray:
        given = columns.get(name, np.full(count, np.nan))
        return np.where(np.isnan(given), default, given)

    sizes = {}
    for name, size in WHEEL.items():
        needed = size in ('radius', 'width') and f'wheels.{size}' not in configuration.stated
        if needed and np.isnan(columns.get(name, np.full(1, np.nan))).any():
            raise UserError(
                f'{source}: no column {name}, and no wheel in the configuration (--config); '
                f'add the column, or -p wheels.{size}:=[0.15] with your number [m]'
            )
        own = getattr(wheels, size)
        sizes[size] = filled(name, float(own[wheel]) if len(own) else np.nan)
    thickness = float(wheels.lug_thickness[wheel]) if len(wheels.lug_thickness) else 0.0
    try:
        return OperatingPoints(
            slip=columns['slip'],
            normal_load=columns['normal_load'],
            wheel=Wheel(**sizes, lug_thickness=thickness),
            slip_radius=configuration.slip_radius,
            gravity=filled('gravity', float(configuration.rover.gravity)),
            **{name: filled(name, value) for name, value in _USUAL.items()},
        )
    except ValueError as error:
        raise UserError(f'{source}: {error}') from None
