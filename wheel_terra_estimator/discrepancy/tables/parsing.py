# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""CSV files and DataFrames as columns of numbers; errors state the remedy."""

from __future__ import annotations

import math
import re
from array import array
from collections.abc import Iterable, Sequence
from dataclasses import replace
from datetime import datetime, timezone
from itertools import chain, islice, zip_longest
from pathlib import Path
from typing import Any

import numpy as np

from wheel_terra_estimator.arrays import FloatArray, IndexArray
from wheel_terra_estimator.configuration.column_map import are_units, bare, factor
from wheel_terra_estimator.csv_file import (
    CsvFile,
    check_width,
    is_number,
    number,
    open_csv,
    value_of,
)
from wheel_terra_estimator.discrepancy.tables.checks import check_table
from wheel_terra_estimator.discrepancy.tables.header import (
    Choice,
    Header,
    Title,
    meaning_of,
    with_unit,
)
from wheel_terra_estimator.discrepancy.tables.steady_table import (
    COLUMNS,
    ONE_OF,
    ORDER_COLUMNS,
    SteadyTable,
)
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.frames import arrays_of, unit_of, units_in
from wheel_terra_estimator.input_file import LARGEST_TABLE

Rows = Iterable[tuple[int, Sequence[Any]]]

REQUIRED = ('slip', 'normal_load')
_KNOWN = 'slip, normal_load, sinkage, drawbar_pull, torque, ...'
MOST_COLUMNS = 1000
"""A table with more was laid on its side."""
_TITLE_LINES = 20
"""Lines above the column names that are looked through for them."""


def read_table(path: str | Path, choice: Choice | None = None) -> SteadyTable:
    """Read and check a CSV file (header row, Unicode).

    Capital letters, names of the field, units beside or below a name, and decimal commas where
    cells are separated otherwise are read, with a note. ``choice`` says which columns are used and
    which are not, where the titles do not. Raises UserError for everything that makes the table
    unusable: one line with file, row and remedy.
    """
    lines, values, notes, units = read_columns(Path(path), choice or Choice(), one_of=ONE_OF)
    return replace(check_table(str(path), values, lines, notes), units=units)


def read_columns(
    path: Path, choice: Choice, wanted: Sequence[str] = COLUMNS, one_of: Sequence[str] = ()
) -> tuple[IndexArray, dict[str, FloatArray], list[str], dict[str, float]]:
    """Return the lines of the rows, the wanted columns of a CSV file in SI, notes, and units.

    Of the columns ``one_of`` there has to be one, beside slip and normal load; columns that are not
    wanted are passed over. Raises UserError as `read_table`, but for values that cannot be.
    """
    with open_csv(path, LARGEST_TABLE) as file:
        if not file.header:
            raise UserError(f'{path}: empty; the first line must name the columns ({_KNOWN})')
        if len(file.header) > MOST_COLUMNS:
            raise UserError(
                f'{path}: {len(file.header)} columns; a table of wheel tests has fewer than '
                f'{MOST_COLUMNS}, one row for each test'
            )
        first = list(islice(file.rows, _TITLE_LINES))
        _check_layout(file, first)
        titles = _with_row_of_units(file, first, choice.ignored)
        header = Header(f'{path}, line {file.line}', titles, choice, wanted)
        header.check(REQUIRED, one_of)
        rows = chain(first, file.rows)
        lines, values = _read_rows(str(path), header, rows, file.decimal_comma)
    notes = []
    if file.decimal_comma:
        mark = 'tabs' if file.delimiter == '\t' else repr(file.delimiter)
        notes.append(f'cells are separated by {mark}, a comma would be read as the decimal mark')
    return lines, values, [*notes, *header.notes], header.units


def table_of(data: Any, name: str, choice: Choice | None = None) -> SteadyTable:
    """Return a DataFrame, or a mapping of columns, read and checked as `read_table` does.

    Its rows count from line 2, as below a header; ``attrs['units']`` of a DataFrame has the units
    of columns that do not say them. Messages call it ``name``.
    """
    units = units_in(data, name, meaning_of)
    columns = {
        with_unit(str(key).strip(), units.get(key, '')): column
        for key, column in arrays_of(data, name).items()
    }
    header = Header(name, list(columns), choice or Choice())
    header.check(REQUIRED, ONE_OF)
    rows = enumerate(zip(*columns.values(), strict=True), start=2)
    lines, values = _read_rows(name, header, rows, decimal_comma=True)
    return replace(check_table(name, values, lines, header.notes), units=header.units)


