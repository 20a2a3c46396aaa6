# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Tables of steady measurements: read, checked, units that look wrong said so."""

from __future__ import annotations

import csv
import difflib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.errors import UserError

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
COLUMNS = (*INPUT_UNITS, *QUANTITIES, 'leaving_angle', *STD_COLUMNS)

MINIMUM_ROWS = 6
MINIMUM_SLIP_SPAN = 0.1
MINIMUM_LOAD_RATIO = 1.5


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
            if name in INPUT_UNITS and finite.size and np.ptp(finite) > 1e-9 * abs(finite).max():
                found.append(name)
        return tuple(found)

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
        )


def read_table(path: str | Path) -> SteadyTable:
    """Read and check a CSV file (header row, UTF-8).

    Raises
    ------
    UserError
        One line with file, row and cure for everything that makes the table unusable.
    """
    path = Path(path)
    try:
        with path.open(encoding='utf-8-sig', newline='') as stream:
            rows = list(csv.reader(stream))
    except FileNotFoundError:
        raise UserError(f'{path}: no such file; give the path of a CSV table') from None
    except IsADirectoryError:
        raise UserError(f'{path}: is a folder; give a CSV table or a rosbag2') from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise UserError(f'{path}: not a CSV text in UTF-8 ({error}); export it again') from None
    numbered = [
        (line, [cell.strip() for cell in row])
        for line, row in enumerate(rows, start=1)
        if any(cell.strip() for cell in row)
    ]
    if not numbered:
        raise UserError(f'{path}: empty; the first line must name the columns ({_known()})')
    header = numbered[0][1]
    notes: list[str] = []
    names = _check_header(str(path), header, notes)
    values = _read_cells(str(path), header, names, numbered[1:])
    lines = np.array([line for line, _ in numbered[1:]], dtype=np.intp)
    return check_table(str(path), values, lines, notes)


def check_table(
    name: str,
    values: Mapping[str, Iterable[float]],
    lines: Sequence[int] | NDArray[np.intp] | None = None,
    notes: Sequence[str] = (),
) -> SteadyTable:
    """Check columns of numbers (SI, nan = not measured) and return them as a table.

    Raises
    ------
    UserError
        As in `read_table`.
    """
    arrays = {key: np.asarray(value, dtype=float) for key, value in values.items()}
    for key in ('slip', 'normal_load'):
        if key not in arrays:
            raise UserError(f'{name}: no column {key!r}; it is required')
    if not any(quantity in arrays for quantity in QUANTITIES):
        raise UserError(
            f'{name}: none of the columns sinkage, drawbar_pull, torque; add at least one'
        )
    count = len(arrays['slip'])
    where = np.arange(2, count + 2) if lines is None else np.asarray(lines, dtype=np.intp)
    remarks = list(notes)
    _check_ranges(name, arrays, where)
    measured = _columns(arrays, QUANTITIES, count)
    empty = ~np.isfinite(measured).any(axis=1)
    if empty.any():
        row = where[empty][0]
        raise UserError(
            f'{name}, line {row}: none of sinkage, drawbar_pull, torque is measured; '
            'fill one in or delete the row'
        )
    stated = _columns(arrays, tuple(f'{q}_std' for q in QUANTITIES), count)
    slip_std = np.nan_to_num(arrays.get('slip_std', np.zeros(count)), nan=0.0)
    inputs = {key: arrays[key] for key in INPUT_UNITS if key in arrays}
    if 'leaving_angle' in arrays:
        inputs['leaving_angle'] = arrays['leaving_angle']
    table = SteadyTable(name, where, inputs, measured, stated, slip_std)
    table, copies = _without_copies(table)
    if copies:
        remarks.append(
            f'{copies} rows are exact copies of others and were counted once; '
            'a repeated measurement would scatter'
        )
    _check_range_of_design(table, remarks)
    constant = [key for key in inputs if key in INPUT_UNITS and key not in table.varying()]
    if constant:
        remarks.append(f'constant in this table: {", ".join(constant)}')
    return SteadyTable(
        name,
        table.lines,
        table.columns,
        table.measured,
        table.stated_std,
        table.slip_std,
        tuple(remarks),
    )


def _known() -> str:
    return 'slip, normal_load, sinkage, drawbar_pull, torque, ...'


