# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The signs of entrapment: what raises the warning, and what it says.

Only driving slip counts: braking and skidding are no entrapment. A single wheel never raises one.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from math import isnan

from wheel_terra_estimator.estimation.judgement.entrapment import ENTRAPPED_SLIP
from wheel_terra_estimator.estimation.judgement.stuck.situation import Situation

ADVICE = 'stop, back out'
"""What to do where wheels dig themselves in: they climb their own ruts better than fresh soil."""


@dataclass(frozen=True)
class SignTuning:
    """Numbers of the signs.

    The logistic law of standing is fitted to the nine snow immobilisations of Lines (Dartmouth,
    2021), where half of the wheels stall; the rest is set on simulators A and B, seeds 1000 to
    1003.
    """

    digging_slip: float = 0.8  # median above which the rover digs itself in, more likely than not
    sure_std: float = 0.25  # of the slip, to call it that
    standing: tuple[float, float, float, float] = (-4.3, 4.5, 2.9, 1.8)
    """Of the logistic law: constant, and for each unit of strain, slowing and lag."""


@dataclass(frozen=True, kw_only=True)
class Sign:
    """One sign of entrapment.

    Attributes
    ----------
    name : str
        For logs.
    hold : float
        Time for which it must be present before it raises the warning [s].
    while_stopping : bool
        Whether it counts while the wheels are being stopped.
    present : callable
        Says whether it is there.
    words : callable
        Says so for the reader of the warning.
    """

    name: str
    hold: float
    while_stopping: bool = False
    present: Callable[[Situation, SignTuning], bool]
    words: Callable[[Situation, SignTuning], str]


def _likely(s: Situation, t: SignTuning) -> bool:
    """Find an entrapment within the horizon likely; wheels that spin on the spot dig by command."""
    told = s.settled and s.motion.slip_told and not s.motion.turning
    return told and s.outlook.probability > s.settings.threshold


def _digging(s: Situation, t: SignTuning) -> bool:
    """Find the median slip above 0.8, or above 0.9 where slip has not settled after a start."""
    told = s.motion.slip_told and s.fastest > 0.0 and s.typical_std < t.sure_std
    return told and s.typical_slip > (t.digging_slip if s.settled else ENTRAPPED_SLIP)


def standing_probability(s: Situation, t: SignTuning) -> float:
    """Return how likely a rover stands for want of power, by a logistic law of three features.

    Strain: share of the torque limit of the second strongest wheel, since one alone may stand
    against a stone. Slowing: what the typical rim lacks of its speed of the last seconds. Lag: what
    it lacks of the fastest.
    """
    pulled_away = not s.rolling_time < s.tuning.pull_away_time and not isnan(s.rolling_time)
    if not pulled_away or s.motion.turning or s.fastest <= 0.0:
        return 0.0
    constant, by_strain, by_slowing, by_lag = t.standing
    slowing = 1.0 - s.typical_rim / max(s.cruise_rim, s.typical_rim)
    lag = 1.0 - s.typical_rim / s.fastest
    strain = min(s.second_strongest, 1.0)
    exponent = constant + by_strain * strain + by_slowing * slowing + by_lag * lag
    return 1.0 / (1.0 + math.exp(-exponent))


def _standing(s: Situation, t: SignTuning) -> bool:
    return standing_probability(s, t) > 0.5


def _likely_in_words(s: Situation, t: SignTuning) -> str:
    return (
        f'median slip {s.typical_slip:.2f}: entrapment within {s.settings.horizon:g} s '
        f'{s.outlook.probability:.0%} likely'
    )


def _digging_in_words(s: Situation, t: SignTuning) -> str:
    return f'median slip {s.typical_slip:.2f}: digging in'


def _standing_in_words(s: Situation, t: SignTuning) -> str:
    count = sum(s.stalled)
    if count > 1:
        return f'{count} wheels stalled near their torque limit'
    return f'wheels slowed to {s.typical_rim:.2f} m/s near their torque limit'


def in_words(sign: Sign, s: Situation, t: SignTuning) -> str:
    """Return why the warning is raised, what the wheels say, and what to do."""
    told = sign.words(s, t)
    if s.sinking:
        growth = max(d.growth for d in s.observed.deepening)
        wheels = 'a wheel sinks' if s.sinking == 1 else f'{s.sinking} wheels sink'
        told += f', {wheels} {100.0 * growth:.0f} cm per metre of rim travel'
    return f'{told}; {ADVICE}'


SIGNS: tuple[Sign, ...] = (
    Sign(name='likely', hold=1.0, present=_likely, words=_likely_in_words),
    Sign(name='digging', hold=1.0, present=_digging, words=_digging_in_words),
    Sign(
        name='standing',
        hold=0.2,  # two readings of wheel odometry at 10 Hz in a row
        while_stopping=True,
        present=_standing,
        words=_standing_in_words,
    ),
)
"""The signs; where several are there at once, the first gives the words."""
