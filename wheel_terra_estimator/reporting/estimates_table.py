# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Estimates of a drive as a table: one row per set and wheel, units in the header."""

from __future__ import annotations

import csv
import importlib
from pathlib import Path
from typing import Any

import numpy as np

from wheel_terra_estimator.bags.history import EstimateHistory
from wheel_terra_estimator.errors import UserError

UNITS = {
    'slip': '-',
    'slip_std': '-',
    'slip_velocity': 'm/s',
    'drawbar_pull': 'N',
    'drawbar_pull_std': 'N',
    'sinkage': 'm',
    'sinkage_std': 'm',
    'normal_load': 'N',
    'rim_travel_left': 'm',
    'pull_margin': 'N',
    'slip_angle': 'rad',
    'slip_angle_std': 'rad',
    'lateral_force': 'N',
}
SUFFIXES = ('.csv', '.parquet')


def check_table(path: Path) -> None:
    """Refuse, before anything is computed, a table that cannot be written."""
    if path.suffix not in SUFFIXES:
        raise UserError(f'{path}: a table ends in .csv or .parquet')
    if path.suffix == '.parquet':
        _pandas(path)


def columns_of(history: EstimateHistory) -> dict[str, Any]:
    """Return header -> column, one entry per set and wheel, wheels of a set together."""
    wheels, sets = len(history.names), history.stamp.size
    table: dict[str, Any] = {
        'stamp [ns]': np.repeat(history.stamp, wheels),
        'wheel': np.tile(np.array(history.names, dtype=object), sets),
        'slip_class': history.slip_class.reshape(-1),
    }
    for name, unit in UNITS.items():
        table[f'{name} [{unit}]'] = history.values[name].reshape(-1)
    table['forward_velocity [m/s]'] = np.repeat(history.forward_velocity, wheels)
    table['stuck'] = np.repeat(stuck_at(history), wheels)
    return table


def stuck_at(history: EstimateHistory) -> Any:
    """Return whether a stuck warning ran, per set."""
    running = np.zeros(history.stamp.size, dtype=bool)
    for warning in history.warnings:
        end = history.stamp[-1] + 1 if warning.end is None else warning.end
        running |= (history.stamp >= warning.start) & (history.stamp < end)
    return running


def write_table(history: EstimateHistory, path: Path) -> None:
    """Write the table as CSV, or as Parquet by the ending of ``path``."""
    table = columns_of(history)
    if path.suffix == '.parquet':
        _pandas(path).DataFrame(table).to_parquet(path, index=False)
        return
    with path.open('w', newline='', encoding='utf-8') as file:
        writer = csv.writer(file)
        writer.writerow(table)
        writer.writerows(zip(*(column.tolist() for column in table.values()), strict=True))


def _pandas(path: Path) -> Any:
    try:
        pandas = importlib.import_module('pandas')
        importlib.import_module('pyarrow')  # pandas writes Parquet with it
    except ImportError as error:
        raise UserError(
            f'{path}: Parquet needs pandas and pyarrow ({error.name} is missing): '
            'pip install pandas pyarrow, or write a .csv'
        ) from None
    return pandas
