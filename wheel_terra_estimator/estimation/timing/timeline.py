# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Releases inputs in the order of their stamps, and decides which sets of estimates are due.

The estimates of a stamp are by definition those of a run through all inputs from the start of the
run to that stamp. The timeline decides when an input is released, when a set is due, and what
becomes of late inputs. It runs nothing itself: its caller runs the log up to each due set, so that
any number of late inputs between two sets costs one run.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from enum import Enum
from typing import NamedTuple

from wheel_terra_estimator.estimation.measurements import Measurement
from wheel_terra_estimator.estimation.scalars import SECOND
from wheel_terra_estimator.estimation.timing.input_checks import WHEEL_ODOMETRY
from wheel_terra_estimator.estimation.timing.input_log import InputLog
from wheel_terra_estimator.estimation.timing.step_grid import TimeSettings

GREATEST_LENGTH = 100_000
"""Inputs that the log holds at most, so that no publisher can fill the memory."""
ALLOWANCE = 2.0  # [s] over which an unused rate of repeated steps accumulates


class Fate(Enum):
    """What became of an input."""

    IN_ORDER = 'in order'
    LATE = 'late'  # older than the state, fused at its own stamp
    DEFERRED = 'deferred'  # late, waits until the rate of repeated steps allows it
    TOO_OLD = 'too old'
    FULL = 'no room'


class Due(NamedTuple):
    """A set that is due; the caller must run the log up to it before it asks for the next one."""

    entry: int  # index in the log
    stamp: int  # [ns]
    silent: bool  # no wheel odometry for `TimeSettings.silence`


