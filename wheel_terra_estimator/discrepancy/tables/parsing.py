# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A CSV file turned into columns of numbers; what cannot be read is said with its cure."""

from __future__ import annotations

import csv
import difflib
import io
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timezone
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.discrepancy.tables.checks import check_table
from wheel_terra_estimator.discrepancy.tables.steady_table import (
    COLUMNS,
    INPUT_UNITS,
    ORDER_COLUMNS,
    QUANTITIES,
    STD_COLUMNS,
    UNITS,
    SteadyTable,
)
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.input_file import LARGEST_TABLE, read_text

FloatArray = NDArray[np.float64]

# What other people call the required columns; only for the cure in a message.
_OTHER_NAMES = {
    'slip': ('s', 'i', 'slip_ratio', 'sr', 'schlupf'),
    'normal_load': ('w', 'fz', 'fn', 'load', 'vertical_load', 'weight', 'wheel_load', 'radlast'),
    'sinkage': ('z', 'depth', 'sinkage_depth', 'einsinkung'),
    'drawbar_pull': ('dp', 'fx', 'f_dp', 'pull', 'drawbar', 'traction', 'zugkraft'),
    'torque': ('t', 'm', 'mz', 'moment', 'drive_torque', 'drehmoment'),
}


_NOT_MEASURED = ('nan', 'na', 'n/a', '-')
_KNOWN = 'slip, normal_load, sinkage, drawbar_pull, torque, ...'
# Units that a header may state in brackets: factor to SI.
_TO_SI: dict[str, dict[str, float]] = {
    'm': {'m': 1.0, 'mm': 1e-3, 'cm': 1e-2},
    'N': {'n': 1.0, 'kn': 1e3},
    'N m': {'nm': 1.0, 'knm': 1e3, 'nmm': 1e-3, 'ncm': 1e-2},
    'rad': {'rad': 1.0, 'deg': np.pi / 180.0, '\u00b0': np.pi / 180.0},
    'rad/s': {'rad/s': 1.0, 'deg/s': np.pi / 180.0, 'rpm': np.pi / 30.0},
    'm/s^2': {'m/s^2': 1.0, 'm/s2': 1.0, 'm/s\u00b2': 1.0},
    '-': {'-': 1.0, '1': 1.0, '': 1.0, '%': 0.01},
}
_UNIT = re.compile(r'^(.*?)\s*[\[(]([^\])]*)[\])]$')
_DECIMAL_COMMA = re.compile(r'[-+]?\d*,\d+([eE][-+]?\d+)?')


@dataclass(frozen=True)
class _Column:
    """A column that is read: its place in the file, its name, the factor to SI."""

    place: int
    name: str
    factor: float = 1.0


def read_table(path: str | Path) -> SteadyTable:
    """Read and check a CSV file (header row, UTF-8).

    Capital letters, units in brackets, and ``;`` with decimal commas are read, with a note.

    Raises
    ------
    UserError
        One line with file, row and cure for everything that makes the table unusable.
    """
    name, (numbered, notes) = str(path), _rows_of(Path(path))
    _check_layout(name, numbered)
    columns = _read_header(name, numbered[0][1], notes)
    values = _read_cells(name, numbered[0][1], columns, numbered[1:])
    lines = np.array([line for line, _ in numbered[1:]], dtype=np.intp)
    return check_table(name, values, lines, notes)


def _rows_of(path: Path) -> tuple[list[tuple[int, list[str]]], list[str]]:
    """Return the numbered rows of cells that are not empty, and notes."""
    try:
        text = read_text(path, LARGEST_TABLE)
        found = _split(text, ',')
        notes: list[str] = []
        if _is_european(found):
            found = [
                (line, [_with_point(cell) for cell in cells]) for line, cells in _split(text, ';')
            ]
            notes.append("cells are separated by ';', a comma was read as the decimal mark")
    except csv.Error as error:
        raise UserError(f'{path}: not a CSV text in UTF-8 ({error}); export it again') from None
    if not found:
        raise UserError(f'{path}: empty; the first line must name the columns ({_KNOWN})')
    return found, notes


def _split(text: str, delimiter: str) -> list[tuple[int, list[str]]]:
    reader = csv.reader(io.StringIO(text, newline=''), delimiter=delimiter)
    rows = [(reader.line_num, [cell.strip() for cell in row]) for row in reader]
    return [(line, row) for line, row in rows if any(row)]


