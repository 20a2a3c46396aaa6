# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Traction limiter: how much of a velocity command a rover should follow, as a plain function.

Sinkage grows with slip and rim travel, and slip grows with what is asked of the soil. Slowing down
alone does not lower the slip that a slope asks for; what it buys is time to notice, and it takes
away the dynamic part of the demand. So the law slows down as the median slip leaves the low
class and as the rim travel left shrinks, and stops before the wheels dig.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from wheel_terra_estimator.estimation.estimates import NO_ENTRAPMENT_IN_SIGHT, SlipClass


@dataclass(frozen=True)
class TractionLimits:
    """Tuning of the limiter.

    Attributes
    ----------
    comfortable_slip : float
        Median slip up to which the command passes unchanged [-].
    critical_slip : float
        Median slip at which only ``creep_scale`` of the command is left [-].
    creep_scale : float
        Least scale while moving on [-].
    stop_rim_travel : float
        The rover stops when less rim travel than this is left before entrapment [m].
    slow_rim_travel : float
        The scale starts to fall below this rim travel left [m].
    """

    comfortable_slip: float = 0.3
    critical_slip: float = 0.6
    creep_scale: float = 0.3
    stop_rim_travel: float = 0.6
    slow_rim_travel: float = 1.4


@dataclass(frozen=True)
class TractionDecision:
    """What to do with the command: multiply it by ``scale``; ``stop`` says why it is 0."""

    scale: float
    stop: bool
    reason: str


def traction_decision(
    slip: Sequence[float],
    slip_class: Sequence[int],
    rim_travel_left: Sequence[float],
    stuck: bool,
    limits: TractionLimits = TractionLimits(),
) -> TractionDecision:
    """Return the scale in [0, 1] of a velocity command and the decision to stop.

    Parameters
    ----------
    slip : sequence of float
        Slip ratio per wheel [-] (``~/slip`` position).
    slip_class : sequence of int
        Class per wheel; wheels of class 255 are not counted.
    rim_travel_left : sequence of float
        Rim travel left before entrapment per wheel [m] (``~/mobility`` position).
    stuck : bool
        ``~/stuck``.
    limits : TractionLimits, optional
        Tuning.

    Returns
    -------
    TractionDecision
    """
    if stuck:
        return TractionDecision(0.0, True, 'stop: entrapment under way or close ahead')
    known = [
        i
        for i, c in enumerate(slip_class)
        if c != SlipClass.UNKNOWN and math.isfinite(slip[i]) and math.isfinite(rim_travel_left[i])
    ]
    if not known:
        return TractionDecision(1.0, False, 'slip unknown: command passes')
    # A single spinning wheel (on a stone, lifted off) is no entrapment.
    typical_slip = _median([abs(slip[i]) for i in known if slip[i] > 0.0] or [0.0])
    # Two wheels that dig in are the begin of an entrapment, whatever the others still do.
    nearest = sorted(rim_travel_left[i] for i in known)
    travel = nearest[min(1, len(nearest) - 1)]
    if travel <= limits.stop_rim_travel:
        return TractionDecision(0.0, True, f'stop: {travel:.2f} m of rim travel left')
    scale, reason = 1.0, 'command passes'
    if typical_slip > limits.comfortable_slip:
        span = limits.critical_slip - limits.comfortable_slip
        fraction = min((typical_slip - limits.comfortable_slip) / span, 1.0)
        scale = 1.0 - (1.0 - limits.creep_scale) * fraction
        reason = f'slowed: median slip {typical_slip:.2f}'
    if travel < min(limits.slow_rim_travel, NO_ENTRAPMENT_IN_SIGHT):
        span = limits.slow_rim_travel - limits.stop_rim_travel
        by_travel = max((travel - limits.stop_rim_travel) / span, limits.creep_scale)
        if by_travel < scale:
            scale, reason = by_travel, f'slowed: {travel:.2f} m of rim travel left'
    return TractionDecision(scale, False, reason)


def _median(values: Sequence[float]) -> float:
    ordered = sorted(values)
    middle = len(ordered) // 2
    if len(ordered) % 2:
        return ordered[middle]
    return 0.5 * (ordered[middle - 1] + ordered[middle])