def _check_header(path: str, header: Sequence[str], notes: list[str]) -> list[str]:
    """Return the known columns; raise where a name looks like a slip of the pen."""
    known = [name for name in header if name in COLUMNS]
    for name in known:
        if header.count(name) > 1:
            raise UserError(f'{path}, line 1: column {name!r} stands there twice; delete one')
    if not known and any(_is_number(name) for name in header):
        raise UserError(f'{path}, line 1: no header; the first line must name the columns')
    ignored = []
    for name in header:
        if name in COLUMNS or not name:
            continue
        nearest = _nearest(name)
        if nearest and nearest not in header:
            unit = INPUT_UNITS.get(nearest) or UNITS.get(nearest)
            in_unit = f' [{unit}]' if unit and unit != '-' else ''
            raise UserError(
                f'{path}, line 1: unknown column {name!r}; rename it to {nearest!r}{in_unit} '
                'if that is what it holds, else give it another name'
            )
        ignored.append(name)
    if ignored:
        notes.append(f'columns not used: {", ".join(ignored)}')
    for name in ('slip', 'normal_load'):
        if name not in known:
            raise UserError(
                f'{path}, line 1: no column {name!r} among {", ".join(header)}; it is required'
            )
    if not any(name in QUANTITIES for name in known):
        raise UserError(
            f'{path}, line 1: none of sinkage, drawbar_pull, torque among {", ".join(header)}; '
            'add at least one'
        )
    return known


def _nearest(name: str) -> str | None:
    """Return the known column that ``name`` may stand for."""
    plain = name.lower().replace('-', '_').replace(' ', '_').split('[')[0].split('(')[0].strip('_')
    if plain in COLUMNS:
        return plain
    for unit in ('_mm', '_cm', '_m', '_n', '_nm', '_kn', '_deg', '_rad', '_percent', '_pct'):
        if plain.endswith(unit) and plain[: -len(unit)] in COLUMNS:
            return plain[: -len(unit)]
    close = difflib.get_close_matches(plain, COLUMNS, n=1, cutoff=0.78)
    return close[0] if close else None


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _read_cells(
    path: str, header: Sequence[str], names: Sequence[str], rows: Sequence[tuple[int, list[str]]]
) -> dict[str, FloatArray]:
    position = {name: header.index(name) for name in names}
    values = {name: np.full(len(rows), np.nan) for name in names}
    for index, (line, cells) in enumerate(rows):
        if len(cells) > len(header) and any(cells[len(header) :]):
            raise UserError(
                f'{path}, line {line}: {len(cells)} cells but {len(header)} columns; '
                'use commas between cells and a point as decimal mark'
            )
        for name, column in position.items():
            cell = cells[column] if column < len(cells) else ''
            if not cell or cell.lower() in ('nan', 'na', 'n/a', '-'):
                continue
            try:
                values[name][index] = float(cell)
            except ValueError:
                raise UserError(
                    f'{path}, line {line}, column {name}: {cell!r} is not a number; '
                    'leave the cell empty where nothing was measured'
                ) from None
            if not np.isfinite(values[name][index]):
                raise UserError(
                    f'{path}, line {line}, column {name}: {cell} is not finite; '
                    'leave the cell empty where nothing was measured'
                )
    return values


def _columns(arrays: Mapping[str, FloatArray], names: Sequence[str], count: int) -> FloatArray:
    return np.column_stack([arrays.get(name, np.full(count, np.nan)) for name in names])


def _check_ranges(name: str, arrays: Mapping[str, FloatArray], lines: NDArray[np.intp]) -> None:
    """Raise where a value is impossible, with the unit that it looks like."""

    def refuse(bad: NDArray[np.bool_], column: str, why: str) -> None:
        if bad.any():
            row = int(np.flatnonzero(bad)[0])
            raise UserError(
                f'{name}, line {lines[row]}, column {column}: {arrays[column][row]:g} {why}'
            )

    if not arrays['slip'].size:
        raise UserError(f'{name}, line 2: no rows below the column names; add one per steady point')
    for column in ('slip', 'normal_load'):
        refuse(np.isnan(arrays[column]), column, 'is missing; every row needs it')
    for column, values in arrays.items():
        refuse(np.isinf(values), column, 'is not finite; leave the cell empty')
    slip, load = arrays['slip'], arrays['normal_load']
    if np.nanmax(abs(slip)) > 1.5:
        refuse(abs(slip) > 1.5, 'slip', 'looks like percent; divide the column by 100')
    refuse(abs(slip) > 1.0, 'slip', 'is outside -1..1; check how the slip ratio was computed')
    refuse(load <= 0.0, 'normal_load', 'is not positive; state the load in N')
    if np.nanmax(load) < 0.5:
        refuse(load > 0.0, 'normal_load', 'looks like kN; multiply the column by 1000')
    for column, limit in (('slope', 0.9), ('leaving_angle', 1.7)):
        if column in arrays:
            refuse(
                abs(arrays[column]) > limit,
                column,
                'looks like degrees; multiply the column by pi/180',
            )
    for column, limit in (('wheel_radius', 5.0), ('wheel_width', 5.0), ('lug_height', 0.5)):
        if column in arrays:
            refuse(
                arrays[column] > limit, column, 'looks like millimetres; divide the column by 1000'
            )
            low = arrays[column] < 0.0 if column == 'lug_height' else arrays[column] <= 0.0
            refuse(low, column, 'is not a positive length in m')
    for column, least, most in (
        ('lug_count', 0.0, 1000.0),
        ('gravity', 1e-3, 100.0),
        ('pass_number', 1.0, 1000.0),
    ):
        if column in arrays:
            bad = (arrays[column] < least) | (arrays[column] > most)
            refuse(bad, column, f'is outside {least:g}..{most:g}')
    if 'angular_velocity' in arrays:
        fast = abs(arrays['angular_velocity']) > 60.0
        refuse(fast, 'angular_velocity', 'looks like degrees per second; give rad/s')
    if 'sinkage' in arrays:
        deep = abs(arrays['sinkage']) > 1.0
        refuse(deep, 'sinkage', 'looks like millimetres; divide the column by 1000')
    if 'drawbar_pull' in arrays:
        strong = abs(arrays['drawbar_pull']) > 3.0 * load
        refuse(strong, 'drawbar_pull', 'is over three times the normal load; check both units')
        pull = arrays['drawbar_pull'][np.isfinite(arrays['drawbar_pull'])]
        if pull.size > 2 and 0.0 < abs(pull).max() < 2e-3 * load.max():
            refuse(
                np.isfinite(arrays['drawbar_pull']),
                'drawbar_pull',
                'looks like kN; multiply the column by 1000',
            )
    for column in STD_COLUMNS:
        if column in arrays:
            low = arrays[column] < 0.0 if column == 'slip_std' else arrays[column] <= 0.0
            refuse(low, column, 'is not positive; leave it empty where the deviation is unknown')
    if 'slip_std' in arrays:
        refuse(arrays['slip_std'] > 0.5, 'slip_std', 'is over 0.5; it looks like percent')