def _is_european(rows: Sequence[tuple[int, list[str]]]) -> bool:
    """Whether header and rows are separated by semicolons."""
    if len(rows) < 2 or len(rows[0][1]) > 1:
        return False
    names = rows[0][1][0].split(';')
    known = sum(_nearest(name) is not None for name in names) > 1
    return known and ','.join(rows[1][1]).count(';') >= len(names) - 1


def _with_point(cell: str) -> str:
    return cell.replace(',', '.') if _DECIMAL_COMMA.fullmatch(cell) else cell


@dataclass
class _Header:
    """What the first line of a file says, and what is wrong with it."""

    columns: list[_Column] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)
    unknown: list[str] = field(default_factory=list)
    mended: list[str] = field(default_factory=list)

    @property
    def names(self) -> list[str]:
        """Columns that are read."""
        return [column.name for column in self.columns]

    def take(self, place: int, title: str) -> None:
        """Take in a title."""
        named = _column(title)
        if named is None:
            self.unknown += [title] if title else []
            return
        name, factor = named[0], _factor(*named)
        if factor is None:
            known = ', '.join(_TO_SI[_unit_of(name)])
            self.faults.append(f'the unit of {title!r} is not known; give one of {known}')
        elif name in self.names:
            self.faults.append(f'column {name!r} stands there twice; delete one')
        else:
            self.columns.append(_Column(place, name, factor))
            if title != name:
                in_si = '' if factor == 1.0 else f' (times {factor:.4g})'
                self.mended.append(f'{title!r} as {name}{in_si}')

    def look_for_missing(self, titles: Sequence[str]) -> None:
        """Note the required columns that are missing, and which titles may be meant for them."""
        names = self.names
        missing = [name for name in ('slip', 'normal_load') if name not in names]
        if not any(name in QUANTITIES for name in names):
            missing += QUANTITIES
        for title in list(self.unknown):
            meant = _nearest(title) or _other_name(title, missing)
            if meant and meant not in names:
                unit = _unit_of(meant)
                in_unit = '' if unit == '-' else f' [{unit}]'
                self.faults.append(
                    f'rename {title!r} to {meant!r}{in_unit} if that is what it holds'
                )
                self.unknown.remove(title)
                missing = [name for name in missing if name != meant]
        among = ', '.join(titles)
        self.faults += [
            f'no column {name!r} among {among}; it is required'
            for name in ('slip', 'normal_load')
            if name in missing
        ]
        if set(QUANTITIES) <= set(missing):
            self.faults.append(
                f'none of sinkage, drawbar_pull, torque among {among}; add at least one'
            )

    def notes(self) -> Iterator[str]:
        """Yield what was read otherwise than it stands there, or not at all."""
        if self.mended:
            yield f'read {", ".join(self.mended)}'
        if self.unknown:
            yield f'columns not used: {", ".join(self.unknown)}'
        for name in self.names:
            quantity = name.removesuffix('_std')
            if name in STD_COLUMNS and quantity not in self.names:
                yield f'{name} is not used: there is no column {quantity}'


def _read_header(path: str, titles: Sequence[str], notes: list[str]) -> list[_Column]:
    """Return the columns to be read; raise with all faults of the header in one line."""
    if not any(_column(title) for title in titles) and any(_is_number(title) for title in titles):
        raise UserError(f'{path}, line 1: no header; the first line must name the columns')
    header = _Header()
    for place, title in enumerate(titles):
        header.take(place, title)
    header.look_for_missing(titles)
    if header.faults:
        raise UserError(f'{path}, line 1: {"; ".join(header.faults)}')
    notes += header.notes()
    return header.columns


def _column(title: str) -> tuple[str, str] | None:
    """Return the known column that a title names, and the unit in brackets (empty = none)."""
    match = _UNIT.match(title)
    name, unit = match.groups() if match else (title, '')
    plain = re.sub(r'[\s-]+', '_', name.strip().lower())
    return (plain, unit.strip()) if plain in COLUMNS else None


def _unit_of(name: str) -> str:
    """Return the SI unit of a column."""
    quantity = name.removesuffix('_std')
    if quantity == 'leaving_angle':
        return 'rad'
    if quantity in ORDER_COLUMNS:
        return '-'
    return INPUT_UNITS.get(quantity) or UNITS[quantity]


def _factor(name: str, unit: str) -> float | None:
    """Return the factor from a unit to that of the column; None where it is not known."""
    if not unit:
        return 1.0
    plain = re.sub(r'[\s*\u00b7.]+', '', unit.lower())
    return _TO_SI[_unit_of(name)].get(plain)


