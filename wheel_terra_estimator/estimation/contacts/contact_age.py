# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""How far the contacts have formed since a start or a reversal.

Shear builds up as a wheel rolls: only after one contact length is all of its contact new, and its
shear that of the steady model.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.rover import Rover

# Error of the shear model after a start; tuned on simulated drives, seeds 1000 to 1019.
VARIANCE_AT_ONE_LENGTH = 2.5  # relative variance of the shear after one contact length [-]
VARIANCE_DECAY = 2.0  # exponent of its decay per contact length [-]


class ContactAgeState(NamedTuple):
    """Travel and direction of the drive."""

    travel: float = 0.0  # [m] since the start or the last change of direction
    direction: float = 0.0  # of the drive: 1, -1, 0 = none yet


class ContactAge(Component[ContactAgeState]):
    """Tracks the travel over which the present contacts have formed."""

    def __init__(self, rover: Rover) -> None:
        super().__init__(ContactAgeState())
        self._rover = rover

    def update(self, rim_speed: float) -> bool:
        """Update with the typical rim speed of a cycle [m/s], nan = unknown.

        Return whether the direction of the drive has reversed.
        """
        if not abs(rim_speed) >= self._rover.low_rim:
            return False
        travel, before = self.state
        direction = 1.0 if rim_speed > 0.0 else -1.0
        turned = direction != before
        self.state = ContactAgeState(0.0 if turned else travel, direction)
        return turned and before != 0.0

    def advance(self, travel: float) -> None:
        """Add the travel of a cycle [m]."""
        self.state = self.state._replace(travel=self.state.travel + travel)

    def stop(self) -> None:
        """Reset the travel: the wheels are at rest."""
        self.state = self.state._replace(travel=0.0)

    @property
    def settled(self) -> bool:
        """Whether the contacts are fully formed."""
        return self.state.travel > self._rover.contact_length

    @property
    def half_formed(self) -> bool:
        """Whether half of each contact is new, not all; before, wheels spin on any soil."""
        return 0.5 < self.state.travel / self._rover.contact_length <= 1.0

    @property
    def shear_variance(self) -> float:
        """Relative variance of the shear model [-]; it decays with the travel."""
        lengths = self.state.travel / self._rover.contact_length
        return VARIANCE_AT_ONE_LENGTH * math.exp(-VARIANCE_DECAY * (lengths - 1.0))
