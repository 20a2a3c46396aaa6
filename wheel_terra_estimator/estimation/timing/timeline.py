# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Inputs in the order of their stamps, whatever the order of their arrival; which sets are due.

An estimate for a stamp is by definition what the estimator gives when it runs through the log of
inputs from the start of the run to that stamp. The timeline says when an input is released, when a
set is due, and what becomes of inputs that come late; it is lazy, so that any number of late inputs
between two sets costs one run.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from enum import Enum

import numpy as np

from wheel_terra_estimator.estimation.estimates import EstimateSet
from wheel_terra_estimator.estimation.measurements import Measurement
from wheel_terra_estimator.estimation.timing.input_checks import WHEEL_ODOMETRY
from wheel_terra_estimator.estimation.timing.input_log import Estimator, InputLog
from wheel_terra_estimator.estimation.timing.step_grid import StepGrid

GREATEST_LENGTH = 100_000
"""Inputs that the log holds at most, so that no publisher can fill the memory."""
ALLOWANCE = 2.0  # [s] over which steps that are run again may be saved up

_FAILURES = (ArithmeticError, ValueError, IndexError, np.linalg.LinAlgError)
"""What a step of the estimator may end with."""
_SECOND = 1_000_000_000


class Fate(Enum):
    """What became of an input."""

    IN_ORDER = 'in order'
    LATE = 'late'  # older than the state, fused at its own stamp
    DEFERRED = 'deferred'  # late, waits until running again is affordable
    TOO_OLD = 'too old'
    FULL = 'no room'


@dataclass(frozen=True)
class TimeSettings:
    """Durations of the timeline [ns] and rates: the parameters of the same names."""

    output_rate: float  # [Hz], 0 = a set at every stamp of the wheel odometry
    history: int
    silence: int
    heartbeat: int  # period
    reference_period: int  # 0 = every reference velocity is used
    rerun_rate: float = 0.0  # steps run again per second of stamps [Hz], 0 = any number


