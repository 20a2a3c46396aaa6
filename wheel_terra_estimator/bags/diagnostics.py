# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What ``/diagnostics`` says, as plain values, and when it is due (REP 107)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from wheel_terra_estimator.estimation.estimates import EstimateSet, SlipClass

OK, WARN, ERROR, STALE = range(4)

NODE = 'wheel_terra_estimator'
PERIOD = 1_000_000_000
"""Time between two messages when no level changes [ns]."""

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


def statuses(
    estimates: EstimateSet,
    names: Sequence[str],
    counters: Mapping[str, Any],
    faults: Mapping[str, str] | None = None,
) -> list[Status]:
    """Return the status of the node, then of each wheel.

    Parameters
    ----------
    estimates : EstimateSet
        The set that is reported.
    names : sequence of str
        Wheel names.
    counters : mapping
        Further key-values of the node (unit in the key).
    faults : mapping of str to str
        Faults that the set does not know of (transport, layout of messages), in words.
    """
    found = {**estimates.faults, **(faults or {})}
    return [
        _node_status(estimates, counters, found),
        *(_wheel_status(estimates, i, name) for i, name in enumerate(names)),
    ]


def stale_statuses(names: Sequence[str], words: str, counters: Mapping[str, Any]) -> list[Status]:
    """Return the statuses of a node that hears nothing."""
    return [
        Status(STALE, f'{NODE}: estimator', words, NODE, _values(counters)),
        *(Status(STALE, f'{NODE}: {name}', words, name, []) for name in names),
    ]


class Schedule:
    """Says when a message is due: every second, and at once when a level changes."""

    def __init__(self) -> None:
        self._stamp: int | None = None
        self._levels: list[int] = []

    def due(self, stamp: int, found: Sequence[Status]) -> bool:
        """Return whether the statuses at a stamp [ns] are to be sent; they count as sent then."""
        levels = [status.level for status in found]
        if (
            self._stamp is None
            or levels != self._levels
            or not 0 <= stamp - self._stamp < PERIOD  # a step back of the clock starts anew
        ):
            self._stamp, self._levels = stamp, levels
            return True
        return False


def _node_status(
    estimates: EstimateSet, counters: Mapping[str, Any], faults: Mapping[str, str]
) -> Status:
    level, message = OK, 'running'
    if faults:
        level = WARN
        message = '; '.join(f'{subject}: {words}' for subject, words in faults.items())
    if estimates.stuck:
        level = ERROR
        message = 'stuck, or about to be' + (f'; {message}' if faults else '')
    values = [('stuck', str(estimates.stuck).lower()), *_values(counters)]
    return Status(level, f'{NODE}: estimator', message, NODE, values)


def _wheel_status(estimates: EstimateSet, i: int, name: str) -> Status:
    e = estimates
    reason = e.reasons[i]
    slip_class = SlipClass(int(e.slip_class[i]))
    level, message = _CLASS_WORDS.get(slip_class, (WARN, reason or 'slip class unknown'))
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
    return Status(level, f'{NODE}: {name}', message, name, values)


def _values(counters: Mapping[str, Any]) -> list[tuple[str, str]]:
    return [
        (key, f'{value:.6g}' if isinstance(value, float) else str(value))
        for key, value in counters.items()
    ]
