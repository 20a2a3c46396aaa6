# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The estimator core: typed measurements in, sets of estimates out; no ROS, no file format.

A measurement is corrected for the configured errors of its sensor, its values are checked, then its
clock; the timeline sorts by stamp and decides when an output is due. Estimator and input monitor
(`InputJudge`) then step through the log together; the monitor may change the estimates, and the
output guard checks them. Node and replay differ only in who calls ``add``: the same calls give
the same numbers.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from math import isnan
from typing import Any, Protocol

import numpy as np

from wheel_terra_estimator.configuration import Configuration
from wheel_terra_estimator.estimation.estimates import EstimateSet, SlipClass
from wheel_terra_estimator.estimation.judgement.classes import PublishedClasses
from wheel_terra_estimator.estimation.judgement.stuck.memory import StuckMemory
from wheel_terra_estimator.estimation.measurements import Measurement, WheelOdometry
from wheel_terra_estimator.estimation.output_guard import OutputGuard
from wheel_terra_estimator.estimation.scalars import NANOSECOND, SECOND
from wheel_terra_estimator.estimation.sensor_errors import SensorErrors
from wheel_terra_estimator.estimation.taught import Taught
from wheel_terra_estimator.estimation.timing.clock_watch import (
    Arrival,
    ClockWatch,
    Judgement,
    Suspicion,
)
from wheel_terra_estimator.estimation.timing.input_checks import (
    CHANNELS,
    INERTIAL,
    REFERENCE,
    WHEEL_ODOMETRY,
    InputChecks,
)
from wheel_terra_estimator.estimation.timing.input_log import Estimator, InputLog, Stepped
from wheel_terra_estimator.estimation.timing.lag import LONGEST_HOLD, LagLearner
from wheel_terra_estimator.estimation.timing.step_grid import TimeSettings
from wheel_terra_estimator.estimation.timing.timeline import Due, Fate, Timeline

_MOST_TOO_OLD = 0.1  # share of the messages of an input that may be dropped for that without a word
_TOO_OLD_GAIN = 0.02  # of that share, per message: a memory of fifty
_FAILURES = (ArithmeticError, ValueError, IndexError, np.linalg.LinAlgError)
"""Numerical errors that a step may raise; they are caught and reported."""


class InputJudge(Stepped, Protocol):
    """Monitor of the inputs that runs beside the estimator and may change its estimates."""

    def judged(self, estimates: EstimateSet, health: Mapping[str, Any]) -> EstimateSet:
        """Return the estimates as they may be published."""


