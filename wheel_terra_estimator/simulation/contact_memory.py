# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What the soil under each wheel remembers; each state relaxes over travel, not over time.

- ``slip``, ``side_slip``: shear of the soil follows the slip of the wheel over a part of the
  contact length, as fresh soil has to come under the rim; it also holds a parked rover.
- ``sense``: -1 .. 1, on which side of the hub the wheel meets undisturbed soil.
- ``depth`` of the stressed contact: grows while the stress exceeds the bearing strength, shrinks
  over ground travel where the soil is stronger than needed; a spinning wheel digs besides.
- ``lug_sinkage``: what lugs dig out or carry, beyond that depth.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wheel_terra_estimator.arrays import FloatArray, Quantity
from wheel_terra_estimator.simulation.contact import SoilForces
from wheel_terra_estimator.terramechanics.wheel import Wheel

START_DEPTH, START_LENGTH = 0.05, 0.3  # of a contact before it settles, over the radius [-]
SHEAR_TRAVEL = 0.25
"""Travel over which the shear follows the slip, as a share of the contact length."""
SHEAR_DAMPING = 0.2
"""Share of the rate of shear that adds to the stress [s]: viscous soil, the rover does not rock."""
SENSE_TRAVEL = 0.5
"""Travel over which the front of the contact changes sides, as a share of the contact length."""
SINKING_TRAVEL = 0.5
"""Travel over which the depth follows the load, as a share of the contact length."""
SLIP_SINKING = 0.3
"""Share of the slip travel that counts for sinking."""
DEPTH_RANGE = (1e-3, 0.9)
"""Least and greatest depth as a share of the radius; beyond, the chassis lies on the ground."""
LEAST_SPEED = 1e-6  # [m/s]; keeps ratios of speeds finite
DIGGING_SLIP = (0.85, 1.0)
"""Up to the first nothing is dug beyond the steady sinkage, at the second all of it [-]."""
SMOOTH_BAND = 0.02
"""Soil that a smooth rim throws out per turn, a band of a few grains, as a share of its radius."""


def digging_rate(
    slip: Quantity, wheel: Wheel, angular_velocity: Quantity, efficiency: float
) -> Quantity:
    """Rate at which a driving wheel digs itself in, beyond its steady sinkage [m/s].

    Every lug that passes throws out a share of a layer of its height, per turn efficiency h n, or a
    thin band for a smooth rim; a braking wheel does not dig itself in. ``angular_velocity``: of
    either sign [rad/s].
    """
    start, full = DIGGING_SLIP
    share = np.clip((np.asarray(slip) - start) / (full - start), 0.0, 1.0)
    lugs = np.multiply(wheel.lug_height, wheel.lug_count)
    per_turn = efficiency * np.maximum(lugs, np.multiply(SMOOTH_BAND, wheel.radius))
    return per_turn * (np.abs(angular_velocity) / (2.0 * np.pi)) * share


class Shear(NamedTuple):
    """Slip and side slip of the soil [-], positive against the motion of the body frame."""

    slip: FloatArray
    side_slip: FloatArray


class ContactMemory:
    """States of the contacts of n wheels; ``slip_radius``: (n,) [m].

    ``dig_efficiency``: share of the soil between passing lugs that a spinning wheel throws out [-].
    """

    def __init__(self, wheel: Wheel, slip_radius: FloatArray, dig_efficiency: float) -> None:
        n = slip_radius.size
        self._radius = np.broadcast_to(np.asarray(wheel.radius, float), n)
        self._slip_radius = slip_radius
        self._wheel, self._dig_efficiency = wheel, dig_efficiency
        self.shear = Shear(np.zeros(n), np.zeros(n))
        self.sense = np.zeros(n)
        self.depth = START_DEPTH * self._radius
        self.lug_sinkage = np.zeros(n)
        self.sinkage_rate = np.zeros(n)
        self._contact_length = START_LENGTH * self._radius

    @property
    def sinkage(self) -> FloatArray:
        """Depth of the rims below the undisturbed surface [m]."""
        return self.depth + self.lug_sinkage

    def trial_shear(
        self, forward: FloatArray, lateral: FloatArray, rate: FloatArray, dt: float
    ) -> tuple[Shear, Shear]:
        """Return the shear after a step with these hub speeds [m/s] and wheel rates [rad/s].

        Beside it, what the stress follows: it and a part of its rate, at most the slip itself.
        """
        rim = rate * self._slip_radius
        speed = np.maximum(np.abs(rim), np.sqrt(forward * forward + lateral * lateral))
        speed = np.maximum(speed, LEAST_SPEED)
        length = SHEAR_TRAVEL * self._contact_length
        weight = 1.0 + dt * speed / length
        slip = np.clip((self.shear.slip + dt / length * (rim - forward)) / weight, -1.0, 1.0)
        side_slip = (self.shear.side_slip - dt / length * lateral) / weight
        damping = np.minimum(SHEAR_DAMPING, length / speed) / dt
        stressed = Shear(
            np.clip(slip + damping * (slip - self.shear.slip), -1.0, 1.0),
            side_slip + damping * (side_slip - self.shear.side_slip),
        )
        return Shear(slip, side_slip), stressed

    def settle(self, soil: SoilForces) -> float:
        """Let the wheels sink at rest until the soil carries them; return the largest move [m]."""
        before = self.depth
        self.depth = self._balanced_depth(soil)
        self.lug_sinkage = soil.lug_sinkage
        self._contact_length = self._radius * soil.contact_angle
        return float(np.abs(self.depth - before).max())

    def advance(
        self,
        forward: FloatArray,
        lateral: FloatArray,
        rate: FloatArray,
        shear: Shear,
        soil: SoilForces,
        dt: float,
    ) -> None:
        """Take a step whose end has these speeds, shear and soil forces."""
        before = self.sinkage
        self.shear = shear
        self._contact_length = length = self._radius * soil.contact_angle
        travel = np.hypot(forward, lateral) * dt
        slipped = np.abs(rate * self._slip_radius - forward) * dt
        kept = np.exp(-travel / (SENSE_TRAVEL * length))
        self.sense = kept * self.sense + (1.0 - kept) * np.sign(forward)

        wanted = self._balanced_depth(soil)
        worked = travel + SLIP_SINKING * slipped
        worked_here = np.where(wanted > self.depth, worked, travel)
        depth = self.depth + (wanted - self.depth) * -np.expm1(
            -worked_here / (SINKING_TRAVEL * length)
        )
        spinning = shear.slip * np.sign(rate)
        depth += digging_rate(spinning, self._wheel, rate, self._dig_efficiency) * dt
        self.depth = np.clip(depth, DEPTH_RANGE[0] * self._radius, DEPTH_RANGE[1] * self._radius)
        self.lug_sinkage = self.lug_sinkage + (soil.lug_sinkage - self.lug_sinkage) * -np.expm1(
            -worked / (SINKING_TRAVEL * length)
        )
        self.sinkage_rate = (self.sinkage - before) / dt

    def _balanced_depth(self, soil: SoilForces) -> FloatArray:
        """Depth at which the stress would just equal the bearing strength (exact at balance).

        Stress grows with depth to the power N, the contact length with its root.
        """
        return self.depth * soil.support_ratio ** (1.0 / (soil.sinkage_exponent + 0.5))
