# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Sets of estimates, the output of the estimator core."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.estimation.sideways import Sideways

NO_ENTRAPMENT_IN_SIGHT = 10.0
"""Rim travel left [m] that ``~/mobility`` states when nothing points to an entrapment."""


class SlipClass(IntEnum):
    """Slip class of a wheel, as published on ``~/slip_class``."""

    LOW = 0
    MODERATE = 1
    HIGH = 2
    STUCK = 3
    UNKNOWN = 255


SLOPES = np.arange(-20.0, 31.0, 5.0)
"""Slopes of `SlipOnSlope` [deg], positive uphill."""
SLOPE_NAMES = tuple(f'slope_{slope:.0f}deg' for slope in SLOPES)


class SlipOnSlope(NamedTuple):
    """Slip to expect on the `SLOPES` when driving forward on this soil, (11,) each."""

    slip: FloatArray  # expected [-]
    std: FloatArray
    entrapment: FloatArray  # probability that the slip exceeds 0.9 there [-]


@dataclass(frozen=True)
class EstimateSet:
    """All outputs that belong to one stamp; every array is (n,) in the order of ``wheels.names``.

    No published field is nan or infinite: what cannot be estimated keeps its last value (0 before
    the first), with a large standard deviation.
    """

    stamp: int  # [ns]
    slip: FloatArray  # [-]
    slip_std: FloatArray
    slip_velocity: FloatArray  # r w - v [m/s]
    slip_velocity_std: FloatArray
    drawbar_pull: FloatArray  # [N]
    drawbar_pull_std: FloatArray
    sinkage: FloatArray  # [m]
    sinkage_std: FloatArray
    sinkage_rate: FloatArray  # [m/s]
    sinkage_rate_std: FloatArray
    normal_load: FloatArray  # [N]
    normal_load_std: FloatArray
    slip_class: NDArray[np.uint8]
    """From the estimator only which wheels have no class (255); the core sets the classes."""
    rim_travel_left: FloatArray  # [m]
    pull_margin: FloatArray  # [N]
    soil_names: tuple[str, ...]
    soil: FloatArray  # (k,)
    soil_std: FloatArray  # (k,)
    forward_velocity: float  # body x in base_link [m/s]
    forward_velocity_variance: float
    yaw_rate: float  # [rad/s]
    yaw_rate_variance: float
    stuck: bool
    stuck_probability: FloatArray  # (n,) [-]
    time_to_stuck: FloatArray  # (n,) [s]
    reasons: tuple[str, ...]  # (n,) text on the class of the wheel and on a warning
    faults: dict[str, str] = field(default_factory=dict)  # input or state -> words, for diagnostics
    stuck_direction: int = 0  # of the rims that led to `stuck`: 1, -1; 0 none, both or unknown
    stuck_confirmed: bool = False  # by evidence that no wrong sign or unit can produce
    stuck_clears: bool = False  # no sign of an entrapment is left
    slip_on_slope: SlipOnSlope | None = None  # once a second; None = not in this set
    sideways: Sideways | None = None  # slip angles, lateral force and speed; None = unknown

    @property
    def stuck_reason(self) -> str:
        """Why the warning stands, or that it does not, in words."""
        for reason in self.reasons:
            _, mark, words = reason.partition('rover: ')
            if mark:
                return words
        return 'entrapment under way or close ahead' if self.stuck else 'moving freely'

    @property
    def sideways_known(self) -> Sideways:
        """Slip angles, lateral forces and speed; with large deviations where unknown."""
        return Sideways.unknown(self.normal_load) if self.sideways is None else self.sideways
