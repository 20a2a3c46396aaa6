# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Arrival of the inputs: rate, age, delay and loss of each topic, and faults as text.

Times are of a steady clock, so that silence is seen when nothing comes any more.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

PERIODS_TO_SILENCE = 3.0
LEAST_SILENCE = 0.75  # [s]
MESSAGES_TO_PERIOD = 3  # from which the period of a topic is known
UNKNOWN_PERIOD = 5.0  # [s] of silence until then
BEHIND = 0.5  # [s] from which it is reported, and beyond which no topic is called silent
AHEAD = 1.0  # [s] of stamps before the clock here, from which it is reported
START = 1.0  # [s] in which the process may be late
RESTARTS = 2  # of publishers in a row of looks at them, at most
_SMOOTHING = 0.1


@dataclass(slots=True)
class _Topic:
    """State of one topic."""

    received: int = 0
    last_time: float = 0.0
    period: float = 0.0
    delay: float = 0.0
    ahead: float = 0.0  # least of what the stamps were before the clock
    latest: float = -math.inf  # greatest delay since the last report
    number: int | None = None  # of the publisher's last message
    gaps: int = 0  # in these numbers since the last look at the publishers
    mixed: bool = False  # a number from before: another publisher's, and so are the gaps
    lost: int = 0
    reported: int = 0  # of these
    numbers: dict[str, int] = field(default_factory=dict)  # of the last message with a wheel
    back: int = 0  # times that these went back since the last look at the publishers
    backs: int = 0  # the same since one look without any
    twice: bool = False  # two publishers send one wheel


class InputWatch:
    """Watches the transport of the input topics."""

    def __init__(self) -> None:
        self._topics: dict[str, _Topic] = {}
        self._first_look: float | None = None
        self._looked_at = 0.0
        self._behind = self._worst = 0.0
        self.awake = -math.inf  # since then it is not late [s]; what was sent before may yet come

    def looked(self, now: float, period: float) -> None:
        """Note that what the middleware had was taken, as should be done once a period [s]."""
        if self._first_look is None:
            self._first_look = now
        if now - self._first_look > START:
            self._behind = max(now - self._looked_at - period, 0.0)
            self._worst = max(self._worst, self._behind)
            # A topic that is always late would never be reported as silent.
            if self._behind > BEHIND and now - self.awake > UNKNOWN_PERIOD:
                self.awake = now
        self._looked_at = now

    def received(self, topic: str, now: float, delay: float, number: int | None) -> None:
        """Note a message at a steady time [s].

        ``delay``: time of the node's clock less the stamp [s]. ``number``: the publisher's count of
        its messages; None where several publish or it is not known.
        """
        state = self._topics.setdefault(topic, _Topic())
        if state.received:
            gap = now - state.last_time
            keep = _SMOOTHING if state.received > 10 else 1.0 / state.received
            state.period += keep * (gap - state.period)
        state.delay += (_SMOOTHING if state.received else 1.0) * (delay - state.delay)
        state.latest = max(state.latest, delay)
        state.last_time = now
        state.received += 1
        if number is not None and state.number is not None:
            state.gaps += max(number - state.number - 1, 0)
            state.mixed |= number <= state.number
        state.number = number

    def mixed(self, topic: str, wheels: Iterable[str], number: int) -> None:
        """Note the publisher's count in a message about `wheels`, where several publish.

        For each wheel it only grows, unless two publishers send it.
        """
        state = self._topics.setdefault(topic, _Topic())
        state.back += any(number <= state.numbers.get(wheel, 0) for wheel in wheels)
        state.numbers.update(dict.fromkeys(wheels, number))

    def believe_gaps(self, topics: Collection[str]) -> None:
        """Count the gaps in the numbers of these topics as lost, and forget all others."""
        for topic, state in self._topics.items():
            if topic in topics and not state.mixed:
                state.lost += state.gaps
            state.gaps, state.mixed = 0, False
            state.backs = state.backs + state.back if state.back else 0
            state.twice, state.back = state.backs > RESTARTS, 0

    def lost(self, topic: str, count: int) -> None:
        """Note messages that were sent and not received."""
        self._topics.setdefault(topic, _Topic()).lost += count

    def age(self, topic: str, now: float) -> float | None:
        """Return for how long a topic has been silent [s]; None if none was ever received."""
        state = self._topics.get(topic)
        return None if state is None or not state.received else now - state.last_time

    def is_silent(self, topic: str, now: float) -> bool:
        """Whether a topic that was received before is late by three of its periods."""
        age = self.age(topic, now)
        if age is None or (self._first_look is not None and now - self._looked_at > BEHIND):
            return False
        state = self._topics[topic]
        least = LEAST_SILENCE if state.received > MESSAGES_TO_PERIOD else UNKNOWN_PERIOD
        return min(age, now - self.awake) > max(least, PERIODS_TO_SILENCE * state.period)

    def faults(self, now: float) -> list[tuple[str, str]]:
        """Return topics that are silent, losses and delays since the last call, as text."""
        found = []
        if self._worst > BEHIND:
            words = f'read {self._worst:.1f} s late: this process lacks processor time'
            found.append(('inputs', words))
        self._worst = 0.0
        found += self._ahead(now)
        for topic, state in self._topics.items():
            if state.lost != state.reported:
                found.append((topic, f'{state.lost} messages lost in transport so far'))
                state.reported = state.lost
            if state.twice:
                found.append(
                    (
                        topic,
                        'two publishers send the same messages: stop one (see ros2 topic info -v)',
                    )
                )
            if self.is_silent(topic, now):
                found.append((topic, f'no message for {now - state.last_time:.1f} s'))
        return found

    def _ahead(self, now: float) -> list[tuple[str, str]]:
        """Return topics whose stamps all lie ahead of the clock, since they were last received."""
        for state in self._topics.values():
            if state.latest > -math.inf:
                state.ahead, state.latest = -state.latest, -math.inf
        current = {t: s.ahead for t, s in self._topics.items() if not self.is_silent(t, now)}
        ahead = {topic: by for topic, by in current.items() if by > AHEAD}
        if len(ahead) > 1 and len(ahead) == len(current):
            ahead = {'inputs': max(ahead.values())}
        words = 'stamps {:.0f} s ahead of the local clock: set the clocks, or stamp in the driver'
        return [(topic, words.format(by)) for topic, by in ahead.items()]

    def values(self, now: float) -> Mapping[str, Any]:
        """Return key -> value for diagnostics."""
        found: dict[str, Any] = {'inputs_behind_s': round(self._behind, 2)}
        for topic, state in self._topics.items():
            if state.received:
                silent = self.is_silent(topic, now)
                rate = 1.0 / state.period if state.period > 0.0 and not silent else 0.0
                found[f'{topic}_rate_Hz'] = round(rate, 2)
                found[f'{topic}_age_s'] = round(now - state.last_time, 3)
                found[f'{topic}_delay_s'] = round(state.delay, 4)
            found[f'{topic}_lost'] = state.lost
        return found
