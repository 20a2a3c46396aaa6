# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The parameters of the stuck warning."""

from __future__ import annotations

from typing import NamedTuple

from wheel_terra_estimator.configuration.configuration import Configuration


class StuckSettings(NamedTuple):
    """The keys ``filter.stuck_*``."""

    horizon: float  # [s]
    travel: float  # [m]
    threshold: float  # probability
    clear_slip: float
    clear_time: float  # [s]

    @classmethod
    def from_configuration(cls, configuration: Configuration) -> StuckSettings:
        """Take them from a configuration."""
        return cls(
            **{name: float(getattr(configuration.filter, f'stuck_{name}')) for name in cls._fields}
        )
