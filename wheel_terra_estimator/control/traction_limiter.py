# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Traction limiter: the share of a velocity command that passes, as a state machine without ROS.

``docs/limiter.md`` is its specification: `INTERLOCK` is its table of states and events, `decide`
its table of commands. Each function takes a `LimiterState`, a time of a steady clock [s] and an
input, and returns the next state; there is no other memory.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from statistics import median
from types import MappingProxyType
from typing import NamedTuple

from wheel_terra_estimator.control.traction_law import LimiterTuning, traction_scale
from wheel_terra_estimator.estimation.estimates import NO_ENTRAPMENT_IN_SIGHT, SlipClass

Velocity = tuple[float, float, float, float, float, float]
"""Command: linear x, y, z [m/s], angular x, y, z [rad/s]."""
ZERO: Velocity = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

RELEASE_TIME = 10.0  # [s] for which ``~/release`` opens a crawl
OUT_TIME = 3.0  # [s] of motion out that ends a stop, as ``filter.stuck_clear_time``
TURN_BACK_TIME = 1.0  # [s] at standstill between two ways out where the direction is unknown
REST_TIME = 0.5  # [s] without motion that count as rest, as in the estimator
REST_SPEED = 0.002  # [m/s], as ``rest_speed`` of the estimator
LONGEST_DELAY = 60.0  # [s] of a set behind its stamp; with more the two clocks disagree
CLOCK_JITTER = 0.1  # [s] of a clock against the steady one
COMMAND_TIMEOUT = 2.0  # [s] without a command after which the rover is taken to stand
LONGEST_STEP = 0.2  # [s] between two commands that counts for the ramp
SAME_WAY = 0.75  # share of the rim speeds that must agree for a direction [-]
LEAST_SLIP = 1e-3  # slip below which slip velocity over slip gives no speed [-]


class Interlock(Enum):
    """State of the interlock."""

    FREE = 'free'
    STOPPED = 'stopped'  # by too little rim travel left
    STUCK = 'stuck'  # ``~/stuck`` stands


class Event(Enum):
    """What changes the state of the interlock."""

    STOP = 'rim travel left is too little'
    STUCK = '~/stuck rises'
    CLEARED = '~/stuck falls, or ~/reset'
    BEGUN = 'an estimator begins without ~/stuck'
    OUT = 'moved out'
    RELEASE = '~/release'


_FREE, _STOPPED, _STUCK = Interlock.FREE, Interlock.STOPPED, Interlock.STUCK
INTERLOCK: Mapping[Event, dict[Interlock, Interlock]] = MappingProxyType(
    {
        Event.STOP: {_FREE: _STOPPED, _STOPPED: _STOPPED, _STUCK: _STUCK},
        Event.STUCK: {_FREE: _STUCK, _STOPPED: _STUCK, _STUCK: _STUCK},
        Event.CLEARED: {_FREE: _FREE, _STOPPED: _FREE, _STUCK: _FREE},
        Event.BEGUN: {_FREE: _FREE, _STOPPED: _STOPPED, _STUCK: _STOPPED},
        Event.OUT: {_FREE: _FREE, _STOPPED: _FREE, _STUCK: _STUCK},
        Event.RELEASE: {_FREE: _FREE, _STOPPED: _FREE, _STUCK: _STUCK},
    }
)
"""The next state of the interlock, by event and state."""


class Estimates(NamedTuple):
    """One set of estimates, per wheel, and by how much the clock is ahead of its stamp [s]."""

    delay: float
    slip: Sequence[float]  # [-]
    slip_velocity: Sequence[float]  # [m/s]
    slip_class: Sequence[int]
    rim_travel_left: Sequence[float]  # [m]


class Wheel(NamedTuple):
    """Last known estimates of a wheel, `at` a time [s] by their stamp, minus infinity: never."""

    slip: float = 0.0
    travel: float = NO_ENTRAPMENT_IN_SIGHT
    at: float = -math.inf


class Decision(NamedTuple):
    """Share of a command that passes, the state in one or two words, and the reason."""

    scale: float
    state: str
    reason: str


NOTHING_KNOWN = Decision(1.0, 'no estimate', 'no estimate yet')


