# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Inputs and memory of the stuck warning, and the quantities that follow from both."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from math import isnan
from typing import NamedTuple

from wheel_terra_estimator.estimation.scalars import NAN, gain_of, known, median

# Set on simulators A, B and C and nine snow immobilisations.
_START_TRAVEL = 0.25
"""Rim travel over which slip, sinkage and torque settle after a start or turn [m]."""
_STALL_RATIO = 0.6  # rim speed over the fastest one below which a wheel hardly turns [-]
_RUT_LENGTH = 0.08  # rim travel over which the growth of the sinkage is taken [m]
_DIGS, _DIGS_AT = 0.02, 0.2
"""Sinkage gained over rim travel [m/m] and slip [-] above which a wheel digs in."""
_DEEP = 0.4
"""Sinkage over the radius from which a wheel does not climb out [-]: its entrance angle is 53
degrees, and the normal stress, centred at about half of it, leans back by 27 degrees, as much as
the friction of loose soil pulls forward."""
_DEEPENING_RADII, _DEEPENED = 5.0, 0.1
"""Rim travel of the running mean of the depth, and depth above that mean of a rover that sinks on;
both over the radius [-]."""
_CRUISE_TIME = 5.0  # time constant with which a greater rim speed is forgotten [s]
_SLOWING = 0.2  # loss of rim speed above which wheels are held or being stopped [-]
_DIRECTION_SHARE = 0.1
"""Rim speed over the recent one below which the direction is kept [-]: wheels rock as they stop."""
NEAR_LIMIT = 0.7
"""Torque over its limit [-]: below it wheels are not held, above it they are not being stopped."""
_RISE = 0.1
"""Growth of that share above its recent mean by which wheels lack power [-]: a climb may need as
much all the time, until the rover is stopped. In snow it grew by 0.17 to 0.67."""
_STALL_SHARE_AT_REST = 0.9  # the same at rest [-]; below it a rover may be parked on a slope
_BEYOND_SLOPE = 0.15  # mean of that share beyond what holds the rover on its slope [-]
_STALL_TIME_AT_REST = 1.0  # for which a wheel may pull near its limit before it turns [s]


class WheelMotion(NamedTuple):
    """Inputs of the warning for one wheel."""

    slip: float  # [-]
    slip_std: float
    rim_speed: float  # [m/s], signed; nan = no recent rate
    known: bool  # a rate is known and the wheel is not at rest
    torque_share: float
    """Torque over its limit; negative where the soil turns or drags the wheel against its drive;
    nan = unknown."""
    sinkage: float  # [m]
    radius: float  # [m]


def driving_share(torque: float, limit: float, rim_speed: float) -> float:
    """Return `WheelMotion.torque_share`; nan without a limit or a torque [N m].

    `rim_speed` has the sign of the direction [m/s]: that of the wheel, or of those that turn; 0:
    unknown.
    """
    if limit <= 0.0:
        return NAN
    return (math.copysign(torque, torque * rim_speed) if rim_speed else abs(torque)) / limit


class RoverMotion(NamedTuple):
    """All inputs of the warning."""

    speed: float  # [m/s]
    speed_known: bool  # by a recent reference
    wheels: tuple[WheelMotion, ...]
    turning: bool = False  # sharply: slip due to turning does not predict entrapment
    depth_read: bool = True  # the sinkage of most wheels is measured
    slip_known: bool = False  # by two recent references while wheels turned
    demand: float = NAN  # required traction coefficient in the direction of the drive [-]
    holding_share: float = 0.0
    """Share of all torque limits that holds a rover at rest on its slope [-]."""


class Memory(NamedTuple):
    """Memory from update to update."""

    time: float = NAN  # [s]
    rolled: float = 0.0  # rim travel since the last rest or sharp turn [m]
    cruise: float = 0.0  # recent rim speed: the typical one, with a slow decay [m/s]
    ruts: tuple[float, ...] = ()  # running mean of each sinkage over rim travel [m]
    depth: float = NAN  # running mean of the typical sinkage over the radius [-]
    direction: int = 0  # of the rims: 1 forward, -1 backward, 0 both
    direction_since: float = NAN  # [s]
    torque_share: float = NAN  # running mean while wheels turn and are not slowed [-]
    pulls_since: float = NAN
    """Since when all wheels stand and one pulls near its limit [s]; nan = this is not the case."""


