# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What the equations of this folder take and give."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Quantity: TypeAlias = 'float | NDArray[np.float64]'
"""A number, or an array of a common shape."""
