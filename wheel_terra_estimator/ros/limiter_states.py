# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""States of the traction limiter: what passes of a command, whatever has become of the estimates.

First that applies:

==================  ===============================================  ==========================
state               when                                             what passes
==================  ===============================================  ==========================
``zero``            the command is zero                              it, at once
``stuck``           ``~/stuck`` stands, also of a dead estimator     against the direction in which
                                                                     it rose: ``creep_scale``,
                                                                     else nothing
``no estimate``     none ever, or none for ``stale_after``           ``stale_scale``
``unknown``         all classes 255 for ``stale_after`` of a         ``stale_scale``
                    command that is not zero
``starting``        all classes 255 for less                         all
``slowed``, ...     the law of `traction_law.traction_decision`      its share
==================  ===============================================  ==========================
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from wheel_terra_estimator.estimation.estimates import SlipClass
from wheel_terra_estimator.estimation.traction_law import TractionLimits, traction_decision
from wheel_terra_estimator.messages.diagnostics import ERROR, OK, WARN

LONGEST_GAP = 1.0  # [s] between two commands that counts for the ramp


@dataclass(frozen=True)
class LimiterTuning:
    """Parameters of the limiter beside those of the law."""

    stale_after: float = 1.0  # [s]
    stale_scale: float = 0.3  # [-]
    max_acceleration: float = 0.5  # [m/s^2]
    max_angular_acceleration: float = 1.0  # [rad/s^2]


class Decision(NamedTuple):
    """What passes of a command, the state in one word or two, and why."""

    scale: float
    state: str
    reason: str
    level: int


class LimiterStates:
    """Keeps what was heard and decides on commands; times are of a steady clock [s]."""

    def __init__(self, limits: TractionLimits, tuning: LimiterTuning) -> None:
        self._limits = limits
        self._tuning = tuning
        self._slip: Sequence[float] = ()
        self._classes: Sequence[int] = ()
        self._travel: Sequence[float] = ()
        self._heard = {'slip': -math.inf, 'slip_class': -math.inf, 'mobility': -math.inf}
        self._stuck = False
        self._stuck_direction = 0.0
        self._direction = 0.0  # of travel, by command or else by the wheels
        self._unknown_since: float | None = None
        self._out = (0.0, 0.0)
        self._out_at = -math.inf

    def hear_slip(self, now: float, slip: Sequence[float], slip_velocity: Sequence[float]) -> None:
        """Take slip ratio and slip velocity [m/s] of the wheels."""
        self._slip = slip
        self._heard['slip'] = now
        driving = sum(slip_velocity)
        if self._direction == 0.0 and abs(driving) > 1e-3:
            self._direction = math.copysign(1.0, driving)

    def hear_classes(self, now: float, classes: Sequence[int]) -> None:
        """Take the slip classes of the wheels."""
        self._classes = classes
        self._heard['slip_class'] = now

    def hear_mobility(self, now: float, rim_travel_left: Sequence[float]) -> None:
        """Take the rim travel left of the wheels [m]."""
        self._travel = rim_travel_left
        self._heard['mobility'] = now

    def hear_stuck(self, stuck: bool) -> None:
        """Take the warning; the direction in which it rose is kept."""
        if stuck and not self._stuck:
            self._stuck_direction = self._direction
        self._stuck = stuck

    def age(self, now: float) -> float:
        """Return the age of the estimates [s], infinite where there never were any."""
        return now - min(self._heard.values())

    def decide(self, now: float, forward: float, turning: float) -> Decision:
        """Return what is to pass of a command [m/s, rad/s] that comes now."""
        moving = forward != 0.0 or turning != 0.0
        all_unknown = bool(self._classes) and all(c == SlipClass.UNKNOWN for c in self._classes)
        if not moving or not all_unknown:
            self._unknown_since = None
        elif self._unknown_since is None:
            self._unknown_since = now
        if not moving:
            return Decision(1.0, 'zero', 'command is zero: passes', ERROR if self._stuck else OK)
        if self._stuck:
            return self._out_of_stuck(forward)
        if forward != 0.0:
            self._direction = math.copysign(1.0, forward)
        share = self._tuning.stale_scale
        if self.age(now) > self._tuning.stale_after:
            return Decision(share, 'no estimate', f'no fresh estimate: cut to {share:.2f}', WARN)
        if not len(self._slip) == len(self._classes) == len(self._travel):
            return Decision(share, 'no estimate', 'estimates do not fit together', WARN)
        if self._unknown_since is not None:
            if now - self._unknown_since > self._tuning.stale_after:
                return Decision(
                    share, 'unknown', f'slip of no wheel known: cut to {share:.2f}', WARN
                )
            return Decision(1.0, 'starting', 'slip unknown at rest: command passes', OK)
        by_law = traction_decision(self._slip, self._classes, self._travel, False, self._limits)
        state = by_law.reason.partition(':')[0]
        level = ERROR if by_law.stop else WARN if by_law.scale < 1.0 else OK
        return Decision(by_law.scale, state, by_law.reason, level)

    def limited(
        self, now: float, decision: Decision, forward: float, turning: float
    ) -> tuple[float, float]:
        """Return the command that goes out [m/s, rad/s]: the share, with limited acceleration.

        Forward and turning keep their ratio on the way; a command of zero passes at once.
        """
        elapsed = min(now - self._out_at, LONGEST_GAP)
        target = decision.scale * forward, decision.scale * turning
        if forward != 0.0 or turning != 0.0:
            limits = self._tuning.max_acceleration, self._tuning.max_angular_acceleration
            part = 1.0
            for aim, out, limit in zip(target, self._out, limits, strict=True):
                if abs(aim - out) > limit * elapsed:
                    part = min(part, limit * elapsed / abs(aim - out))
            target = (
                self._out[0] + part * (target[0] - self._out[0]),
                self._out[1] + part * (target[1] - self._out[1]),
            )
        self._out, self._out_at = target, now
        return target

    def _out_of_stuck(self, forward: float) -> Decision:
        if self._stuck_direction * forward < 0.0:
            share = self._limits.creep_scale
            return Decision(share, 'backing out', f'backing out of stuck: at {share:.2f}', ERROR)
        way = 'in that direction' if self._stuck_direction else '(direction unknown)'
        words = f'stuck: nothing passes {way}; back out, or ~/reset of the estimator'
        return Decision(0.0, 'stuck', words, ERROR)