@dataclass(frozen=True)
class Situation:
    """The rover at one update, as the warning sees it."""

    time: float  # [s]
    motion: RoverMotion
    before: Memory

    @cached_property
    def memory(self) -> Memory:
        """What is remembered after this update."""
        before, wheels = self.before, self.motion.wheels
        dt = 0.0 if isnan(before.time) else max(self.time - before.time, 0.0)
        moves, turning = bool(self.moving), self.motion.turning
        # Wheels settle into their ruts after a start; those that turn on the spot dig by command.
        rolled = before.rolled + self.fastest * dt if moves and not turning else 0.0
        fresh = rolled < _START_TRAVEL
        usual = self.depth if isnan(before.depth) else before.depth
        direction = before.direction
        if moves and self.rim > _DIRECTION_SHARE * before.cruise:
            forward = sum([1 if w.rim_speed > 0.0 else -1 for w in self.moving])
            direction = (forward > 0) - (forward < 0)
        stands = not moves and not any(isnan(w.rim_speed) for w in wheels)
        shares = [w.torque_share for w in wheels if not isnan(w.torque_share)]
        pulls = stands and max(shares, default=0.0) > _STALL_SHARE_AT_REST
        pulls = pulls and sum(shares) / len(shares) - self.motion.holding_share > _BEYOND_SLOPE
        since = self.time if isnan(before.pulls_since) else before.pulls_since
        cruise = max(before.cruise * math.exp(-dt / _CRUISE_TIME), self.rim)
        share = self.torque_share if isnan(before.torque_share) else before.torque_share
        if not self.slow_against(cruise):
            share += gain_of(dt, _CRUISE_TIME) * (self.torque_share - share)
        return Memory(
            time=self.time,
            rolled=rolled,
            cruise=0.0 if turning else cruise,
            ruts=tuple(
                [
                    w.sinkage
                    if fresh or isnan(w.rim_speed)
                    else rut + gain_of(abs(w.rim_speed) * dt, _RUT_LENGTH) * (w.sinkage - rut)
                    for w, rut in zip(
                        wheels, before.ruts or [w.sinkage for w in wheels], strict=True
                    )
                ]
            ),
            depth=usual
            + gain_of(self.rim * dt, _DEEPENING_RADII * self.radius) * (self.depth - usual),
            direction=direction,
            direction_since=before.direction_since if direction == before.direction else self.time,
            torque_share=share if moves else NAN,
            pulls_since=since if pulls else NAN,
        )

    @cached_property
    def moving(self) -> tuple[WheelMotion, ...]:
        """Wheels with a known rate that are not at rest."""
        return tuple([w for w in self.motion.wheels if w.known])

    @cached_property
    def fastest(self) -> float:
        """Rim speed of the fastest wheel [m/s]."""
        return max([abs(w.rim_speed) for w in self.moving], default=0.0)

    @cached_property
    def rim(self) -> float:
        """Typical rim speed, that of standing wheels included [m/s]."""
        rims = known([abs(w.rim_speed) for w in self.motion.wheels])
        return median(rims) if rims else 0.0

    @cached_property
    def slip(self) -> float:
        """Typical slip; 0 where it is known of no wheel."""
        return median([w.slip for w in self.moving]) if self.moving else 0.0

    @cached_property
    def slip_std(self) -> float:
        """Typical deviation of the slip; 1 where nothing is known."""
        return median([w.slip_std for w in self.moving]) if self.moving else 1.0

    @cached_property
    def settled(self) -> bool:
        """Whether the start is over, as far as slip and sinkage tell."""
        return self.memory.rolled > _START_TRAVEL

    @cached_property
    def digging(self) -> float:
        """Sinkage gained over rim travel by more than half of the wheels [m/m].

        Half is not enough: at a border to softer soil the first of two axles sinks alone.
        """
        growths = sorted(self.growths)
        return growths[(len(growths) - 1) // 2] if growths else 0.0

    @cached_property
    def growths(self) -> tuple[float, ...]:
        """Sinkage gained over rim travel by each wheel [m/m]."""
        return tuple(
            (wheel.sinkage - rut) / _RUT_LENGTH
            for wheel, rut in zip(self.motion.wheels, self.memory.ruts, strict=True)
        )

    @cached_property
    def radius(self) -> float:
        """Typical radius [m]."""
        return median([w.radius for w in self.motion.wheels])

    @cached_property
    def depth(self) -> float:
        """Typical sinkage over the radius [-]."""
        return median([w.sinkage / w.radius for w in self.motion.wheels])

    @property
    def sunk(self) -> bool:
        """Whether wheels are too deep to climb out, and no measured speed shows that they do."""
        return self.motion.depth_read and not self.motion.speed_known and self.depth > _DEEP

    @property
    def burying(self) -> bool:
        """Whether they also sink on: of a rover that moves on the depth stays the same."""
        return self.settled and self.sunk and self.depth - self.memory.depth > _DEEPENED

    @cached_property
    def travel_until_too_deep(self) -> tuple[float, ...]:
        """Rim travel after which each wheel is too deep to climb out [m].

        Extrapolated from its sinkage over the last travel; infinite where it does not dig in, or is
        deeper already and a measured speed shows that the rover moves on.
        """
        found = []
        for wheel, growth in zip(self.motion.wheels, self.growths, strict=True):
            digs = self.settled and wheel.known and growth > _DIGS and wheel.slip > _DIGS_AT
            room = _DEEP * wheel.radius - wheel.sinkage
            climbs = room < 0.0 and self.motion.speed_known
            found.append(max(room, 0.0) / growth if digs and not climbs else math.inf)
        return tuple(found)

    @cached_property
    def torque_share(self) -> float:
        """Share of the torque limit of the second strongest wheel [-]; 0 where it is unknown.

        One wheel alone may stand against a stone.
        """
        shares = sorted(w.torque_share for w in self.motion.wheels if w.torque_share >= 0.0)
        return shares[-2] if len(shares) > 1 else 0.0

    @cached_property
    def slowed(self) -> bool:
        """Whether the wheels are slower than in the last seconds."""
        return self.rim < (1.0 - _SLOWING) * self.memory.cruise

    def slow_against(self, cruise: float) -> bool:
        """Return whether wheels are slower than `cruise` [m/s], or than the fastest wheel."""
        return self.rim < (1.0 - _SLOWING) * max(cruise, self.fastest)

    @property
    def braked(self) -> bool:
        """Whether the wheels are being stopped, at low torque."""
        return self.slowed and self.torque_share < NEAR_LIMIT

    @cached_property
    def standing(self) -> bool:
        """Whether the wheels stall at their torque limit, or are about to."""
        if self.pulls_at_rest:
            return self.torque_share > _STALL_SHARE_AT_REST
        risen = min(self.memory.torque_share + _RISE, _STALL_SHARE_AT_REST)
        slow = self.slow_against(self.memory.cruise)
        return self.settled and self.torque_share > max(NEAR_LIMIT, risen) and slow

    @cached_property
    def pulls_at_rest(self) -> bool:
        """Whether all wheels stand, and one has pulled near its limit for too long."""
        return self.memory.time - self.memory.pulls_since > _STALL_TIME_AT_REST

    @cached_property
    def stalled(self) -> tuple[bool, ...]:
        """Wheels that pull near their limit and hardly turn, while another turns or all stand."""
        if self.pulls_at_rest:
            return tuple([w.torque_share > _STALL_SHARE_AT_REST for w in self.motion.wheels])
        slow = _STALL_RATIO * self.fastest if self.settled else 0.0
        wheels = self.motion.wheels
        return tuple([w.torque_share > NEAR_LIMIT and abs(w.rim_speed) < slow for w in wheels])

    @property
    def slip_magnitude(self) -> float:
        """Median of |s|, braking included; nan where it is known of no wheel."""
        return median([abs(w.slip) for w in self.moving]) if self.moving else NAN
