# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The inputs of a run, sorted by stamp, and the steps of estimator and checks through them.

Inputs of equal stamps are merged. How the log divides into steps follows from the stamps alone (see
``step_grid``), so the state at a stamp does not depend on the order of arrival. For a late input
the steps are repeated from the last kept state before it.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

from wheel_terra_estimator.estimation.estimates import EstimateSet
from wheel_terra_estimator.estimation.measurements import Measurement, StepInputs
from wheel_terra_estimator.estimation.timing.input_checks import (
    CHANNELS,
    INERTIAL,
    REFERENCE,
    WHEEL_ODOMETRY,
)
from wheel_terra_estimator.estimation.timing.merging import (
    LastMeasured,
    merge_step,
    merge_wheels,
    same,
)
from wheel_terra_estimator.estimation.timing.step_grid import LONGEST_STEP, StepGrid, TimeSettings

KEPT_STATE_SPACING = 50_000_000
"""Least time between kept states [ns]: keeping one costs a twentieth of a step."""
TRIM_LENGTH = 64
"""Entries that are no longer needed are removed once there are so many."""


class Stepped(Protocol):
    """A part that steps through the log: from the same state the same steps give the same state."""

    def step(self, stamp: int, inputs: StepInputs) -> None:
        """Bring the state to `stamp` [ns], later than the one before, with all inputs of it."""

    def snapshot(self) -> Any:
        """Return the state in a form that later steps leave alone."""

    def restore(self, snapshot: Any) -> None:
        """Return to a kept state."""

    def begin_run(self, stamp: int, keep_soil: bool) -> None:
        """Restart at `stamp` [ns]; soil and biases kept with inflated covariance, or reset."""


class Estimator(Stepped, Protocol):
    """What the core runs; it may have `learned` and `taught` too (see `EstimatorCore`)."""

    def health(self) -> dict[str, Any]:
        """Return counters and texts for diagnostics, in a new dictionary."""

    def estimates(self) -> EstimateSet:
        """Return the estimates at the stamp of the last step."""


class _Progress(NamedTuple):
    """What the division into steps needs to know of the steps before."""

    next_reference: int  # stamp from which on a reference velocity is used again [ns]
    step_index: int  # of the last wheel odometry; -1: none yet
    end: int  # stamp of the last step [ns]
    measured: LastMeasured
    steps: int  # since the start of the run


class _LastRun(NamedTuple):
    """Where the last run ended: the cost of late inputs is counted from there."""

    position: int  # entries[:position] made its state
    end: int  # stamp of its last step [ns]
    unchanged: int  # entries[:unchanged] have not changed since


class Entry:
    """All inputs of one stamp."""

    __slots__ = ('kept', 'parts', 'stamp', 'thinned')

    def __init__(self, stamp: int, channel: int, measurement: Measurement) -> None:
        self.stamp = stamp
        self.parts: list[Any] = [None] * len(CHANNELS)
        self.parts[channel] = measurement
        self.kept: tuple[tuple[Any, ...], _Progress] | None = None  # after this entry
        self.thinned = False  # its reference velocity was not used


