# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Inputs in the order of their stamps, whatever the order of their arrival.

All inputs of a run stand in one log, sorted by stamp, equal stamps merged. An estimate for a stamp
is by definition what the estimator gives when it runs through the log from the start of the run to
that stamp. The rest is economy: kept states, so that a late input costs a short run and not a long
one, and laziness, so that any number of late inputs between two sets costs one run.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Any, Protocol

import numpy as np

from wheel_terra_estimator.estimation.estimates import EstimateSet
from wheel_terra_estimator.estimation.measurements import (
    FloatArray,
    LeavingAngleReading,
    Measurement,
    SinkageReading,
    StepInputs,
    WheelOdometry,
)
from wheel_terra_estimator.estimation.timing.input_checks import (
    INERTIAL,
    REFERENCE,
    WHEEL_ODOMETRY,
)

KEPT_STATE_SPACING = 50_000_000
"""Distance of kept states [ns]: what a late input costs, against what keeping costs."""
DENSE_SPAN = 50_000_000
"""Inputs that come so little [ns] after a set that would have used them make kept states denser."""
GREATEST_LENGTH = 100_000
"""Inputs that the log holds at most, so that no publisher can fill the memory."""
TRIM_LENGTH = 64
"""Forgotten entries are taken off the log in pieces of this length."""


class Estimator(Protocol):
    """What the timeline runs."""

    def step(self, stamp: int, inputs: StepInputs) -> None:
        """Bring the state to `stamp` [ns], later than the one before, with all inputs of it."""

    def estimates(self) -> EstimateSet:
        """Return the estimates at the stamp of the last step."""

    def snapshot(self) -> Any:
        """Return the state in a form that later steps leave alone."""

    def restore(self, snapshot: Any) -> None:
        """Return to a kept state."""

    def begin_run(self, stamp: int, keep_soil: bool) -> None:
        """Start anew at `stamp` [ns]; soil and biases kept but widened, or forgotten."""


class Fate(Enum):
    """What became of an input."""

    IN_ORDER = 'in order'
    LATE = 'late'  # older than the state, fused at its own stamp
    TOO_OLD = 'too old'
    FULL = 'no room'


@dataclass(frozen=True)
class TimeSettings:
    """Times of the contract, in nanoseconds."""

    max_lag: int
    history: int
    silence: int
    heartbeat: int  # period
    reference_period: int  # 0 = every reference velocity is used


class _Entry:
    """All inputs of one stamp."""

    __slots__ = ('inputs', 'kept', 'parts', 'stamp')

    def __init__(self, stamp: int, channel: int, measurement: Measurement) -> None:
        self.stamp = stamp
        self.parts: list[Any] = [None] * 5
        self.parts[channel] = measurement
        self.inputs: StepInputs | None = None  # made when first run
        self.kept: tuple[Any, int] | None = None  # state after this entry