class Timeline:
    """Log of one run after the other, and the sets that are due.

    Parameters
    ----------
    estimator : Estimator
        Must be deterministic: the same steps from the same state give the same numbers.
    settings : TimeSettings
        Durations and rates.
    finish : callable
        Takes the stamp of a due set, the estimates (or the error instead of them) and whether
        wheel odometry is silent; returns the set to be published, and whether the estimator has
        failed and must start anew.

    Attributes
    ----------
    counts : dict
        ``runs``, ``filter_restarts``, ``late_inputs_deferred``, ``late_inputs_dropped`` and those
        of the log.
    repeated : list of int
        Per channel: inputs whose stamp the channel had given before.
    """

    def __init__(
        self,
        estimator: Estimator,
        settings: TimeSettings,
        finish: Callable[[int, EstimateSet | Exception, bool], tuple[EstimateSet, bool]],
    ) -> None:
        self.settings = settings
        self._grid = StepGrid(settings.output_rate)
        self._log = InputLog(estimator, self._grid, settings.reference_period)
        self._own_counts = {
            'runs': 0,
            'filter_restarts': 0,
            'late_inputs_deferred': 0,
            'late_inputs_dropped': 0,
        }
        self._finish = finish
        self._begins_run: bool  # the next input is the first of its run
        self._released: int  # entries[:_released] may be used
        self._state: int | None  # newest released stamp
        self._last_set: int | None
        self._odometry: int | None  # newest released stamp of wheel odometry
        self._heartbeats: int  # sets of the present silence
        self._overdue: int  # wheel odometry lags by so much more than is waited for [ns]
        self._deferred: list[tuple[int, Measurement]]
        self._newest: int | None
        self._allowance: float  # steps that may be run again now
        self._clear()

    @property
    def counts(self) -> dict[str, int]:
        """Counters for diagnostics."""
        return self._own_counts | self._log.counts

    @property
    def repeated(self) -> list[int]:
        """Per channel: inputs whose stamp the channel had given before."""
        return self._log.repeated

    @property
    def contradicted(self) -> list[int]:
        """Per channel: inputs of a stamp given before, with other numbers."""
        return self._log.contradicted

    def end_run(self, *, keep_soil: bool) -> None:
        """Let the next input begin a new run; soil and biases kept but widened, or forgotten."""
        self._log.clear(keep_soil=keep_soil)
        self._clear()

    def retune(self, estimator: Estimator, settings: TimeSettings) -> None:
        """Go on with another estimator of the same kind of state, and other times."""
        self.settings = settings
        self._grid = StepGrid(settings.output_rate)
        self._log.retune(estimator, self._grid, settings.reference_period)
        self._allowance = min(self._allowance, settings.rerun_rate * ALLOWANCE)

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
        stamp, state = measurement.stamp, self._state
        if state is not None and stamp < state - self.settings.history:
            return Fate.TOO_OLD, []
        if len(self._log.entries) >= GREATEST_LENGTH:
            return Fate.FULL, []
        cost = self._log.steps_after(stamp) - self._log.dirty
        if cost > 0 and self.settings.rerun_rate > 0.0:
            if self._deferred or cost > self._allowance:
                self._own_counts['late_inputs_deferred'] += 1
                self._deferred.append((channel, measurement))
                return Fate.DEFERRED, []
            self._allowance -= cost
        return self._insert(channel, measurement)

    def advance(self, newest: int, hold: int = 0, overdue: int = 0) -> list[EstimateSet]:
        """Release inputs and return the sets that became due.

        Parameters
        ----------
        newest : int
            Newest stamp seen [ns].
        hold : int
            How long inputs are held back [ns].
        overdue : int
            By how much wheel odometry lags behind what is held back [ns]; no silence.
        """
        self._overdue = overdue
        if self._newest is None or newest > self._newest:
            rate = self.settings.rerun_rate
            elapsed = 0.0 if self._newest is None else (newest - self._newest) / _SECOND
            self._allowance = min(self._allowance + rate * elapsed, rate * ALLOWANCE)
            self._newest = newest
        if self._deferred:
            self._insert_deferred()
        return self._release(newest - hold)

    def flush(self) -> list[EstimateSet]:
        """Release everything."""
        self._insert_deferred(at_any_cost=True)
        return self._release(self._log.stamps[-1]) if self._log.stamps else []

    def settle(self) -> None:
        """Make the steps that the next set would have to make, while nobody waits for it.

        Changes no number: a step that fails is made again, and told of, at the next set.
        """
        if self._released:
            with suppress(*_FAILURES), np.errstate(all='ignore'):
                self._log.settle(self._released - 1)

    # -- The log --------------------------------------------------------------------------------

    def _clear(self) -> None:
        self._begins_run = True
        self._released = 0
        self._state = None
        self._last_set = None
        self._odometry = None
        self._heartbeats = 0
        self._overdue = 0
        self._deferred = []
        self._newest = None
        self._allowance = self.settings.rerun_rate * ALLOWANCE

    def _insert(self, channel: int, measurement: Measurement) -> tuple[Fate, list[EstimateSet]]:
        stamp, state = measurement.stamp, self._state
        if not self._log.stamps:
            self._own_counts['runs'] += self._begins_run
            self._begins_run = False
        index, new = self._log.insert(channel, measurement)
        if new and index < self._released:
            self._released += 1
        fate = Fate.LATE if state is not None and stamp < state else Fate.IN_ORDER
        if channel == WHEEL_ODOMETRY and index < self._released:
            self._hear_odometry(stamp)
            if self._set_is_due(stamp):
                return fate, [self._publish(index)]
        return fate, []

    def _insert_deferred(self, at_any_cost: bool = False) -> None:
        """Fuse what waited, all at once, as soon as running again for the oldest is affordable."""
        if not self._deferred:
            return
        oldest = min(measurement.stamp for _, measurement in self._deferred)
        cost = self._log.steps_after(oldest) - self._log.dirty
        if cost > self._allowance and not at_any_cost:
            return
        self._allowance -= max(cost, 0)
        deferred, self._deferred = self._deferred, []
        for channel, measurement in deferred:
            state = self._state
            if state is not None and measurement.stamp < state - self.settings.history:
                self._own_counts['late_inputs_dropped'] += 1
            else:
                self._insert(channel, measurement)

    # -- Release --------------------------------------------------------------------------------

    def _release(self, limit: int) -> list[EstimateSet]:
        sets = []
        log = self._log
        while self._released < len(log.stamps) and log.stamps[self._released] <= limit:
            index = self._released
            entry = log.entries[index]
            self._released = index + 1
            self._state = entry.stamp
            if self._odometry is None:
                self._hear_odometry(entry.stamp)  # silence counts from the start of the run
            if entry.parts[WHEEL_ODOMETRY] is not None:
                self._hear_odometry(entry.stamp)
                if self._set_is_due(entry.stamp):
                    sets.append(self._publish(index))
            elif self._heartbeat_is_due(entry.stamp):
                sets.append(self._publish(index))
        if self._state is not None:
            self._released -= log.forget(self._state - self.settings.history)
        return sets

    def _set_is_due(self, stamp: int) -> bool:
        """Whether wheel odometry of this stamp is the first since a multiple of the period."""
        last = self._last_set
        if last is None:
            return True
        if stamp <= last:
            return False
        if self._grid.every_stamp:
            return True
        first = self._log.first
        assert first is not None
        return self._grid.set_index(stamp - first) > self._grid.set_index(last - first)

    def _hear_odometry(self, stamp: int) -> None:
        if self._odometry is None or stamp > self._odometry:
            self._odometry = stamp
            self._heartbeats = 0

    def _heartbeat_is_due(self, stamp: int) -> bool:
        """Whether the silence of wheel odometry makes this stamp one of a set."""
        assert self._odometry is not None
        silent = stamp - self._odometry - self.settings.silence - self._overdue
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

    def _publish(self, index: int) -> EstimateSet:
        """Bring the estimator to an entry and return the set of its stamp."""
        stamp = self._log.entries[index].stamp
        assert self._odometry is not None
        silent = stamp - self._odometry >= self.settings.silence + self._overdue
        outcome: EstimateSet | Exception
        try:
            with np.errstate(all='ignore'):  # the result is judged below, number by number
                self._log.run_to(index)
                outcome = self._log.estimator.estimates()
        except _FAILURES as error:
            outcome = error
        self._last_set = stamp
        estimates, failed = self._finish(stamp, outcome, silent)
        if failed:
            self._own_counts['filter_restarts'] += 1
            self._log.begin_after(index)
            self._released -= index + 1
        return estimates