def check_against_wheel(table: SteadyTable, radius: FloatArray, width: FloatArray) -> None:
    """Raise where a row cannot belong to the wheel: sinkage or torque out of proportion."""
    sinkage, torque = table.measured[:, 0], table.measured[:, 2]
    load = table.columns['normal_load']
    deep = abs(sinkage) > radius
    if deep.any():
        row = int(np.flatnonzero(deep)[0])
        millimetres = abs(np.nanmedian(sinkage)) > np.median(radius)
        cure = (
            'it looks like millimetres, divide the column by 1000'
            if millimetres
            else 'check the unit, and that --config states the wheel of the table'
        )
        raise UserError(
            f'{table.name}, line {table.lines[row]}, column sinkage: {sinkage[row]:g} m is deeper '
            f'than the wheel radius {radius[row]:g} m; {cure}'
        )
    strong = abs(torque) > 5.0 * load * radius
    if strong.any():
        row = int(np.flatnonzero(strong)[0])
        raise UserError(
            f'{table.name}, line {table.lines[row]}, column torque: {torque[row]:g} N m is over '
            f'five times load times radius; check its unit (N m), and that --config states the '
            'wheel of the table'
        )


def _without_copies(table: SteadyTable) -> tuple[SteadyTable, int]:
    """Drop rows in which every number equals that of an earlier row."""
    everything = np.column_stack(
        [*table.columns.values(), table.measured, table.stated_std, table.slip_std]
    )
    keys = [row.tobytes() for row in everything]
    first = {key: index for index, key in reversed(list(enumerate(keys)))}
    keep = np.array(sorted(first.values()), dtype=np.intp)
    return table.select(keep), len(keys) - len(keep)


def _check_range_of_design(table: SteadyTable, remarks: list[str]) -> None:
    """Raise where the rows are too few or too alike to tell anything.

    A drive (its slip is uncertain) cannot choose its slips, and may still show a wrong radius.
    """
    if len(table) < MINIMUM_ROWS:
        raise UserError(
            f'{table.name}: {len(table)} different rows; at least {MINIMUM_ROWS} are needed, best '
            '8 slips from 0.05 to 0.8 at 2 loads'
        )
    slip, load = table.columns['slip'], table.columns['normal_load']
    span, ratio = np.ptp(slip), load.max() / load.min()
    if span < MINIMUM_SLIP_SPAN and ratio < MINIMUM_LOAD_RATIO:
        if (table.slip_std > 0).all():
            remarks.append(
                f'narrow: slip only from {slip.min():.3g} to {slip.max():.3g} at one load; little '
                'but a wrong radius can be told from it'
            )
            return
        raise UserError(
            f'{table.name}: slip only from {slip.min():.3g} to {slip.max():.3g} and load only from '
            f'{load.min():.3g} to {load.max():.3g} N: too narrow to tell anything; add rows with '
            f'slip between {max(0.02, slip.min() - 0.3):.2g} and {min(0.8, slip.max() + 0.4):.2g}'
        )
