# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What a replay writes, in order, and the same from the fixed-interval smoother."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from wheel_terra_estimator.bags.history import HistoryRecorder
from wheel_terra_estimator.estimation.estimates import EstimateSet
from wheel_terra_estimator.estimation.smoothing.smoother import DriveSmoother
from wheel_terra_estimator.messages.diagnostics import Diagnostics, Status


class Event(NamedTuple):
    """A set at its log time [ns]; without one, a start or a reset: no warning runs."""

    log_time: int
    estimates: EstimateSet | None = None
    statuses: list[Status] | None = None  # what diagnostics said of it; None: not asked yet


def smoothed(
    events: Iterator[Event],
    smoother: DriveSmoother,
    live: HistoryRecorder,
    diagnostics: Diagnostics,
) -> Iterator[Event]:
    """Yield the events of a drive with the sets of its smoother, once all have come.

    Parameters
    ----------
    events : iterator of Event
        Of the forward pass, whose estimator is that of the smoother.
    smoother : DriveSmoother
        Keeps them.
    live : HistoryRecorder
        Gets the sets of the filter.
    diagnostics : Diagnostics
        Asked set by set, as the live node asks it.
    """
    starts: list[Event] = []
    for event in events:
        if event.estimates is None:
            starts.append(event)
            continue
        live.add(event.estimates)
        statuses = diagnostics.due(event.estimates)
        smoother.keep(event.estimates, (tuple(starts), event.log_time, statuses))
        starts = []
    for estimates, (before, log_time, statuses) in smoother.sets():
        yield from before
        yield Event(log_time, estimates, statuses)
    yield from starts
