# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Slip that reference velocities alone tell, beside that of the torques: two interacting modes.

Either the traction curve holds, and torques and references together tell the slip; or the soil has
changed faster than the curve walks, and references alone tell it. Each reference weighs the modes
by its likelihood (interacting multiple models, Bar-Shalom et al. 2001); what goes out is their
mixture.
"""

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
    slip_std: float = 0.005  # floor of what torques tell
    most_slip: float = 2.0  # that is held: a rover that slides back has more than 1
    change_rate: float = 0.001  # of the soil, faster than the curve walks [1/s]
    change_by_torque: float = 0.05  # more, by what the wheels' torques disagree [1/s]
    settle_rate: float = 1.0  # at which the curve holds again [1/s]
    change_std: float = 0.4  # of the slip, at a change
    least_share: float = 1e-5  # of either mode


class Weights(NamedTuple):
    """Probabilities after a reference."""

    sound: float  # that the reference is no wild one
    in_steady: float  # the same if the curve holds
    in_changed: float  # the same if it does not
    holding: float  # that the curve holds


class HeldSlip(NamedTuple):
    """Slip of the body by references alone, held between them."""

    slip: float = 0.0
    variance: float = math.inf
    changed: float = 0.0  # slip where the soil has changed
    changed_variance: float = math.inf
    holding: float = 1.0  # probability that it has not, and the traction curve holds

    def later(
        self, dt: float, steady: tuple[float, float], disagreement: float, tuning: ReferenceTuning
    ) -> HeldSlip:
        """Return it after a time [s].

        Parameters
        ----------
        dt : float
            [s].
        steady : tuple[float, float]
            Slip and variance where the curve holds.
        disagreement : float
            Of the wheels' torques with the curve: mean squared residual over its variance.
        """
        if math.isinf(self.variance) or dt <= 0.0:
            return self
        walked = tuning.walk**2 * dt
        rate = tuning.change_rate + tuning.change_by_torque * max(disagreement - 1.0, 0.0)
        come = self.holding * (1.0 - math.exp(-rate * dt))
        stayed = (1.0 - self.holding) * math.exp(-tuning.settle_rate * dt)
        new = steady[0], steady[1] + tuning.change_std**2
        before = self.changed, self.changed_variance + walked
        changed, variance = _mean((come, new), (stayed, before))
        return HeldSlip(self.slip, self.variance + walked, changed, variance, 1.0 - come - stayed)

    def corrected(
        self, seen: float, variance: float, weights: Weights, tuning: ReferenceTuning
    ) -> HeldSlip:
        """Return it after a reference that told a slip, with its variance and its weights."""
        holding = weights.holding
        if math.isinf(self.variance):
            variance = variance / weights.sound
            return HeldSlip(seen, variance, seen, variance, holding)
        before = self.changed, self.changed_variance
        changed = _corrected(before, seen, variance / weights.in_changed)
        held = _corrected((self.slip, self.variance), seen, variance / weights.sound)
        held = _mean((holding, held), (1.0 - holding, changed))
        most = tuning.most_slip
        slips = [min(max(x, -most), most) for x in (held[0], changed[0])]
        return HeldSlip(slips[0], held[1], slips[1], changed[1], holding)


def _corrected(known: tuple[float, float], seen: float, variance: float) -> tuple[float, float]:
    share = known[1] / (known[1] + variance)
    return known[0] + share * (seen - known[0]), share * variance


def _mean(*parts: tuple[float, tuple[float, float]]) -> tuple[float, float]:
    """Return mean and variance of a mixture of weights and (mean, variance)."""
    total = sum(weight for weight, _ in parts)
    mean = sum(weight * x for weight, (x, _) in parts) / total
    spread = sum(weight * (variance + (x - mean) ** 2) for weight, (x, variance) in parts)
    return mean, spread / total


def joined(found: BodySlip, held: HeldSlip, tuning: ReferenceTuning) -> tuple[float, float]:
    """Return slip and variance of torques and references together, where the curve holds.

    The side of the torques' deviation counts that the references are on: on the plateau of the
    curve a higher slip is as likely.
    """
    ahead = held.slip - found.slip
    own = (found.above if ahead > 0.0 else found.below) ** 2 + tuning.slip_std**2
    share = own / (own + held.variance)
    return found.slip + share * ahead, (1.0 - share) * (found.std**2 + tuning.slip_std**2)


def mixed(steady: tuple[float, float], held: HeldSlip) -> tuple[float, float]:
    """Return slip and variance of both modes; `steady` is that where the curve holds."""
    if math.isinf(held.changed_variance):  # no reference yet, whatever a smoother knows
        return steady
    changed = held.changed, held.changed_variance
    return _mean((held.holding, steady), (1.0 - held.holding, changed))


def weighed(
    seen: float,
    variance: float,
    steady: tuple[float, float],
    held: HeldSlip,
    tuning: ReferenceTuning,
) -> Weights:
    """Return the probabilities that a reference is sound, and that the curve holds.

    Parameters
    ----------
    seen, variance : float
        Slip by the reference, and its variance.
    steady : tuple[float, float]
        Slip and variance where the curve holds.
    held : HeldSlip
        By the references before.
    """
    wild = tuning.wild_share / tuning.wild_range
    sound = 1.0 - tuning.wild_share
    curve = sound * _density(seen - steady[0], steady[1] + variance)
    if math.isinf(held.variance):
        share = curve / (curve + wild)
        return Weights(share, share, share, 1.0)
    own = sound * _density(seen - held.changed, held.changed_variance + variance)
    h = held.holding
    total = h * curve + (1.0 - h) * own + wild
    least = tuning.least_share
    return Weights(
        max((total - wild) / total, 1e-6),
        max(curve / (curve + wild), 1e-6),
        max(own / (own + wild), 1e-6),
        min(max(h * (curve + wild) / total, least), 1.0 - least),
    )


def _density(error: float, variance: float) -> float:
    return math.exp(-0.5 * error**2 / variance) / math.sqrt(2.0 * math.pi * variance)
