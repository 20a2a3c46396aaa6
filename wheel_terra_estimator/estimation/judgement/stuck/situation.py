# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What the stuck warning observes of the rover: typical slip, its trend, digging, torques."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import isnan
from typing import NamedTuple

from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.judgement.stuck.forecast import Outlook, outlook
from wheel_terra_estimator.estimation.judgement.stuck.passage import FirstPassage
from wheel_terra_estimator.estimation.judgement.stuck.settings import StuckSettings
from wheel_terra_estimator.estimation.judgement.stuck.windows import (
    Window,
    appended,
    slope,
    trimmed,
)
from wheel_terra_estimator.estimation.scalars import NAN, median

_TIME_ROUNDING = 1e-9  # [s]


@dataclass(frozen=True)
class SituationTuning:
    """Windows and thresholds of what is observed.

    Tuned on simulated drives, seeds 1000 to 1019, and on the nine snow immobilisations of Lines
    (Dartmouth, 2021) where wheels stall.
    """

    trend_window: float = 5.0  # over which the growth of the slip is taken [s]
    shortest_trend: float = 2.5
    fewest_trend: int = 5  # samples
    trend_spacing: float = 0.2  # of the samples [s]
    settling_travel: float = 0.25  # [m] of rim travel after a start in which slip settles
    growth_travel: float = 0.15  # [m] of rim travel over which the growth of the sinkage is taken
    growth_samples: float = 10.0  # in it
    least_growth_share: float = 0.5  # of that travel that must be covered
    cruise_decay: float = 0.999  # of the greatest rim speed, per update
    rolling_share: float = 0.5  # of it, above which the rover has pulled away
    standing_share: float = 0.2  # below which it has stopped
    pull_away_time: float = 1.0  # [s]: pulling away from rest looks like a stall
    stall_ratio: float = 0.6  # of the fastest rim speed: a wheel below it is held
    standing_ratio: float = 0.1  # of it: a wheel below it stands among wheels that turn
    stall_torque: float = 0.7  # of the torque limit
    stopping_window: float = 1.0  # [s]
    stopping_share: float = 0.8  # of the fastest rim speed in it
    strained_torque: float = 0.5  # of the limit: two such wheels are held by the soil
    cruise_window: float = 5.0  # [s]
    standing_std: float = 2.0  # deviations of a speed that a rover is said to stand within
    limit_tolerance: float = 0.2  # of a torque that is at its limit, over the limit
    direction_memory: float = 0.5  # of the rims' direction [s] of turning: half a sign's hold time
    direction_share: float = 0.75  # of the rim travel that must be one way
    least_deepening: float = 0.02  # sinkage per rim travel that counts as digging
    deepening_slip: float = 0.2
    deep: float = 0.5
    """Sinkage over the radius from which a wheel does not climb out: its entrance angle is 60
    degrees there, and the normal stress, centred at about half of it, leans back by 30 degrees, as
    much as the friction of loose soil pulls forward."""


class WheelMotion(NamedTuple):
    """What the warning needs of one wheel."""

    slip: float
    slip_std: float
    rim_speed: float  # [m/s], signed
    known: bool  # a rate is known and the wheel is not at rest
    torque_share: float
    """Torque over its limit; negative where the soil turns or drags the wheel against its drive;
    nan = unknown."""
    sinkage: float  # [m]
    radius: float  # [m]
    rate_told: bool = True
    """Whether a rate came of late; without one the rim speed is 0."""


def driving_share(torque: float, limit: float, rim_speed: float) -> float:
    """Return `WheelMotion.torque_share`; nan without a limit or a torque [N m].

    `rim_speed` tells the direction [m/s]: that of the wheel, or of those that turn.
    """
    return math.copysign(torque, torque * rim_speed) / limit if limit > 0.0 else NAN


class RoverMotion(NamedTuple):
    """What the warning needs of the rover."""

    speed: float  # [m/s]
    speed_known: bool
    """Whether the speed rests on more than a guess."""
    wheels: tuple[WheelMotion, ...]
    slip_told: bool = True
    """Whether a reference, a torque or a sinkage tells of the slip, not an accelerometer alone."""
    turning: bool = False
    """Sharply: slip that comes from turning says nothing of what is ahead."""


