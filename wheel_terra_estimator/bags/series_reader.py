# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The input topics of a bag as arrays, for the checks; memory is bounded."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from wheel_terra_estimator.bags.message_types import topic_messages
from wheel_terra_estimator.bags.reader import NO_INPUTS
from wheel_terra_estimator.bags.salvage import limits
from wheel_terra_estimator.bags.storage import Bag
from wheel_terra_estimator.checks.series import (
    ImuSeries,
    JointSeries,
    Recording,
    SinkageSeries,
    VelocitySeries,
)
from wheel_terra_estimator.messages.cdr import Alike
from wheel_terra_estimator.messages.convert import INPUT_TYPES

MOST_MESSAGES = 400_000
"""Messages of a topic that are kept; a longer recording is judged by its beginning."""
MOST_JOINTS = 64
"""Joints of a topic that are kept."""

_REFERENCE_WORDS = ('reference', 'truth', 'visual', 'vio', 'gps', 'gnss', 'rtk', 'mocap', 'vo')
_JOINT_WORDS = ('joint_states', 'wheel', 'joint')
_IMU_WORDS = ('imu/data', 'imu')


def choose_topics(bag: Bag, remaps: Mapping[str, str]) -> dict[str, str]:
    """Return {estimator's topic: topic in the bag}: as named, else the likeliest one."""
    chosen: dict[str, str] = {}
    there = [
        topic
        for topic in bag.topics.values()
        if topic.message_count and not topic.name.startswith(NO_INPUTS)
    ]
    # A slip-free velocity first: what is left may be wheel odometry.
    for name in sorted(INPUT_TYPES, key=lambda name: name == 'odom'):
        kind = INPUT_TYPES[name]
        wanted = remaps.get(name, f'/{name}')
        fitting = [topic.name for topic in there if topic.type == kind]
        if wanted in fitting:
            chosen[name] = wanted
        elif name not in remaps:
            guess = _likeliest(name, [t for t in fitting if t not in chosen.values()])
            if guess:
                chosen[name] = guess
    return chosen


def _likeliest(name: str, topics: Sequence[str]) -> str | None:
    words = {
        'joint_states': _JOINT_WORDS,
        'imu/data': _IMU_WORDS,
        'reference_odom': _REFERENCE_WORDS,
        'leaving_angle': ('leaving',),
        'odom': ('wheel', 'odom'),
    }.get(name, (name,))
    for word in words:
        for topic in topics:
            slip_free = any(w in topic.lower().replace('/', '_').split('_') for w in words)
            if word in topic.lower() and (name != 'reference_odom' or slip_free):
                return topic
    if name in ('joint_states', 'imu/data') and len(topics) == 1:
        return topics[0]
    return None


def read_series(
    bag: Bag, remaps: Mapping[str, str], name: str, most: int = MOST_MESSAGES
) -> Recording:
    """Read the input topics of an open bag.

    Of a topic at most ``most`` messages are kept, its beginning; ``name`` is what reports call the
    recording, ``remaps`` are the estimator's topics to the bag's.
    """
    chosen = choose_topics(bag, remaps)
    by_topic = {topic: own for own, topic in chosen.items()}
    collectors: dict[str, _Collector] = {
        own: _COLLECTORS[own](topic, INPUT_TYPES[own])
        for own, topic in chosen.items()
        if own in _COLLECTORS
    }
    shortened = False
    for log_time, topic, data in bag.messages([chosen[own] for own in collectors]):
        collector = collectors[by_topic[topic]]
        if len(collector.arrivals) >= most:
            shortened = True
        elif len(data) <= limits.MESSAGE:
            collector.add(log_time, data)
    for collector in collectors.values():
        collector.unpack()
    garbage = Counter({collector.topic: collector.damaged for collector in collectors.values()})
    if garbage.total() or bag.damaged:
        for collector in collectors.values():
            garbage[collector.topic] += collector.leave_out_strays()
    left_out = [
        f'{n} damaged messages on {topic} were left out' for topic, n in garbage.items() if n
    ]

    def made(own: str) -> Any:
        collector = collectors.get(own)
        return collector.series() if collector and collector.stamps.size else None

    return Recording(
        name=name,
        topics=tuple((t.name, t.type, t.message_count) for t in bag.topics.values()),
        joints=made('joint_states'),
        imu=made('imu/data'),
        sinkage=made('sinkage'),
        reference=made('reference_odom'),
        wheel_odometry=made('odom'),
        shortened=shortened,
        notes=(*bag.notes, *left_out),
    )


LARGEST = 1e9
"""A number beyond this is damage in any unit."""
_STRAY = 1e9
"""Stamps of a damaged recording that lie so far [ns] from where the others do are damaged."""
_STRAYS = 0.2
"""Greatest share of such stamps that damage explains."""
_AT_ONCE = 4096
"""Messages that are unpacked together: what is held of the recording itself."""


def credible(values: Any) -> Any:
    """Return values with nan in place of infinity and absurd numbers."""
    with np.errstate(invalid='ignore'):
        return np.where(np.abs(values) < LARGEST, values, math.nan)


