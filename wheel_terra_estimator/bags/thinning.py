# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Rows of a drive of any length in bounded memory, for pictures."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]

MOST_ROWS = 20_000
"""Rows that are kept: a thousand seconds at 20 Hz, ten times what a picture can show."""


class ThinnedRows:
    """Stamped rows; once there are too many, one of each 2, 4, 8 ... following ones is kept.

    Parameters
    ----------
    most : int
        Greatest number of rows that are kept; even.
    """

    def __init__(self, most: int = MOST_ROWS) -> None:
        self._most = most
        self._rows: list[tuple[int, float, FloatArray]] = []  # stamp, score, values
        self._together = 1  # rows of which one is kept
        self._count = 0  # of those, the rows that the last one kept stands for

    def add(self, stamp: int, values: ArrayLike, score: float = 0.0) -> None:
        """Append a row; of those that follow one another the one with the highest score stays."""
        row = (stamp, score, np.array(values, dtype=np.float64))
        if 0 < self._count < self._together:
            self._count += 1
            if score > self._rows[-1][1]:
                self._rows[-1] = row
            return
        if len(self._rows) >= self._most:
            pairs = zip(self._rows[::2], self._rows[1::2], strict=True)
            self._rows = [one if one[1] >= two[1] else two for one, two in pairs]
            self._together *= 2
        self._count = 1
        self._rows.append(row)

    def stamps(self) -> NDArray[np.int64]:
        """Return the stamps that were kept, (k,) [ns]."""
        return np.array([stamp for stamp, _, _ in self._rows], dtype=np.int64)

    def values(self, width: int) -> FloatArray:
        """Return the values that were kept, (k, width)."""
        found = np.array([values for _, _, values in self._rows], dtype=np.float64)
        return found.reshape(len(self._rows), width)
