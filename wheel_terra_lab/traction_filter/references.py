# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Slip that reference velocities alone tell, beside that of the torques, and which to trust."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from wheel_terra_lab.traction_filter.speed import BodySlip


@dataclass(frozen=True)
class ReferenceTuning:
    """Numbers of the references' own slip."""

    walk: float = 0.15  # of the slip between references [1/sqrt(s)]
    wild_share: float = 0.1  # of the references
    wild_range: float = 2.0  # of their slips, evenly
    jump_share: float = 0.1  # of the references that tell a slip nothing but the one before does
    slip_std: float = 0.005  # floor of what torques tell


class HeldSlip(NamedTuple):
    """Slip of the body by references alone, held between them."""

    slip: float = 0.0
    variance: float = math.inf
    last: float = 0.0  # slip of the last reference, wild or not
    age: float = math.inf  # of that [s]

    def later(self, dt: float, tuning: ReferenceTuning) -> HeldSlip:
        """Return it after a time [s]."""
        variance = self.variance + tuning.walk**2 * dt
        return self._replace(variance=variance, age=self.age + dt)

    def corrected(self, seen: float, variance: float) -> HeldSlip:
        """Return it after a reference that told a slip, with its variance."""
        share = 1.0 if math.isinf(self.variance) else self.variance / (self.variance + variance)
        return HeldSlip(self.slip + share * (seen - self.slip), share * variance, seen, 0.0)


def joined(found: BodySlip, held: HeldSlip, tuning: ReferenceTuning) -> tuple[float, float]:
    """Return slip and variance of torques and references together.

    The side of the torques' deviation counts that the references are on: on the plateau of the
    curve a higher slip is as likely.
    """
    ahead = held.slip - found.slip
    own = (found.above if ahead > 0.0 else found.below) ** 2 + tuning.slip_std**2
    share = own / (own + held.variance)
    return found.slip + share * ahead, (1.0 - share) * (found.std**2 + tuning.slip_std**2)


def trust(
    seen: float,
    variance: float,
    known: tuple[float, float],
    held: HeldSlip,
    tuning: ReferenceTuning,
) -> float:
    """Return the probability that the slip which a reference tells is no wild one.

    A sound one is near the slip known before, or, where the slip has jumped, near the reference
    before.

    Parameters
    ----------
    seen, variance : float
        Slip by the reference, and its variance.
    known : tuple[float, float]
        Slip and variance known before.
    held : HeldSlip
        By the references before.
    """
    slip, spread = known[0], known[1] + variance
    sound = math.exp(-0.5 * (seen - slip) ** 2 / spread) / math.sqrt(spread)
    spread = 2.0 * variance + tuning.walk**2 * held.age
    if not math.isinf(spread):
        again = math.exp(-0.5 * (seen - held.last) ** 2 / spread) / math.sqrt(spread)
        sound = max(sound, tuning.jump_share * again)
    sound *= (1.0 - tuning.wild_share) / math.sqrt(2.0 * math.pi)
    return max(sound / (sound + tuning.wild_share / tuning.wild_range), 1e-6)