def _check_layout(file: CsvFile, rows: Sequence[tuple[int, list[str]]]) -> None:
    """Raise where the first line is not one of column names, or the next not one of cells."""
    header, where = file.header, f'{file.path}, line {file.line}'
    if len(header) == 1:
        for mark, said in (('|', "'|'"), (' ', 'spaces')):
            if sum(meaning_of(cell) is not None for cell in header[0].split(mark)) > 1:
                raise UserError(
                    f'{where}: the cells are separated by {said}; export the table with commas '
                    'between cells and a point as decimal mark'
                )
    if not any(meaning_of(title) for title in header):
        if any(is_number(title) for title in header):
            raise UserError(f'{where}: no header; the first line must name the columns')
        for line, cells in rows:
            named = [meaning_of(cell) for cell in re.split('[,;\t]', ','.join(cells))]
            if sum(meaning is not None for meaning in named) > 1:
                raise UserError(
                    f'{where}: not the column names, they stand in line {line}; '
                    'delete the lines above them'
                )
    for line, cells in rows[:1]:
        if len(cells) == 1 < len(header) and not is_number(cells[0]):
            raise UserError(
                f'{file.path}, line {line}: one cell but {len(header)} columns; the column names '
                f'are separated by {file.delimiter!r}, the cells are not'
            )


def _with_row_of_units(
    file: CsvFile, rows: list[tuple[int, list[str]]], ignored: Sequence[str]
) -> list[str]:
    """Return the titles with the units that a row below them has; take that out of ``rows``."""
    line, cells = rows[0] if rows else (0, [])
    if not are_units(cells):
        return file.header
    units = [bare(cell) for cell in cells]
    del rows[0]
    titles = []
    for title, unit in zip_longest(file.header, units[: len(file.header)], fillvalue=''):
        said = meaning_of(title) or Title('')
        if said.unit and unit:
            si = unit_of(said.name)
            if factor(si, said.unit) != factor(si, unit):
                raise UserError(f'{file.path}, line {line}: {unit!r} below {title!r}; correct one')
        plain = said.unit or not (title and unit) or title in ignored
        titles.append(title if plain else f'{title} [{unit}]')
    return titles


def _read_rows(
    source: str, header: Header, rows: Rows, decimal_comma: bool
) -> tuple[IndexArray, dict[str, FloatArray]]:
    """Return the lines of the rows and the columns that are used; ask for the others."""
    lines = array('q')
    values = [(column, array('d')) for column in header.columns if column.name not in ORDER_COLUMNS]
    ordered: list[tuple[str, int, list[Any]]] = [
        (column.name, column.place, []) for column in header.columns if column.name in ORDER_COLUMNS
    ]
    others: dict[int, list[float | None]] = {place: [] for place, _ in header.unused}
    width = len(header.titles)
    for line, row in rows:
        cells = [*row, *[''] * (width - len(row))]
        if not lines:
            _check_first_row(source, line, [cells[column.place] for column, _ in values])
        check_width(cells, width, f'{source}, line {line}')
        for column, found in values:
            where = f'{source}, line {line}, column {column.name}'
            found.append(column.factor * number(cells[column.place], where, decimal_comma))
        for _, place, texts in ordered:
            texts.append(cells[place])
        for place, other in others.items():
            other.append(value_of(cells[place], decimal_comma))
        lines.append(line)
    header.check_unused([place for place, other in others.items() if _holds_numbers(other)])
    columns = {column.name: np.array(found) for column, found in values}
    columns |= {name: _ordered(texts) for name, _, texts in ordered}
    return np.array(lines, dtype=np.intp), columns


def _holds_numbers(values: Sequence[float | None]) -> bool:
    """Return whether a column is one of numbers (None: a text, nan: empty), but those of its rows.

    These are 0, 1, 2 ... or 1, 2, 3 ...
    """
    numbers = [(i, v) for i, v in enumerate(values) if v is not None and not math.isnan(v)]
    first = 1.0 if numbers and numbers[0] == (0, 1.0) else 0.0
    count = all(value == first + i for i, value in numbers)
    return len(numbers) > values.count(None) and not (count and len(numbers) > 1)


def _ordered(cells: Sequence[Any]) -> FloatArray:
    """Return numbers and ISO dates as they are [-, days], other texts as counts of appearance."""
    texts = [str(cell) for cell in cells]
    for read in (float, _days):
        try:
            return np.array([read(text) if text else math.nan for text in texts])
        except ValueError:
            continue
    known = {text: place for place, text in enumerate(dict.fromkeys(filter(None, texts)))}
    return np.array([known.get(text, math.nan) for text in texts], dtype=float)


def _days(text: str) -> float:
    return datetime.fromisoformat(text).replace(tzinfo=timezone.utc).timestamp() / 86400.0


def _check_first_row(source: str, line: int, cells: Sequence[Any]) -> None:
    """Raise where something else than numbers stands below the header."""
    filled = [cell for cell in cells if cell != '']
    if len(filled) > 1 and not any(is_number(cell, decimal_comma=True) for cell in filled):
        raise UserError(
            f'{source}, line {line}: no numbers below the column names; delete the line '
            '(units may stand in brackets behind the names: sinkage [mm])'
        )
