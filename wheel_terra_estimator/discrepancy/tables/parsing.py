# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A CSV file turned into columns of numbers; what cannot be read is said with its cure."""

from __future__ import annotations

import csv
import difflib
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.discrepancy.tables.checks import check_table
from wheel_terra_estimator.discrepancy.tables.steady_table import (
    COLUMNS,
    INPUT_UNITS,
    QUANTITIES,
    STD_COLUMNS,
    UNITS,
    SteadyTable,
)
from wheel_terra_estimator.errors import UserError

FloatArray = NDArray[np.float64]

# What other people call the required columns; only for the cure in a message.
_OTHER_NAMES = {
    'slip': ('s', 'i', 'slip_ratio', 'sr', 'schlupf'),
    'normal_load': ('w', 'fz', 'fn', 'load', 'vertical_load', 'weight', 'wheel_load', 'radlast'),
    'sinkage': ('z', 'depth', 'sinkage_depth', 'einsinkung'),
    'drawbar_pull': ('dp', 'fx', 'f_dp', 'pull', 'drawbar', 'traction', 'zugkraft'),
    'torque': ('t', 'm', 'mz', 'moment', 'drive_torque', 'drehmoment'),
}


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
            reader = csv.reader(stream)
            rows = [(reader.line_num, row) for row in reader]
    except FileNotFoundError:
        raise UserError(f'{path}: no such file; give the path of a CSV table') from None
    except IsADirectoryError:
        raise UserError(f'{path}: is a folder; give a CSV table or a rosbag2') from None
    except OSError as error:
        raise UserError(f'{path}: cannot be read ({error.strerror}); check its rights') from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise UserError(f'{path}: not a CSV text in UTF-8 ({error}); export it again') from None
    numbered = [
        (line, [cell.strip() for cell in row])
        for line, row in rows
        if any(cell.strip() for cell in row)
    ]
    if not numbered:
        raise UserError(f'{path}: empty; the first line must name the columns ({_known()})')
    _check_layout(str(path), numbered)
    header = numbered[0][1]
    notes: list[str] = []
    names = _check_header(str(path), header, notes)
    values = _read_cells(str(path), header, names, numbered[1:])
    lines = np.array([line for line, _ in numbered[1:]], dtype=np.intp)
    return check_table(str(path), values, lines, notes)


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
                f'{path}, line 1: no column {name!r} among {", ".join(header)}; '
                f'{_renaming(header, (name,)) or "it is required"}'
            )
    if not any(name in QUANTITIES for name in known):
        raise UserError(
            f'{path}, line 1: none of sinkage, drawbar_pull, torque among {", ".join(header)}; '
            f'{_renaming(header, QUANTITIES) or "add at least one"}'
        )
    for name in known:
        if name in STD_COLUMNS and name.removesuffix('_std') not in known:
            notes.append(f'{name} is not used: there is no column {name.removesuffix("_std")}')
    return known


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
    if not {'slip', 'normal_load'} & set(header):
        for later, cells in rows[1:20]:
            if {'slip', 'normal_load'} <= set(cells):
                raise UserError(
                    f'{path}, line {line}: not the column names, they stand in line {later}; '
                    'delete the lines above them'
                )


def _plain(name: str) -> str:
    plain = name.lower().replace('-', '_').replace(' ', '_').split('[')[0].split('(')[0]
    return plain.strip('_')


def _renaming(header: Sequence[str], wanted: Sequence[str]) -> str:
    """Return which column may be meant by one of the wanted names; empty = none."""
    for name in wanted:
        for column in header:
            if _plain(column) in _OTHER_NAMES[name] and column not in COLUMNS:
                unit = INPUT_UNITS.get(name) or UNITS[name]
                in_unit = '' if unit == '-' else f' [{unit}]'
                return f'rename {column!r} to {name!r}{in_unit} if that is what it holds'
    return ''


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
    path: str, header: Sequence[str], names: Sequence[str], rows: Sequence[tuple[int, list[str]]]
) -> dict[str, FloatArray]:
    position = {name: header.index(name) for name in names}
    if rows:
        line, cells = rows[0]
        filled = [cells[c] for c in position.values() if c < len(cells) and cells[c]]
        if len(filled) > 1 and not any(_is_number(cell) for cell in filled):
            raise UserError(
                f'{path}, line {line}: no numbers below the column names; delete the line '
                '(units are fixed: m, N, N m, rad, slip as a ratio)'
            )
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
                    f'{path}, line {line}, column {name}: {cell[:40]!r} is not a number; '
                    + _cure(cell)
                ) from None
            if not np.isfinite(values[name][index]):
                raise UserError(
                    f'{path}, line {line}, column {name}: {cell} is not finite; '
                    'leave the cell empty where nothing was measured'
                )
    return values


def _cure(cell: str) -> str:
    """Return what to do about a cell that is no number."""
    if re.fullmatch(r'[-+]?\d*,\d+([eE][-+]?\d+)?', cell):
        return 'use a point as decimal mark, without marks between thousands'
    if _is_number(cell.replace(',', '')):
        return 'take out the marks between thousands'
    if _is_number(cell.rstrip('% ')):
        return 'give the ratio, without a percent sign'
    if _is_number(cell.replace('\u2212', '-').replace('\u2013', '-')):
        return 'use the plain minus sign'
    return 'leave the cell empty where nothing was measured'
