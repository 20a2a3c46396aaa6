# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Outlook of a rover: probability of an entrapment, time and rim travel left."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from wheel_terra_estimator.estimation.estimates import NO_ENTRAPMENT_IN_SIGHT
from wheel_terra_estimator.estimation.judgement.entrapment import ENTRAPPED_SLIP
from wheel_terra_estimator.estimation.judgement.stuck.passage import FirstPassage
from wheel_terra_estimator.estimation.scalars import median

if TYPE_CHECKING:
    from wheel_terra_estimator.estimation.judgement.stuck.situation import Situation

LONGEST_TIME = 600.0
"""Time to entrapment that is said where none is in sight [s]."""
_LEAST_RIM = 1e-3
"""Rim speed [m/s] below which no travel is foreseen."""
_LONGEST_HORIZON = 60.0
"""Time within which a crawling rover is looked at over ``filter.stuck_travel`` [s]."""
_LEAST_TREND = 1e-4  # of the slip that is followed [1/s]
_LEAST_SLIP = 0.3  # from which a growing slip leads to an entrapment
_LEAST_TRAVEL = 0.05  # [m]; 0 is said of wheels that are entrapped
_UNTOLD_STD = 1.0  # of a slip of which nothing is known


class WheelForecast(NamedTuple):
    """Outlook of one wheel."""

    probability: float  # of an entrapment within the horizon [-]
    time: float  # until it is expected [s]
    travel: float  # rim travel to it [m]


class Outlook(NamedTuple):
    """What lies ahead of a rover."""

    wheels: tuple[WheelForecast, ...]
    probability: float  # median of the wheels that tell [-]


def outlook(s: Situation, passage: FirstPassage) -> Outlook:
    """Return what lies ahead in a situation."""
    rim = max(s.fastest, _LEAST_RIM)
    time = max(s.settings.horizon, min(s.settings.travel / rim, _LONGEST_HORIZON))
    deepening = growth_of_most([d.growth for d in s.observed.deepening])
    likely = passage.probability(
        [w.slip for w in s.motion.wheels],
        [w.slip_std for w in s.motion.wheels],
        deepening,
        rim * time,
    ).tolist()
    wheels, telling = [], []
    for i, (wheel, stands) in enumerate(zip(s.motion.wheels, s.stalled, strict=True)):
        probability, left = likely[i], LONGEST_TIME
        if stands:
            probability, left = 1.0, 0.0
        elif not wheel.known or wheel.slip <= 0.0 or wheel.slip_std >= _UNTOLD_STD:
            probability = 0.0
        else:
            dug = passage.digging_travel(wheel.slip, deepening)
            left = min(dug / max(abs(wheel.rim_speed), _LEAST_RIM), LONGEST_TIME)
            if s.trend > _LEAST_TREND and wheel.slip > _LEAST_SLIP:
                # On with the present growth: what an operator who drives on should be told.
                left = min(left, max(ENTRAPPED_SLIP - wheel.slip, 0.0) / s.trend)
        if wheel.known or stands:
            telling.append(probability)
        wheels.append(WheelForecast(probability, left, _travel(s, i, left)))
    return Outlook(tuple(wheels), median(telling) if telling else 0.0)


def _travel(s: Situation, i: int, left: float) -> float:
    """Return the rim travel left of a wheel [m]."""
    travel, room = NO_ENTRAPMENT_IN_SIGHT, s.climbing_room[i]
    if left < LONGEST_TIME:
        travel = min(left * abs(s.motion.wheels[i].rim_speed), travel)
    if room < math.inf:
        travel = min(travel, max(room, _LEAST_TRAVEL if left > 0.0 else 0.0))
    return travel


def growth_of_most(growths: list[float]) -> float:
    """Return the growth of the sinkage that more than half of the wheels exceed or have [-].

    Half of the wheels sink where the first axle of two enters other soil: that is a step, and no
    rover that digs itself in.
    """
    return sorted(growths)[(len(growths) - 1) // 2] if growths else 0.0
