# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The input topics of a bag as arrays, for the checks; memory is bounded."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np

from wheel_terra_estimator.arrays import IndexArray
from wheel_terra_estimator.bags.salvage import limits
from wheel_terra_estimator.bags.storage import Bag
from wheel_terra_estimator.bags.topic_choice import choose_topics, other_references, other_rovers
from wheel_terra_estimator.checks.series import (
    ImuSeries,
    JointSeries,
    Recording,
    SinkageSeries,
    VelocitySeries,
)
from wheel_terra_estimator.messages.convert import INPUT_TYPES
from wheel_terra_estimator.messages.unpack import DamagedMessageError, unpack

MOST_MESSAGES = 400_000
"""Messages of a topic up to which a recording is read: all topics end at the same time."""
MOST_JOINTS = 64  # joints of a topic that are kept


def read_series(
    bag: Bag, remaps: Mapping[str, str], name: str, most: int = MOST_MESSAGES
) -> Recording:
    """Read the input topics of an open bag.

    It is read until one of them has ``most`` messages; ``name`` is what reports call the recording,
    ``remaps`` are the estimator's topics to the bag's.
    """
    chosen = choose_topics(bag, remaps)
    collectors: dict[str, _Collector] = {
        own: _COLLECTORS[own](topic, INPUT_TYPES[own])
        for own, topic in chosen.items()
        if own in _COLLECTORS
    }
    first = end = None  # log times
    heard: dict[str, int] = {}
    for log_time, topic, data in bag.messages([chosen[own] for own in collectors]):
        first = first or log_time
        for collector in collectors.values():
            if collector.topic != topic:
                continue
            if len(collector.arrivals) >= most:
                end = end or log_time
            if not end and len(data) <= limits.MESSAGE:
                collector.add(log_time, data)
        heard[topic] = log_time
    garbage = Counter({c.topic: len(c.arrivals) - len(c.stamps) for c in collectors.values()})
    notes = [
        *bag.notes,
        *(f'{n} damaged messages on {topic} were skipped' for topic, n in garbage.items() if n),
    ]
    if first and end:
        minutes = (end - first) * 1e-9 / 60.0
        notes.append(f'a long recording: only its first {minutes:.3g} minutes were checked')
    notes += [f'it also holds another rover: {options}' for options in other_rovers(bag, chosen)]
    if 'reference_odom' not in chosen and (others := other_references(bag)):
        notes.append(others)

    def made(own: str) -> Any:
        collector = collectors.get(own)
        return collector.series() if collector and collector.stamps else None

    return Recording(
        name=name,
        topics=tuple((t.name, t.type, t.message_count) for t in bag.topics.values()),
        joints=made('joint_states'),
        imu=made('imu/data'),
        sinkage=made('sinkage'),
        reference=made('reference_odom'),
        wheel_odometry=made('odom'),
        heard={} if bag.damaged else heard,  # by then any time may be
        lost=bag.lost,
        notes=tuple(notes),
    )


LARGEST = 1e9  # A number beyond this is damage in any unit


def credible(values: Any) -> Any:
    """Return values with nan in place of infinity and absurd numbers."""
    with np.errstate(invalid='ignore'):
        return np.where(np.abs(values) < LARGEST, values, math.nan)


class _Collector:
    """Numbers of one topic."""

    columns: IndexArray | slice = slice(None)  # of the numbers of a message that are kept

    def __init__(self, topic: str, kind: str) -> None:
        self.topic, self._kind = topic, kind
        self.arrivals: list[int] = []
        self.stamps: list[int] = []  # of the messages that could be read, and their log times
        self._log_times: list[int] = []
        # Names, and lengths of the lists -> places among the messages, and the numbers as bytes
        self._alike: dict[Any, tuple[list[int], list[bytearray]]] = {}

    def add(self, log_time: int, data: bytes) -> None:
        self.arrivals.append(log_time)
        try:
            stamp, names, lists = unpack(self._kind, data)
        except DamagedMessageError:
            return
        key = names, *map(len, lists)
        places, kept = self._alike.setdefault(key, ([], [bytearray() for _ in lists]))
        places.append(len(self.stamps))
        for numbers, raw in zip(lists if names else lists[:1], kept, strict=False):
            raw += numbers[self.columns].tobytes()
        self.stamps.append(stamp)
        self._log_times.append(log_time)

    def series(self) -> Any:
        raise NotImplementedError

    @property
    def times(self) -> tuple[Any, Any]:
        """Stamps and log times [ns]."""
        return np.array(self.stamps, dtype=np.int64), np.array(self._log_times, dtype=np.int64)

    def table(self, field: int, columns: int) -> Any:
        """Return a list of numbers of all messages, (messages, columns)."""
        values = np.full((len(self.stamps), columns), math.nan)
        for (names, *_), (places, kept) in self._alike.items():
            numbers = np.frombuffer(kept[field]).reshape(len(places), -1)
            self.fill(values, places, names, numbers)
        return credible(values)

    def fill(self, values: Any, places: list[int], names: tuple[str, ...], numbers: Any) -> None:
        values[places] = numbers


class _Joints(_Collector):
    """Joint states, sorted by name."""

    @property
    def names(self) -> tuple[str, ...]:
        """The first joints that were named."""
        named = dict.fromkeys(name for names, *_ in self._alike for name in names)
        return tuple(named)[:MOST_JOINTS]

    def fill(self, values: Any, places: list[int], names: tuple[str, ...], numbers: Any) -> None:
        if len(names) == numbers.shape[1]:
            column = {name: i for i, name in enumerate(self.names)}
            known = [i for i, name in enumerate(names) if name in column]
            values[np.ix_(places, [column[names[i]] for i in known])] = numbers[:, known]

    def series(self) -> Any:
        position, rate, torque = (self.table(field, len(self.names)) for field in range(3))
        return JointSeries(self.topic, *self.times, self.names, rate, torque, position)


class _Sinkage(_Joints):
    def series(self) -> Any:
        return SinkageSeries(self.topic, *self.times, self.names, self.table(0, len(self.names)))


class _Imu(_Collector):
    # Specific force, angular rate, attitude; the first covariance of each
    columns = np.array([25, 26, 27, 13, 14, 15, 0, 1, 2, 3, 28, 16, 4])

    def series(self) -> Any:
        table = self.table(0, len(self.columns))
        force, rate, attitude, stated = np.split(table, (3, 6, 10), axis=1)
        for field, values in enumerate((force, rate, attitude)):
            values[stated[:, field] == -1.0] = math.nan  # there is none
        none = (stated == -1.0).all(axis=0)
        absent = tuple(name for name, said in zip(('force', 'rate'), none, strict=False) if said)
        return ImuSeries(self.topic, *self.times, force, rate, attitude, absent)


class _Velocity(_Collector):
    columns = np.array([0, 1, 2, 5, 6])  # linear velocity, yaw rate; variance of the first

    def fill(self, values: Any, places: list[int], names: tuple[str, ...], numbers: Any) -> None:
        values[places] = numbers
        values[places, 4] = np.minimum(numbers[:, 4], 0.1 * LARGEST)  # any number states it

    def series(self) -> Any:
        table = self.table(0, len(self.columns))
        return VelocitySeries(self.topic, *self.times, table[:, :3], table[:, 3], table[:, 4])


_COLLECTORS: dict[str, Any] = {
    'joint_states': _Joints,
    'imu/data': _Imu,
    'sinkage': _Sinkage,
    'reference_odom': _Velocity,
    'odom': _Velocity,
}
