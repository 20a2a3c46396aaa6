# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Outlook of a rover: probability of an entrapment, time and rim travel left."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.estimates import NO_ENTRAPMENT_IN_SIGHT
from wheel_terra_estimator.estimation.judgement.stuck.passage import TRAVELS, passage_probability
from wheel_terra_estimator.estimation.judgement.stuck.situation import Situation
from wheel_terra_estimator.estimation.scalars import median

LONGEST_TIME = 600.0
"""Time to entrapment that is said where none is in sight [s]."""


class StuckSettings(NamedTuple):
    """The keys ``filter.stuck_*``."""

    horizon: float  # [s]
    travel: float  # [m]
    threshold: float  # probability
    clear_slip: float
    clear_time: float  # [s]

    @classmethod
    def from_configuration(cls, configuration: Configuration) -> StuckSettings:
        """Take them from a configuration."""
        return cls(
            **{name: float(getattr(configuration.filter, f'stuck_{name}')) for name in cls._fields}
        )


class WheelForecast(NamedTuple):
    """Outlook of one wheel.

    Time and travel are those within which an entrapment is as likely as not, or the wheel is in
    too deep to climb out, if that comes first.
    """

    probability: float  # of an entrapment within the horizon [-]
    time: float  # [s]
    travel: float  # [m]


class Outlook(NamedTuple):
    """What lies ahead of a rover."""

    wheels: tuple[WheelForecast, ...]
    probability: float  # median of the wheels that tell [-]


def outlook(s: Situation, settings: StuckSettings) -> Outlook:
    """Return what lies ahead in a situation; before a start is over only what is under way."""
    wheels = s.motion.wheels
    within = passage_probability([w.slip for w in wheels], [w.slip_std for w in wheels], s.digging)
    travel = max(settings.horizon * s.fastest, settings.travel) if s.settled else 0.0
    place = min(travel / TRAVELS[1], len(TRAVELS) - 1.0)
    before = min(int(place), len(TRAVELS) - 2)
    chances = within[:, before] + (place - before) * (within[:, before + 1] - within[:, before])
    found = []
    by_wheel = zip(
        wheels, s.stalled, chances.tolist(), within, s.travel_until_too_deep, strict=True
    )
    for wheel, stands, likely, course, room in by_wheel:
        if stands:
            found.append(WheelForecast(1.0, 0.0, 0.0))
        elif not wheel.known:
            found.append(WheelForecast(0.0, LONGEST_TIME, NO_ENTRAPMENT_IN_SIGHT))
        else:
            left, time = min(room, NO_ENTRAPMENT_IN_SIGHT), LONGEST_TIME
            if course[-1] > 0.5:
                left = min(left, float(np.interp(0.5, course, TRAVELS)))
            if left < NO_ENTRAPMENT_IN_SIGHT:
                time = min(left / abs(wheel.rim_speed), LONGEST_TIME)
            found.append(WheelForecast(likely, time, left))
    telling = [
        ahead.probability
        for ahead, wheel, stands in zip(found, wheels, s.stalled, strict=True)
        if wheel.known or stands
    ]
    return Outlook(tuple(found), median(telling) if telling else 0.0)
