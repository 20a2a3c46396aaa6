# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A drive as the bench needs it, whoever simulated it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.arrays import FloatArray, IntArray
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.measurements import Measurement


class Arrival(NamedTuple):
    """A measurement and when it arrives [ns]."""

    arrival: int
    measurement: Measurement


@dataclass(frozen=True)
class Truth:
    """Ground truth at the stamps of the wheel odometry, k stamps and n wheels."""

    stamp: IntArray  # [ns]
    slip: FloatArray  # (k, n), nan at rest
    slip_velocity: FloatArray  # (k, n) [m/s]
    drawbar_pull: FloatArray  # (k, n) [N]
    normal_load: FloatArray  # (k, n) [N]
    sinkage: FloatArray  # (k, n) [m]
    wheel_rate: FloatArray  # (k, n) [rad/s]
    slip_class: NDArray[np.uint8]  # (k, n)
    yaw_rate: FloatArray  # (k,) [rad/s]

    @classmethod
    def of(cls, told: Any) -> Truth:
        """Return what the bench needs of a longer truth."""
        return cls(*(getattr(told, f.name) for f in fields(cls)))


@dataclass(frozen=True)
class BenchDrive:
    """What the estimator is told and hears, and what is true."""

    configuration: Configuration
    arrivals: Sequence[Arrival]
    truth: Truth