class EstimatorCore:
    """Estimates of one rover from its measurements."""

    def __init__(
        self,
        configuration: Configuration,
        estimator: Estimator | None = None,  # default: ``WheelSoilEstimator``
        judged_by: Callable[[Configuration], InputJudge] | None = None,
    ) -> None:
        self._estimator = estimator or _estimator(configuration)
        self._judge = judged_by(configuration) if judged_by else None
        settings = _time_settings(configuration)
        self._lags = LagLearner(settings.max_lag)
        self._watch = ClockWatch(
            len(CHANNELS), settings.clock_step, self._lags.longest, settings.history
        )
        self._errors = SensorErrors(configuration)
        self._checks = InputChecks(configuration)
        self._guard = OutputGuard(configuration)
        self._classes = PublishedClasses(configuration)
        self.warning = StuckMemory(configuration)  # it survives all restarts but `reset`
        self._log = InputLog(self._runners(), settings)
        self._timeline = Timeline(self._log, settings)
        self._received = [0] * len(CHANNELS)
        self._late = [0] * len(CHANNELS)
        self._too_old = [0.0] * len(CHANNELS)  # recent share of messages
        self._deferred = False  # since the last set
        self._reruns = 0  # until the last set
        self._latest: EstimateSet | None = None
        self._first_set: int | None = None  # stamp of that of the run [ns]
        self._second = -1  # of the last set, from then on
        self._clock_steps = 0
        self._clock_stepped = False  # since the last set
        self._resets = 0

    def add(self, measurement: Measurement) -> list[EstimateSet]:
        """Process the next measurement that arrived; return the estimates now due, oldest first."""
        channel = CHANNELS[type(measurement)]
        self._received[channel] += 1
        checked = self._checks.check(channel, self._errors.corrected(measurement))
        if checked is None:
            return []
        return self._follow(self._watch.judge(channel, checked, self._lags.present))

    def run(self, measurements: Iterable[Measurement]) -> Iterator[EstimateSet]:
        """Yield the estimates of a whole drive, whose measurements are in the order of arrival."""
        for measurement in measurements:
            yield from self.add(measurement)
        yield from self.flush()

    def process_pending(self) -> None:
        """Compute pending steps in idle time, so that the next output has less to do.

        Changes no number: a step that fails is repeated, and reported, at the next output.
        """
        if self._timeline.released:
            with suppress(*_FAILURES), np.errstate(all='ignore'):
                self._log.process_pending(self._timeline.released - 1)

    def flush(self) -> list[EstimateSet]:
        """Return the estimates held back for late inputs, at the end of the data."""
        sets = self._follow(self._watch.finish())
        return sets + self._flushed()

    def reset(self) -> None:
        """Forget the state, keep the parameters; the next measurement begins a new run."""
        self._resets += 1
        self._latest = None
        self.warning.clear()
        self._watch.reset()
        self._end_run(keep_soil=False)

    def retune(self, configuration: Configuration) -> None:
        """Continue from the present state with other tuning (``filter.*``, rates, lag, history).

        What is held back is released first. Wheels, sensors and soil must be the same.
        """
        self._ran_on()  # the state is the same whatever was run before
        self._estimator = _estimator(configuration)
        settings = _time_settings(configuration)
        self._lags.fixed = settings.max_lag
        self._watch.retune(settings.clock_step, self._lags.longest, settings.history)
        self._classes.retune(configuration)
        self.warning.retune(configuration)
        self._log.retune(self._runners(), settings)
        self._timeline.retune(settings)

    def learned(self) -> dict[str, Any]:
        """Return identified soil and sensor parameters: key -> value; ``_std`` = deviation.

        Empty where there were no estimates yet.
        """
        if self._latest is None:
            return {}
        return dict(getattr(self._estimator, 'learned', dict)())

    def taught(self) -> tuple[Taught, ...]:
        """Return the information gained on soil and sensors; empty before estimates."""
        if self._latest is None:
            return ()
        return tuple(getattr(self._estimator, 'taught', tuple)())

    @property
    def rejected(self) -> Counter[tuple[str, str]]:
        """Number of rejected messages, or parts of them, by (input topic, reason)."""
        counted = zip(self._checks.names, self._checks.rejected, strict=True)
        return Counter({(name, why): n for name, counts in counted for why, n in counts.items()})

    @property
    def repeated(self) -> dict[str, int]:
        """Number of messages merged because their stamp is repeated, by input topic."""
        counted = zip(self._checks.names, self._log.repeated, strict=True)
        return {name: count for name, count in counted if count}

    def health(self) -> dict[str, Any]:
        """Return counters and texts for diagnostics: key (with its unit, if any) -> value."""
        result: dict[str, Any] = {}
        checks, log = self._checks, self._log
        for channel, name in enumerate(checks.names):
            unused = checks.refused[channel] + (log.thinned if channel == REFERENCE else 0)
            result[f'{name}_used'] = self._received[channel] - unused
            if self._late[channel]:
                result[f'{name}_late'] = self._late[channel]
            if log.repeated[channel]:
                result[f'{name}_stamp_repeated'] = log.repeated[channel]
            for reason, count in checks.rejected[channel].items():
                result[f'{name}_rejected: {reason}'] = count
        result |= self._timeline.counts | log.counts
        result['held_back_s'] = self._lags.hold() * NANOSECOND
        result['clock_steps_back'] = self._clock_steps
        result['resets'] = self._resets
        own = self._estimator.health()
        # Restarts by the filter itself and by the core both count.
        own['filter_restarts'] = own.get('filter_restarts', 0) + result['filter_restarts']
        taught = {f'taught {each.name}': each.in_words() for each in self.taught()}
        return result | own | taught

    def _runners(self) -> list[Stepped]:
        return [self._estimator] if self._judge is None else [self._judge, self._estimator]

    def _follow(self, judgement: Judgement) -> list[EstimateSet]:
        sets: list[EstimateSet] = []
        for suspicion, arrival in judgement.strays:
            if suspicion is Suspicion.BEHIND:
                sets += self._insert(arrival, stray=True)
            else:
                self._checks.refuse(
                    arrival.channel, 'stamp far ahead of all others (set its clock)'
                )
        if judgement.stepped_back:
            self._clock_steps += 1
            sets += self._flushed()
            self.warning.begin_anew()
            self._end_run(keep_soil=self._ran_on())
            self._clock_stepped = True
        for arrival in judgement.accepted:
            sets += self._insert(arrival)
        present = self._lags.present
        if judgement.accepted and present is not None:
            hold = self._lags.hold()
            overdue = max(self._lags.learned[WHEEL_ODOMETRY] - hold, 0)
            sets += [self._published(due) for due in self._timeline.advance(present, hold, overdue)]
        return sets

    def _flushed(self) -> list[EstimateSet]:
        """Return the estimates held back, except stamps of a clock that is ahead."""
        end = (self._lags.present or 0) + LONGEST_HOLD
        return [self._published(due) for due in self._timeline.flush(end)]

    def _ran_on(self) -> bool:
        """Process all released inputs, so that the state is independent of earlier calls."""
        try:
            with np.errstate(all='ignore'):
                if self._timeline.released:
                    self._log.run_to(self._timeline.released - 1)
        except _FAILURES:
            return False
        return True

    def _end_run(self, keep_soil: bool) -> None:
        self._timeline.end_run(keep_soil=keep_soil)
        self._classes.reset()
        self._first_set, self._second = None, -1
        self._lags.begin_run()

    def _insert(self, arrival: Arrival, *, stray: bool = False) -> list[EstimateSet]:
        """Put an input into the log; the stamp of a `stray` says nothing of the lags."""
        channel, measurement = arrival
        contradicted = self._log.contradicted[channel]
        fate, due = self._timeline.insert(channel, measurement)
        too_old = fate is Fate.TOO_OLD
        self._too_old[channel] += _TOO_OLD_GAIN * (too_old - self._too_old[channel])
        if not (stray or too_old):
            rates = measurement.rate.tolist() if isinstance(measurement, WheelOdometry) else ()
            self._lags.note(channel, measurement.stamp, whole=not isnan(sum(rates)))
        if self._log.contradicted[channel] != contradicted:
            self._checks.reject(channel, 'stamp repeated with other numbers (the newer ones count)')
        if fate in (Fate.LATE, Fate.DEFERRED):
            self._late[channel] += 1
            self._deferred |= fate is Fate.DEFERRED
        elif too_old:
            self._checks.refuse(channel, 'stamp older than `history` (raise it, or set its clock)')
        elif fate is Fate.FULL:
            self._checks.refuse(channel, 'more inputs than can be held for sorting')
        return [] if due is None else [self._published(due)]

    def _estimated(self, due: Due) -> EstimateSet | Exception:
        """Advance estimator and input monitor to a due output; return estimates or error."""
        try:
            with np.errstate(all='ignore'):  # the guard looks at the result, number by number
                self._log.run_to(due.entry)
                estimates = self._estimator.estimates()
                if self._judge is None:
                    return estimates
                return self._judge.judged(estimates, self._estimator.health())
        except _FAILURES as error:
            return error

    def _published(self, due: Due) -> EstimateSet:
        """Return the estimates that are due, as published."""
        stamp, silent = due.stamp, due.silent
        estimates, failed = self._guard.repaired(stamp, self._estimated(due))
        faults = self._faults(silent)
        if faults:
            estimates = replace(estimates, faults={**estimates.faults, **faults})
        if silent:
            unknown = np.full(len(estimates.slip_class), SlipClass.UNKNOWN, dtype=np.uint8)
            estimates = replace(estimates, slip_class=unknown)
        reruns, self._reruns = self._reruns, self._log.counts['reruns']
        estimates = self.warning.follow(
            self._classes.follow(estimates), run_again=self._reruns != reruns
        )
        self._first_set = stamp if self._first_set is None else self._first_set
        before, self._second = self._second, (stamp - self._first_set) // SECOND
        if self._second == before:
            estimates = replace(estimates, slip_on_slope=None)  # at 1 Hz
        if failed:
            self.warning.begin_anew()
            self._timeline.begin_after(due)
        self._latest = estimates
        return estimates

    def _faults(self, silent: bool) -> dict[str, str]:
        """Return faults of the inputs since the last output: name -> message."""
        faults, names = {}, self._checks.names
        if self._deferred:
            self._deferred = False
            rate = self._timeline.settings.rerun_rate
            faults['late inputs'] = (
                f'more than {rate:.0f} steps a second would be repeated '
                '(filter.rerun_rate): fused late'
            )
        if self._clock_stepped:
            self._clock_stepped = False
            faults['clock'] = (
                f'stamps went back ({self._clock_steps} so far): a new run begins, soil is '
                'kept (a looped recording, a clock that was set, or sources of different clocks)'
            )
        for channel, by in self._lags.clock_offsets.items():
            where = 'ahead of wheels and IMU' if by > 0 else f'behind {names[INERTIAL - channel]}'
            faults[names[channel]] = (
                f'stamps {abs(by) / SECOND:.1f} s {where}: late, or a clock is off -> set the '
                'clocks, or sensors.*_stamp_offset of the one that is off'
            )
        for name, share in zip(names, self._too_old, strict=True):
            if share > _MOST_TOO_OLD:
                history = self._timeline.settings.history / SECOND
                late = f'many messages are more than {history:g} s late and dropped'
                faults.setdefault(name, f'{late} -> raise history, or set its clock')
        if silent:
            name, every = names[WHEEL_ODOMETRY], self._timeline.slow_odometry
            words = f'no usable message on {name}: wheel rates unknown'
            if every:
                words = f'{name} arrives every {every:.1f} s -> filter.silence: {2.5 * every:.1f}'
            faults['wheel_odometry'] = words
        return faults


def _estimator(configuration: Configuration) -> Estimator:
    from wheel_terra_estimator.estimation.wheel_soil_estimator import WheelSoilEstimator

    return WheelSoilEstimator(configuration)


def _time_settings(configuration: Configuration) -> TimeSettings:
    rate, tuning = configuration.reference_odom_max_rate, configuration.filter
    return TimeSettings(
        output_rate=configuration.output_rate,
        max_lag=_nanoseconds(configuration.max_lag) if configuration.max_lag >= 0.0 else -1,
        clock_step=_nanoseconds(tuning.clock_step),
        history=_nanoseconds(configuration.history),
        silence=_nanoseconds(tuning.silence),
        heartbeat=max(_nanoseconds(1.0 / tuning.heartbeat_rate), 1),
        reference_period=_nanoseconds(1.0 / rate) if rate else 0,
        # Where every stamp is a set, any number of steps may be run again.
        rerun_rate=float(tuning.rerun_rate) if configuration.output_rate > 0.0 else 0.0,
    )


def _nanoseconds(seconds: float) -> int:
    return round(seconds * SECOND)
