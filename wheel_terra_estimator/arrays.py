# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Types of arrays and tuples by what they hold, for annotations."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
IndexArray = NDArray[np.intp]
BoolArray = NDArray[np.bool_]
Quantity: TypeAlias = 'float | NDArray[np.float64]'  # a number, or an array of a common shape
Floats = tuple[float, ...]
