# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The life of a fault: raised, counted, told for a while and at least once, then cleared."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

MEMORY = 10_000_000_000  # how long a fault stands in words after it was last seen [ns]

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
        """Return the faults that stand, each with its subject in front; clear the others."""
        for key, fault in list(self._faults.items()):
            if now < fault.seen:
                fault.seen = now
            elif fault.published and now - fault.seen >= MEMORY:
                del self._faults[key]
        return [f'{subject}: {f.words}' for (subject, _), f in self._faults.items()]

    def publish(self) -> list[str]:
        """Take note that all faults are told; return those that were not before."""
        new = []
        for (subject, _), fault in self._faults.items():
            if not fault.published:
                fault.published = True
                new.append(f'{subject}: {fault.words}')
        return new
