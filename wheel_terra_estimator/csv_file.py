# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""CSV files as people export them: comma, semicolon or tab, point or decimal comma, Unicode."""

from __future__ import annotations

import csv
import math
import re
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO

from wheel_terra_estimator.configuration.column_map import are_units
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.input_file import check_size

DELIMITERS = (',', ';', '\t')  # where two are as frequent, the first
_NOT_MEASURED = frozenset({'', 'nan', 'na', 'n/a', '-', '<na>', 'none', 'nat'})
_DECIMAL_COMMA = re.compile(r'[-+]?\d*,\d+([eE][-+]?\d+)?')
_STATED_DELIMITER = re.compile(r'"?sep=(.)"?\s*', re.IGNORECASE)  # of spreadsheets, line 1
_QUOTED = re.compile('"[^"]*"')


@dataclass(frozen=True)
class CsvFile:
    """An open table."""

    path: Path
    header: list[str]  # titles of the columns; empty for an empty file
    line: int  # line of the header
    delimiter: str  # what stands between the cells; where it is no comma, a comma is a decimal mark
    # Line and cells of each row below the header in which something stands
    rows: Iterator[tuple[int, list[str]]]

    @property
    def decimal_comma(self) -> bool:
        """Whether a comma in a number is its decimal mark."""
        return self.delimiter != ','


@contextmanager
def open_csv(path: Path, largest: int | None = None) -> Iterator[CsvFile]:
    """Open a table for one pass over its rows.

    Raises UserError where it is not there, too large, or no CSV text in UTF-8, or in UTF-16 with a
    mark of it; also while its rows are read.
    """
    check_size(path, largest)
    wide = False
    try:
        with path.open('rb') as file:
            head = file.read(4)
        if head == b'PK\x03\x04':
            raise UserError(f'{path}: a spreadsheet or archive, not text; export the table as CSV')
        wide = head.startswith((BOM_UTF16_LE, BOM_UTF16_BE))  # as spreadsheets save Unicode text
        with path.open(newline='', encoding='utf-16' if wide else 'utf-8-sig') as text:
            above, titles, stated = _titles(text)
            text.seek(0)
            for _ in range(above):
                text.readline()
            delimiter = stated or max(DELIMITERS, key=_QUOTED.sub('', titles).count)
            reader = csv.reader(text, delimiter=delimiter)
            cells = ((above + reader.line_num, [cell.strip() for cell in row]) for row in reader)
            rows = ((line, row) for line, row in cells if any(row))
            line, header = next(rows, (1, []))
            yield CsvFile(path, header, line, delimiter, rows)
    except UnicodeDecodeError:
        said, old = ('UTF-16', '-c -f utf-16') if wide else ('UTF-8', '-f cp1252')
        raise UserError(
            f'{path}: not a {said} text; save it as CSV (UTF-8), or: iconv {old} -t utf8'
        ) from None
    except csv.Error as error:
        raise UserError(f'{path}: not a CSV text ({error}); export it again') from None


def _titles(text: TextIO) -> tuple[int, str, str]:
    """Return how many lines stand above that of the titles, this, and a delimiter that one states.

    Above it may stand comments (#); one that numbers or units follow is the line of titles itself.
    """
    comment, stated = (0, ''), ''
    for above, line in enumerate(iter(text.readline, '')):
        delimiter = _STATED_DELIMITER.fullmatch(line)
        cells = [cell.strip('" \r\n') for cell in re.split('[,;\t]', line)]
        below = bool(comment[1]) and are_units(cells)
        if delimiter:
            stated = delimiter[1]
        elif line.startswith('#'):
            comment = comment if below else (above, line)
        elif line.strip():
            below |= bool(comment[1]) and any(map(is_number, cells))
            return (*(comment if below else (above, line)), stated)
    return (*comment, stated)


def write_csv(path: Path, header: Iterable[str], rows: Iterable[Iterable[Any]]) -> None:
    """Write a table: comma, UTF-8."""
    with path.open('w', newline='', encoding='utf-8') as file:
        writer = csv.writer(file)
        writer.writerow(header)
        writer.writerows(rows)


def check_width(cells: Sequence[Any], columns: int, where: str) -> None:
    """Raise UserError where something stands beyond the last column."""
    if any(cells[columns:]):
        raise UserError(
            f'{where}: {len(cells)} cells but {columns} columns; use commas between cells and a '
            'point as decimal mark'
        )


def number(cell: Any, where: str, decimal_comma: bool = False) -> float:
    """Return the number in a cell; nan where the cell is empty.

    Raises UserError for what is not a number, or not a finite one; it names ``where``: file, line,
    column.
    """
    value = value_of(cell, decimal_comma)
    if value is None:
        text = str(cell).strip()
        raise UserError(f'{where}: {text[:40]!r} is not a number; {_cure(text)}')
    if math.isinf(value):
        raise UserError(
            f'{where}: {cell} is not finite; leave the cell empty where nothing was measured'
        )
    return value


def value_of(cell: Any, decimal_comma: bool) -> float | None:
    """Return the number in a cell, nan where the cell is empty, None for something else."""
    try:
        return float(cell)
    except (TypeError, ValueError):
        text = str(cell).strip()
    if text.lower() in _NOT_MEASURED:
        return math.nan
    if decimal_comma and _DECIMAL_COMMA.fullmatch(text):
        return float(text.replace(',', '.'))
    return None


def is_number(cell: Any, decimal_comma: bool = False) -> bool:
    """Return whether a number stands in a cell."""
    value = value_of(cell, decimal_comma)
    return value is not None and math.isfinite(value)


def _cure(cell: str) -> str:
    """Return what to do about a cell that is no number."""
    if _DECIMAL_COMMA.fullmatch(cell):
        return 'use a point as decimal mark, no thousands separators'
    if is_number(cell.replace(',', '')) or is_number(cell.replace('.', ''), decimal_comma=True):
        return 'remove the thousands separators'
    if is_number(cell.rstrip('% ')):
        return 'give the ratio, without a percent sign'
    if is_number(cell.replace('\u2212', '-').replace('\u2013', '-')):
        return 'use the plain minus sign'
    if ':' in cell:
        return 'give a time as a number, in s, ms, us or ns'
    if is_number(cell.partition(' ')[0]):
        return 'a unit belongs into the title, in brackets'
    return 'leave the cell empty where nothing was measured'
