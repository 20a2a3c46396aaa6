# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Signs of entrapment, one entry each in `SIGNS`; any of them raises the warning.

To add one, write a predicate and a line of words, and enter them in the table with a hold time and
what the sign needs. Only driving slip counts: braking and skidding are no entrapment. A single
wheel never raises a sign.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import Flag, auto
from math import isnan

from wheel_terra_estimator.estimation.judgement.stuck.forecast import (
    ENTRAPPED_SLIP,
    exceedance_probability,
)
from wheel_terra_estimator.estimation.judgement.stuck.situation import Situation
from wheel_terra_estimator.estimation.scalars import median

ADVICE = 'stop, back out'
"""What to do where wheels dig themselves in: they climb their own ruts better than fresh soil."""
_TWO_READINGS = 0.1
"""Of wheel odometry at 10 Hz, in a row [s]: what these signs look at are means already."""
_TOLD_TIME = 0.05
"""Time below which a tenth of a second says nothing [s]."""


@dataclass(frozen=True)
class SignTuning:
    """Thresholds of the signs.

    Tuned on simulated drives, seeds 1000 to 1019, and on the nine snow immobilisations of Lines
    (Dartmouth, 2021), where half of the wheels stall.
    """

    digging_slip: float = 0.8
    sure_std: float = 0.25  # of the slip, to call it digging
    trend_doubt: float = 0.45
    """Taken off the trend, over the deviation of the slip [1/s]: 1.5 deviations of the slope of
    five references in five seconds, 1.5 / (5 s / sqrt(12) sqrt(5))."""
    ahead_slip: float = 0.65
    """Typical slip above which its trend is followed over the whole ``filter.stuck_horizon``."""
    sudden_time: float = 4.0  # [s]
    sudden_slip: float = 0.45  # above which it is followed for so long
    ahead_std: float = 0.2  # of the slip
    least_deepening: int = 2  # wheels that dig themselves in
    spare_margin: float = 0.045  # of the load: with more left, no entrapment is near
    held_slip: float = 0.6
    bog_slip: float = 0.35
    bog_time: float = 6.0  # to a stand [s]
    bog_torque: float = 0.5  # of the torque limit, second strongest wheel
    bog_doubt: float = 1.5
    """Taken off the loss of speed, in deviations of the speed over the window: what references that
    disagree by chance make of it."""
    least_loss: float = 1e-6  # [m/s^2]
    labour_torque: float = 0.68  # of the torque limit, second strongest wheel
    labour_ratio: float = 0.87  # of the rim speed of the last seconds
    least_stalled: int = 2  # wheels


class Need(Flag):
    """What must hold for a sign to tell anything."""

    NOTHING = 0
    SPEED = auto()  # the speed rests on a reference
    SLIP_TOLD = auto()  # a reference, a torque or a sinkage tells of the slip
    STRAIGHT = auto()  # the rover does not turn sharply: a spin in place is commanded
    PULLED_AWAY = auto()  # the wheels have turned at their own cruise since they stood


# Plain numbers: arithmetic of flags is slow, and this is done at every stamp.
_SPEED, _SLIP_TOLD, _STRAIGHT, _PULLED_AWAY = (
    need.value for need in (Need.SPEED, Need.SLIP_TOLD, Need.STRAIGHT, Need.PULLED_AWAY)
)


@dataclass(frozen=True, kw_only=True)
class Sign:
    """One sign of entrapment.

    Attributes
    ----------
    name : str
        For logs.
    hold : float
        Time for which it must be present before it raises the warning [s].
    needs : Need
        What must hold for it to be judged at all.
    while_stopping : bool
        Whether it counts while the wheels are being stopped.
    present : callable
        Says whether it is there.
    words : callable
        Says so for the reader of the warning.
    """

    name: str
    hold: float
    needs: Need = Need.NOTHING
    while_stopping: bool = False
    present: Callable[[Situation, SignTuning], bool]
    words: Callable[[Situation, SignTuning], str]


def needs_met(s: Situation) -> int:
    """Return what of the needs of signs holds, as the value of a `Need`."""
    met = _SPEED if s.speed_known else 0
    if s.motion.slip_told:
        met |= _SLIP_TOLD
    if not s.motion.turning:
        met |= _STRAIGHT
    if not isnan(s.rolling_time):
        met |= _PULLED_AWAY
    return met


