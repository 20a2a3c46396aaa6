# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Learns how far wheel odometry and IMU lag behind one another, by stamps and order of arrival.

Where one of them is always late, waiting for it is cheaper than repeating steps for each of its
messages. A lag of a few milliseconds is not waited for: to repeat one step costs less than to delay
all outputs. Where wheel odometry of one stamp comes in several messages, the next stamp is awaited.

Both also give the time of the run; while both are silent other topics advance it, less the lead of
their clock.
"""

from __future__ import annotations

from collections import defaultdict, deque

from wheel_terra_estimator.estimation.timing.input_checks import INERTIAL, WHEEL_ODOMETRY

LONGEST_HOLD = 500_000_000
"""Inputs are held back this long at most [ns]."""
SHORTEST_HOLD = 20_000_000
"""A lag below this [ns] is not waited for."""

_MEMORY = 64  # messages of a channel
_SHARE = 0.95  # of the messages that the learned lag covers
_LEARN_EVERY = 8  # messages, once the memory is half full
_MARGIN = 1.05  # learned lag over the observed one
_LEADS = 4  # messages of another topic; the least of their leads is that of its clock
_CLOCKS_AGREE = 200_000_000  # a lead below this [ns] is no difference of clocks
_IN_PARTS = 0.25
"""Share of repeated stamps above which one stamp comes in several messages."""


class LagLearner:
    """Lag of each of the two channels, and how long to hold inputs back.

    `fixed` is a stated time to hold them [ns], below 0: as learned; it may be changed. `learned` is
    the lag of each channel [ns], `present` the time of the run [ns].
    """

    def __init__(self, fixed: int) -> None:
        self.fixed = fixed
        self._lags = {c: deque[int](maxlen=_MEMORY) for c in (WHEEL_ODOMETRY, INERTIAL)}
        self._counts = dict.fromkeys(self._lags, 0)
        self._repeats = deque[bool](maxlen=_MEMORY)
        self._odometry: int | None = None  # last stamp of it
        self._newest: int | None = None  # stamp of either channel
        self._gap = 0  # between the last two of these
        self._leads = defaultdict[int, deque[int]](lambda: deque(maxlen=_LEADS))
        self._led: set[int] = set()  # other channels that were received since then
        self.present: int | None = None
        self._first: int | None = None
        self.learned = dict.fromkeys(self._lags, 0)

    @property
    def longest(self) -> int:
        """How long inputs may be held back at most [ns]."""
        return LONGEST_HOLD if self.fixed < 0 else self.fixed

    @property
    def clock_offsets(self) -> dict[int, int]:
        """Channels whose stamps are too far off to be waited for -> by how much [ns].

        Positive: ahead of wheel odometry and IMU; negative: one of these two behind the other.
        """
        ahead = {c: min(each) for c, each in self._leads.items() if len(each) == _LEADS}
        behind = {c: min(each) for c, each in self._lags.items() if len(each) == _MEMORY}
        return {c: by for c, by in ahead.items() if by > LONGEST_HOLD + self._gap} | {
            c: -by for c, by in behind.items() if by > LONGEST_HOLD
        }

    def begin_run(self) -> None:
        """Forget the time, not the lags: they belong to the transport."""
        self._newest = self._first = self.present = self._odometry = None
        self._led.clear()

    def note(self, channel: int, stamp: int, *, whole: bool = True) -> None:
        """Take the stamp [ns] of an accepted message; not `whole`: it holds some wheels only."""
        if self._first is None:
            self._first = stamp
        lags, present = self._lags.get(channel), stamp
        if lags is None:
            leads = self._leads[channel]
            if self._newest is not None and channel not in self._led:
                self._led.add(channel)
                leads.append(stamp - self._newest)
            # With a stated lag a second message is needed before a clock counts as ahead.
            if len(leads) > (self.fixed >= 0) and min(leads) > _CLOCKS_AGREE:
                present = stamp - min(leads)
        self.present = present if self.present is None else max(self.present, present)
        if lags is None:
            return
        self._led.clear()
        if channel == WHEEL_ODOMETRY:
            self._repeats.append(stamp == self._odometry and not whole)
            self._odometry = stamp
        newest = self._newest
        if newest is not None and stamp > newest:
            self._gap = stamp - newest
        self._newest = stamp if newest is None else max(newest, stamp)
        lags.append(0 if newest is None else max(newest - stamp, 0))
        self._counts[channel] += 1
        if len(lags) < _MEMORY // 2 or self._counts[channel] % _LEARN_EVERY == 0:
            usual = sorted(lags)[int(_SHARE * (len(lags) - 1) + 0.5)]
            self.learned[channel] = 0 if usual < SHORTEST_HOLD else round(_MARGIN * usual)

    def hold(self) -> int:
        """Return how long inputs are held back now [ns]."""
        if self.fixed >= 0:
            return self.fixed
        if (
            self._odometry is None
            and self._first is not None
            and self.present is not None
            and self.present - self._first < 2 * LONGEST_HOLD
        ):
            return LONGEST_HOLD  # wheel odometry may still be on its way
        in_parts = sum(self._repeats) > _IN_PARTS * len(self._repeats)
        return min(max(*self.learned.values(), int(in_parts)), LONGEST_HOLD)
