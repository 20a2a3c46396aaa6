# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Messages out of their CDR bytes, for the node and for recordings alike.

rclpy and rosbags make objects of every field of a message, which takes three to ten times as long;
of the four types that are read only stamp, names and numbers are used.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

import numpy as np

from wheel_terra_estimator.arrays import FloatArray

JOINT_STATE = 'sensor_msgs/msg/JointState'
IMU = 'sensor_msgs/msg/Imu'
ODOMETRY = 'nav_msgs/msg/Odometry'
TWIST = 'geometry_msgs/msg/TwistWithCovarianceStamped'

TYPES = frozenset({JOINT_STATE, IMU, ODOMETRY, TWIST})  # types that are unpacked here
_STRINGS = {JOINT_STATE: 1, IMU: 1, ODOMETRY: 2, TWIST: 1}
"""Type -> strings between stamp and names or numbers."""
_NUMBERS = {IMU: (0, 37), ODOMETRY: (43, 42), TWIST: (0, 42)}
"""Type -> numbers that are passed over (a pose with its covariance), and that are taken."""
_BODY = 4  # where the fields begin, and from where they are aligned [byte]
_AFTER_STAMP = 12  # [byte]
_LONGEST_PADDING = 3  # [byte] behind the last field
_WORD = 4
"""Bytes that rmw_serialize leaves behind the last field for each list without numbers, and once
more where there is any, at most."""


class _Order(NamedTuple):
    """How stamps, lengths and numbers are read in one order of bytes."""

    stamp: struct.Struct
    length: struct.Struct
    number: np.dtype[np.float64]


_ORDERS = {
    head: _Order(struct.Struct(f'{sign}iI'), struct.Struct(f'{sign}I'), np.dtype(f'{sign}f8'))
    for head, sign in ((b'\0\1', '<'), (b'\0\0', '>'))
}
"""First bytes of a message -> order of its bytes."""

MOST_SEEN, LARGEST_SEEN = 16, 65_536  # layouts that are remembered, and their size [byte]


class DamagedMessageError(ValueError):
    """Bytes that are no message of the type."""


class Message(NamedTuple):
    """Stamp [ns], names and numbers of a message.

    ``numbers`` of a JointState: position, velocity and effort. Of an Imu: attitude (4, then 9
    covariances), angular rate (3 and 9), specific force (3 and 9). Of Odometry and stamped twist:
    linear and angular velocity (3 each), then 36 covariances; of Odometry the position (3), too.
    """

    stamp: int
    names: tuple[str, ...]
    numbers: tuple[FloatArray, ...]


class _Layout(NamedTuple):
    """Layout common to the messages of a topic: names, and positions of the numbers.

    ``lists``: first byte and length of each list of numbers, as in `Message`.
    """

    order: _Order
    names: tuple[str, ...]
    lists: tuple[tuple[int, int], ...]
    fixed: tuple[tuple[int, bytes], ...]  # where what lies around stamp and numbers begins


_SEEN: dict[tuple[str, int], _Layout] = {}  # latest one of a type and size


def _read_layout(kind: str, data: bytes) -> _Layout:
    try:
        order = _ORDERS[data[:2]]
        order.stamp.unpack_from(data, _BODY)
        _, at = _strings(data, _AFTER_STAMP, _STRINGS[kind], order)
        names, lists, fixed = list[str](), list[tuple[int, int]](), [(0, data[:_BODY])]
        since = _AFTER_STAMP
        if kind == JOINT_STATE:
            count, at = _count(data, at, order)
            names, at = _strings(data, at, count, order)
        for _ in range(3 if kind == JOINT_STATE else 1):
            passed_over, count = _NUMBERS.get(kind, (0, 0))
            if kind == JOINT_STATE:
                count, at = _count(data, at, order)
            fixed.append((since, data[since:at]))
            if count:
                at += -(at - _BODY) % 8
            lists.append((at + 8 * passed_over, count))
            if kind == ODOMETRY:
                lists.append((at, 3))
            since = at = at + 8 * (passed_over + count)
        empty = sum(count == 0 for _, count in lists)
        spare = _LONGEST_PADDING + (_WORD * (empty + 1) if empty else 0)
        if not 0 <= len(data) - at <= spare:
            raise ValueError('other bytes than fields')
    except (struct.error, KeyError, ValueError) as error:
        raise DamagedMessageError(str(error)) from None
    return _Layout(order, tuple(names), tuple(lists), tuple(fixed))


def unpack(kind: str, data: bytes) -> Message:
    """Return a message of one of the four types, laid out mostly as one before it was.

    Raises DamagedMessageError where the bytes are none.
    """
    layout = _SEEN.get((kind, len(data)))
    if layout is None or not all(data.startswith(part, at) for at, part in layout.fixed):
        layout = _read_layout(kind, data)
        if len(data) <= LARGEST_SEEN:
            if len(_SEEN) == MOST_SEEN:
                _SEEN.clear()
            _SEEN[kind, len(data)] = layout
    order, names, lists, _ = layout
    seconds, nanoseconds = order.stamp.unpack_from(data, _BODY)
    values = [np.frombuffer(data, order.number, count, at) for at, count in lists]
    numbers = values if order.number.isnative else [v.astype(np.float64) for v in values]
    return Message(seconds * 1_000_000_000 + nanoseconds, names, tuple(numbers))


def _count(data: bytes, at: int, order: _Order) -> tuple[int, int]:
    """Return the number of entries of a list, and where the list begins [byte]."""
    at += -(at - _BODY) % 4
    (count,) = order.length.unpack_from(data, at)
    return count, at + 4


def _strings(data: bytes, at: int, count: int, order: _Order) -> tuple[list[str], int]:
    """Return strings, and where they end [byte]."""
    found, length = [], order.length.unpack_from
    for _ in range(count):
        at += -(at - _BODY) % 4
        (size,) = length(data, at)
        text = data[at + 4 : at + 4 + size]
        if len(text) < size or text[-1:] != b'\0':
            raise ValueError('a string does not end')
        found.append(text[:-1].decode())
        at += 4 + size
    return found, at
