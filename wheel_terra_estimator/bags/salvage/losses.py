# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What a damaged file has lost, counted and in words."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field

SHOWN_TOPICS = 6
SHOWN_SPANS = 4
LONGEST_END = 60_000_000_000  # [ns] behind the last message that was read


@dataclass
class Losses:
    """Losses of a file, collected while it is read."""

    name: str  # of the file
    # Messages on each topic, as the file itself states; None where it does not
    declared: Mapping[str, int] | None = None
    # Messages on each topic that were read to the end
    recovered: dict[str, int] = field(default_factory=dict)
    state: str = ''  # fault of the file as a whole, empty if there is none
    # Place of a damage in the file -> log times [ns] between which it lies, None if unknown
    spans: dict[int, tuple[int, int] | None] = field(default_factory=dict)
    # Place of a chunk with a wrong checksum -> number of messages in it
    doubtful: dict[int, int] = field(default_factory=dict)
    left_out: list[str] = field(default_factory=list)  # what was not read on purpose, in words
    start: int | None = None  # first and last log time that were read [ns]
    last: int | None = None

    def lost(self) -> Counter[str]:
        """Return how many messages are missing on each topic, as far as it can be told."""
        declared = self.declared or {}
        return Counter(
            {
                topic: declared[topic] - count
                for topic, count in self.recovered.items()
                if declared.get(topic, 0) > count
            }
        )

    def in_words(self) -> list[str]:
        """Return messages on the losses of a file, empty if there are none."""
        lost = self.lost()
        if not (self.state or self.spans or self.doubtful or self.left_out or lost):
            return []
        total = sum(self.recovered.values())
        declared = sum((self.declared or {}).get(topic, 0) for topic in self.recovered)
        of = f' of {declared}' if declared >= total and self.declared else ''
        words = [f'{self.name} {self.state or "is damaged"}: {total}{of} whole messages recovered']
        if lost:
            topics = ', '.join(
                f'{count} of {(self.declared or {})[topic]} on {topic}'
                for topic, count in lost.most_common(SHOWN_TOPICS)
            )
            more = len(lost) - SHOWN_TOPICS
            words.append(f'lost: {topics}' + (f' and on {more} more topics' if more > 0 else ''))
        elif self.declared is None and (self.spans or self.state):
            words.append('how many are lost is unknown')
        if spans := self._spans():
            words.append(f'lost {spans} of the recording' if not lost else spans)
        if self.doubtful:
            count = sum(self.doubtful.values())
            words.append(f'{count} of them come from a chunk with a wrong checksum')
        return ['; '.join([*words, *self.left_out])]

    def _spans(self) -> str:
        """Return the times of the damage, those that touch joined."""
        joined: list[list[int]] = []
        first, last = self.start or 0, self.last or 0
        for span in sorted(span for span in self.spans.values() if span is not None):
            # A time may be damaged itself: it lies in the recording, or not long behind it.
            begin, end = (t if first <= t <= last + LONGEST_END else first for t in span)
            end = max(begin, end)
            if joined and begin <= joined[-1][1]:
                joined[-1][1] = max(joined[-1][1], end)
            else:
                joined.append([begin, end])
        texts = []
        for begin, end in joined[:SHOWN_SPANS]:
            if end == first:
                texts.append('before the first of these')
                continue
            ends = f'to {(end - first) * 1e-9:.1f} s' if end < last else 'on'
            texts.append(f'from {(begin - first) * 1e-9:.1f} s {ends}')
        more = len(joined) - SHOWN_SPANS
        return ', '.join(texts) + (f' and {more} more times' if more > 0 else '')