@dataclass(frozen=True)
class LimiterState:
    """Memory of the limiter; times are of a steady clock [s]."""

    interlock: Interlock = Interlock.FREE
    direction: int = 0  # that led in: 1 forward, -1 backward, 0 both or unknown
    reason: str = ''  # why it is not free
    stuck_direction: int = 0  # ``~/stuck_direction`` as last received
    released_until: float = -math.inf  # a crawl passes by ``~/release``
    out: tuple[float, float] | None = None  # since and until when the rover moves out
    wheels: tuple[Wheel, ...] = ()
    judgement: Decision = NOTHING_KNOWN  # of the last set
    judged_at: float = -math.inf  # when that came
    delay: float = 0.0  # by how much the clock was ahead of its stamp then
    clock_offset: float | None = None  # of the clock to the stamps, where the two disagree
    known_since_start: bool = True  # a class, since the rover last pulled away
    started_at: float | None = None  # when it did; None: not since it stood
    sent: Velocity = ZERO  # what went out last
    sent_at: float = -math.inf
    still_since: float = 0.0  # nothing goes out
    last_direction: int = 0  # of the last motion that went out, 0 = none yet


# -- Inputs ---------------------------------------------------------------------------------------


def after_event(
    state: LimiterState, event: Event, direction: int = 0, reason: str = ''
) -> LimiterState:
    """Return the state after an event of the interlock, as its table says.

    `direction` and `reason` are of an event that closes it; a known direction is not replaced by an
    unknown one.
    """
    following = INTERLOCK[event][state.interlock]
    if event is Event.STUCK and state.interlock is not Interlock.STUCK:
        state = replace(state, released_until=-math.inf)  # a release does not cover this
    if following is Interlock.FREE:
        return replace(state, interlock=following, direction=0, reason='', out=None)
    if event in (Event.STOP, Event.STUCK):
        known = event is Event.STOP and state.interlock is not Interlock.FREE
        direction = state.direction if known else direction or state.direction
        reason = state.reason if known else reason
        return replace(state, interlock=following, direction=direction, reason=reason, out=None)
    return replace(state, interlock=following)


def after_stuck(state: LimiterState, stuck: bool, *, change: bool) -> LimiterState:
    """Return the state after ``~/stuck``.

    `change`: the same estimator had sent it before, so that False means cleared or reset; the first
    one of a new estimator does not.
    """
    if stuck:
        return after_event(state, Event.STUCK, state.stuck_direction, 'stuck')
    return after_event(state, Event.CLEARED if change else Event.BEGUN)


def after_direction(state: LimiterState, direction: int) -> LimiterState:
    """Return the state after ``~/stuck_direction``, which comes shortly before or after it."""
    direction = _sign(direction)  # whatever its publisher sends
    state = replace(state, stuck_direction=direction)
    if direction and state.interlock is Interlock.STUCK:
        return replace(state, direction=direction)
    return state


def after_release(state: LimiterState, now: float) -> tuple[LimiterState, str]:
    """Return the state after ``~/release``, and a message on its effect."""
    if state.interlock is Interlock.FREE:
        return state, 'nothing to release'
    released = after_event(state, Event.RELEASE)
    what = 'released' if released.interlock is Interlock.FREE else 'still stuck'
    words = (
        f'{what} ({state.reason}): crawling is allowed in every direction for {RELEASE_TIME:.0f} s'
    )
    return replace(released, released_until=now + RELEASE_TIME), words


def after_estimates(
    state: LimiterState, now: float, estimates: Estimates, tuning: LimiterTuning
) -> LimiterState:
    """Return the state after a set of estimates.

    A set whose arrays differ in length is not used. One that is too old can only lower the scale or
    stop, but its slips and rim travels left are kept.
    """
    count = len(estimates.slip_class)
    if not count == len(estimates.slip) == len(estimates.rim_travel_left):
        return state
    known = [
        grade != SlipClass.UNKNOWN and math.isfinite(slip) and math.isfinite(travel)
        for grade, slip, travel in zip(
            estimates.slip_class, estimates.slip, estimates.rim_travel_left, strict=True
        )
    ]
    offset = _clock_offset(state, now, estimates.delay, tuning)
    state = replace(state, judged_at=now, delay=estimates.delay, clock_offset=offset)
    at = now - _late(state)
    before = state.wheels if len(state.wheels) == count else (Wheel(),) * count
    wheels = [
        Wheel(estimates.slip[i], estimates.rim_travel_left[i], at) if known[i] else wheel
        for i, wheel in enumerate(before)
    ]
    state = replace(state, wheels=tuple(wheels))
    fresh = is_fresh(state, now, tuning)
    if not any(known):
        return _after_unknown(state, now, estimates, tuning) if fresh else state
    slips = _counted_slips(state, known, now, tuning)
    travels = [wheel.travel for wheel in wheels if wheel.at > -math.inf]
    scale, reason = traction_scale(slips, travels, tuning)
    judgement = Decision(scale or tuning.creep_scale, reason.partition(':')[0], reason)
    if fresh:
        state = replace(state, known_since_start=True, judgement=judgement)
    elif judgement.scale < state.judgement.scale:
        state = replace(state, judgement=judgement)
    if scale > 0.0:
        return _after_motion(state, now, estimates, known, tuning) if fresh else state
    if now < state.released_until:
        return replace(state, out=None)
    direction = _direction(estimates, known) or _sign(state.sent[0])
    return after_event(state, Event.STOP, direction, reason)


