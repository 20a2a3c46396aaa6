# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Normal load of each wheel, from the specific force of the last cycle."""

from __future__ import annotations

from typing import NamedTuple

from wheel_terra_estimator.arrays import Floats
from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.contacts.steering import Headings
from wheel_terra_estimator.estimation.inputs.inertial import InertialWindow
from wheel_terra_estimator.estimation.rover import Rover
from wheel_terra_estimator.estimation.scalars import TINY, gain_of

LEAST_LOAD = 1e-3
"""Of a wheel on the ground [N]: with less it is in the air."""
_LEAST_FORCE = 0.1  # specific force on z [m/s^2] below which a slope is not defined
_NOISE_SHARE = 0.03  # of gravity: noise of the specific force that loads may have


class LoadState(NamedTuple):
    """Loads of the last cycle."""

    load: Floats  # [N]
    force: tuple[float, float, float]  # mean specific force [m/s^2]
    force_known: bool = False

    @property
    def slope_share(self) -> float:
        """Required traction coefficient (pull along the body over load) of each wheel [-]."""
        return self.force[0] / max(self.force[2], _LEAST_FORCE)


class WheelLoads(Component[LoadState]):
    """Normal load of each wheel."""

    def __init__(self, rover: Rover) -> None:
        level = (0.0, 0.0, rover.gravity)
        super().__init__(LoadState(tuple(rover.load.loads(level).tolist()), level))
        self._rover = rover

    def update(
        self,
        window: InertialWindow,
        pulls: Floats,
        torques: Floats,
        unloaded: tuple[bool, ...],
        headings: Headings,
    ) -> LoadState:
        """Return the loads of a cycle; without an IMU reading those of the last one.

        `pulls` [N] and `torques` [N m] are those of each wheel after the last cycle, along its
        heading. The load of `unloaded` wheels is shared out among the others.
        """
        if window.has_force:
            force, rover = self._smoothed(window), self._rover
            moment = [t - f * r for t, f, r in zip(torques, pulls, rover.rim_radius, strict=True)]
            moment = [m * c for m, c in zip(moment, headings.along, strict=True)]
            pulls = tuple([f * c for f, c in zip(pulls, headings.along, strict=True)])
            loads = rover.load.loads(force, pulls, moment).tolist()
            if any(unloaded):
                total = sum(loads)
                loads = [0.0 if off else w for w, off in zip(loads, unloaded, strict=True)]
                loads = [w * total / max(sum(loads), TINY) for w in loads]
            self.state = LoadState(tuple(loads), force, force_known=True)
        return self.state

    def _smoothed(self, window: InertialWindow) -> tuple[float, float, float]:
        """Return the mean specific force, low-passed so that vibration moves no load."""
        force, before = window.mean_force(), self.state
        if not (before.force_known and window.duration > 0.0):
            return force
        lag = window.noise_density / (2.0 * (_NOISE_SHARE * self._rover.gravity) ** 2)
        gain = gain_of(window.duration, max(lag, TINY))
        x, y, z = (old + gain * (new - old) for old, new in zip(before.force, force, strict=True))
        return x, y, z
