# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Distinguishes a stray stamp from a step of the clock, by stamps and their order of arrival alone.

A message that is late, resent or wrongly stamped must not end a run. A step of the clock (a looped
bag, a simulation that was reset, a corrected system clock) shifts all topics. So a message far off
the present time line is held until a second one confirms it, or until the old time line goes on.
Wheel odometry keeps the time: other topics move it only while wheel odometry is silent.
"""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

from wheel_terra_estimator.estimation.measurements import Measurement
from wheel_terra_estimator.estimation.timing.input_checks import WHEEL_ODOMETRY

PROVING_MESSAGES = 5
"""Messages of wheel odometry that prove a step though other topics stay on the old time line."""

MOST_HELD = 1000
"""Messages that are held at most, so that a stuck clock cannot fill the memory."""


class Suspicion(Enum):
    """On which side of the time line a stamp does not fit."""

    BEHIND = 'behind'
    AHEAD = 'ahead'


class Arrival(NamedTuple):
    """A measurement and its channel."""

    channel: int
    measurement: Measurement


class Judgement(NamedTuple):
    """What to do after a message came."""

    accepted: list[Arrival]  # to be used, in this order
    stepped_back: bool = False  # the run has ended; `accepted` belongs to the new one
    strays: tuple[tuple[Suspicion, Arrival], ...] = ()
    """Held before and now known not to fit; those behind may still be late inputs."""


class ClockWatch:
    """Watches the stamps of one run."""

    def __init__(self, channels: int, clock_step: int, max_lag: int, history: int) -> None:
        self.retune(clock_step, max_lag, history)
        self._channels = channels
        self.reset()

    def reset(self) -> None:
        """Forget all messages."""
        self._newest_of: list[int | None] = [None] * self._channels
        self._held: list[Arrival] = []
        self._suspicion = Suspicion.BEHIND
        self._odometry_held = 0
        self._odometry_suspicion: Suspicion | None = None
        self._odometry_held_from = 0, 0  # stamp of the first of them, and the time of the run then

    def retune(self, clock_step: int, max_lag: int, history: int) -> None:
        """Go on with other limits [ns].

        A stamp more than `clock_step` before the newest of its channel does not fit; disorder up to
        `max_lag` is never taken for a step. Late inputs are used up to `history` back; a message
        further ahead than that would push the others out of use, so it does not fit either.
        """
        self._clock_step = max(clock_step, max_lag)
        self._reach = max(history, self._clock_step)
        self._reach_back = max(history + max_lag, clock_step)

    def judge(self, channel: int, measurement: Measurement, present: int | None) -> Judgement:
        """Return what to do with a message, and with those held before it.

        `present` is the time of the run [ns], None before it begins.
        """
        stamp = measurement.stamp
        arrival = Arrival(channel, measurement)
        suspicion = self._suspect(channel, stamp, present)
        if suspicion is None:
            strays = self._drop_held() if self._held else ()
            self._accept(arrival)
            return Judgement([arrival], strays=strays)
        strays = ()
        held = self._held
        if held and (
            suspicion is not self._suspicion
            or abs(stamp - held[-1].measurement.stamp) > self._reach_back
        ):
            strays = self._drop_held()
        self._held.append(arrival)
        self._suspicion = suspicion
        if channel == WHEEL_ODOMETRY:
            if suspicion is not self._odometry_suspicion:
                self._odometry_suspicion = suspicion
                self._odometry_held, self._odometry_held_from = 0, (stamp, present or 0)
            self._odometry_held += 1
        if not self._confirmed(present or 0):
            return Judgement([], strays=strays)
        accepted = self.release()
        return Judgement(accepted, suspicion is Suspicion.BEHIND, strays)

    def release(self) -> list[Arrival]:
        """Return the messages that are held and take them as the time line from here on."""
        accepted, self._held = self._held, []
        if accepted and self._suspicion is Suspicion.BEHIND:
            self._newest_of = [None] * len(self._newest_of)
        for arrival in accepted:
            self._accept(arrival)
        return accepted

    def finish(self) -> Judgement:
        """Return what to do with what is still held at the end of the data."""
        if self._suspicion is Suspicion.AHEAD:
            return Judgement(self.release())
        return Judgement([], strays=self._drop_held())

    def _suspect(self, channel: int, stamp: int, present: int | None) -> Suspicion | None:
        """Return how a stamp does not fit the time line; None: it fits."""
        if present is None:
            return None
        own = self._newest_of[channel]
        if own is not None and stamp < own - self._clock_step:
            return Suspicion.BEHIND
        reach = self._reach if channel == WHEEL_ODOMETRY else self._reach_back
        if (own is None or channel == WHEEL_ODOMETRY) and stamp < present - reach:
            return Suspicion.BEHIND
        if stamp > present + self._reach and any(
            other is not None for i, other in enumerate(self._newest_of) if i != channel
        ):
            return Suspicion.AHEAD
        return None

    def _confirmed(self, present: int) -> bool:
        """Return whether the held messages prove a step of the clock."""
        channels = [arrival.channel for arrival in self._held]
        odometry, own = WHEEL_ODOMETRY in channels, self._newest_of[WHEEL_ODOMETRY]
        stamps = [a.measurement.stamp for a in self._held if a.channel == channels[-1]]
        first, then = self._odometry_held_from
        # Wheel odometry that has only fallen behind (a late burst) will catch up.
        late = self._suspicion is Suspicion.BEHIND and own is not None and first >= own
        astray = self._odometry_held >= PROVING_MESSAGES
        return (
            (not late and odometry and len(channels) > 1)
            # Another topic alone for so long that wheel odometry would have arrived.
            or (not late and stamps[-1] - stamps[0] > 3 * self._clock_step)
            or len(channels) >= MOST_HELD
            # Where wheel odometry and another topic have different clocks for good, it prevails.
            or (astray and (not late or 2 * (present - then) > stamps[-1] - first))
        )

    def _accept(self, arrival: Arrival) -> None:
        channel, stamp = arrival.channel, arrival.measurement.stamp
        if channel == WHEEL_ODOMETRY:
            self._odometry_held, self._odometry_suspicion = 0, None
        own = self._newest_of[channel]
        if own is None or stamp > own:
            self._newest_of[channel] = stamp

    def _drop_held(self) -> tuple[tuple[Suspicion, Arrival], ...]:
        strays = tuple((self._suspicion, arrival) for arrival in self._held)
        self._held = []
        return strays