# -- Commands -------------------------------------------------------------------------------------


def decide(state: LimiterState, now: float, command: Velocity, tuning: LimiterTuning) -> Decision:
    """Return the decision on a command that comes now, by the first line that applies."""
    if command == ZERO:
        return Decision(1.0, 'zero', 'zero command: passes')
    free = state.interlock is Interlock.FREE
    if now < state.released_until:
        share = min(tuning.creep_scale, _decide_free(state, now, tuning).scale if free else 1.0)
        left = state.released_until - now
        return Decision(
            share, 'released', f'~/release: crawl at {share:.2f} for another {left:.0f} s'
        )
    if free:
        return _decide_free(state, now, tuning)
    return _decide_closed(state, now, _sign(command[0]), tuning)


def after_command(
    state: LimiterState, now: float, command: Velocity, tuning: LimiterTuning
) -> tuple[LimiterState, Decision]:
    """Return the state after a command, whose `sent` goes out, and the decision.

    A reduction goes out at once, an increase with the greatest acceleration; nan or infinity is a
    stop.
    """
    if not all(map(math.isfinite, command)):
        command = ZERO
    decision = decide(state, now, command, tuning)
    still = _still_time(state, now)
    silent = now - state.sent_at > COMMAND_TIMEOUT
    before, elapsed = (ZERO, 0.0) if silent else (state.sent, now - state.sent_at)
    sent = _ramped(before, command, decision.scale, min(elapsed, LONGEST_STEP), tuning)
    moves = sent != ZERO
    starts = moves and state.started_at is None
    state = replace(
        state,
        sent=sent,
        sent_at=now,
        still_since=now if moves else now - still,
        last_direction=_sign(sent[0]) or state.last_direction,
        started_at=now if starts else state.started_at,
        known_since_start=state.known_since_start and not starts,
    )
    return state, decision


def is_fresh(state: LimiterState, now: float, tuning: LimiterTuning) -> bool:
    """Return whether the last set of estimates is trusted: by its stamp, and by its arrival."""
    return estimate_age(state, now) <= tuning.stale_after


def estimate_age(state: LimiterState, now: float) -> float:
    """Return the age of the last set [s], infinite where there never was one."""
    return now - state.judged_at + _late(state)


# -- Helpers --------------------------------------------------------------------------------------


def _clock_offset(
    state: LimiterState, now: float, delay: float, tuning: LimiterTuning
) -> float | None:
    """Return the clock less the stamp of a set that is not late; None where the clocks agree.

    Where they do not, that is the least since either of them stepped.
    """
    if -tuning.stale_after <= delay <= LONGEST_DELAY:
        return None
    elapsed = now - state.judged_at
    stepped = delay - state.delay > elapsed + CLOCK_JITTER
    agreed = state.clock_offset is None and math.isfinite(elapsed)
    if agreed and delay > 0.0 and not stepped:
        return None  # the topic ended or is late; no clock stepped
    return delay if state.clock_offset is None or stepped else min(state.clock_offset, delay)


def _late(state: LimiterState) -> float:
    """Return the age of the last set when it came [s]."""
    return max(state.delay - (state.clock_offset or 0.0), 0.0)


def _counted_slips(
    state: LimiterState, known: Sequence[bool], now: float, tuning: LimiterTuning
) -> list[float]:
    """Return the slip that counts of each wheel: a fresh one, else at least the critical one.

    A wheel without a known slip since the last rest counts only after the start.
    """
    counted = []
    for wheel, is_known in zip(state.wheels, known, strict=True):
        if is_known or now - wheel.at <= tuning.stale_after:
            counted.append(wheel.slip)
        elif wheel.at > -math.inf or not _is_starting(state, now, tuning):
            counted.append(max(wheel.slip, tuning.critical_slip))
    return counted


def _after_unknown(
    state: LimiterState, now: float, estimates: Estimates, tuning: LimiterTuning
) -> LimiterState:
    """Return the state after a set without any known class: rest, a start, or unknown slip."""
    state = replace(state, out=None)
    # Wheels whose rates are missing keep an old slip velocity and are left out.
    latest = max((wheel.at for wheel in state.wheels), default=-math.inf)
    slowly = all(
        abs(speed) <= REST_SPEED
        for wheel, speed in zip(state.wheels, estimates.slip_velocity, strict=True)
        if not latest - wheel.at > tuning.stale_after  # all of them while none was ever known
    )
    if slowly and _still_time(state, now) >= REST_TIME and state.known_since_start:
        start = Decision(1.0, 'starting', 'slip unknown at rest: command passes')
        wheels = (Wheel(),) * len(state.wheels)
        return replace(state, judgement=start, started_at=None, wheels=wheels)
    if state.judgement.state == 'starting' and _is_starting(state, now, tuning):
        return state
    if any(now - wheel.at <= tuning.stale_after for wheel in state.wheels):
        return state  # the last known classes count on
    scale = min(tuning.stale_scale, state.judgement.scale)
    words = f'slip of all wheels unknown: cut to {scale:.2f}'
    return replace(state, judgement=Decision(scale, 'unknown', words))