class Deepening(NamedTuple):
    """Sinkage of one wheel over its rim travel."""

    travel: float = 0.0  # [m]
    samples: Window = ()
    growth: float = 0.0  # sinkage gained per rim travel [m/m]


class Observed(NamedTuple):
    """What is remembered from update to update."""

    time: float = NAN  # [s]
    rolling_since: float = NAN  # [s], nan = not pulled away yet
    cruise: float = 0.0  # greatest rim speed, slowly forgotten [m/s]
    rim_travel: float = 0.0  # since the wheels last stood [m]
    slips: Window = ()  # typical slip over time
    trend: float = 0.0  # its growth [1/s]
    fastest: Window = ()  # fastest rim speed over time
    typical: Window = ()  # typical rim speed over time
    deepening: tuple[Deepening, ...] = ()
    standing: tuple[bool, ...] = ()  # wheels that stand while others turn
    travels: tuple[float, float] = (0.0, 0.0)
    """Rim travel forward and backward of late [m]; kept while the rims stand."""


@dataclass(frozen=True)
class Situation:
    """The rover at one update, as the signs of entrapment see it."""

    motion: RoverMotion
    observed: Observed
    moving: tuple[WheelMotion, ...]  # wheels with a known rate that are not at rest
    stalled: tuple[bool, ...]
    """Wheels that pull near their limit and hardly turn while another turns."""
    fastest: float  # rim speed [m/s]
    typical_slip: float
    """Median; a stalled wheel offers nothing and counts as one that makes no way."""
    typical_std: float
    settled: bool  # the slip has settled after a start
    stopping: bool
    """The wheels are being stopped: a late or early reference then shows slip that is none."""
    rolling_time: float  # [s] since the rover pulled away, nan = it did not
    settings: StuckSettings
    tuning: SituationTuning
    passage: FirstPassage

    @cached_property
    def climbing_room(self) -> tuple[float, ...]:
        """Rim travel after which each wheel is in too deep for its lugs to climb out [m].

        It sinks as it turns, as over its last travel; infinite where it does not.
        """
        t = self.tuning
        return tuple(
            [
                max(t.deep * wheel.radius - wheel.sinkage, 0.0) / deepening.growth
                if deepening.growth > t.least_deepening
                and wheel.known
                and wheel.slip > t.deepening_slip
                else math.inf
                for wheel, deepening in zip(
                    self.motion.wheels, self.observed.deepening, strict=True
                )
            ]
        )

    @cached_property
    def outlook(self) -> Outlook:
        """What lies ahead: probability, time and travel to an entrapment."""
        return outlook(self, self.passage)

    @property
    def led_by(self) -> int:
        """Direction in which the rims turned last: 1 forward, -1 backward, 0 both or none."""
        forward, backward = self.observed.travels
        least = self.tuning.direction_share * (forward + backward)
        return (forward > least) - (backward > least)

    @property
    def trend(self) -> float:
        """Growth of the typical slip [1/s]."""
        return self.observed.trend

    @cached_property
    def second_strongest(self) -> float:
        """Second greatest share of the torque limit [-]; 0 where fewer are known."""
        shares = sorted(w.torque_share for w in self.motion.wheels if w.torque_share >= 0.0)
        return shares[-2] if len(shares) > 1 else 0.0

    @cached_property
    def typical_rim(self) -> float:
        """Typical rim speed, that of standing wheels included [m/s]."""
        return typical_rim(self.motion)

    @cached_property
    def cruise_rim(self) -> float:
        """Greatest typical rim speed of the last seconds [m/s]."""
        return max((rim for _, rim in self.observed.typical), default=0.0)

    @property
    def typical_magnitude(self) -> float:
        """Median of |s|, braking included; nan where no wheel tells."""
        return median([abs(w.slip) for w in self.moving]) if self.moving else NAN

    @property
    def confirmed(self) -> bool:
        """Whether the rover stands by a reference, or two wheels are at their torque limit.

        In a wrong unit rim speeds make a slip near 1 of any speed, but no speed of zero; torques
        are then far beyond their limit.
        """
        spread = self.tuning.standing_std * self.typical_std * self.fastest
        stands = self.motion.speed_known and self.fastest > 0.0 and abs(self.motion.speed) < spread
        return stands or abs(self.second_strongest - 1.0) < self.tuning.limit_tolerance

    @cached_property
    def sinking(self) -> int:
        """Number of wheels that sink as they turn."""
        least = self.tuning.least_deepening
        return sum(d.growth > least for d in self.observed.deepening)


