# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Traction limiter: how much of a velocity command a rover should follow, as a plain function.

Sinkage grows with slip and rim travel, and slip with the required traction coefficient. Slowing
down does not reduce the slip on a slope, but it gives time to react and removes the dynamic part of
the demand. So the law slows down as the median slip leaves the low class and as the rim travel left
shrinks, and stops before the wheels dig in.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from statistics import median
from typing import Any

from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.estimation.estimates import NO_ENTRAPMENT_IN_SIGHT


def _parameter(default: float, upper: float, meaning: str, lower: float = 0.0) -> Any:
    """Return a field of `LimiterTuning` with its bounds and its meaning."""
    bounds = {'lower': lower, 'upper': upper, 'meaning': meaning}
    return field(default=default, metadata=bounds)


@dataclass(frozen=True)
class LimiterTuning:
    """Parameters of the limiter; the node declares them as they stand here."""

    comfortable_slip: float = _parameter(
        0.3, 1.0, 'median slip up to which the command passes unchanged [-]'
    )
    critical_slip: float = _parameter(
        0.6, 1.0, 'median slip at which only creep_scale of the command is left [-]'
    )
    creep_scale: float = _parameter(
        0.3, 1.0, 'least share of the command while moving on, and share of a crawl [-]', 0.01
    )
    stop_rim_travel: float = _parameter(
        0.6, 10.0, 'stop when less rim travel than this is left before entrapment [m]'
    )
    slow_rim_travel: float = _parameter(1.4, 10.0, 'the share falls below this rim travel left [m]')
    stale_after: float = _parameter(
        1.0, 10.0, 'an estimate older than this, by its stamp, is not trusted [s]', 0.1
    )
    stale_scale: float = _parameter(
        0.3, 1.0, 'greatest share of the command that passes without a fresh estimate [-]'
    )
    max_acceleration: float = _parameter(
        0.5, 10.0, 'greatest increase of the speed that goes out [m/s^2]', 0.01
    )
    max_angular_acceleration: float = _parameter(
        1.0, 10.0, 'greatest increase of the turn rate that goes out [rad/s^2]', 0.01
    )

    def __post_init__(self) -> None:
        """Raise a `UserError` where two bounds are in the wrong order."""
        for lower, upper in (
            ('comfortable_slip', 'critical_slip'),
            ('stop_rim_travel', 'slow_rim_travel'),
        ):
            if not getattr(self, lower) < getattr(self, upper):
                raise UserError(f'{lower} must be below {upper}')


def traction_scale(
    slip: Sequence[float],  # ratio per wheel [-]; at least one
    rim_travel_left: Sequence[float],  # before entrapment, per wheel [m]
    tuning: LimiterTuning,
) -> tuple[float, str]:
    """Return the scale in [0, 1] of a command on this soil, and why; 0 is a stop."""
    # The median: a single spinning wheel (on a stone, lifted off) is no entrapment, nor is braking.
    typical = median([max(s, 0.0) for s in slip])
    # Two wheels that dig in are the beginning of an entrapment, whatever the others do.
    nearest = sorted(rim_travel_left)
    travel = nearest[min(1, len(nearest) - 1)]
    if travel <= tuning.stop_rim_travel:
        return 0.0, f'stop: {travel:.2f} m of rim travel left'
    scale, reason = 1.0, 'command passes'
    if typical > tuning.comfortable_slip:
        span = tuning.critical_slip - tuning.comfortable_slip
        fraction = min((typical - tuning.comfortable_slip) / span, 1.0)
        scale = 1.0 - (1.0 - tuning.creep_scale) * fraction
        reason = f'slowed: median slip {typical:.2f}'
    if travel < min(tuning.slow_rim_travel, NO_ENTRAPMENT_IN_SIGHT):
        span = tuning.slow_rim_travel - tuning.stop_rim_travel
        by_travel = max((travel - tuning.stop_rim_travel) / span, tuning.creep_scale)
        if by_travel < scale:
            scale, reason = by_travel, f'slowed: {travel:.2f} m of rim travel left'
    return scale, reason
