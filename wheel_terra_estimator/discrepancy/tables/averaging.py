# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Long tables averaged over neighbouring inputs; several tables, or one and a reference, as one."""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from wheel_terra_estimator.arrays import MAD_TO_STD, BoolArray, FloatArray, IndexArray
from wheel_terra_estimator.discrepancy.tables.steady_table import (
    INPUT_COLUMNS,
    SteadyTable,
    concatenated,
    new_rows,
)
from wheel_terra_estimator.errors import UserError

MINIMUM_ROWS = 6
MOST_ROWS = 240  # more are averaged over neighbouring inputs: the time grows with their cube

_FAR = 8.0  # pooled robust deviations from the median of a cell


def averaged(table: SteadyTable, most: int) -> SteadyTable:
    """Return the table averaged over cells of neighbouring inputs, at most ``most`` of them.

    The cells halve the widest input of the fullest cell over and over, between two of its values
    (k-d tree): levels stay separate while there are cells. Rows that lack different columns are
    not mixed; readings further than `_FAR` from the median of their cell are left out.
    """
    names = list(table.columns)
    inputs = np.column_stack([table.columns[name] for name in names])
    width = np.nanmax(inputs, axis=0) - np.nanmin(inputs, axis=0)
    scaled = np.nan_to_num(inputs / np.where(width > 0.0, width, 1.0))
    scaled[:, [i for i, name in enumerate(names) if name not in INPUT_COLUMNS]] = 0.0
    known = np.isfinite(np.column_stack([inputs, table.measured, table.stated_std]))
    _, pattern = np.unique(known, axis=0, return_inverse=True)
    whole = [np.flatnonzero(np.ravel(pattern) == p) for p in np.unique(pattern)]
    cells = _halved(scaled, whole, max(most, len(whole)))

    def mean(values: FloatArray) -> FloatArray:
        centre = np.array([np.median(values[cell]) for cell in cells])
        off = np.zeros(len(values))
        for cell, middle in zip(cells, centre, strict=True):
            off[cell] = np.abs(values[cell] - middle)
        spread = MAD_TO_STD * np.median(off[off > 0.0]) if (off > 0.0).any() else 0.0
        kept = ~(off > _FAR * spread)
        picked = [cell[kept[cell]] if len(cell) > 2 else cell for cell in cells]
        return np.array([np.mean(values[cell]) if len(cell) else np.nan for cell in picked])

    def of_mean(std: FloatArray) -> FloatArray:
        return np.array([np.sqrt(np.sum(std[c] ** 2)) / len(c) for c in cells])

    return SteadyTable(
        table.name,
        np.array([table.lines[cell].min() for cell in cells], dtype=np.intp),
        {name: np.array([np.mean(table.columns[name][c]) for c in cells]) for name in names},
        np.column_stack([mean(column) for column in table.measured.T]),
        np.column_stack([of_mean(column) for column in table.stated_std.T]),
        of_mean(table.slip_std),
        of_mean(table.leaving_angle_std),
        np.array([table.true_rows[cell].all() for cell in cells]),
        table.notes,
        table.units,
    )


def together(tables: Sequence[SteadyTable]) -> SteadyTable:
    """Return several tables as one, the soil in common; what one does not state is the model's.

    Long tables are averaged first, each to its share of what a diagnosis takes.
    """
    if len(tables) == 1:
        return tables[0]
    share = MOST_ROWS // len(tables)
    parts: list[SteadyTable] = []
    for part in tables:
        parts.append(new_rows(averaged(part, share) if len(part) > share else part, parts))
    listed = ', '.join(f'{part.name} ({len(part)} rows)' for part in parts)
    notes = (
        f'{len(parts)} tables share one soil: {listed}; a line number is that of its own table',
        *dict.fromkeys(f'{part.name}: {note}' for part in parts for note in part.notes),
    )
    return concatenated(' + '.join(part.name for part in parts), parts, notes)


def join(table: SteadyTable, reference: SteadyTable) -> tuple[SteadyTable, SteadyTable, BoolArray]:
    """Return the table less the rows of the reference, both as one, and which are not reference.

    Raises UserError if the two share no measured quantity, only one of them states a column, or a
    few rows of the table are left.
    """
    if not set(table.quantities) & set(reference.quantities):
        raise UserError(
            f'{reference.name}: measures {", ".join(reference.quantities)}, but {table.name} '
            f'{", ".join(table.quantities)}; a reference needs a quantity of the table'
        )
    for column in set(table.columns) ^ set(reference.columns):
        if column in INPUT_COLUMNS or column == 'leaving_angle':
            has, lacks = (table, reference) if column in table.columns else (reference, table)
            raise UserError(
                f'{lacks.name}: no column {column!r}, which {has.name} has; state it in both'
            )
    own = new_rows(table, [reference])
    if 0 < len(own) < MINIMUM_ROWS:
        raise UserError(
            f'{table.name}: {len(own)} of {len(table)} rows are not copies of rows of '
            f'{reference.name}; at least {MINIMUM_ROWS} are needed'
        )
    table = own if len(own) else replace(table, notes=own.notes)
    notes = (*table.notes, f'{len(reference)} rows of {reference.name} as reference')
    joined = concatenated(table.name, (table, reference), notes)
    return table, joined, np.arange(len(joined)) < len(table)


def _halved(scaled: FloatArray, cells: list[IndexArray], most: int) -> list[IndexArray]:
    """Split the cell with the most rows times extent until there are ``most``."""
    heap = [(-_weight(scaled[cell]), i, cell) for i, cell in enumerate(cells)]
    heapq.heapify(heap)
    label = len(heap)
    while len(heap) < most and heap[0][0] < 0.0:  # not all are of equal rows
        _, _, cell = heapq.heappop(heap)
        axis = int(np.argmax(np.ptp(scaled[cell], axis=0)))
        values = scaled[cell, axis]
        levels = np.unique(values)
        cut = levels[np.clip(np.searchsorted(levels, np.median(values)), 1, len(levels) - 1)]
        for half in (cell[values < cut], cell[values >= cut]):
            heapq.heappush(heap, (-_weight(scaled[half]), label, half))
            label += 1
    return [cell for _, _, cell in heap]


def _weight(values: FloatArray) -> float:
    return float(len(values) * np.ptp(values, axis=0).max())