class Timeline:
    """Log of one run after the other, and the estimator that runs through it.

    Parameters
    ----------
    estimator : Estimator
        Must be deterministic: the same steps from the same state give the same numbers.
    settings : TimeSettings
        Times of the contract.
    finish : callable
        Takes the stamp of a due set, the estimates (or the error instead of them) and whether
        wheel odometry is silent; returns the set to be published, and whether the estimator has
        failed and must start anew.

    Attributes
    ----------
    counts : dict
        ``runs``, ``steps``, ``reruns``, ``steps_repeated``, ``filter_restarts``.
    repeated : list of int
        Per channel: inputs whose stamp the channel had given before.
    """

    def __init__(
        self,
        estimator: Estimator,
        settings: TimeSettings,
        finish: Callable[[int, EstimateSet | Exception, bool], tuple[EstimateSet, bool]],
    ) -> None:
        self.estimator = estimator
        self.settings = settings
        self.counts = {
            'runs': 0,
            'steps': 0,
            'reruns': 0,
            'steps_repeated': 0,
            'filter_restarts': 0,
        }
        self.repeated = [0] * 5
        self._finish = finish
        self._pristine = estimator.snapshot()
        self._entries: list[_Entry] = []
        self._stamps: list[int] = []
        self._origin: tuple[Any, bool] | None  # state before the run, whether soil is kept
        self._begins_run: bool  # the next input is the first of its run
        self._released: int  # entries[:_released] may be used
        self._ran: int  # entries[:_ran] have been run, and not changed since
        self._position: int  # entries[:_position] made the estimator's state; -1: none did
        self._state: int | None  # newest released stamp
        self._last_set: int | None
        self._odometry: int | None  # newest released stamp of wheel odometry
        self._heartbeats: int  # sets of the present silence
        self._next_reference: int  # a reference velocity is used again from here on
        self._disorder: bool  # inputs come a little after sets that would have used them
        self._last_kept = 0  # stamp of the newest kept state
        self._clear(self._pristine, keep_soil=False)

    def end_run(self, *, keep_soil: bool) -> None:
        """Let the next input begin a new run; soil and biases kept but widened, or forgotten."""
        self._clear(self.estimator.snapshot() if keep_soil else self._pristine, keep_soil)

    def insert(self, channel: int, measurement: Measurement) -> tuple[Fate, list[EstimateSet]]:
        """Put an input into the log.

        Returns
        -------
        fate : Fate
            What became of it.
        sets : list of EstimateSet
            A set that it made due at once: wheel odometry that comes after younger inputs of
            other channels but is younger than the last set.
        """
        stamp = measurement.stamp
        state = self._state
        if state is not None and stamp < state - self.settings.history:
            return Fate.TOO_OLD, []
        entries, stamps = self._entries, self._stamps
        if len(entries) >= GREATEST_LENGTH:
            return Fate.FULL, []
        if not stamps:
            self.counts['runs'] += self._begins_run
            self._begins_run = False
        index = len(stamps)
        if index and stamp <= stamps[-1]:
            index = bisect_left(stamps, stamp)
            if stamps[index] == stamp:
                changed = self._merge(entries[index], channel, measurement)
            else:
                self._insert_at(index, _Entry(stamp, channel, measurement))
                changed = True
            if changed and index < self._ran:
                if stamp > stamps[self._ran - 1] - DENSE_SPAN:
                    self._disorder = True
                self._ran = index
        else:
            entries.append(_Entry(stamp, channel, measurement))
            stamps.append(stamp)
        fate = Fate.LATE if state is not None and stamp < state else Fate.IN_ORDER
        if channel == WHEEL_ODOMETRY and index < self._released:
            self._hear_odometry(stamp)
            if self._last_set is None or stamp > self._last_set:
                return fate, [self._publish(index)]
        return fate, []

    def advance(self, newest: int) -> list[EstimateSet]:
        """Release the inputs that `newest`, the newest stamp seen, lets pass; return the sets."""
        return self._release(newest - self.settings.max_lag)

    def flush(self) -> list[EstimateSet]:
        """Release everything."""
        return self._release(self._stamps[-1]) if self._stamps else []

    # -- The log --------------------------------------------------------------------------------

    def _clear(self, origin: Any, keep_soil: bool) -> None:
        self._entries.clear()
        self._stamps.clear()
        self._origin = origin, keep_soil
        self._begins_run = True
        self._released = 0
        self._ran = 0
        self._position = -1
        self._state = None
        self._last_set = None
        self._odometry = None
        self._heartbeats = 0
        self._next_reference = 0
        self._disorder = False

    def _insert_at(self, index: int, entry: _Entry) -> None:
        self._entries.insert(index, entry)
        self._stamps.insert(index, entry.stamp)
        if index < self._released:
            self._released += 1

    def _merge(self, entry: _Entry, channel: int, measurement: Any) -> bool:
        """Merge into the entry of the same stamp; return whether that changes anything."""
        before = entry.parts[channel]
        if before is None:
            entry.parts[channel] = measurement
        elif channel in (INERTIAL, REFERENCE):
            self.repeated[channel] += 1
            if _same(before, measurement):
                return False
            entry.parts[channel] = measurement
        else:
            merged, overlap = _merge_wheels(before, measurement)
            self.repeated[channel] += overlap
            if _same(before, merged):
                return False
            entry.parts[channel] = merged
        entry.inputs = None
        return True

    def _forget(self) -> None:
        """Take off what no late input can reach."""
        stamps = self._stamps
        if self._state is None or len(stamps) <= TRIM_LENGTH:
            return
        horizon = self._state - self.settings.history
        if stamps[TRIM_LENGTH] >= horizon:
            return
        # The last kept state from which every input within the history can be run.
        index = min(bisect_left(stamps, horizon), self._ran) - 1
        while index > 0 and self._entries[index].kept is None:
            index -= 1
        if index > 0:
            del self._entries[:index], stamps[:index]
            self._origin = None
            self._released -= index
            self._ran -= index
            self._position -= index

    # -- Release --------------------------------------------------------------------------------

    def _release(self, limit: int) -> list[EstimateSet]:
        sets = []
        while self._released < len(self._stamps) and self._stamps[self._released] <= limit:
            index = self._released
            entry = self._entries[index]
            self._released = index + 1
            self._state = entry.stamp
            if self._odometry is None:
                self._hear_odometry(entry.stamp)  # silence counts from the start of the run
            if entry.parts[WHEEL_ODOMETRY] is not None:
                self._hear_odometry(entry.stamp)
                if self._last_set is None or entry.stamp > self._last_set:
                    sets.append(self._publish(index))
            elif self._heartbeat_is_due(entry.stamp):
                sets.append(self._publish(index))
        self._forget()
        return sets

    def _hear_odometry(self, stamp: int) -> None:
        if self._odometry is None or stamp > self._odometry:
            self._odometry = stamp
            self._heartbeats = 0

    def _heartbeat_is_due(self, stamp: int) -> bool:
        """Whether the silence of wheel odometry makes this stamp one of a set."""
        assert self._odometry is not None
        silent = stamp - self._odometry - self.settings.silence
        if silent < 0:
            return False
        beat = silent // self.settings.heartbeat + 1
        if beat <= self._heartbeats:
            return False
        period = self.settings.heartbeat
        if self._last_set is not None and stamp < self._last_set + 3 * period // 4:
            return False  # wheel odometry came late, its sets were given already
        self._heartbeats = beat
        return True

    # -- Running --------------------------------------------------------------------------------

    def _publish(self, index: int) -> EstimateSet:
        """Bring the estimator to an entry and return the set of its stamp."""
        entry = self._entries[index]
        assert self._odometry is not None
        silent = entry.stamp - self._odometry >= self.settings.silence
        outcome: EstimateSet | Exception
        try:
            with np.errstate(all='ignore'):  # the result is judged below, number by number
                self._run(index)
                outcome = self.estimator.estimates()
        except (ArithmeticError, ValueError, IndexError, np.linalg.LinAlgError) as error:
            outcome = error
        self._last_set = entry.stamp
        estimates, failed = self._finish(entry.stamp, outcome, silent)
        if failed:
            self._start_anew(index)
        return estimates

    def _start_anew(self, failed: int) -> None:
        """Forget the state and the log up to the entry at which the estimator failed."""
        self.counts['filter_restarts'] += 1
        del self._entries[: failed + 1], self._stamps[: failed + 1]
        self._released -= failed + 1
        self._ran, self._position = 0, -1
        self._origin = self._pristine, False

    def _run(self, last: int) -> None:
        """Run the log up to and with the entry `last`."""
        if self._position != self._ran or self._position < 0:
            self._go_back()
        elif self._position:
            self._keep(self._position - 1, self._disorder)
        entries = self._entries
        dense = entries[last].stamp - DENSE_SPAN
        for index in range(self._position, last + 1):
            entry = entries[index]
            self._step(entry, must=index == last)
            entry.kept = None
            # The state at the end is kept by the next run, if nothing has changed before.
            if index < last:
                odometry = entry.parts[WHEEL_ODOMETRY] is not None and entry.stamp >= dense
                self._keep(index, self._disorder and (odometry or index == last - 1))
        self._ran = self._position = last + 1

    def _keep(self, index: int, must: bool) -> None:
        """Keep the estimator's state, which is that after entry `index`, if it is worth it."""
        entry = self._entries[index]
        if entry.kept is None and (must or entry.stamp - self._last_kept >= KEPT_STATE_SPACING):
            entry.kept = self.estimator.snapshot(), self._next_reference
            self._last_kept = entry.stamp

    def _go_back(self) -> None:
        """Return to the last kept state before the first entry that has changed."""
        first = self._ran - 1
        while first >= 0 and self._entries[first].kept is None:
            first -= 1
        if self._position >= 0:
            self.counts['reruns'] += 1
            self.counts['steps_repeated'] += max(self._position - first - 1, 0)
        if first >= 0:
            kept = self._entries[first].kept
            assert kept is not None
            state, self._next_reference = kept
            self.estimator.restore(state)
            self._last_kept = self._entries[first].stamp
        else:
            assert self._origin is not None
            state, keep_soil = self._origin
            self.estimator.restore(state)
            self.estimator.begin_run(self._stamps[0], keep_soil)
            self._next_reference = 0
            self._last_kept = self._stamps[0]
        self._position = first + 1

    def _step(self, entry: _Entry, must: bool) -> None:
        parts = entry.parts
        if parts[REFERENCE] is None or self._reference_is_due(entry.stamp):
            if entry.inputs is None:
                entry.inputs = StepInputs(*parts)
            inputs = entry.inputs
        else:
            # Thinned out here, in the order of stamps, so that the order of arrival is nothing.
            if not must and not any(part is not None for part in parts[:REFERENCE]):
                return
            inputs = StepInputs(*parts[:REFERENCE])
        self.counts['steps'] += 1
        self.estimator.step(entry.stamp, inputs)

    def _reference_is_due(self, stamp: int) -> bool:
        period = self.settings.reference_period
        if not period:
            return True
        if stamp < self._next_reference - period // 20:  # leaves room for jitter of stamps
            return False
        # In step with the first one, so that jitter does not add up to a lower rate.
        due = self._next_reference + period
        self._next_reference = due if due > stamp else stamp + period
        return True


def _same(one: Any, other: Any) -> bool:
    for a, b in zip(vars(one).values(), vars(other).values(), strict=True):
        if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
            if not np.array_equal(a, b, equal_nan=True):
                return False
        elif a is not b and (a is None or b is None or a != b):
            return False
    return True


def _merge_wheels(before: Any, after: Any) -> tuple[Any, bool]:
    """Merge two readings of the same stamp; the later arrival wins wheel by wheel."""
    stamp = before.stamp
    if isinstance(before, WheelOdometry):
        rate, overlap = _newer(before.rate, after.rate)
        torque, _ = _newer(before.torque, after.torque)
        return WheelOdometry(stamp, rate, torque), overlap
    if isinstance(before, SinkageReading):
        sinkage, overlap = _newer(before.sinkage, after.sinkage)
        return SinkageReading(stamp, sinkage), overlap
    angle, overlap = _newer(before.leaving_angle, after.leaving_angle)
    return LeavingAngleReading(stamp, angle), overlap


def _newer(before: FloatArray, after: FloatArray) -> tuple[FloatArray, bool]:
    given = ~np.isnan(after)
    return np.where(given, after, before), bool(np.any(given & ~np.isnan(before)))
