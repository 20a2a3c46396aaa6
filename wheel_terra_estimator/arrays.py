# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Types of arrays and tuples for annotations, and a constant of statistics."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
IndexArray = NDArray[np.intp]
BoolArray = NDArray[np.bool_]
Quantity: TypeAlias = 'float | NDArray[np.float64]'  # a number, or an array of a common shape
MAD_TO_STD = 1.4826  # standard deviation over median absolute deviation of a normal distribution
Floats = tuple[float, ...]