class _Collector:
    """Numbers of one topic; `unpack` what was added before anything is read from it."""

    def __init__(self, topic: str, kind: str) -> None:
        self.topic = topic
        self.arrivals: list[int] = []
        self._messages = topic_messages(kind)
        self._waiting: list[bytes] = []
        self._kept: list[Alike] = []
        self.stamps = self.log_times = np.zeros(0, dtype=np.int64)
        self._rows: list[Any] = []  # of each of `_kept`, their rows in the order of arrival

    def add(self, log_time: int, data: bytes) -> None:
        self.arrivals.append(log_time)
        self._waiting.append(data)
        if len(self._waiting) == _AT_ONCE:
            self._unpack_waiting()

    def unpack(self) -> None:
        """Unpack what waits and put everything into the order of arrival."""
        self._unpack_waiting()
        places = [np.zeros(0, dtype=np.int64), *(alike.order for alike in self._kept)]
        stamps = [np.zeros(0, dtype=np.int64), *(alike.stamps for alike in self._kept)]
        arrived = np.concatenate(places)
        order = np.argsort(arrived)
        self.stamps = np.concatenate(stamps)[order]
        self.log_times = np.array(self.arrivals, dtype=np.int64)[arrived[order]]
        self._rows = [np.searchsorted(arrived, index, sorter=order) for index in places[1:]]
        self._sound = np.arange(len(order))

    def _unpack_waiting(self) -> None:
        first = len(self.arrivals) - len(self._waiting)
        for alike in self._messages.unpack_alike(self._waiting):
            self._kept.append(self.needed(alike._replace(order=first + alike.order)))
        self._waiting = []

    @property
    def damaged(self) -> int:
        """Messages that could not be read."""
        return len(self.arrivals) - self.stamps.size

    def leave_out_strays(self) -> int:
        """Leave out what is stamped far from its log time, unless much is; return how many."""
        delays = self.log_times.astype(float) - self.stamps.astype(float)
        if not delays.size:
            return 0
        stray = np.abs(delays - np.median(delays)) > _STRAY
        if np.mean(stray) > _STRAYS:  # a clock that was set, not damage
            return 0
        self._sound = np.flatnonzero(~stray)
        return int(stray.sum())

    def needed(self, alike: Alike) -> Alike:
        """Return what is kept of messages."""
        raise NotImplementedError

    def series(self) -> Any:
        raise NotImplementedError

    @property
    def times(self) -> tuple[Any, Any]:
        return self.stamps[self._sound], self.log_times[self._sound]

    def table(self, field: int, columns: int) -> Any:
        """Return a field of numbers in the order of arrival, (messages, columns)."""
        values = np.full((self.stamps.size, columns), math.nan)
        for alike, rows in zip(self._kept, self._rows, strict=True):
            self.fill(values, rows, alike.names, alike.numbers[field])
        return credible(values)[self._sound]

    def fill(self, values: Any, rows: Any, names: tuple[str, ...], numbers: Any) -> None:
        values[rows] = numbers


class _Joints(_Collector):
    """Joint states, sorted by name."""

    def __init__(self, topic: str, kind: str) -> None:
        super().__init__(topic, kind)
        self.names: dict[str, int] = {}

    def needed(self, alike: Alike) -> Alike:
        for name in alike.names:
            if len(self.names) < MOST_JOINTS:
                self.names.setdefault(name, len(self.names))
        return alike

    def fill(self, values: Any, rows: Any, names: tuple[str, ...], numbers: Any) -> None:
        if len(names) == numbers.shape[1]:
            known = [i for i, name in enumerate(names) if name in self.names]
            places = [self.names[names[i]] for i in known]
            values[np.ix_(rows, places)] = numbers[:, known]

    def series(self) -> Any:
        n = len(self.names)
        position, rate, torque = (self.table(field, n) for field in range(3))
        return JointSeries(self.topic, *self.times, tuple(self.names), rate, torque, position)


class _Sinkage(_Joints):
    def series(self) -> Any:
        names = tuple(self.names)
        return SinkageSeries(self.topic, *self.times, names, self.table(0, len(names)))


class _Imu(_Collector):
    def needed(self, alike: Alike) -> Alike:
        (all_numbers,) = alike.numbers
        fields = []
        for at, count in ((25, 3), (13, 3), (0, 4)):  # specific force, angular rate, attitude
            values = all_numbers[:, at : at + count].copy()
            values[all_numbers[:, at + count] == -1.0] = math.nan  # its covariance: there is none
            fields.append(values)
        return alike._replace(numbers=(np.hstack(fields),))

    def series(self) -> Any:
        table = self.table(0, 10)
        return ImuSeries(self.topic, *self.times, table[:, :3], table[:, 3:6], table[:, 6:])


class _Velocity(_Collector):
    def needed(self, alike: Alike) -> Alike:
        (twist,) = alike.numbers
        values = twist[:, [0, 1, 2, 5, 6]]
        np.minimum(values[:, 4], 0.1 * LARGEST, out=values[:, 4])
        return alike._replace(numbers=(values,))

    def series(self) -> Any:
        table = self.table(0, 5)
        return VelocitySeries(self.topic, *self.times, table[:, :3], table[:, 3], table[:, 4])


_COLLECTORS: dict[str, Any] = {
    'joint_states': _Joints,
    'imu/data': _Imu,
    'sinkage': _Sinkage,
    'reference_odom': _Velocity,
    'odom': _Velocity,
}
