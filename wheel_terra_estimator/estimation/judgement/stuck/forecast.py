# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Probability and time of an entrapment: the state carried forward along the way.

Over a rim travel x and a time t the slip of a wheel goes on as

    ds = (-(s - s0) / l + k dz/dx) dx + b exp(-t / tau) dt + noise

It returns to the usual slip s0 over the length l, since the ground ahead is not the ground here; a
wheel that sinks as it turns digs itself in, since what it climbs grows; and a growth b of the slip
over time dies away. The noise is what the soil varies along the way (an Ornstein-Uhlenbeck process
of the same length). Mean and variance follow in closed form, the variance of the present slip and
that of its growth included. The probability is that of a slip above 0.9, at the worst of some times
within ``filter.stuck_horizon`` or ``filter.stuck_travel``, whichever is longer.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from math import exp, sqrt
from typing import TYPE_CHECKING, NamedTuple

from wheel_terra_estimator.estimation.estimates import NO_ENTRAPMENT_IN_SIGHT
from wheel_terra_estimator.estimation.scalars import median

if TYPE_CHECKING:
    from wheel_terra_estimator.estimation.judgement.stuck.situation import Situation, WheelMotion

ENTRAPPED_SLIP = 0.9
"""Slip above which a rover makes no way that matters: class *stuck*."""
LONGEST_TIME = 600.0
"""Time to entrapment that is said where none is in sight [s]."""
_LEAST_RIM = 1e-3
"""Rim speed [m/s] below which no travel is foreseen."""
_LEAST_STD = 1e-6
_LEAST_VARIANCE = 1e-12  # of a slip
_LONGEST_HORIZON = 60.0
"""Time within which a crawling rover is looked at over ``filter.stuck_travel`` [s]."""


@dataclass(frozen=True)
class ForecastTuning:
    """Greatest likelihood on simulated drives of both worlds, seeds 1021 to 1023 (51 runs).

    That of the growth of the slip is so flat that its three numbers are stated, not fitted.
    """

    usual_slip: float = 0.12  # of a rover in loose soil, as in the filter's own process
    return_length: float = 1.15  # rim travel over which slip returns to it [m]
    slip_scatter: float = 0.43  # of the slip from place to place, far ahead [-]
    growth_time: float = 10.0  # with which a growth of the slip dies away [s]
    growth_scatter: float = 0.02  # usual growth of the slip over seconds [1/s]
    growth_doubt: float = 0.3
    """Deviation of the growth over that of the slip [1/s]: the slope of five references in five
    seconds, 1 / (5 s / sqrt(12) sqrt(5))."""
    digging_gain: float = 38.0
    """Growth of the slip over that of the sinkage, both per rim travel [1/m]."""
    parts: tuple[float, ...] = (0.0, 0.25, 0.5, 1.0)
    """Of the horizon, at which the slip is looked at."""
    beyond: tuple[float, ...] = (2.0, 4.0, 8.0)  # for the time left alone
    least_trend: float = 1e-4  # [1/s]
    least_slip: float = 0.3  # from which a growing slip leads to an entrapment
    least_travel: float = 0.05  # [m]; 0 is said of wheels that are entrapped
    untold_std: float = 1.0
    """Deviation of a slip of which nothing is known: no forecast is made from it."""


class WheelForecast(NamedTuple):
    """Outlook of one wheel."""

    probability: float  # of an entrapment within the horizon [-]
    time: float  # until it is as likely as not [s]
    travel: float  # rim travel to it [m]


class Outlook(NamedTuple):
    """What lies ahead of a rover."""

    wheels: tuple[WheelForecast, ...]
    probability: float  # median of the wheels that tell [-]


_Ahead = tuple[float, float, float, float]
"""What moves the slip of all wheels alike: after which time [s], share that is kept of what a slip
is off the usual one, shift by growth and digging, variance without that of the present slip."""


