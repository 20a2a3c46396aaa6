# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""How soon each wheel would be entrapped if slip and sinkage went on as they do."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from wheel_terra_estimator.estimation.estimates import NO_ENTRAPMENT_IN_SIGHT
from wheel_terra_estimator.estimation.judgement.classes import exceedance_probability
from wheel_terra_estimator.estimation.judgement.stuck.signs import ENTRAPPED_SLIP
from wheel_terra_estimator.estimation.judgement.stuck.situation import Situation, WheelMotion

LONGEST_TIME = 600.0
"""Time to entrapment that is said where none is in sight [s]."""


@dataclass(frozen=True)
class ForecastTuning:
    """Tuned on simulated drives, seeds 1000 to 1019, where no other source is given."""

    least_trend: float = 1e-4  # [1/s]
    least_slip: float = 0.3  # from which a growing slip leads to an entrapment
    least_travel: float = 0.05  # [m]; 0 is said of wheels that are entrapped
    digging_slip: float = 0.8
    untold_std: float = 1.0
    """Deviation of a slip of which nothing is known: no forecast is made from it."""
    certain: float = 0.9
    """Least probability said of wheels that dig while the warning stands."""


class WheelForecast(NamedTuple):
    """Outlook of one wheel."""

    probability: float  # of an entrapment within the horizon [-]
    time: float  # to it [s]
    travel: float  # rim travel to it [m]


def forecast(
    s: Situation, *, warned: bool, tuning: ForecastTuning = ForecastTuning()
) -> tuple[WheelForecast, ...]:
    """Return the outlook of each wheel.

    Parameters
    ----------
    s : Situation
        At present.
    warned : bool
        Whether the stuck warning stands.
    tuning : ForecastTuning
        Thresholds.
    """
    return tuple(
        [
            _of_wheel(wheel, stands, room, s, warned, tuning)
            for wheel, stands, room in zip(s.motion.wheels, s.stalled, s.climbing_room, strict=True)
        ]
    )


def _of_wheel(
    wheel: WheelMotion,
    stalled: bool,
    room: float,
    s: Situation,
    warned: bool,
    tuning: ForecastTuning,
) -> WheelForecast:
    if stalled:
        probability, time = 1.0, 0.0
    elif not wheel.known or wheel.slip <= 0.0 or wheel.slip_std >= tuning.untold_std:
        probability, time = 0.0, LONGEST_TIME
    else:
        ahead = wheel.slip + max(s.trend, 0.0) * s.settings.horizon
        probability = exceedance_probability(ahead, wheel.slip_std, ENTRAPPED_SLIP)
        time = _time_left(wheel.slip, s.trend, tuning)
    if warned and (probability > 0.5 or wheel.slip > tuning.digging_slip):
        probability = max(probability, tuning.certain)
    travel = NO_ENTRAPMENT_IN_SIGHT
    if time < LONGEST_TIME:
        travel = min(time * abs(wheel.rim_speed), travel)
    if room < math.inf:
        travel = min(travel, max(room, tuning.least_travel if time > 0.0 else 0.0))
    return WheelForecast(probability, time, travel)


def _time_left(slip: float, trend: float, tuning: ForecastTuning) -> float:
    """Return the time until the slip of a driving wheel passes that of an entrapment [s]."""
    if slip >= ENTRAPPED_SLIP:
        return 0.0
    if trend > tuning.least_trend and slip > tuning.least_slip:
        return min((ENTRAPPED_SLIP - slip) / trend, LONGEST_TIME)
    return LONGEST_TIME