def _is_starting(state: LimiterState, now: float, tuning: LimiterTuning) -> bool:
    return state.started_at is None or now - state.started_at <= tuning.stale_after


def _after_motion(
    state: LimiterState,
    now: float,
    estimates: Estimates,
    known: Sequence[bool],
    tuning: LimiterTuning,
) -> LimiterState:
    """Return the state after a set in motion that is no reason to stop: moving out, or not."""
    slips = [abs(s) for s, k in zip(estimates.slip, known, strict=True) if k]
    moving = _direction(estimates, known)
    if moving in (0, state.direction) or median(slips) >= tuning.critical_slip:
        return replace(state, out=None)
    since, seen = state.out or (now, now)
    if now - seen > tuning.stale_after:
        since = now
    state = replace(state, out=(since, now))
    return after_event(state, Event.OUT) if now - since >= OUT_TIME else state


def _direction(estimates: Estimates, known: Sequence[bool]) -> int:
    """Return the direction of the rims: 1 forward, -1 backward, 0 both or none.

    Slip velocity over slip is the greater of rim and ground speed, with its sign.
    """
    forward = backward = 0.0
    for slip, velocity, k in zip(estimates.slip, estimates.slip_velocity, known, strict=False):
        if k and abs(slip) > LEAST_SLIP:
            forward += max(velocity / slip, 0.0)
            backward += max(-velocity / slip, 0.0)
    least = SAME_WAY * (forward + backward)
    return int(forward > least) - int(backward > least)


def _decide_free(state: LimiterState, now: float, tuning: LimiterTuning) -> Decision:
    if is_fresh(state, now, tuning):
        return state.judgement
    scale = min(tuning.stale_scale, state.judgement.scale)
    come = now - state.judged_at <= tuning.stale_after
    old = f' (they arrive {_late(state):.1f} s old)' if come else ''
    words = f'no fresh estimate{old}: cut to {scale:.2f}'
    return Decision(scale, 'no estimate', words)


def _decide_closed(
    state: LimiterState, now: float, forward: int, tuning: LimiterTuning
) -> Decision:
    share = tuning.creep_scale
    if state.direction == 0:
        turned = state.last_direction * forward < 0 and _still_time(state, now) < TURN_BACK_TIME
        if not turned:
            return Decision(share, 'backing out', f'direction unknown: crawl at {share:.2f}')
        words = (
            f'direction unknown: reversing is allowed after {TURN_BACK_TIME:.0f} s at standstill'
        )
        return Decision(0.0, state.interlock.value, words)
    if forward != state.direction:
        return Decision(share, 'backing out', f'backing out at {share:.2f} ({state.reason})')
    way = 'forward' if forward > 0 else 'backward'
    words = (
        f'{state.reason}: no driving {way}; back out, call ~/release, or ~/reset of the estimator'
    )
    return Decision(0.0, state.interlock.value, words)


def _still_time(state: LimiterState, now: float) -> float:
    """Return for how long the rover has been commanded to stand [s]."""
    if state.sent == ZERO:
        return now - state.still_since
    return max(now - state.sent_at - COMMAND_TIMEOUT, 0.0)


def _ramped(
    before: Velocity, command: Velocity, scale: float, elapsed: float, tuning: LimiterTuning
) -> Velocity:
    """Return what goes out [m/s, rad/s]: a reduction at once, an increase as a ramp.

    All components rise by the same share of their increase, so that the curvature is kept.
    """
    limits = (tuning.max_acceleration,) * 3 + (tuning.max_angular_acceleration,) * 3
    target = [scale * component for component in command]
    base = [
        math.copysign(min(abs(b), abs(t)), t) if b * t > 0.0 else 0.0
        for b, t in zip(before, target, strict=True)
    ]
    part = 1.0
    for b, t, limit in zip(base, target, limits, strict=True):
        if abs(t - b) > limit * elapsed:
            part = min(part, limit * elapsed / abs(t - b))
    x, y, z, wx, wy, wz = (b + part * (t - b) for b, t in zip(base, target, strict=True))
    return (x, y, z, wx, wy, wz)


def _sign(value: float) -> int:
    return int(value > 0.0) - int(value < 0.0)