def _digging(s: Situation, t: SignTuning) -> bool:
    """Find the median slip above 0.8 with a probability above one half."""
    sure = s.settled and s.typical_std < t.sure_std
    if not (sure and s.slips_known and s.fastest > 0.0):
        return False
    return exceedance_probability(s.typical_slip, s.typical_std, t.digging_slip) > 0.5


def _likely(s: Situation, t: SignTuning) -> bool:
    """Find an entrapment within the horizon more likely than not."""
    return s.settled and s.outlook.probability > s.settings.threshold


def _time_to_entrapment(s: Situation, t: SignTuning) -> float:
    """Return after which time the median slip passes 0.9 with a probability of one half [s].

    The trend counts less what the slip's own wandering makes of it.
    """
    growth = s.trend - t.trend_doubt * s.typical_std
    lacking = ENTRAPPED_SLIP - s.typical_slip
    return max(lacking, 0.0) / growth if growth > 0.0 else (math.inf if lacking >= 0.0 else 0.0)


def _slip_is_told(s: Situation, t: SignTuning) -> bool:
    """Say whether the slip is known well enough to follow its trend."""
    if not s.speed_known and s.motion.margin > t.spare_margin:
        return False  # without a speed the slip is half a guess: the soil must be near its limit
    return s.typical_std < t.ahead_std


def _within_horizon(s: Situation, t: SignTuning) -> bool:
    """Find that the median slip passes 0.9 soon; the higher it stands, the farther this looks."""
    horizon = s.settings.horizon
    if s.typical_slip <= t.ahead_slip:
        horizon = min(horizon, t.sudden_time)
    soon = s.typical_slip > t.sudden_slip and _time_to_entrapment(s, t) < horizon
    return soon and _slip_is_told(s, t)


def _deepening(s: Situation, t: SignTuning) -> bool:
    """Find half of the wheels so deep within the rim travel that they do not climb out."""
    count = sum(room < s.settings.travel for room in s.climbing_room)
    return count >= t.least_deepening and 2 * count >= len(s.climbing_room)


def _lost_share(s: Situation) -> float:
    """Return the share of the fastest rim speed that the body does not make [-]."""
    return 1.0 - s.speed_ahead / s.fastest


def _held(s: Situation, t: SignTuning) -> bool:
    """Find little of the fastest rim speed made good while half of the wheels slip or stand.

    Torque-limited wheels stall as often as they spin.
    """
    if not (s.moving and s.fastest > 0.0 and any(s.stalled)):
        return False
    slow = s.tuning.stall_ratio * s.fastest
    bad = sum(1 for w in s.moving if w.slip > t.held_slip or abs(w.rim_speed) < slow)
    bad += len(s.stalled) - len(s.moving)
    return _lost_share(s) > t.held_slip and 2 * bad >= len(s.stalled)


def _time_to_stand(s: Situation, t: SignTuning) -> float:
    """Return after which time the rover would stand at its present loss of speed [s]."""
    loss = s.speed_loss
    if s.speed_known:
        spread = median([w.slip_std for w in s.moving]) * s.fastest
        loss -= t.bog_doubt * spread / s.tuning.loss_window
    return max(s.speed_ahead, 0.0) / loss if loss > t.least_loss else math.inf


def _bogging(s: Situation, t: SignTuning) -> bool:
    """Find wheels near their limit that slow down, the rover still more than its fastest wheel.

    Drives that hold their rim speed are not stalling, whatever the slip.
    """
    # Two wheels or more: one alone may stand against a stone.
    if not (s.second_strongest > t.bog_torque and s.moving and s.fastest > 0.0):
        return False
    if s.typical_rim >= t.labour_ratio * s.cruise_rim:
        return False
    return _lost_share(s) > t.bog_slip and _time_to_stand(s, t) < t.bog_time


def _stalling(s: Situation, t: SignTuning) -> bool:
    """Find half of the wheels near their torque limit, much slower than the fastest."""
    count = sum(s.stalled)
    return count >= t.least_stalled and 2 * count >= len(s.stalled)


def _held_back(s: Situation, t: SignTuning) -> bool:
    """Find two wheels near their limit and slower than the fastest, the rover slower still."""
    if not s.moving:
        return False
    return (
        s.second_strongest >= t.labour_torque
        and s.typical_rim < t.labour_ratio * s.fastest
        and (not s.speed_known or 1.0 - abs(s.motion.speed) / s.fastest > t.bog_slip)
    )