class InputLog:
    """Inputs of one run, and the `runners` that make the same steps through them.

    Reference velocities are thinned by stamps to the `reference_period` of the settings.
    """

    def __init__(self, runners: Sequence[Stepped], settings: TimeSettings) -> None:
        self._runners = runners
        self.grid = StepGrid(settings.output_rate)
        self.entries: list[Entry] = []  # forgotten ones are taken off the front
        self.stamps: list[int] = []  # of the entries
        self.counts = {'steps': 0, 'reruns': 0, 'steps_repeated': 0}
        # Per channel: inputs whose stamp it had given before, and those with other numbers.
        self.repeated = [0] * len(CHANNELS)
        self.contradicted = [0] * len(CHANNELS)
        self.thinned = 0  # reference velocities that were not used
        self._reference_period = settings.reference_period
        self._pristine = self._snapshot()
        self._last_run: _LastRun
        self._caught_up: bool  # since the last run
        self.clear(keep_soil=False)

    def clear(self, *, keep_soil: bool) -> None:
        """Begin a new run; soil and biases kept with inflated covariance, or reset."""
        self._origin = self._snapshot() if keep_soil else self._pristine, keep_soil
        self.forgotten = 0  # stamp up to which no state is kept; 0: the start of the run is known
        self.entries.clear()
        self.stamps.clear()
        self.first: int | None = None  # stamp of the run, from which the grid counts
        self._ran = 0  # entries[:_ran] have been run, and not changed since
        self._position = -1  # entries[:_position] made the state of the last step; -1: none did
        self._provisional = False  # the runners have made a part of the next step
        self._progress = _Progress(0, -1, 0, None, 0)
        self._account()
        self._last_kept = 0  # stamp of the newest kept state

    def retune(self, runners: Sequence[Stepped], settings: TimeSettings) -> None:
        """Continue from the state after the last step with other runners and times."""
        state = self._snapshot()
        self._runners = runners
        self._pristine = self._snapshot()
        if self._provisional or self._position != self._ran:
            for entry in self.entries[self._ran :]:
                entry.kept = None  # run again by the new one
        self._restore(state)
        self._reference_period = settings.reference_period
        self.grid = StepGrid(settings.output_rate)
        self._progress = self._progress._replace(step_index=-1)

    def insert(self, channel: int, measurement: Measurement) -> tuple[int, bool]:
        """Insert an input by its stamp; return its index, and whether it is a new entry."""
        stamp = measurement.stamp
        entries, stamps = self.entries, self.stamps
        self.first = stamp if self.first is None else min(self.first, stamp)
        index = len(stamps)
        if not index or stamp > stamps[-1]:
            entries.append(Entry(stamp, channel, measurement))
            stamps.append(stamp)
            return index, True
        index = bisect_left(stamps, stamp)
        new = stamps[index] != stamp
        if new:
            entries.insert(index, Entry(stamp, channel, measurement))
            stamps.insert(index, stamp)
            changed = True
        else:
            changed = self._merge(entries[index], channel, measurement)
        last_run = self._last_run
        if changed and index < last_run.unchanged:
            self._dirty += self.added_steps(stamp)
            self._last_run = last_run._replace(unchanged=index)
        if changed and index < self._ran:
            self._ran = index
        return index, new

    def added_steps(self, stamp: int) -> int:
        """Return how many more steps would be made again for an input of this stamp [ns]."""
        position, end, _ = self._last_run
        if position <= 0 or self.first is None or stamp > end:
            return 0
        if self.grid.every_stamp:
            steps = position - bisect_left(self.stamps, stamp)
        else:
            before = self.grid.step_index(stamp - self.first)
            steps = self.grid.step_index(end - self.first) - before + 1
        return max(steps - self._dirty, 0)

    def run_to(self, last: int) -> None:
        """Run up to and with the entry `last`."""
        pending = self._run_steps(last)
        self._account()
        if pending:
            # These make a provisional step for this set; the next one begins where it began.
            self._keep(always=True)
            self._provisional = True
            self._step(self.entries[last].stamp, pending, self._progress)

    def process_pending(self, last: int) -> None:
        """Make the steps up to the entry `last` that the next run would make anyway.

        At most once between two runs, so that late inputs are not paid for twice.
        """
        if self._position < 0 or self._caught_up:
            return  # the first run begins by itself
        self._caught_up = True
        try:
            self._run_steps(last)
        except BaseException:
            self._provisional = True  # a step failed; the next run begins before it
            raise

    def _run_steps(self, last: int) -> list[list[Any]]:
        """Make all whole steps up to the entry `last`; return what is left over of the next."""
        if self._position != self._ran or self._position < 0 or self._provisional:
            self._go_back()
        pending: list[list[Any]] = []
        for index in range(self._position, last + 1):
            entry = self.entries[index]
            entry.kept = None
            after = self._extend_step(entry, pending)
            if after is not None:
                self._step(entry.stamp, pending, after)
                pending.clear()
                self._position = self._ran = index + 1
                self._keep()
        return pending

    def _account(self) -> None:
        """Count the cost of late inputs from here on."""
        self._dirty = 0  # steps that the next run will make again
        self._caught_up = False
        self._last_run = _LastRun(self._position, self._progress.end, self._ran)

    def begin_after(self, index: int) -> None:
        """Drop the state and all entries up to an index: the estimator failed there."""
        del self.entries[: index + 1], self.stamps[: index + 1]
        self._ran, self._position, self._provisional = 0, -1, False
        self._origin = self._pristine, False
        self.forgotten = 0
        self._account()

    def forget(self, horizon: int) -> int:
        """Drop entries that no input younger than `horizon` [ns] needs; return how many."""
        stamps = self.stamps
        if len(stamps) <= TRIM_LENGTH or stamps[TRIM_LENGTH] >= horizon:
            return 0
        # The last kept state from which every input within the history can be run.
        index = min(bisect_left(stamps, horizon), self._ran) - 1
        while index > 0 and self.entries[index].kept is None:
            index -= 1
        if index <= 0:
            return 0
        del self.entries[:index], stamps[:index]
        self.forgotten = stamps[0]
        self._ran -= index
        self._position -= index
        position, end, unchanged = self._last_run
        self._last_run = _LastRun(position - index, end, unchanged - index)
        return index

    # -- Steps ----------------------------------------------------------------------------------

    def _extend_step(self, entry: Entry, pending: list[list[Any]]) -> _Progress | None:
        """Add an entry to the `pending` step; return the progress after it if it ends the step."""
        parts, stamp = entry.parts, entry.stamp
        after = self._progress
        ends = self.grid.every_stamp or stamp - after.end >= LONGEST_STEP
        if parts[REFERENCE] is not None:
            # Thinned here, by stamps, so that the order of arrival has no effect.
            due = self._next_reference(stamp)
            self.thinned += (due is None) - entry.thinned
            entry.thinned = due is None
            if due is None:
                parts = [*parts[:REFERENCE], None, *parts[REFERENCE + 1 :]]
                ends = ends and any(part is not None for part in parts)
            else:
                after = after._replace(next_reference=due)
                ends = True  # a reference is fused at its own stamp
        pending.append(parts)
        if parts[WHEEL_ODOMETRY] is not None:
            assert self.first is not None
            step_index = self.grid.step_index(stamp - self.first)
            if step_index > after.step_index:
                after = after._replace(step_index=step_index)
                ends = True
        return after if ends else None

    def _step(self, stamp: int, pending: list[list[Any]], after: _Progress) -> None:
        inputs, measured = merge_step(stamp, pending, self._progress.measured)
        self.counts['steps'] += 1
        self._progress = after._replace(end=stamp, measured=measured, steps=after.steps + 1)
        for runner in self._runners:
            runner.step(stamp, inputs)

    def _next_reference(self, stamp: int) -> int | None:
        """Return the stamp from which on the next one is used; None where this one is not."""
        period, due = self._reference_period, self._progress.next_reference
        if not period:
            return 0
        if stamp < due - period // 20:  # leaves room for jitter of stamps
            return None
        # Counted from the due stamp, so that jitter does not lower the rate.
        return due + period if due + period > stamp else stamp + period

    # -- Kept states ----------------------------------------------------------------------------

    def _snapshot(self) -> tuple[Any, ...]:
        return tuple([runner.snapshot() for runner in self._runners])

    def _restore(self, states: tuple[Any, ...]) -> None:
        for runner, state in zip(self._runners, states, strict=True):
            runner.restore(state)

    def _keep(self, always: bool = False) -> None:
        """Keep the state after the last step; not `always`: if the last one kept is old enough."""
        if self._position <= 0:
            return  # the start of the run is known anyway
        entry = self.entries[self._position - 1]
        if entry.kept is None and (always or entry.stamp - self._last_kept >= KEPT_STATE_SPACING):
            entry.kept = self._snapshot(), self._progress
            self._last_kept = entry.stamp

    def _go_back(self) -> None:
        """Return to the last kept state before the first entry that has changed."""
        index = self._ran - 1
        while index >= 0 and self.entries[index].kept is None:
            index -= 1
        steps = self._progress.steps
        if index >= 0:
            kept = self.entries[index].kept
            assert kept is not None
            state, self._progress = kept
            self._restore(state)
        else:
            assert not self.forgotten
            state, keep_soil = self._origin
            self._restore(state)
            for runner in self._runners:
                runner.begin_run(self.stamps[0], keep_soil)
            self._progress = _Progress(0, -1, self.stamps[0], None, 0)
        if self._position >= 0:
            self.counts['reruns'] += self._position != self._ran
            self.counts['steps_repeated'] += max(steps - self._progress.steps, 0)
        self._last_kept = self._progress.end
        self._position = self._ran = index + 1
        self._provisional = False

    def _merge(self, entry: Entry, channel: int, measurement: Any) -> bool:
        """Merge into the entry of the same stamp; return whether that changes anything."""
        before = entry.parts[channel]
        if before is None:
            entry.parts[channel] = measurement
            return True
        if channel in (INERTIAL, REFERENCE):
            merged, overlap = measurement, True
        else:
            merged, overlap = merge_wheels(before, measurement)
        self.repeated[channel] += overlap
        if same(before, merged):
            return False
        self.contradicted[channel] += overlap
        entry.parts[channel] = merged
        return True
