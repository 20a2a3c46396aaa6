# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Rows of a drive of any length in bounded memory, for pictures and means."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from wheel_terra_estimator.arrays import FloatArray, IntArray

MOST_ROWS = 20_000
"""Rows that are kept: a thousand seconds at 20 Hz, ten times what a picture can show."""


class ThinnedRows:
    """Stamped rows; once there are too many, the first of each 2, 4, 8 ... is kept.

    ``most``: greatest number of rows that are kept; even.
    """

    def __init__(self, most: int = MOST_ROWS) -> None:
        self._most = most
        self._rows: list[tuple[int, FloatArray]] = []
        self._together = 1  # rows of which the first is kept
        self._count = 0  # of those, the rows that the last one kept stands for

    def add(self, stamp: int, values: ArrayLike) -> None:
        """Append a row."""
        if 0 < self._count < self._together:
            self._count += 1
            return
        if len(self._rows) >= self._most:
            self._rows = self._rows[::2]
            self._together *= 2
        self._count = 1
        self._rows.append((stamp, np.array(values, dtype=np.float64)))

    def stamps(self) -> IntArray:
        """Return the stamps that were kept, (k,) [ns]."""
        return np.array([stamp for stamp, _ in self._rows], dtype=np.int64)

    def values(self, width: int) -> FloatArray:
        """Return the values that were kept, (k, width)."""
        found = np.array([values for _, values in self._rows], dtype=np.float64)
        return found.reshape(len(self._rows), width)
