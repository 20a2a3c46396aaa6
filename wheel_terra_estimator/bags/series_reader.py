# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The input topics of a bag as arrays, for the checks; memory is bounded."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from wheel_terra_estimator.bags.message_types import topic_messages
from wheel_terra_estimator.bags.storage import Bag
from wheel_terra_estimator.checks.series import (
    ImuSeries,
    JointSeries,
    Recording,
    SinkageSeries,
    VelocitySeries,
)
from wheel_terra_estimator.messages.cdr import DamagedMessageError
from wheel_terra_estimator.messages.convert import INPUT_TYPES, stamp_of

MOST_MESSAGES = 400_000
"""Messages of a topic that are kept; a longer recording is judged by its beginning."""
MOST_JOINTS = 64
"""Joints of a topic that are kept."""

_REFERENCE_WORDS = ('reference', 'truth', 'visual', 'vio', 'gps', 'gnss', 'rtk', 'mocap', 'vo')
_JOINT_WORDS = ('joint_states', 'wheel', 'joint')
_IMU_WORDS = ('imu/data', 'imu')
_OWN_TOPICS = ('/wheel_terra_estimator/', '/ground_truth/')


def choose_topics(bag: Bag, remaps: Mapping[str, str]) -> dict[str, str]:
    """Return {estimator's topic: topic in the bag}: as named, else the likeliest one."""
    chosen: dict[str, str] = {}
    there = [
        topic
        for topic in bag.topics.values()
        if topic.message_count and not topic.name.startswith(_OWN_TOPICS)
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
        own: _COLLECTORS[own](topic) for own, topic in chosen.items() if own in _COLLECTORS
    }
    unpack = {own: topic_messages(INPUT_TYPES[own]).unpack for own in collectors}
    shortened = False
    garbage: Counter[str] = Counter()
    for log_time, topic, data in bag.messages([chosen[own] for own in collectors]):
        own = by_topic[topic]
        collector = collectors[own]
        if len(collector.stamps) >= most:
            shortened = True
            continue
        if len(data) > bag.limits.message:
            continue
        try:
            message = unpack[own](data)
        except DamagedMessageError:
            garbage[topic] += 1
            continue
        collector.add(log_time, message)
    if garbage or bag.damaged:
        for collector in collectors.values():
            garbage[collector.topic] += collector.leave_out_strays()
    left_out = [
        f'{n} damaged messages on {topic} were left out' for topic, n in garbage.items() if n
    ]

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
        shortened=shortened,
        notes=(*bag.notes, *left_out),
    )


LARGEST = 1e9
"""A number beyond this is damage in any unit."""
_STRAY = 1e9
"""Stamps of a damaged recording that lie so far [ns] from where the others do are damaged."""
_STRAYS = 0.2
"""Greatest share of such stamps that damage explains."""


def credible(values: Any) -> Any:
    """Return values with nan in place of infinity and absurd numbers."""
    with np.errstate(invalid='ignore'):
        return np.where(np.abs(values) < LARGEST, values, math.nan)


class _Collector:
    """Rows of one topic."""

    def __init__(self, topic: str) -> None:
        self.topic = topic
        self.stamps: list[int] = []
        self.log_times: list[int] = []
        self.rows: list[Any] = []

    def add(self, log_time: int, message: Any) -> None:
        self.stamps.append(stamp_of(message))
        self.log_times.append(log_time)
        self.rows.append(self.row(message))

    def leave_out_strays(self) -> int:
        """Leave out what is stamped far from its log time, unless much is; return how many."""
        stamps, log_times = (times.astype(float) for times in self.times)
        delays = log_times - stamps
        if not delays.size:
            return 0
        stray = np.abs(delays - np.median(delays)) > _STRAY
        if np.mean(stray) > _STRAYS:  # a clock that was set, not damage
            return 0
        keep = np.flatnonzero(~stray).tolist()
        self.stamps = [self.stamps[i] for i in keep]
        self.log_times = [self.log_times[i] for i in keep]
        self.rows = [self.rows[i] for i in keep]
        return int(stray.sum())

    def row(self, message: Any) -> Any:
        raise NotImplementedError

    def series(self) -> Any:
        raise NotImplementedError

    @property
    def times(self) -> tuple[Any, Any]:
        return np.array(self.stamps, dtype=np.int64), np.array(self.log_times, dtype=np.int64)


class _Joints(_Collector):
    """Joint states, sorted by name."""

    def __init__(self, topic: str) -> None:
        super().__init__(topic)
        self.names: dict[str, int] = {}
        self._last_names: tuple[str, ...] = ()

    def row(self, message: Any) -> Any:
        names = tuple(message.name)
        if names != self._last_names:
            self._last_names = names
            for name in names:
                if len(self.names) < MOST_JOINTS:
                    self.names.setdefault(name, len(self.names))
        return names, *self.fields(message)

    def fields(self, message: Any) -> tuple[Any, ...]:
        return message.velocity, message.effort

    def table(self, column: int) -> Any:
        values = np.full((len(self.rows), len(self.names)), math.nan)
        alike: defaultdict[tuple[str, ...], list[int]] = defaultdict(list)
        for index, row in enumerate(self.rows):
            if len(row[0]) == len(row[column]):
                alike[row[0]].append(index)
        for names, rows in alike.items():
            known = [i for i, name in enumerate(names) if name in self.names]
            places = [self.names[names[i]] for i in known]
            numbers = np.array([self.rows[index][column] for index in rows])
            values[np.ix_(rows, places)] = numbers[:, known]
        return credible(values)

    def series(self) -> Any:
        return JointSeries(self.topic, *self.times, tuple(self.names), self.table(1), self.table(2))


class _Sinkage(_Joints):
    def fields(self, message: Any) -> tuple[Any, ...]:
        return (message.position,)

    def series(self) -> Any:
        return SinkageSeries(self.topic, *self.times, tuple(self.names), self.table(1))


class _Imu(_Collector):
    def row(self, message: Any) -> Any:
        f, w, q = message.linear_acceleration, message.angular_velocity, message.orientation
        known = message.orientation_covariance[0] != -1.0
        orientation = (q.x, q.y, q.z, q.w) if known else (math.nan,) * 4
        force, rate = (f.x, f.y, f.z), (w.x, w.y, w.z)
        if message.linear_acceleration_covariance[0] == -1.0:  # says that there is none
            force = (math.nan,) * 3
        if message.angular_velocity_covariance[0] == -1.0:
            rate = (math.nan,) * 3
        return (*force, *rate, *orientation)

    def series(self) -> Any:
        table = credible(np.array(self.rows, dtype=float))
        return ImuSeries(self.topic, *self.times, table[:, :3], table[:, 3:6], table[:, 6:])


class _Velocity(_Collector):
    def row(self, message: Any) -> Any:
        linear, angular = message.twist.twist.linear, message.twist.twist.angular
        variance = min(float(message.twist.covariance[0]), 0.1 * LARGEST)
        return (linear.x, linear.y, linear.z, angular.z, variance)

    def series(self) -> Any:
        table = credible(np.array(self.rows, dtype=float))
        return VelocitySeries(self.topic, *self.times, table[:, :3], table[:, 3], table[:, 4])


_COLLECTORS: dict[str, Any] = {
    'joint_states': _Joints,
    'imu/data': _Imu,
    'sinkage': _Sinkage,
    'reference_odom': _Velocity,
    'odom': _Velocity,
}
