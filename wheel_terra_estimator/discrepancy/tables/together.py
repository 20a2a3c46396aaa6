# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Several tables as one: other wheels, lugs or slopes, the soil in common."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.discrepancy.tables.averaging import MOST_ROWS, averaged
from wheel_terra_estimator.discrepancy.tables.steady_table import SteadyTable

FloatArray = NDArray[np.float64]


def together(tables: Sequence[SteadyTable]) -> SteadyTable:
    """Return the rows of all tables; what one does not state comes from the configuration.

    Long tables are averaged first, each to its share of what a diagnosis takes.
    """
    if len(tables) == 1:
        return tables[0]
    share = MOST_ROWS // len(tables)
    parts = [averaged(t, share) if len(t) > share else t for t in tables]
    names = dict.fromkeys(name for part in parts for name in part.columns if name != 'time')
    stds = [part.leaving_angle_std for part in parts]

    def column(part: SteadyTable, name: str) -> FloatArray:
        return part.columns.get(name, np.full(len(part), np.nan))

    listed = ', '.join(f'{part.name} ({len(part)} rows)' for part in parts)
    return SteadyTable(
        ' + '.join(part.name for part in parts),
        np.concatenate([part.lines for part in parts]),
        {name: np.concatenate([column(part, name) for part in parts]) for name in names},
        np.concatenate([part.measured for part in parts]),
        np.concatenate([part.stated_std for part in parts]),
        np.concatenate([part.slip_std for part in parts]),
        (
            f'{len(parts)} tables share one soil: {listed}; a line number is that of its own table',
            *dict.fromkeys(f'{part.name}: {note}' for part in parts for note in part.notes),
        ),
        None
        if all(std is None for std in stds)
        else np.concatenate(
            [
                np.zeros(len(part)) if std is None else std
                for part, std in zip(parts, stds, strict=True)
            ]
        ),
        np.concatenate([part.true_rows for part in parts]),
    )
