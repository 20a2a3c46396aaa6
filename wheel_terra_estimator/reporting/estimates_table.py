# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Estimates of a drive as a table, a row per set and wheel; its map as one (CSV)."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import numpy as np

from wheel_terra_estimator.bags.history import WHEEL_FIELDS, EstimateHistory
from wheel_terra_estimator.bags.track import COLUMNS, Track
from wheel_terra_estimator.csv_file import write_csv
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.frames import unit_of

PARQUET = '.parquet'


def columns_of(history: EstimateHistory) -> dict[str, Any]:
    """Return header -> column, one entry per set and wheel, wheels of a set together."""
    wheels, sets = len(history.names), history.stamp.size
    table: dict[str, Any] = {
        'stamp [ns]': np.repeat(history.stamp, wheels),
        'wheel': np.tile(np.array(history.names, dtype=object), sets),
        'slip_class': history.slip_class.reshape(-1),
    }
    for name in WHEEL_FIELDS:
        table[f'{name} [{unit_of(name)}]'] = history.values[name].reshape(-1)
    table['forward_velocity [m/s]'] = np.repeat(history.forward_velocity, wheels)
    table['stuck'] = np.repeat(history.stuck, wheels)
    return table


def write_table(history: EstimateHistory, path: Path) -> None:
    """Write the table as CSV, or as Parquet by the ending of ``path``."""
    table = columns_of(history)
    if path.suffix.lower() == PARQUET:
        pandas_for(path).DataFrame(table).to_parquet(path, index=False)
        return
    write_csv(path, table, zip(*(column.tolist() for column in table.values()), strict=True))


def pandas_for(path: Path) -> Any:
    """Return pandas, by which Parquet is written; refuse where it is missing."""
    try:
        pandas = importlib.import_module('pandas')
        importlib.import_module('pyarrow')  # pandas writes Parquet with it
    except ImportError as error:
        raise UserError(
            f'{path}: Parquet needs pandas and pyarrow ({error.name} is missing): '
            'pip install pandas pyarrow, or write a .csv'
        ) from None
    return pandas


WHOLE = ('slip_class', 'stuck')  # columns of whole numbers
DIGITS = 6  # significant ones in a table


def write_track(track: Track, path: Path) -> None:
    """Write a track."""
    heads = [f'{name} [{unit}]' if unit else name for name, unit in COLUMNS.items()]
    columns = [
        [int(v) for v in track.values[name]]
        if name in WHOLE
        else [f'{v:.{DIGITS}g}' for v in track.values[name]]
        for name in COLUMNS
    ]
    write_csv(path, ['stamp [ns]', *heads], zip(track.stamp.tolist(), *columns, strict=True))
