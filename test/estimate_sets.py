# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Estimate sets made up for tests, and what holds of every set."""

from dataclasses import fields
from typing import Any

import numpy as np

from wheel_terra_estimator.estimation.estimates import EstimateSet

STAMP = 1_583_940_000_123_456_789


def some_estimates(wheels: int = 2, **changes: Any) -> EstimateSet:
    """A set in which every number is another one."""
    values: dict[str, Any] = {}
    for place, field in enumerate(fields(EstimateSet)):
        base = 0.01 * (place + 1)
        if field.type == 'FloatArray':
            values[field.name] = base + np.arange(wheels) * 1e-3
        elif field.type == 'float':
            values[field.name] = base
    values |= {
        'stamp': STAMP,
        'slip_class': np.array([0, 255] + [1] * (wheels - 2), dtype=np.uint8),
        'soil_names': ('soil.cohesion', 'soil.shear_modulus'),
        'soil': np.array([800.0, 0.02]),
        'soil_std': np.array([80.0, 0.002]),
        'stuck': False,
        'reasons': ('slip 0.10 +- 0.05', 'at rest') + ('slip',) * (wheels - 2),
    }
    return EstimateSet(**{**values, **changes})


def assert_sound(estimates: EstimateSet) -> None:
    """Every number is finite, every deviation and variance is one, no slip is beyond its range."""
    for name, value in vars(estimates).items():
        if isinstance(value, (np.ndarray, float)):
            assert np.isfinite(value).all(), name
            assert not name.endswith(('_std', '_variance')) or np.all(value >= 0.0), name
    assert (np.abs(estimates.slip) <= 1.0).all()
