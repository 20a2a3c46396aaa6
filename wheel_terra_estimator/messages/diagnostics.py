# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What ``/diagnostics`` says, as plain values, and when it is due (REP 107)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from wheel_terra_estimator.estimation.estimates import EstimateSet, SlipClass

OK, WARN, ERROR, STALE = range(4)

NODE = 'wheel_terra_estimator'
PERIOD = 1_000_000_000
"""Time between two messages when no level changes [ns]."""

NO_TIME_TO_STUCK = 600.0
"""Time to an entrapment [s] that is said where none is in sight."""

LEVEL_HOLD = 1_000_000_000
"""A level of the node's own must be over for so long [ns of stamps] before it falls."""

SMALLEST = 1e-12
"""Smaller numbers are written as 0: no unit of this package makes them anything else."""

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


def stale_statuses(
    names: Sequence[str],
    words: str,
    counters: Mapping[str, Any],
    latest: EstimateSet | None = None,
    node_name: str = NODE,
) -> list[Status]:
    """Return the statuses of a node without estimates; values are held as in the latest set."""
    stuck = latest is not None and latest.stuck
    values = [('stuck', str(stuck).lower()), *_values(counters)]
    node = Status(STALE, f'{node_name}: estimator', words, node_name, values)
    if latest is None:
        values = _values({'stuck_probability': 0.0, 'time_to_stuck_s': NO_TIME_TO_STUCK})
        values.append(('reason', words))
        return [
            node,
            *(
                Status(STALE, f'{node_name}: {n}', words, _hardware(node_name, n), values)
                for n in names
            ),
        ]
    unknown = replace(
        latest,
        slip_class=np.full(len(names), SlipClass.UNKNOWN, dtype=np.uint8),
        reasons=(words,) * len(names),
    )
    wheels = (_wheel_status(unknown, i, name, node_name) for i, name in enumerate(names))
    return [node, *(status._replace(level=STALE) for status in wheels)]


class Diagnostics:
    """Decides for each estimate set whether a message is due, and what it says.

    Parameters
    ----------
    names : sequence of str
        Wheel names.
    counters : callable
        Returns further key-values of the node (unit in the key); asked only when one is due.
    faults : callable
        Takes a stamp [ns], returns faults that the set does not know of, in words.
    node_name : str
        Name of the node with its namespace, for names and hardware ids.
    """

    def __init__(
        self,
        names: Sequence[str],
        counters: Callable[[], Mapping[str, Any]] = dict,
        faults: Callable[[int], Mapping[str, str]] = lambda stamp: {},
        node_name: str = NODE,
    ) -> None:
        self.node_name = node_name
        self._names = names
        self._counters = counters
        self._faults = faults
        self._stamp: int | None = None
        self._levels: list[int] = []
        self._raised: tuple[int, int] | None = None  # level of the node, when it was last that high
        self._lacking: set[str] | None = None  # subjects with a fault in every set so far

    def due(self, estimates: EstimateSet) -> list[Status]:
        """Return the statuses if a message is due, else nothing.

        It is due every second of stamps, and at once when a level changes.
        """
        found = estimates.faults.keys()
        self._lacking = found - _NEEDED if self._lacking is None else self._lacking & found
        levels = [self._node_level(estimates)]
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
        return [
            self._node_status(estimates),
            *(
                _wheel_status(estimates, i, name, self.node_name)
                for i, name in enumerate(self._names)
            ),
        ]

    def _node_level(self, estimates: EstimateSet) -> int:
        """Return the level: it rises at once and falls a while after what raised it."""
        level, stamp = self._level_of_now(estimates), estimates.stamp
        raised = self._raised
        if raised is None or level >= raised[0] or not 0 <= stamp - raised[1] < LEVEL_HOLD:
            self._raised = level, stamp
            return level
        return raised[0]

    def _level_of_now(self, estimates: EstimateSet) -> int:
        """A rover without a sensor is not at fault; a sensor that fell silent is."""
        if estimates.stuck:
            return ERROR
        lost = estimates.faults.keys() - (self._lacking or set())
        return WARN if lost or self._faults(estimates.stamp) else OK

    def _node_status(self, estimates: EstimateSet) -> Status:
        faults = {**estimates.faults, **self._faults(estimates.stamp)}
        words = ['stuck, or about to be'] if estimates.stuck else []
        words += [f'{subject}: {fault}' for subject, fault in faults.items()]
        level = self._node_level(estimates)
        running = 'running' if level == OK else 'running again'
        return Status(
            level=level,
            name=f'{self.node_name}: estimator',
            message='; '.join(words) or running,
            hardware_id=self.node_name,
            values=[('stuck', str(estimates.stuck).lower()), *_values(self._counters())],
        )


def _wheel_level(estimates: EstimateSet, i: int) -> int:
    slip_class = SlipClass(int(estimates.slip_class[i]))
    if slip_class in _CLASS_WORDS:
        return _CLASS_WORDS[slip_class][0]
    if 'wheel_odometry' in estimates.faults:
        return STALE
    return OK if estimates.reasons[i].startswith('at rest') else WARN


def _wheel_status(estimates: EstimateSet, i: int, name: str, node_name: str) -> Status:
    e = estimates
    reason = e.reasons[i]
    slip_class = SlipClass(int(e.slip_class[i]))
    message = _CLASS_WORDS[slip_class][1] if slip_class in _CLASS_WORDS else reason
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
    return Status(_wheel_level(e, i), f'{node_name}: {name}', message, hardware, values)


def _hardware(node_name: str, wheel: str) -> str:
    """Return the id of a wheel: its name, below the namespace of the node."""
    namespace, separator, _ = node_name.rpartition('/')
    return f'{namespace}{separator}{wheel}'


def _values(counters: Mapping[str, Any]) -> list[tuple[str, str]]:
    return [
        (key, f'{_no_dust(value):.6g}' if isinstance(value, float) else str(value))
        for key, value in counters.items()
    ]


def _no_dust(value: float) -> float:
    return 0.0 if abs(value) < SMALLEST else value
