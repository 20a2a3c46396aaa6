# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The parameters of the stuck warning."""

from __future__ import annotations

from dataclasses import dataclass

from wheel_terra_estimator.configuration.configuration import Configuration


@dataclass(frozen=True)
class StuckSettings:
    """The keys ``filter.stuck_*``."""

    horizon: float = 15.0  # [s]
    travel: float = 0.3  # [m]
    threshold: float = 0.5  # probability
    clear_slip: float = 0.6
    clear_time: float = 3.0  # [s]

    @classmethod
    def from_configuration(cls, configuration: Configuration) -> StuckSettings:
        """Take them from a configuration."""
        figures = configuration.filter
        return cls(
            horizon=float(figures.stuck_horizon),
            travel=float(figures.stuck_travel),
            threshold=float(figures.stuck_threshold),
            clear_slip=float(figures.stuck_clear_slip),
            clear_time=float(figures.stuck_clear_time),
        )
