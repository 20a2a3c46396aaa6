# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Travel since the contacts began to form, at a start or a reversal."""

from __future__ import annotations

import math
from typing import NamedTuple

from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.rover import Rover

# Model error of the shear model after a start; tuned on simulated drives, seeds 1000 to 1019.
START_VARIANCE = 2.5  # at one contact length, over the square of the shear
DECAY = 2.0  # per contact length


class ContactAgeState(NamedTuple):
    """Travel and direction of the drive."""

    travel: float = 0.0  # [m] since the start or the last change of direction
    direction: float = 0.0  # of the drive: 1, -1, 0 = none yet


class ContactAge(Component[ContactAgeState]):
    """Travel since the contacts formed."""

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
    def forming(self) -> bool:
        """Whether they are in the second half of forming; before, even gripping wheels spin."""
        return 0.5 < self.state.travel / self._rover.contact_length <= 1.0

    @property
    def shear_variance(self) -> float:
        """Relative variance of the shear model [-]: shear builds up over a contact length."""
        lengths = self.state.travel / self._rover.contact_length
        return START_VARIANCE * math.exp(-DECAY * (lengths - 1.0))
