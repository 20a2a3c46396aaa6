# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The map of a drive as a table (CSV)."""

from __future__ import annotations

from pathlib import Path

from wheel_terra_estimator.bags.track import COLUMNS, Track
from wheel_terra_estimator.csv_file import write_csv
from wheel_terra_estimator.errors import UserError

WHOLE = ('slip_class', 'stuck')  # columns of whole numbers
DIGITS = 6  # significant ones in a table


def check_track(path: Path) -> None:
    """Refuse, before anything is computed, a map that cannot be written."""
    if path.suffix != '.csv':
        raise UserError(f'{path}: a track ends in .csv')


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
