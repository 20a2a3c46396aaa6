# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Stuck warning: raised by any of three criteria, cleared when none has been met for a while.

Slip: the probability of an entrapment exceeds the threshold, or the median slip is above 0.8.
Standing: the wheels stall at their torque limit. Burying: without a measured speed, most wheels are
too deep to climb out and sink on. Only driving slip counts, and a single wheel never raises a
warning.
"""

from __future__ import annotations

from math import isnan
from typing import NamedTuple

from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.judgement.entrapment import ENTRAPPED_SLIP
from wheel_terra_estimator.estimation.judgement.stuck.forecast import (
    TYPICAL_STD,
    Outlook,
    StuckSettings,
    WheelForecast,
    outlook,
)
from wheel_terra_estimator.estimation.judgement.stuck.situation import (
    NEAR_LIMIT,
    Memory,
    RoverMotion,
    Situation,
)
from wheel_terra_estimator.estimation.scalars import NAN

ADVICE = 'stop, back out'
"""Advice where wheels dig themselves in: they climb their own ruts better than fresh soil."""
HOLD, SINKING_HOLD, STANDING_HOLD = 0.95, 0.45, 0.15
"""Times for which a criterion must hold [s], half a cycle short of 1, 0.5 and 0.2 s: slip, slip of
wheels that sink, standing. At a stop the reference is at rest up to 0.9 s before the wheels."""
_BORDER_RADII = 10.0
"""Rim travel for which burying must hold, over the radius [-]; after a border to softer soil wheels
sink over less."""
_SINKING = 0.01  # sinkage gained over rim travel by most wheels [m/m]
_DIGGING_SLIP = 0.8  # median slip above which a rover that drives on digs itself in [-]
_EASED = 0.05
"""Decrease of the demand after which the ground may no longer hold the rover [-]: 3 degrees."""


class StuckAssessment(NamedTuple):
    """Result of one update; tuples have one entry per wheel."""

    stuck: bool = False
    reason: str = ''
    wheels: tuple[WheelForecast, ...] = ()
    stalled: tuple[bool, ...] = ()
    direction: int = 0  # of the rims that led to it: 1, -1; 0 none, both or unknown
    digging: float = 0.0
    """Sinkage gained over rim travel by more than half of the wheels [m/m]."""
    confirmed: bool = False
    """Whether there is evidence that no wrong sign or unit of the wheels' readings can produce.

    These make the slip of a moving rover near 1, but its speed zero only while it stops or starts.
    """
    holds: bool = False
    """Whether the ground still holds the rover: same direction, no smaller demand."""
    buried: bool = False
    """Whether it does, and most wheels are measured too deep to climb out."""
    clears: bool = False
    """Whether no sign of an entrapment is left; the warning ends if that lasts."""


class StuckState(NamedTuple):
    """Memory of the monitor."""

    memory: Memory = Memory()
    since: tuple[float, ...] = (NAN, NAN, NAN)  # when each criterion was met [s], nan = it is not
    stuck: bool = False
    reason: str = ''
    direction: int = 0
    demand: float = NAN  # when the warning was raised [-]
    clear_since: float = NAN  # [s]
    stands_since: float = NAN  # by a reference, while wheels turn on [s]


class StuckMonitor(Component[StuckState]):
    """Stuck warning of one rover."""

    def __init__(self, settings: StuckSettings) -> None:
        super().__init__(StuckState())
        self._settings = settings

    def update(self, time: float, motion: RoverMotion) -> StuckAssessment:
        """Judge the motion of the rover at a time [s]."""
        old, settings = self.state, self._settings
        situation = Situation(time, motion, old.memory)
        ahead = outlook(situation, settings)
        digs = situation.slip > _DIGGING_SLIP and situation.slip_std < TYPICAL_STD
        at_once = motion.slip_known and _stands(situation) and not motion.turning
        digs = digs and (situation.settled or at_once)
        likely = ahead.probability > settings.threshold or digs
        criteria = likely and not situation.braked, situation.standing, situation.burying
        since = tuple(
            (time if isnan(begun) else begun) if met else NAN
            for met, begun in zip(criteria, old.since, strict=True)
        )
        slip_hold = SINKING_HOLD if situation.digging > _SINKING else HOLD
        border = _BORDER_RADII * situation.radius / max(situation.rim, 1e-9)
        times = zip(since, (slip_hold, STANDING_HOLD, max(HOLD, border)), strict=True)
        held = [time - begun > hold for begun, hold in times]
        stays = any(criteria) or situation.sunk
        stands = time if isnan(old.stands_since) else old.stands_since
        stands = stands if _stands(situation) and not situation.slowed else NAN
        state = old._replace(
            memory=situation.memory, since=since, clear_since=NAN, stands_since=stands
        )
        if any(held) and not old.stuck:
            memory = situation.memory
            direction = memory.direction if time - memory.direction_since > SINKING_HOLD else 0
            reason = _in_words(situation, ahead, settings, held)
            state = state._replace(
                stuck=True, reason=reason, direction=direction, demand=motion.demand
            )
        elif old.stuck and not stays and situation.slip_magnitude < settings.clear_slip:
            clear = time if isnan(old.clear_since) else old.clear_since
            free = time - clear >= settings.clear_time
            state = StuckState(situation.memory) if free else state._replace(clear_since=clear)
        self.state = state
        ways = state.direction * situation.memory.direction
        holds = state.stuck and ways >= 0 and not motion.demand < state.demand - _EASED
        return StuckAssessment(
            state.stuck,
            state.reason,
            ahead.under_warning(situation, settings.horizon) if holds else ahead.wheels,
            situation.stalled,
            state.direction,
            situation.digging,
            state.stuck and (time - stands > HOLD or _at_limit(situation)),
            holds,
            holds and situation.sunk,
            not isnan(state.clear_since),
        )


def _at_limit(s: Situation) -> bool:
    """Return whether two wheels are at their torque limit; torques in a wrong unit are beyond."""
    return NEAR_LIMIT < s.torque_share < 1.0 / NEAR_LIMIT


def _stands(s: Situation) -> bool:
    """Return whether the rover stands by a reference, within the deviation of the slip."""
    return s.motion.speed_known and abs(s.motion.speed) < s.slip_std * s.fastest


def _in_words(s: Situation, ahead: Outlook, settings: StuckSettings, held: list[bool]) -> str:
    """Return the reason of the warning, with what to do."""
    count = sum(s.stalled)
    if held[1] and count > 1:
        text = f'{count} wheels stalled near their torque limit'
    elif held[1]:
        text = f'wheels slowed to {s.rim:.2f} m/s near their torque limit'
    elif held[2]:
        text = f'most wheels sunk to {s.depth:.0%} of their radius'
    elif s.slip > ENTRAPPED_SLIP:
        text = f'median slip {s.slip:.2f}: entrapment under way'
    elif ahead.probability <= settings.threshold:
        text = f'median slip {s.slip:.2f}: digging in'
    else:
        text = (
            f'median slip {s.slip:.2f}: entrapment within {settings.horizon:g} s '
            f'{ahead.probability:.0%} likely'
        )
    centimetres = round(100.0 * s.digging)
    if centimetres > 0:
        text += f', most wheels sink {centimetres} cm per metre of rim travel'
    return f'{text}; {ADVICE}'
