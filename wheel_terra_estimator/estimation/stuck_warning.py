# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Stuck warning: entrapment under way, or expected within a time or a rim travel.

Signs, each with a hold time of its own, any of which raises the warning:

* *digging in*: the median slip is above 0.8 with a probability above one half;
* *look ahead*: at the rate at which the median slip grew over the last seconds it passes 0.9
  soon; the higher it stands, the farther this looks;
* *held wheels*: the rover makes little of what its fastest wheel offers while at least half of its
  wheels slip heavily or stand (torque-limited wheels stall as often as they spin);
* *bogging down*: wheels pull near their limit while the rover loses speed against its fastest
  wheel so fast that it would stand within seconds;
* *labour*: wheels near their torque limit turn slower than they did, and slower than the fastest;
* *exhausted*: without any speed, the soil gives hardly more pull than is asked, at high slip;
* *stall*: without any speed, two or more wheels pull near their torque limit while they turn much
  slower than the fastest. Pulling away from rest looks the same: a start mask keeps it out.

Wheels that are being stopped raise no sign of slip: a late or early reference shows slip then that
is none. Only driving slip counts: braking and skidding are no entrapment. A single wheel never
raises it.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

from wheel_terra_estimator.estimation.estimates import NO_ENTRAPMENT_IN_SIGHT
from wheel_terra_estimator.estimation.slip_classes import exceedance_probability
from wheel_terra_estimator.estimation.speed_process import median

_ENTRAPPED_SLIP = 0.9
_DIGGING_SLIP = 0.8
_SURE_STD = 0.25  # of the slip, to call it digging
_TREND_WINDOW = 5.0  # [s]
_SHORTEST_TREND = 2.5  # [s]
# Taken off the slope, over the deviation of the slip: 1.5 / (5 s / sqrt(12) * sqrt(5 fixes)).
_SLOPE_DOUBT = 0.45  # [1/s]
_SETTLING_TRAVEL = 0.25  # [m] of rim travel after a start
# Sinkage per rim travel that counts as digging, at which slip, to which share of the radius.
_DEEPENING, _DEEPENING_SLIP, _DEEP = 0.02, 0.2, 0.25
_GROWTH_TRAVEL = 0.15  # [m] of rim travel over which it is taken
_LEAST_TRAVEL = 0.05  # [m]; 0 is said of wheels that are stuck
_BOG_WINDOW = 1.5  # [s] over which the loss of speed is taken
_LOSS_DOUBT = 1.5  # taken off the loss, in deviations of the speed over that window
_STOPPING_WINDOW, _STOPPING_SHARE = 1.0, 0.8  # [s], of the fastest rim speed in it
_CRUISE_WINDOW = 5.0  # [s]
_LONGEST_TIME = 600.0  # [s] said where no entrapment is in sight


@dataclass(frozen=True)
class StuckTuning:
    """Thresholds; defaults as tuned on simulated tuning drives (docs/estimation)."""

    horizon: float = 15.0  # [s]
    travel: float = 0.3  # [m]
    clear_slip: float = 0.6
    clear_time: float = 3.0
    dig_hold: float = 1.5
    look_ahead: float = 10.0
    look_ahead_slip: float = 0.65
    sudden_ahead: float = 4.0
    sudden_slip: float = 0.45
    look_ahead_hold: float = 1.0
    held_slip: float = 0.6
    held_hold: float = 0.4
    bog_slip: float = 0.35
    bog_time: float = 6.0  # [s] to a stand
    bog_torque: float = 0.5  # of the torque limit, second strongest wheel
    bog_hold: float = 0.2
    labour_torque: float = 0.68  # of the torque limit, second strongest wheel
    labour_ratio: float = 0.87  # of the rim speed of the last seconds
    labour_hold: float = 0.4
    spare_margin: float = 0.045  # of the load: more than this and no entrapment is near
    exhausted_margin: float = 0.015
    exhausted_slip: float = 0.6
    exhausted_hold: float = 6.0
    stall_ratio: float = 0.6
    stall_torque: float = 0.7  # of the torque limit
    stall_hold: float = 0.4


@dataclass(frozen=True)
class WheelMotionState:
    """What the warning needs of one wheel."""

    slip: float
    slip_std: float
    rim_speed: float  # [m/s], signed
    known: bool  # a rate is known and the wheel is not at rest
    torque_share: float  # |torque| over its limit, nan = unknown
    sinkage: float
    radius: float


