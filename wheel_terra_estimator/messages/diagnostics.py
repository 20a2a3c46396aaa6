# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What ``/diagnostics`` says, as plain values, and when it is due (REP 107)."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from wheel_terra_estimator.estimation.estimates import EstimateSet, SlipClass
from wheel_terra_estimator.estimation.words import COST, NO_RATE, STALLED

SECOND = 1_000_000_000  # [ns]
MEMORY = 10 * SECOND  # how long a fault stands in words after it was last seen [ns]

_NUMBER = re.compile(r'[0-9]+(\.[0-9]+)?')


@dataclass(slots=True)
class _Fault:
    """A fault as it was last seen."""

    words: str
    seen: int
    published: bool = False


class FaultLog:
    """All faults of a node, in the order in which they were raised.

    Faults of one subject whose words differ in numbers only are one fault, seen again: counts and
    durations go on. It is cleared when it has been published and was not seen for 10 s.
    """

    def __init__(self) -> None:
        self._faults: dict[tuple[str, str], _Fault] = {}

    def note(self, faults: Iterable[tuple[str, str]], now: int) -> None:
        """Raise faults, or see them again.

        ``faults``: subject and words of each. ``now``: time [ns], of any clock; a step back begins
        the 10 s anew.
        """
        for subject, words in faults:
            fault = self._faults.setdefault((subject, _NUMBER.sub('#', words)), _Fault(words, now))
            fault.words, fault.seen = words, now

    def standing(self, now: int) -> list[str]:
        """Return the faults that stand, with subject and age; clear the others."""
        words = []
        for (subject, form), fault in list(self._faults.items()):
            fault.seen = min(fault.seen, now)
            age = now - fault.seen
            if fault.published and age >= MEMORY:
                del self._faults[subject, form]
                continue
            ended = f' ({age // SECOND} s ago)' if age >= SECOND else ''
            words.append(f'{subject}: {fault.words}{ended}')
        return words

    def publish(self) -> list[str]:
        """Take note that all faults are reported; return those that were not before."""
        new = []
        for (subject, _), fault in self._faults.items():
            if not fault.published:
                fault.published = True
                new.append(f'{subject}: {fault.words}')
        return new


OK, WARN, ERROR, STALE = range(4)

NODE = 'wheel_terra_estimator'
PERIOD = SECOND  # time between two messages when no level changes [ns]

NO_TIME_TO_STUCK = 600.0  # time to an entrapment [s] that is said where none is in sight

START = SECOND  # in the first second inputs may be on their way [ns]

SMALLEST = 1e-12
"""Smaller numbers are written as 0: no unit of this package makes them anything else."""

INPUTS = frozenset(COST)
_NEEDED = frozenset({'wheel_odometry', 'imu'})  # that no rover does without

_CLASS_WORDS = {
    SlipClass.LOW: (OK, 'low slip'),
    SlipClass.MODERATE: (OK, 'moderate slip'),
    SlipClass.HIGH: (WARN, 'high slip'),
    SlipClass.STUCK: (ERROR, 'stuck'),
}


class Status(NamedTuple):
    """Fields of a DiagnosticStatus."""

    level: int
    name: str
    message: str
    hardware_id: str
    values: list[tuple[str, str]]


