# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Outlook of a rover: probability of an entrapment, time and rim travel left.

It is the probability of a first passage of 0.9 by the slip within a rim travel. Over the rim travel
x the slip is modelled as an Ornstein-Uhlenbeck process

    ds = -(s - k z' s_0) / L dx + sigma dW

Variations of soil and ground disturb the slip (sigma), it reverts (L), and wheels that sink by z'
per rim travel at a slip s_0 dig themselves in (k), as they must climb out of an ever deeper rut.
The border 0.9 absorbs. The probability of absorption is computed backwards by the transitions
between the cells of a grid (Chapman-Kolmogorov), and tabulated over the slip, k z' s_0 and the
travel.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.special import ndtr

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.estimates import NO_ENTRAPMENT_IN_SIGHT
from wheel_terra_estimator.estimation.judgement.entrapment import ENTRAPPED_SLIP
from wheel_terra_estimator.estimation.judgement.stuck.situation import Situation
from wheel_terra_estimator.estimation.scalars import clipped, median

_LOWEST = -0.5
"""Lower end of the grid [-]; a lower slip counts in its first cell."""
_CELLS = 48
_EDGES = np.linspace(_LOWEST, ENTRAPPED_SLIP, _CELLS + 1)
_STEP = 0.05
"""Rim travel of a step [m]: a second at 5 cm/s, for which an entrapment must last."""
_STEPS = 80
TRAVELS = _STEP * np.arange(_STEPS + 1)
"""Rim travels at which the probability is given [m]."""
_LEVELS = np.linspace(0.0, 1.6, 9) * ENTRAPPED_SLIP
_LEAST_STD = 1e-3

# Near the maximum of the likelihood on tuning drives of simulators A, B and C.
RETURN_LENGTH = 0.3  # L [m]
SCATTER = 0.8  # sigma [1/sqrt(m)]
DIGGING = 45.0  # k [1]: over the present slip and the sinkage gained per rim travel
TYPICAL_SLIP = 0.06  # of a rover in loose soil
TYPICAL_STD = 0.28
"""Deviation of the slips around it [-], the prior of an uncertain slip."""


def passage_probability(
    slip: Sequence[float], std: Sequence[float], deepening: float
) -> FloatArray:
    """Return the probability within each of the `TRAVELS` for each of n wheels, (n, travels).

    `slip` and `std` are those of the wheels now [-], `deepening` is the sinkage that the rover
    gains over rim travel [m/m]; s_0 is the median slip.
    """
    variance = np.square(np.maximum(std, _LEAST_STD))
    known = TYPICAL_STD**2 / (TYPICAL_STD**2 + variance)
    mean = TYPICAL_SLIP + known * (np.asarray(slip) - TYPICAL_SLIP)
    below = ndtr((_EDGES - mean[:, None]) / np.sqrt(known * variance)[:, None])
    weights = below[:, 1:] - below[:, :-1]
    weights[:, 0] += below[:, 0]
    level = DIGGING * max(deepening, 0.0) * clipped(median(mean.tolist()), 0.0, 1.0)
    place = min(level / _LEVELS[1], len(_LEVELS) - 1 - 1e-9)
    i = int(place)
    table = _table()
    ahead = (1.0 - place + i) * table[i] + (place - i) * table[i + 1]
    return np.asarray(1.0 - below[:, -1:] + weights @ ahead.T)


@cache
def _table() -> FloatArray:
    """Return (levels, travels, cells) the probability from the middle of each cell."""
    middle = 0.5 * (_EDGES[1:] + _EDGES[:-1])
    kept = math.exp(-_STEP / RETURN_LENGTH)
    std = SCATTER * math.sqrt(0.5 * RETURN_LENGTH * (1.0 - kept * kept))
    found = np.zeros((len(_LEVELS), _STEPS + 1, _CELLS))
    for level, rows in zip(_LEVELS, found, strict=True):
        mean = level + (middle - level) * kept
        below = ndtr((_EDGES - mean[:, None]) / std)
        absorbed = 1.0 - below[:, -1]
        below[:, 0] = 0.0
        moves = np.diff(below, axis=1)
        for step in range(_STEPS):
            rows[step + 1] = absorbed + moves @ rows[step]
    return found


LONGEST_TIME = 600.0
"""Time to entrapment that stands for none in sight [s]."""


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

    Time and travel are those after which an entrapment is as likely as not, or after which the
    wheel is too deep to climb out, if that comes first; under a warning at most its horizon.
    """

    probability: float  # of an entrapment within the horizon [-]
    time: float  # [s]
    travel: float  # [m]


class Outlook(NamedTuple):
    """What lies ahead of a rover."""

    wheels: tuple[WheelForecast, ...]
    probability: float  # median of the wheels whose slip is known or that stall [-]
    reach: float  # rim travel within which a warning expects an entrapment [m]

    def under_warning(self, s: Situation, horizon: float) -> tuple[WheelForecast, ...]:
        """Return the outlook of the wheels under a warning with a horizon [s]."""
        return tuple(
            [
                ahead._replace(time=min(ahead.time, horizon), travel=min(ahead.travel, self.reach))
                if wheel.known
                else ahead
                for ahead, wheel in zip(self.wheels, s.motion.wheels, strict=True)
            ]
        )


def outlook(s: Situation, settings: StuckSettings) -> Outlook:
    """Return the outlook in a situation; until a start is over only of a present entrapment."""
    wheels = s.motion.wheels
    within = passage_probability([w.slip for w in wheels], [w.slip_std for w in wheels], s.digging)
    reach = max(settings.horizon * s.fastest, settings.travel)
    travel = reach if s.settled else 0.0
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
    known_ones = [
        ahead.probability
        for ahead, wheel, stands in zip(found, wheels, s.stalled, strict=True)
        if wheel.known or (stands and s.moving)
    ]
    return Outlook(tuple(found), median(known_ones) if known_ones else 0.0, reach)