@dataclass(frozen=True)
class StuckAssessment:
    """Result of one update; lists have one entry per wheel."""

    stuck: bool
    reason: str
    probability: list[float]
    time_to_stuck: list[float]
    rim_travel_left: list[float]
    stalled: list[bool]


@dataclass
class _Memory:
    raised: bool = False
    reason: str = ''
    clear_since: float | None = None
    since: dict[str, float] = field(default_factory=dict)
    rolling_since: float | None = None
    cruise: float = 0.0
    trend: deque[tuple[float, float]] = field(default_factory=deque)
    rim_travel: float = 0.0
    last_time: float | None = None
    speeds: deque[tuple[float, float]] = field(default_factory=deque)
    rims: deque[tuple[float, float]] = field(default_factory=deque)
    cruises: deque[tuple[float, float]] = field(default_factory=deque)
    depths: list[deque[tuple[float, float]]] = field(default_factory=list)  # travel, sinkage
    wheel_travel: list[float] = field(default_factory=list)


class StuckMonitor:
    """Stuck warning of one rover."""

    def __init__(self, tuning: StuckTuning) -> None:
        self._tuning = tuning
        self._memory = _Memory()

    def snapshot(self) -> _Memory:
        """Return a copy of the memory."""
        m = self._memory
        return _Memory(
            m.raised,
            m.reason,
            m.clear_since,
            dict(m.since),
            m.rolling_since,
            m.cruise,
            deque(m.trend),
            m.rim_travel,
            m.last_time,
            deque(m.speeds),
            deque(m.rims),
            deque(m.cruises),
            [deque(d) for d in m.depths],
            list(m.wheel_travel),
        )

    def restore(self, memory: _Memory) -> None:
        """Go back to a snapshot."""
        self._memory = memory
        self._memory = self.snapshot()

    def update(
        self,
        time: float,
        speed: float,
        speed_known: bool,
        wheels: Sequence[WheelMotionState],
        turning: bool = False,
        margin: float = math.nan,
    ) -> StuckAssessment:
        """Judge the state at `time` [s].

        Parameters
        ----------
        time : float
            Time [s].
        speed : float
            Body speed [m/s].
        speed_known : bool
            Whether the speed rests on more than a guess: the rules that compare it with single
            wheels need it.
        wheels : sequence of WheelMotionState
            One per wheel.
        turning : bool
            The rover turns sharply: slip that comes from turning says nothing of what is ahead.
        margin : float
            Greatest pull that the soil can give beyond what is asked, over the load; nan: unknown.
        """
        memory, tuning = self._memory, self._tuning
        dt = 0.0 if memory.last_time is None else max(time - memory.last_time, 0.0)
        memory.last_time = time
        moving = [w for w in wheels if w.known]
        fastest = max((abs(w.rim_speed) for w in moving), default=0.0)
        stalled = self._stalled(time, wheels, fastest)
        driving = [w.slip for w in moving]
        # A stalled wheel offers nothing: it counts as a wheel that makes no way.
        effective = driving + [
            1.0 for w, s in zip(wheels, stalled, strict=True) if s and not w.known
        ]
        typical = median(effective) if effective else 0.0
        typical_std = median([w.slip_std for w in moving]) if moving else 1.0
        # Slip settles over the first travel after a start: its growth there says nothing.
        memory.rim_travel = memory.rim_travel + fastest * dt if moving else 0.0
        settled = memory.rim_travel > _SETTLING_TRAVEL
        growth = self._sinkage_growth(wheels, dt)
        slope = self._trend(time, typical, settled and not turning)
        # Growth that is more than the estimate's own wandering.
        sure_slope = slope - _SLOPE_DOUBT * typical_std
        slowing = self._slowing(time, fastest, wheels)

        probability = exceedance_probability(typical, typical_std, _DIGGING_SLIP)
        signs: dict[str, str] = {}
        sure = settled and typical_std < _SURE_STD
        if effective and probability > 0.5 and fastest > 0.0 and sure:
            if self._held('dig', time, tuning.dig_hold) and not slowing:
                signs['dig'] = f'median slip {typical:.2f}: digging in'
        else:
            memory.since.pop('dig', None)
        soon = typical > tuning.look_ahead_slip and (
            typical + tuning.look_ahead * sure_slope > _ENTRAPPED_SLIP
        )
        at_once = typical > tuning.sudden_slip and (
            typical + tuning.sudden_ahead * sure_slope > _ENTRAPPED_SLIP
        )
        # Without a speed the slip is half a guess: the soil must be near its limit too.
        unaided = not speed_known and margin == margin
        if unaided and margin > tuning.spare_margin:
            soon = at_once = False
        if unaided and margin < tuning.exhausted_margin and typical > tuning.exhausted_slip:
            if self._held('exhausted', time, tuning.exhausted_hold) and not slowing:
                signs['exhausted'] = f'soil gives {margin:.3f} of the load more than is asked'
        else:
            memory.since.pop('exhausted', None)
        if (soon or at_once) and typical_std < 0.2:
            if self._held('ahead', time, tuning.look_ahead_hold) and not slowing:
                signs['ahead'] = f'median slip {typical:.2f} grows by {slope:.3f} per second'
        else:
            memory.since.pop('ahead', None)
        self._held_wheels_sign(time, speed, speed_known, moving, stalled, fastest, signs)
        if turning:
            # A spin in place has turning wheels and no speed, by command.
            memory.speeds.clear()
            memory.since.pop('bog', None)
        else:
            self._bog_sign(time, speed, speed_known, wheels, moving, fastest, signs)
        self._stall_sign(time, moving, stalled, fastest, signs)
        labouring = not turning and self._labour_sign(
            time, speed if speed_known else None, wheels, moving, signs
        )

        if signs:
            if not memory.raised:
                memory.reason = next(iter(signs.values()))
            memory.raised, memory.clear_since = True, None
        elif memory.raised:
            magnitude = median([abs(s) for s in driving]) if driving else None
            if magnitude is not None and magnitude < tuning.clear_slip and not labouring:
                if memory.clear_since is None:
                    memory.clear_since = time
                elif time - memory.clear_since >= tuning.clear_time:
                    memory.raised, memory.reason, memory.clear_since = False, '', None
            else:
                memory.clear_since = None
        return self._assessment(wheels, stalled, slope, growth)

    def _assessment(
        self,
        wheels: Sequence[WheelMotionState],
        stalled: list[bool],
        slope: float,
        growth: list[float],
    ) -> StuckAssessment:
        probability, time_left, travel_left = [], [], []
        for wheel, stands, deepening in zip(wheels, stalled, growth, strict=True):
            if stands:
                p, t = 1.0, 0.0
            elif not wheel.known or wheel.slip <= 0.0:
                p, t = 0.0, _LONGEST_TIME
            else:
                ahead = wheel.slip + max(slope, 0.0) * self._tuning.horizon
                p = exceedance_probability(ahead, wheel.slip_std, _ENTRAPPED_SLIP)
                if wheel.slip >= _ENTRAPPED_SLIP:
                    t = 0.0
                elif slope > 1e-4 and wheel.slip > 0.3:
                    t = min((_ENTRAPPED_SLIP - wheel.slip) / slope, _LONGEST_TIME)
                else:
                    t = _LONGEST_TIME
            if self._memory.raised and (p > 0.5 or wheel.slip > 0.8):
                p = max(p, 0.9)
            travel = min(t * max(abs(wheel.rim_speed), 0.0), NO_ENTRAPMENT_IN_SIGHT)
            if t >= _LONGEST_TIME:
                travel = NO_ENTRAPMENT_IN_SIGHT
            if deepening > _DEEPENING and wheel.known and wheel.slip > _DEEPENING_SLIP:
                # It sinks as it turns: travel until it is in too deep for its lugs to climb out.
                room = max(_DEEP * wheel.radius - wheel.sinkage, 0.0)
                travel = min(travel, max(room / deepening, _LEAST_TRAVEL if t > 0.0 else 0.0))
            probability.append(p)
            time_left.append(t)
            travel_left.append(travel)
        return StuckAssessment(
            self._memory.raised, self._memory.reason, probability, time_left, travel_left, stalled
        )

    def _sinkage_growth(self, wheels: Sequence[WheelMotionState], dt: float) -> list[float]:
        """Return the sinkage gained per rim travel of each wheel [m/m], over its last travel."""
        memory = self._memory
        if len(memory.depths) != len(wheels):
            memory.depths = [deque() for _ in wheels]
            memory.wheel_travel = [0.0] * len(wheels)
        growth = []
        for i, wheel in enumerate(wheels):
            depths = memory.depths[i]
            memory.wheel_travel[i] += abs(wheel.rim_speed) * dt
            travel = memory.wheel_travel[i]
            if memory.rim_travel < _SETTLING_TRAVEL:
                depths.clear()  # wheels settle into their ruts after a start
            if not depths or travel - depths[-1][0] >= _GROWTH_TRAVEL / 10.0:
                depths.append((travel, wheel.sinkage))
            while travel - depths[0][0] > _GROWTH_TRAVEL:
                depths.popleft()
                if not depths:
                    depths.append((travel, wheel.sinkage))
            covered = depths[-1][0] - depths[0][0]
            growth.append(_slope(depths) if covered > 0.5 * _GROWTH_TRAVEL else 0.0)
        return growth

    def _held(self, name: str, time: float, hold: float) -> bool:
        since = self._memory.since.setdefault(name, time)
        return time - since >= hold - 1e-9

    def forget_trend(self) -> None:
        """Begin the look-ahead anew: the level of the slip was wrong, which is no growth."""
        self._memory.trend.clear()

    def _trend(self, time: float, typical: float, moving: bool) -> float:
        """Return the growth of the typical slip [1/s] over the last seconds, 0 when unknown."""
        trend = self._memory.trend
        if not moving:
            trend.clear()
            return 0.0
        if not trend or time - trend[-1][0] >= 0.2 - 1e-9:
            trend.append((time, typical))
        while trend and time - trend[0][0] > _TREND_WINDOW:
            trend.popleft()
        if len(trend) < 5 or trend[-1][0] - trend[0][0] < _SHORTEST_TREND:
            return 0.0
        return _slope(trend)

    def _stalled(
        self, time: float, wheels: Sequence[WheelMotionState], fastest: float
    ) -> list[bool]:
        """Say which wheels pull near their limit and hardly turn while another turns."""
        memory = self._memory
        # Start mask: the fastest wheel above half of its own cruise for a second. It rests on rim
        # speed alone, so that no unaided body speed decides.
        memory.cruise = max(fastest, 0.999 * memory.cruise)
        if fastest > 0.5 * memory.cruise and fastest > 0.0:
            if memory.rolling_since is None:
                memory.rolling_since = time
        elif fastest < 0.2 * memory.cruise:
            memory.rolling_since = None
        masked = memory.rolling_since is None or time - memory.rolling_since < 1.0
        if masked:
            return [False] * len(wheels)
        return [
            w.torque_share >= self._tuning.stall_torque
            and abs(w.rim_speed) < self._tuning.stall_ratio * fastest
            for w in wheels
        ]

    def _slowing(self, time: float, fastest: float, wheels: Sequence[WheelMotionState]) -> bool:
        """Say whether the wheels are being stopped: a rover that is told to stop is not stuck.

        A late or early reference then shows slip that is none. Wheels near their torque limit are
        held by the soil instead.
        """
        rims = self._memory.rims
        rims.append((time, fastest))
        while time - rims[0][0] > _STOPPING_WINDOW:
            rims.popleft()
        strained = sum(w.torque_share > self._tuning.bog_torque for w in wheels)
        return strained < 2 and fastest < _STOPPING_SHARE * max(rim for _, rim in rims)

    def _held_wheels_sign(
        self,
        time: float,
        speed: float,
        speed_known: bool,
        moving: Sequence[WheelMotionState],
        stalled: list[bool],
        fastest: float,
        signs: dict[str, str],
    ) -> None:
        tuning, memory = self._tuning, self._memory
        held = False
        if speed_known and fastest > 0.0 and memory.rolling_since is not None and moving:
            direction = 1.0 if max(moving, key=lambda w: abs(w.rim_speed)).rim_speed > 0 else -1.0
            lost = 1.0 - direction * speed / fastest
            bad = sum(
                1
                for w in moving
                if w.slip > tuning.held_slip or abs(w.rim_speed) < tuning.stall_ratio * fastest
            ) + (len(stalled) - len(moving))
            held = lost > tuning.held_slip and 2 * bad >= len(stalled) and any(stalled)
        if held:
            if self._held('held', time, tuning.held_hold):
                signs['held'] = f'{lost:.0%} of the fastest rim speed lost, others held'
        else:
            memory.since.pop('held', None)

    def _bog_sign(
        self,
        time: float,
        speed: float,
        speed_known: bool,
        wheels: Sequence[WheelMotionState],
        moving: Sequence[WheelMotionState],
        fastest: float,
        signs: dict[str, str],
    ) -> None:
        tuning, memory = self._tuning, self._memory
        speeds = memory.speeds
        speeds.append((time, speed))
        while time - speeds[0][0] > _BOG_WINDOW + 1e-6:
            speeds.popleft()
        bogging, left = False, 0.0
        # Two wheels or more: one alone may stand against a stone.
        if _second_strongest(wheels) > tuning.bog_torque and moving and fastest > 0.0:
            direction = 1.0 if max(moving, key=lambda w: abs(w.rim_speed)).rim_speed > 0 else -1.0
            ahead = direction * speed
            loss = -direction * _slope(speeds)
            if speed_known:
                # Less what fixes that disagree by chance make of it.
                spread = median([w.slip_std for w in moving]) * fastest
                loss -= _LOSS_DOUBT * spread / _BOG_WINDOW
            left = max(ahead, 0.0) / loss if loss > 1e-6 else math.inf
            bogging = 1.0 - ahead / fastest > tuning.bog_slip and left < tuning.bog_time
            bogging = bogging and memory.rolling_since is not None
        if bogging:
            if self._held('bog', time, tuning.bog_hold):
                signs['bog'] = (
                    f'bogging down: stands in {left:.1f} s, wheels near their torque limit'
                )
        else:
            memory.since.pop('bog', None)

    def _labour_sign(
        self,
        time: float,
        speed: float | None,
        wheels: Sequence[WheelMotionState],
        moving: Sequence[WheelMotionState],
        signs: dict[str, str],
    ) -> bool:
        """Judge drives that give way; say whether the soil holds them back now."""
        tuning, memory = self._tuning, self._memory
        cruise = memory.cruises
        rims = [abs(w.rim_speed) for w in moving]
        typical, fastest = (median(rims), max(rims)) if rims else (0.0, 0.0)
        cruise.append((time, typical))
        while time - cruise[0][0] > _CRUISE_WINDOW:
            cruise.popleft()
        # Two wheels near their limit and slower than the fastest, the rover slower still.
        held_back = (
            _second_strongest(wheels) >= tuning.labour_torque
            and typical < tuning.labour_ratio * fastest
            and (speed is None or 1.0 - abs(speed) / fastest > tuning.bog_slip)
        )
        slowed = typical < tuning.labour_ratio * max(rim for _, rim in cruise)
        started = memory.rolling_since is not None and time - memory.rolling_since >= 1.0
        if held_back and slowed and started:
            if self._held('labour', time, tuning.labour_hold):
                signs['labour'] = f'wheels slowed to {typical:.2f} m/s near their torque limit'
        else:
            memory.since.pop('labour', None)
        return held_back

    def _stall_sign(
        self,
        time: float,
        moving: Sequence[WheelMotionState],
        stalled: list[bool],
        fastest: float,
        signs: dict[str, str],
    ) -> None:
        count = sum(stalled)
        if count >= 2 and 2 * count >= len(stalled):
            if self._held('stall', time, self._tuning.stall_hold):
                signs['stall'] = f'{count} wheels stalled near their torque limit'
        else:
            self._memory.since.pop('stall', None)


def _second_strongest(wheels: Sequence[WheelMotionState]) -> float:
    """Return the second greatest share of the torque limit [-]; 0 where fewer are known."""
    shares = sorted(w.torque_share for w in wheels if w.torque_share >= 0.0)
    return shares[-2] if len(shares) > 1 else 0.0


def _slope(samples: Sequence[tuple[float, float]] | deque[tuple[float, float]]) -> float:
    """Return the least-squares slope of values over time, 0 for too few."""
    n = len(samples)
    if n < 5:
        return 0.0
    t_mean = math.fsum(t for t, _ in samples) / n
    s_mean = math.fsum(s for _, s in samples) / n
    spread = math.fsum((t - t_mean) ** 2 for t, _ in samples)
    return math.fsum((t - t_mean) * (s - s_mean) for t, s in samples) / max(spread, 1e-12)