def _labouring(s: Situation, t: SignTuning) -> bool:
    """Find wheels near their limit that turn slower than in the last seconds."""
    return (
        s.rolling_time >= s.tuning.pull_away_time
        and _held_back(s, t)
        and s.typical_rim < t.labour_ratio * s.cruise_rim
    )


def _bogging_in_words(s: Situation, t: SignTuning) -> str:
    time = _time_to_stand(s, t)
    soon = f'stands in {time:.1f} s' if time >= _TOLD_TIME else 'hardly moves'
    return f'bogging down: {soon}, wheels near their torque limit'


def _likely_in_words(s: Situation, t: SignTuning) -> str:
    return (
        f'median slip {s.typical_slip:.2f}: entrapment within {s.settings.horizon:g} s '
        f'{s.outlook.probability:.0%} likely'
    )


def _growth_in_words(s: Situation, t: SignTuning) -> str:
    if s.typical_slip >= ENTRAPPED_SLIP:
        return f'median slip {s.typical_slip:.2f}: hardly any way is made'
    return f'median slip {s.typical_slip:.2f} grows by {s.trend:.2g} per second'


def _digging_in_words(s: Situation, t: SignTuning) -> str:
    return f'median slip {s.typical_slip:.2f}: digging in'


def _deepening_in_words(s: Situation, t: SignTuning) -> str:
    return f'wheels dig in: too deep to climb out within {s.settings.travel:g} m of rim travel'


def _held_in_words(s: Situation, t: SignTuning) -> str:
    return f'{_lost_share(s):.0%} of the fastest rim speed lost, others held'


def _stalling_in_words(s: Situation, t: SignTuning) -> str:
    return f'{sum(s.stalled)} wheels stalled near their torque limit'


def _labouring_in_words(s: Situation, t: SignTuning) -> str:
    return f'wheels slowed to {s.typical_rim:.2f} m/s near their torque limit'


def in_words(sign: Sign, s: Situation, t: SignTuning) -> str:
    """Return why the warning is raised, what the wheels and the soil say, and what to do."""
    told = [sign.words(s, t)]
    growths = [d.growth for d in s.observed.deepening]
    sinking = sum(growth > s.tuning.least_deepening for growth in growths)
    if sinking:
        wheels = 'a wheel sinks' if sinking == 1 else f'{sinking} wheels sink'
        told.append(f'{wheels} {100.0 * max(growths):.0f} cm per metre of rim travel')
    if not isnan(s.motion.margin):
        left = max(s.motion.margin, 0.0)
        told.append(f'pull left {left:.0%} of the load')
    return f'{", ".join(told)}; {ADVICE}'


SIGNS: tuple[Sign, ...] = (
    Sign(
        name='likely',
        hold=1.0,
        needs=Need.SLIP_TOLD | Need.STRAIGHT,  # wheels that spin on the spot dig by command
        present=_likely,
        words=_likely_in_words,
    ),
    Sign(
        name='within_horizon',
        hold=1.0,
        needs=Need.SLIP_TOLD,
        present=_within_horizon,
        words=_growth_in_words,
    ),
    Sign(
        name='digging',
        hold=1.5,
        needs=Need.SLIP_TOLD,
        present=_digging,
        words=_digging_in_words,
    ),
    Sign(
        name='deepening',
        hold=4.0,  # wheels that enter a patch sink as fast, over a contact length
        needs=Need.SLIP_TOLD,
        present=_deepening,
        words=_deepening_in_words,
    ),
    Sign(
        name='held',
        hold=_TWO_READINGS,
        needs=Need.SPEED | Need.PULLED_AWAY,
        while_stopping=True,
        present=_held,
        words=_held_in_words,
    ),
    Sign(
        name='bogging',
        hold=_TWO_READINGS,
        needs=Need.STRAIGHT | Need.PULLED_AWAY,
        while_stopping=True,
        present=_bogging,
        words=_bogging_in_words,
    ),
    Sign(
        name='stall',
        hold=_TWO_READINGS,
        while_stopping=True,
        present=_stalling,
        words=_stalling_in_words,
    ),
    Sign(
        name='labour',
        hold=0.4,
        needs=Need.STRAIGHT,
        while_stopping=True,
        present=_labouring,
        words=_labouring_in_words,
    ),
)
"""The signs; where several are there at once, the first gives the words."""