def _other_name(title: str, wanted: Sequence[str]) -> str:
    """Return which of the wanted columns other people call like this; empty = none."""
    return next((name for name in wanted if _plain(title) in _OTHER_NAMES[name]), '')


def _check_layout(path: str, rows: Sequence[tuple[int, list[str]]]) -> None:
    """Raise where the first line is not one of column names between commas."""
    line, header = rows[0]
    if header[0].startswith('PK'):
        raise UserError(f'{path}: a spreadsheet or archive, not text; export the table as CSV')
    if len(header) == 1:
        for mark, said in ((';', "';'"), ('\t', 'tabs'), ('|', "'|'"), (' ', 'spaces')):
            if sum(_nearest(cell) is not None for cell in header[0].split(mark)) > 1:
                raise UserError(
                    f'{path}, line {line}: the cells are separated by {said}; export the table '
                    'with commas between cells and a point as decimal mark'
                )
    if not any(_column(name) for name in header):
        for later, cells in rows[1:20]:
            if {'slip', 'normal_load'} <= set(cells):
                raise UserError(
                    f'{path}, line {line}: not the column names, they stand in line {later}; '
                    'delete the lines above them'
                )


def _plain(name: str) -> str:
    plain = name.lower().replace('-', '_').replace(' ', '_').split('[')[0].split('(')[0]
    return plain.strip('_')


def _nearest(name: str) -> str | None:
    """Return the known column that ``name`` may stand for."""
    plain = _plain(name)
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
    path: str,
    header: Sequence[str],
    columns: Sequence[_Column],
    rows: Sequence[tuple[int, list[str]]],
) -> dict[str, FloatArray]:
    _check_first_row(path, columns, rows)
    values = {column.name: np.full(len(rows), np.nan) for column in columns}
    for index, (line, cells) in enumerate(rows):
        if len(cells) > len(header) and any(cells[len(header) :]):
            raise UserError(
                f'{path}, line {line}: {len(cells)} cells but {len(header)} columns; '
                'use commas between cells and a point as decimal mark'
            )
        for column in columns:
            cell = cells[column.place] if column.place < len(cells) else ''
            if column.name in ORDER_COLUMNS:
                continue
            if cell and cell.lower() not in _NOT_MEASURED:
                number = _number(cell, f'{path}, line {line}, column {column.name}')
                values[column.name][index] = column.factor * number
    for column in columns:
        if column.name in ORDER_COLUMNS:
            cells = [row[column.place] if column.place < len(row) else '' for _, row in rows]
            values[column.name] = _ordered(cells)
    return values


def _ordered(cells: Sequence[str]) -> FloatArray:
    """Return numbers and ISO dates as they are [-, days], other texts as counts of appearance."""
    for read in (float, _days):
        try:
            return np.array([read(cell) if cell else math.nan for cell in cells])
        except ValueError:
            continue
    known = {cell: place for place, cell in enumerate(dict.fromkeys(filter(None, cells)))}
    return np.array([known.get(cell, math.nan) for cell in cells], dtype=float)


def _days(text: str) -> float:
    return datetime.fromisoformat(text).replace(tzinfo=timezone.utc).timestamp() / 86400.0


def _check_first_row(
    path: str, columns: Sequence[_Column], rows: Sequence[tuple[int, list[str]]]
) -> None:
    """Raise where something else than numbers stands below the header."""
    if not rows:
        return
    line, cells = rows[0]
    filled = [cells[c.place] for c in columns if c.place < len(cells) and cells[c.place]]
    if len(filled) > 1 and not any(_is_number(cell) for cell in filled):
        raise UserError(
            f'{path}, line {line}: no numbers below the column names; delete the line '
            '(units may stand in brackets behind the names: sinkage [mm])'
        )


def _number(cell: str, where: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        raise UserError(f'{where}: {cell[:40]!r} is not a number; {_cure(cell)}') from None
    if not math.isfinite(value):
        raise UserError(
            f'{where}: {cell} is not finite; leave the cell empty where nothing was measured'
        )
    return value


def _cure(cell: str) -> str:
    """Return what to do about a cell that is no number."""
    if _DECIMAL_COMMA.fullmatch(cell):
        return 'use a point as decimal mark, without marks between thousands'
    if _is_number(cell.replace(',', '')):
        return 'take out the marks between thousands'
    if _is_number(cell.rstrip('% ')):
        return 'give the ratio, without a percent sign'
    if _is_number(cell.replace('\u2212', '-').replace('\u2013', '-')):
        return 'use the plain minus sign'
    return 'leave the cell empty where nothing was measured'