class SituationObserver(Component[Observed]):
    """Turns the motion of the rover into the situation that the signs judge."""

    def __init__(
        self, settings: StuckSettings, tuning: SituationTuning = SituationTuning()
    ) -> None:
        super().__init__(Observed())
        self._settings, self._tuning = settings, tuning
        self._passage = FirstPassage()

    def update(self, time: float, motion: RoverMotion) -> Situation:
        """Observe the motion at a time [s]."""
        old, tuning = self.state, self._tuning
        dt = 0.0 if isnan(old.time) else max(time - old.time, 0.0)
        moving = tuple([w for w in motion.wheels if w.known])
        fastest = max([abs(w.rim_speed) for w in moving], default=0.0)
        cruise = max(fastest, tuning.cruise_decay * old.cruise)
        rolling_since = self._rolling_since(time, fastest, cruise, anew=motion.turning)
        stalled = self._stalled(motion.wheels, fastest, time - rolling_since)
        standing = self._standing(motion.wheels, fastest)
        # Slip settles over the first travel after a start: its growth there says nothing. So it
        # does where a wheel is held or comes free: the others take over its share, and more.
        settles_anew = not moving or standing != old.standing
        rim_travel = 0.0 if settles_anew else old.rim_travel + fastest * dt
        settled = rim_travel > tuning.settling_travel
        effective = [w.slip for w in moving]
        effective += [1.0 for w, s in zip(motion.wheels, stalled, strict=True) if s and not w.known]
        typical = median(effective) if effective else 0.0
        slips, trend = self._trend(time, typical, follow=settled and not motion.turning)
        rims = appended(old.fastest, time, fastest, tuning.stopping_window)
        observed = Observed(
            time=time,
            rolling_since=rolling_since,
            cruise=cruise,
            rim_travel=rim_travel,
            slips=slips,
            trend=trend,
            fastest=rims,
            standing=standing,
            typical=self._typical_rims(time, motion),
            travels=self._travels(dt, moving),
            deepening=self._deepened(
                motion.wheels,
                dt,
                # Wheels that turn on the spot dig by command.
                fresh=motion.turning or rim_travel < tuning.settling_travel,
            ),
        )
        self.state = observed
        return Situation(
            motion=motion,
            observed=observed,
            moving=moving,
            stalled=stalled,
            fastest=fastest,
            typical_slip=typical,
            typical_std=median([w.slip_std for w in moving]) if moving else 1.0,
            settled=settled,
            stopping=self._stopping(motion.wheels, fastest, rims),
            rolling_time=time - rolling_since,
            settings=self._settings,
            tuning=tuning,
            passage=self._passage,
        )

    def _rolling_since(self, time: float, fastest: float, cruise: float, *, anew: bool) -> float:
        """Return since when the fastest wheel turns at half of its own cruise, nan = it does not.

        It rests on rim speed alone, so that no unaided body speed decides. A sharp turn begins it
        `anew`: behind a spin one side stands for a moment and pulls away the other way round.
        """
        since, tuning = self.state.rolling_since, self._tuning
        if fastest > tuning.rolling_share * cruise and fastest > 0.0:
            return time if anew or isnan(since) else since
        return NAN if fastest < tuning.standing_share * cruise else since

    def _stalled(
        self, wheels: Sequence[WheelMotion], fastest: float, rolling_time: float
    ) -> tuple[bool, ...]:
        tuning = self._tuning
        if not rolling_time >= tuning.pull_away_time:
            return (False,) * len(wheels)
        return tuple(
            [
                w.torque_share >= tuning.stall_torque
                and abs(w.rim_speed) < tuning.stall_ratio * fastest
                for w in wheels
            ]
        )

    def _standing(self, wheels: Sequence[WheelMotion], fastest: float) -> tuple[bool, ...]:
        """Return which wheels stand; as before where a wheel tells no rate or none turns."""
        before = self.state.standing or (False,) * len(wheels)
        if fastest <= 0.0:
            return before
        slow = self._tuning.standing_ratio * fastest
        return tuple(
            [
                abs(w.rim_speed) < slow if w.rate_told else stood
                for w, stood in zip(wheels, before, strict=True)
            ]
        )

    def _stopping(self, wheels: Sequence[WheelMotion], fastest: float, rims: Window) -> bool:
        """Wheels that slow down; near their torque limit they are held by the soil instead."""
        tuning = self._tuning
        if fastest >= tuning.stopping_share * max(rim for _, rim in rims):
            return False
        return sum(w.torque_share > tuning.strained_torque for w in wheels) < 2

    def _trend(self, time: float, typical: float, *, follow: bool) -> tuple[Window, float]:
        """Return the samples of the typical slip and their growth [1/s], 0 when unknown."""
        tuning, slips = self._tuning, self.state.slips
        if not follow:
            return (), 0.0
        if not slips or time - slips[-1][0] >= tuning.trend_spacing - _TIME_ROUNDING:
            slips = (*slips, (time, typical))
        slips = trimmed(slips, time, tuning.trend_window)
        if len(slips) < tuning.fewest_trend or slips[-1][0] - slips[0][0] < tuning.shortest_trend:
            return slips, 0.0
        return slips, self.state.trend if slips is self.state.slips else slope(slips)

    def _typical_rims(self, time: float, motion: RoverMotion) -> Window:
        if motion.turning:
            return self.state.typical
        return appended(self.state.typical, time, typical_rim(motion), self._tuning.cruise_window)

    def _travels(self, dt: float, moving: Sequence[WheelMotion]) -> tuple[float, float]:
        if not moving:
            return self.state.travels
        forward, backward = self.state.travels
        kept = math.exp(-dt / self._tuning.direction_memory)
        share = dt / len(moving)
        return (
            kept * forward + share * sum([max(w.rim_speed, 0.0) for w in moving]),
            kept * backward + share * sum([max(-w.rim_speed, 0.0) for w in moving]),
        )

    def _deepened(
        self, wheels: Sequence[WheelMotion], dt: float, *, fresh: bool
    ) -> tuple[Deepening, ...]:
        """Return the sinkage of each wheel over its last rim travel."""
        before = self.state.deepening or (Deepening(),) * len(wheels)
        return tuple(
            [
                self._deepening(b, w, w.rim_speed * dt, fresh)
                for b, w in zip(before, wheels, strict=True)
            ]
        )

    def _deepening(
        self, before: Deepening, wheel: WheelMotion, rolled: float, fresh: bool
    ) -> Deepening:
        tuning = self._tuning
        span = tuning.growth_travel
        travel = before.travel + abs(rolled)
        samples = () if fresh else before.samples  # wheels settle into their ruts after a start
        if not samples or travel - samples[-1][0] >= span / tuning.growth_samples:
            samples = (*samples, (travel, wheel.sinkage))
        samples = trimmed(samples, travel, span) or ((travel, wheel.sinkage),)
        if samples is before.samples:
            return Deepening(travel, samples, before.growth)
        covered = samples[-1][0] - samples[0][0]
        growth = slope(samples) if covered > tuning.least_growth_share * span else 0.0
        return Deepening(travel, samples, growth)


def typical_rim(motion: RoverMotion) -> float:
    """Return the median rim speed of the wheels that tell one [m/s]."""
    told = [abs(w.rim_speed) for w in motion.wheels if w.rate_told]
    return median(told) if told else 0.0