def outlook(s: Situation, tuning: ForecastTuning = ForecastTuning()) -> Outlook:
    """Return what lies ahead in a situation."""
    rim = max(s.fastest, _LEAST_RIM)
    horizon = max(s.settings.horizon, min(s.settings.travel / rim, _LONGEST_HORIZON))
    digging = max(_growth_of_most([d.growth for d in s.observed.deepening]), 0.0)
    within = _way_ahead(s, rim, horizon, digging, tuning)
    wheels = tuple(
        [
            _of_wheel(wheel, stands, room, s.trend, within, tuning)
            for wheel, stands, room in zip(s.motion.wheels, s.stalled, s.climbing_room, strict=True)
        ]
    )
    telling = [
        wheel.probability
        for wheel, motion, stands in zip(wheels, s.motion.wheels, s.stalled, strict=True)
        if motion.known or stands
    ]
    return Outlook(wheels, median(telling) if telling else 0.0)


def _growth_of_most(growths: list[float]) -> float:
    """Return the growth of the sinkage that more than half of the wheels exceed or have [-].

    Half of the wheels sink where the first axle of two enters other soil: that is a step, and no
    rover that digs itself in.
    """
    return sorted(growths)[(len(growths) - 1) // 2] if growths else 0.0


def _way_ahead(
    s: Situation, rim: float, horizon: float, digging: float, t: ForecastTuning
) -> list[_Ahead]:
    """Return what moves the slips until some times; `digging`: sinkage over rim travel."""
    doubt, usual = (t.growth_doubt * s.typical_std) ** 2, t.growth_scatter**2
    believed = usual / (usual + doubt)
    growth, doubt = believed * s.trend, believed * doubt
    dug, scatter = t.digging_gain * digging * t.return_length, t.slip_scatter**2
    found = []
    for part in (*t.parts, *t.beyond):
        time = part * horizon
        keep = exp(-rim * time / t.return_length)
        reach = t.growth_time * (1.0 - exp(-time / t.growth_time))
        shift = growth * reach + dug * (1.0 - keep)
        found.append((time, keep, shift, doubt * reach**2 + scatter * (1.0 - keep * keep)))
    return found


def _of_wheel(
    wheel: WheelMotion,
    stalled: bool,
    room: float,
    trend: float,
    ahead: list[_Ahead],
    t: ForecastTuning,
) -> WheelForecast:
    near = len(t.parts)
    if stalled:
        probability, time = 1.0, 0.0
    elif not wheel.known or wheel.slip <= 0.0 or wheel.slip_std >= t.untold_std:
        probability, time = 0.0, LONGEST_TIME
    else:
        # A slip that is hardly known is worth no more than what slips usually are.
        square, usual = wheel.slip_std * wheel.slip_std, t.slip_scatter * t.slip_scatter
        known = usual / (usual + square)
        off, variance = known * (wheel.slip - t.usual_slip), max(known * square, _LEAST_VARIANCE)
        lacking = ENTRAPPED_SLIP - t.usual_slip
        # The worst of the times, in deviations: one error function does for all of them.
        nearest = min(
            [
                (lacking - off * keep - shift) / sqrt(variance * keep * keep + more)
                for _, keep, shift, more in ahead[:near]
            ]
        )
        probability = exceedance_probability(-nearest, 1.0, 0.0)
        time = _time_left(wheel.slip, off, lacking, ahead)
        if trend > t.least_trend and wheel.slip > t.least_slip:
            # On with the present growth: what an operator who drives on should be told.
            time = min(time, max(ENTRAPPED_SLIP - wheel.slip, 0.0) / trend)
    travel = NO_ENTRAPMENT_IN_SIGHT
    if time < LONGEST_TIME:
        travel = min(time * abs(wheel.rim_speed), travel)
    if room < math.inf:
        travel = min(travel, max(room, t.least_travel if time > 0.0 else 0.0))
    return WheelForecast(probability, time, travel)


def _time_left(slip: float, off: float, lacking: float, ahead: list[_Ahead]) -> float:
    """Return the time until the expected slip passes that of an entrapment [s].

    `off` and `lacking` are the present slip and that of an entrapment, both less the usual one.
    """
    before, since = slip - ENTRAPPED_SLIP, 0.0
    if before >= 0.0:
        return 0.0
    for time, keep, shift, _ in ahead:
        after = off * keep + shift - lacking
        if after >= 0.0:
            return min(since + before / (before - after) * (time - since), LONGEST_TIME)
        before, since = after, time
    return LONGEST_TIME


def exceedance_probability(slip: float, slip_std: float, border: float) -> float:
    """Return the probability that a driving slip exceeds a border [-]."""
    return 0.5 * math.erfc((border - slip) / (sqrt(2.0) * max(slip_std, _LEAST_STD)))