class Diagnostics:
    """Decides for each estimate set whether a message is due, and what it says."""

    def __init__(
        self,
        names: Sequence[str],
        # Returns further key-values of the node (unit in the key); asked only when one is due
        counters: Callable[[], Mapping[str, Any]] = dict,
        # Returns faults that the sets do not know of, since it was last asked: subject and words
        faults: Callable[[], Iterable[tuple[str, str]]] = tuple,
        node_name: str = NODE,  # name of the node with its namespace, for names and hardware ids
    ) -> None:
        self.node_name = node_name
        # Stamp of a set [ns] -> time by which faults stand and are cleared [ns]: that stamp itself,
        # or for whoever looks on live the time of a clock
        self.clock: Callable[[int], int] = int
        self.new_faults: list[str] = []  # faults that the latest message was the first to tell
        self._names = names
        self._counters = counters
        self._faults = faults
        self._log = FaultLog()
        self._stamp: int | None = None
        self._levels: list[int] = []
        self._begun: int | None = None  # by the clock
        self._lacking: set[str] | None = None  # subjects with a fault in every set so far
        self._awaited: set[str] = set()  # inputs that may be on their way

    def begin_anew(self) -> None:
        """Wait for inputs as at the start: no input of before counts."""
        self._begun = None

    def look(self, stamp: int = 0) -> None:
        """Ask for the faults that the sets do not know of."""
        self._log.note(self._faults(), self.clock(stamp))

    def follow(self, estimates: EstimateSet) -> None:
        """Take the faults of a set.

        A rover without a sensor is not at fault; a sensor that fell silent is. What is missing in
        the first second may be on its way.
        """
        now, faults = self.clock(estimates.stamp), estimates.faults
        if self._begun is None or now < self._begun:
            self._begun = now
        optional = faults.keys() & (INPUTS - _NEEDED)
        self._lacking = optional if self._lacking is None else self._lacking & faults.keys()
        starts = now - self._begun < START
        self._awaited = faults.keys() & INPUTS if starts else set()
        passed_over = self._lacking | self._awaited
        self._log.note(((s, w) for s, w in faults.items() if s not in passed_over), now)
        if not starts and 'wheel_odometry' not in faults:
            wheels = zip(self._names, estimates.reasons, strict=True)
            self._log.note(((name, NO_RATE) for name, r in wheels if r.startswith(NO_RATE)), now)
        self.look(estimates.stamp)

    def due(self, estimates: EstimateSet) -> list[Status]:
        """Return the statuses if a message is due, else nothing.

        It is due every second of stamps, and at once when a level changes.
        """
        self.follow(estimates)
        levels = [self._level(estimates)]
        levels += [_wheel_level(estimates, i) for i in range(len(self._names))]
        stamp = estimates.stamp
        if (
            self._stamp is not None
            and levels == self._levels
            and 0 <= stamp - self._stamp < PERIOD  # a step back of the clock starts anew
        ):
            return []
        self._stamp, self._levels = stamp, levels
        return self.now(estimates)

    def now(self, estimates: EstimateSet) -> list[Status]:
        """Return the status of the node, then of each wheel."""
        words = [f'stuck: {estimates.stuck_reason}'] if estimates.stuck else []
        words += self._log.standing(self.clock(estimates.stamp))
        # Of these nothing is remembered: they hold for this set.
        lacking = sorted((self._lacking or set()) - self._awaited)
        words += [f'{subject}: {estimates.faults[subject]}' for subject in lacking]
        if self._awaited:
            words.append(f'waiting for {", ".join(sorted(self._awaited))}')
        values = [('stuck', str(estimates.stuck).lower()), *_values(self._counters())]
        node = self._node_status(self._level(estimates), '; '.join(words) or 'running', values)
        return [node, *self._wheel_statuses(estimates)]

    def stale(self, words: str, latest: EstimateSet | None = None) -> list[Status]:
        """Return the statuses while there are no estimates; values are held as in the latest set.

        ``words``: why there are none.
        """
        self.look()
        text = '; '.join([words, *self._log.standing(self.clock(0))])
        stuck = latest is not None and latest.stuck
        values = [('stuck', str(stuck).lower()), *_values(self._counters())]
        node = self._node_status(STALE, text, values)
        if latest is not None:
            unknown = replace(
                latest,
                slip_class=np.full(len(self._names), SlipClass.UNKNOWN, dtype=np.uint8),
                reasons=(words,) * len(self._names),
            )
            return [node, *(s._replace(level=STALE) for s in self._wheel_statuses(unknown))]
        values = _values({'stuck_probability': 0.0, 'time_to_stuck_s': NO_TIME_TO_STUCK})
        values.append(('reason', words))
        own = self.node_name
        wheels = ((f'{own}: {name}', _hardware(own, name)) for name in self._names)
        return [node, *(Status(STALE, name, words, identity, values) for name, identity in wheels)]

    def _level(self, estimates: EstimateSet) -> int:
        if estimates.stuck:
            return ERROR
        return WARN if self._log.standing(self.clock(estimates.stamp)) else OK

    def _node_status(self, level: int, words: str, values: list[tuple[str, str]]) -> Status:
        """Return the status of the node; its faults are published with it."""
        self.new_faults = self._log.publish()
        return Status(level, f'{self.node_name}: estimator', words, self.node_name, values)

    def _wheel_statuses(self, estimates: EstimateSet) -> list[Status]:
        return [
            _wheel_status(estimates, i, name, self.node_name) for i, name in enumerate(self._names)
        ]


def _wheel_level(estimates: EstimateSet, i: int) -> int:
    slip_class = SlipClass(int(estimates.slip_class[i]))
    if slip_class in _CLASS_WORDS:
        return _CLASS_WORDS[slip_class][0]
    if 'wheel_odometry' in estimates.faults or estimates.reasons[i].startswith(NO_RATE):
        return STALE
    return OK if estimates.reasons[i].startswith('at rest') else WARN


def _wheel_status(estimates: EstimateSet, i: int, name: str, node_name: str) -> Status:
    e = estimates
    reason = e.reasons[i]
    slip_class = SlipClass(int(e.slip_class[i]))
    level, message = _wheel_level(e, i), reason
    if slip_class in _CLASS_WORDS and not reason.startswith(STALLED):
        message = _CLASS_WORDS[slip_class][1]
    elif reason.startswith('slip'):
        message = NO_RATE if level == STALE else f'unknown: {reason}'
    numbers = {
        'slip': e.slip[i],
        'slip_stddev': e.slip_std[i],
        'slip_velocity_m_per_s': e.slip_velocity[i],
        'sinkage_m': e.sinkage[i],
        'sinkage_stddev_m': e.sinkage_std[i],
        'drawbar_pull_N': e.drawbar_pull[i],
        'drawbar_pull_stddev_N': e.drawbar_pull_std[i],
        'normal_load_N': e.normal_load[i],
        'rim_travel_left_m': e.rim_travel_left[i],
        'pull_margin_N': e.pull_margin[i],
        'stuck_probability': e.stuck_probability[i],
        'time_to_stuck_s': e.time_to_stuck[i],
    }
    values = [*_values(numbers), ('slip_class', slip_class.name.lower()), ('reason', reason)]
    hardware = _hardware(node_name, name)
    return Status(level, f'{node_name}: {name}', message, hardware, values)


def _hardware(node_name: str, wheel: str) -> str:
    """Return the id of a wheel: its name, below the namespace of the node."""
    namespace, separator, _ = node_name.rpartition('/')
    return f'{namespace}{separator}{wheel}'


def _values(counters: Mapping[str, Any]) -> list[tuple[str, str]]:
    return [
        (
            key,
            f'{0.0 if abs(value) < SMALLEST else value:.6g}'
            if isinstance(value, float)
            else str(value),
        )
        for key, value in counters.items()
    ]
