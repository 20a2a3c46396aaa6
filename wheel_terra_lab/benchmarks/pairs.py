# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Interleaved pairs of timings: what both sides suffer from the machine cancels in the ratio."""

from __future__ import annotations

import resource
import statistics
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Figure:
    """Processor times [s] of ours and of what stands beside it, one of each per pair."""

    name: str
    beside: str  # the floor or peer
    ours: tuple[float, ...]  # time of one unit of work [s], pair by pair
    other: tuple[float, ...]
    drive: float = 0.0  # length of the drive of a replay [s]; 0 for everything else

    @property
    def ratios(self) -> list[float]:
        """Time of the other over ours, pair by pair: how many times faster ours is."""
        return [b / a for a, b in zip(self.ours, self.other, strict=True)]

    @property
    def ratio(self) -> float:
        """Median of `ratios`."""
        return statistics.median(self.ratios)

    @property
    def seconds(self) -> float:
        """Median of `ours` [s]."""
        return statistics.median(self.ours)

    def as_dict(self) -> dict[str, object]:
        """Return the figure for JSON."""
        return {
            'name': self.name,
            'beside': self.beside,
            'seconds': self.seconds,
            'seconds_beside': statistics.median(self.other),
            'times_as_fast': self.ratio,
            'least': min(self.ratios),
            'greatest': max(self.ratios),
            'pairs': len(self.ours),
            'real_time_factor': self.drive / self.seconds if self.drive else None,
        }


def timed_pairs(
    name: str,
    ours: tuple[Callable[[], object], int],  # with the units of work that one call does
    beside: str,
    other: tuple[Callable[[], object], int],
    pairs: int,
    drive: float = 0.0,
) -> Figure:
    """Time two callables in turn; of several pairs, each after one call that does not count."""
    if pairs > 1:
        for call, _ in (ours, other):
            call()
    times: list[tuple[float, float]] = []
    for _ in range(pairs):
        times.append((_seconds(*ours), _seconds(*other)))
    mine, theirs = zip(*times, strict=True)
    return Figure(name, beside, mine, theirs, drive)


def _seconds(call: Callable[[], object], units: int) -> float:
    before = _processor_time()
    call()
    return max(_processor_time() - before, 1e-9) / units


def _processor_time() -> float:
    """Return the processor time [s] of this process and of those that it has waited for."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(u.ru_utime + u.ru_stime for u in used)