class Timeline:
    """Release of the inputs of successive runs, and the sets that are due.

    ``log.entries[:released]`` may be used.
    """

    def __init__(self, log: InputLog, settings: TimeSettings) -> None:
        self.settings = settings
        self._log = log
        self.counts = {
            'runs': 0,
            'filter_restarts': 0,
            'late_inputs_deferred': 0,
            'late_inputs_dropped': 0,
        }
        self._clear()

    def _clear(self) -> None:
        self.released = 0
        self._state: int | None = None  # newest released stamp
        self._last_set: int | None = None
        self._odometry: int | None = None  # newest released stamp of wheel odometry
        self._intervals = 0, 0  # the last two between such stamps [ns]
        self._heartbeats = 0  # sets of the present silence
        self._overdue = 0  # lag of wheel odometry beyond what is waited for [ns]
        self._deferred: list[tuple[int, Measurement]] = []
        self._newest: int | None = None
        self._allowance = self.settings.rerun_rate * ALLOWANCE  # steps that may be repeated now

    def end_run(self, *, keep_soil: bool) -> None:
        """Let the next input begin a new run; soil and biases kept or reset."""
        self._log.clear(keep_soil=keep_soil)
        self._clear()

    def retune(self, settings: TimeSettings) -> None:
        """Go on with other times."""
        self.settings = settings
        self._allowance = min(self._allowance, settings.rerun_rate * ALLOWANCE)

    def insert(self, channel: int, measurement: Measurement) -> tuple[Fate, Due | None]:
        """Put an input into the log; return its fate, and a set that is due by it at once.

        The latter for wheel odometry older than inputs released before it but younger than the last
        set.
        """
        stamp = measurement.stamp
        if self._is_too_old(stamp):
            return Fate.TOO_OLD, None
        if len(self._log.entries) >= GREATEST_LENGTH:
            return Fate.FULL, None
        cost = self._log.added_steps(stamp)
        if cost and self.settings.rerun_rate > 0.0:
            if self._deferred or cost > self._allowance:
                self.counts['late_inputs_deferred'] += 1
                self._deferred.append((channel, measurement))
                return Fate.DEFERRED, None
            self._allowance -= cost
        return self._insert(channel, measurement)

    def advance(self, newest: int, hold: int = 0, overdue: int = 0) -> Iterator[Due]:
        """Release inputs up to `hold` before the newest stamp; yield the sets that became due.

        `overdue`: lag of wheel odometry beyond `hold`, which does not count as silence. All [ns].
        """
        self._overdue = overdue
        if self._newest is None or newest > self._newest:
            rate = self.settings.rerun_rate
            elapsed = 0.0 if self._newest is None else (newest - self._newest) / SECOND
            self._allowance = min(self._allowance + rate * elapsed, rate * ALLOWANCE)
            self._newest = newest
        if self._deferred:
            yield from self._insert_deferred(newest - hold)
        yield from self._release(newest - hold)

    def flush(self, end: int) -> Iterator[Due]:
        """Release everything up to a stamp [ns]."""
        yield from self._insert_deferred(math.inf)
        yield from self._release(end)

    def begin_after(self, due: Due) -> None:
        """Forget the state and all inputs up to a set: the estimator failed there."""
        self.counts['filter_restarts'] += 1
        self._log.begin_after(due.entry)
        self.released -= due.entry + 1

    def _is_too_old(self, stamp: int) -> bool:
        """Return whether an input of this stamp [ns] comes too late to be used."""
        state = self._state
        if state is None:
            return False
        return stamp < state - self.settings.history or stamp <= self._log.forgotten

    @property
    def slow_odometry(self) -> float:
        """Period of wheel odometry that is slow rather than silent [s]; 0: it is silent."""
        every, settings = min(self._intervals), self.settings
        silent = (self._last_set or 0) - (self._odometry or 0)
        slow = every > 0.9 * settings.silence and silent < 2 * every
        return every / SECOND if slow else 0.0

    # -- The log --------------------------------------------------------------------------------

    def _insert(self, channel: int, measurement: Measurement) -> tuple[Fate, Due | None]:
        stamp, state = measurement.stamp, self._state
        self.counts['runs'] += self._log.first is None
        index, new = self._log.insert(channel, measurement)
        if new and index < self.released:
            self.released += 1
        fate = Fate.LATE if state is not None and stamp < state else Fate.IN_ORDER
        if channel == WHEEL_ODOMETRY and index < self.released and self._ends_period(stamp):
            return fate, self._due(index)
        return fate, None

    def _insert_deferred(self, limit: float) -> Iterator[Due]:
        """Insert all deferred inputs, as soon as the allowance covers the oldest of them.

        At any cost before a release up to `limit` [ns] leaves the oldest behind the history.
        """
        if not self._deferred:
            return
        oldest = min(measurement.stamp for _, measurement in self._deferred)
        cost = self._log.added_steps(oldest)
        if cost > self._allowance and oldest >= limit - self.settings.history:
            return
        self._allowance = max(self._allowance - cost, 0.0)
        deferred, self._deferred = self._deferred, []
        for channel, measurement in deferred:
            if self._is_too_old(measurement.stamp):
                self.counts['late_inputs_dropped'] += 1
            else:
                _, due = self._insert(channel, measurement)
                if due is not None:
                    yield due

    # -- Release --------------------------------------------------------------------------------

    def _release(self, limit: int) -> Iterator[Due]:
        log = self._log
        while self.released < len(log.stamps) and log.stamps[self.released] <= limit:
            index = self.released
            entry = log.entries[index]
            self.released = index + 1
            self._state = entry.stamp
            if self._odometry is None:
                self._odometry = entry.stamp  # silence counts from the start of the run
            rolled = entry.parts[WHEEL_ODOMETRY] is not None
            if (self._ends_period if rolled else self._heartbeat_is_due)(entry.stamp):
                yield self._due(index)
        if self._state is not None:
            self.released -= log.forget(self._state - self.settings.history)

    def _ends_period(self, stamp: int) -> bool:
        """Take note of wheel odometry; return whether it is the first in a period of the sets."""
        assert self._odometry is not None
        if stamp > self._odometry:
            self._intervals = self._intervals[1], stamp - self._odometry
            self._odometry, self._heartbeats = stamp, 0
        last = self._last_set
        if last is None:
            return True
        if stamp <= last:
            return False
        if self._log.grid.every_stamp:
            return True
        first = self._log.first
        assert first is not None
        return self._log.grid.set_index(stamp - first) > self._log.grid.set_index(last - first)

    def _heartbeat_is_due(self, stamp: int) -> bool:
        """Return whether, in a silence of wheel odometry, a set is due at this stamp."""
        assert self._odometry is not None
        silent = stamp - self._odometry - self.settings.silence - self._overdue
        if silent < 0:
            return False
        beat = silent // self.settings.heartbeat + 1
        if beat <= self._heartbeats:
            return False
        period = self.settings.heartbeat
        if self._last_set is not None and stamp < self._last_set + 3 * period // 4:
            return False  # wheel odometry was late, its sets have been given
        self._heartbeats = beat
        return True

    def _due(self, index: int) -> Due:
        stamp = self._log.entries[index].stamp
        assert self._odometry is not None
        self._last_set = stamp
        silent = stamp - self._odometry >= self.settings.silence + self._overdue
        return Due(index, stamp, silent)
