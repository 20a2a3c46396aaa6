# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The prediction that the parts of the process fill in."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wheel_terra_estimator.arrays import FloatArray


class Prediction(NamedTuple):
    """Predicted mean, transition matrix F and process noise Q; each part fills in its entries."""

    mean: FloatArray  # (size,)
    F: FloatArray  # (size, size)
    Q: FloatArray  # (size, size)

    @classmethod
    def unchanged(cls, mean: FloatArray) -> Prediction:
        """Return the prediction that everything stays as it is."""
        size = len(mean)
        return cls(mean.copy(), np.eye(size), np.zeros((size, size)))
