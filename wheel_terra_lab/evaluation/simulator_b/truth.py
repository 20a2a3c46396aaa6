# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Ground truth of a drive on the stamps of its wheel odometry."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

CLASS_BORDERS = (0.3, 0.6, 0.9)
REST_SPEED, REST_TIME = 2e-3, 0.5  # [m/s], [s]
_UNKNOWN_CLASS = 255


def resting(time: FloatArray, rim: FloatArray, ground: FloatArray) -> NDArray[np.bool_]:
    """Return which wheels (k, n) have stood still for the rest time."""
    still = np.maximum(np.abs(rim), np.abs(ground)) < REST_SPEED
    moved = np.where(still, -np.inf, time[:, None])
    last = np.maximum.accumulate(moved, axis=0)
    return np.asarray(time[:, None] - np.maximum(last, time[0] - REST_TIME) >= REST_TIME)


def slip_classes(slip: FloatArray) -> NDArray[np.uint8]:
    """Return classes 0 to 3 of slips, 255 where nan."""
    found = np.searchsorted(CLASS_BORDERS, np.abs(np.nan_to_num(slip)), side='left')
    return np.where(np.isnan(slip), _UNKNOWN_CLASS, found).astype(np.uint8)
