# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Messages as CDR bytes, which node and recordings send as they are.

rclpy would check every field of a message, rosbags would make objects of it. Stamps are in ns.
"""

from __future__ import annotations

import struct
from collections.abc import Container, Iterable, Iterator, Sequence
from functools import cache
from itertools import chain
from operator import attrgetter

import numpy as np

from wheel_terra_estimator.estimation.estimates import SLOPE_NAMES, EstimateSet
from wheel_terra_estimator.messages.diagnostics import Status
from wheel_terra_estimator.messages.unpack import JOINT_STATE, TWIST

JOINT_OUTPUTS = {
    'slip': ('slip', 'slip_velocity', 'drawbar_pull'),
    'sinkage': ('sinkage', 'sinkage_rate', 'normal_load'),
    'slip_stddev': ('slip_std', 'slip_velocity_std', 'drawbar_pull_std'),
    'sinkage_stddev': ('sinkage_std', 'sinkage_rate_std', 'normal_load_std'),
    'mobility': ('rim_travel_left', '', 'pull_margin'),
    'soil': ('soil', '', 'soil_std'),
    'slip_on_slope': ('slip_on_slope.slip', 'slip_on_slope.entrapment', 'slip_on_slope.std'),
    'slip_angle': ('sideways_known.angle', '', 'sideways_known.force'),
    'slip_angle_stddev': ('sideways_known.angle_std', '', 'sideways_known.force_std'),
}
"""Outputs that are a JointState: topic -> fields of a set that are its position, velocity and
effort, '' for none; node, replay and recordings publish these."""
_COLUMNS = {
    topic: tuple(attrgetter(field) if field else None for field in fields)
    for topic, fields in JOINT_OUTPUTS.items()
}
OUTPUT_TYPES = {
    **dict.fromkeys(JOINT_OUTPUTS, JOINT_STATE),
    'slip_class': 'std_msgs/msg/UInt8MultiArray',
    'twist': TWIST,
    'stuck_direction': 'std_msgs/msg/Int8',
    'stuck': 'std_msgs/msg/Bool',
}
"""Private output topics of the estimator and their message types."""

BASE_FRAME = 'base_link'
UNKNOWN_VARIANCE = 1e6
"""Variance of the twist components that are not estimated (finite, so that no filter chokes)."""
SET_TOPICS = (*JOINT_OUTPUTS, 'slip_class', 'twist')
"""Private topics that have a message of each set (``slip_on_slope``: once a second)."""

_HEAD = b'\0\1\0\0'  # little-endian
_AFTER_STAMP = 8  # [byte] from the first field, from where fields are aligned
_UPRIGHT = (0.0, 0.0, 0.0, 1.0)
_NO_POSE = (0.0, 0.0, 0.0, *_UPRIGHT, *(0.1 if i % 7 == 0 else 0.0 for i in range(36)))
"""Origin and placeholder of its covariance, of an Odometry that states a twist only."""


def pack(
    estimates: EstimateSet, names: tuple[str, ...], wanted: Container[str] = SET_TOPICS
) -> Iterator[tuple[str, bytes]]:
    """Yield private topic and CDR bytes of the messages of a set on the topics wanted.

    ``names``: of the wheels.
    """
    stamp = estimates.stamp
    others = {'soil': estimates.soil_names, 'slip_on_slope': SLOPE_NAMES}
    for topic, columns in _COLUMNS.items():
        due = topic != 'slip_on_slope' or estimates.slip_on_slope is not None  # once a second
        if due and topic in wanted:
            fields = [np.asarray(c(estimates)).tolist() if c else [] for c in columns]
            yield topic, joint_state(stamp, others.get(topic, names), *fields)
        if topic == 'slip' and 'slip_class' in wanted:
            yield 'slip_class', slip_classes(estimates.slip_class.tolist())
    if 'twist' in wanted:
        aside = estimates.sideways_known
        covariance = [0.0] * 36
        covariance[::7] = [UNKNOWN_VARIANCE] * 6
        covariance[0] = estimates.forward_velocity_variance
        covariance[7] = aside.velocity_variance
        covariance[35] = estimates.yaw_rate_variance
        velocity = estimates.forward_velocity, aside.velocity
        yield 'twist', twist_stamped(stamp, velocity, estimates.yaw_rate, covariance)


def joint_state(
    stamp: int,
    names: tuple[str, ...],
    position: Sequence[float] = (),
    velocity: Sequence[float] = (),
    effort: Sequence[float] = (),
) -> bytes:
    """Return a ``sensor_msgs/msg/JointState``."""
    counts = len(position), len(velocity), len(effort)
    form, beginning = _joint_layout(names, counts)
    time = divmod(stamp, 1_000_000_000)
    lists = counts[0], *position, counts[1], *velocity, counts[2], *effort
    return form.pack(_HEAD, *time, beginning, *lists)


def twist_stamped(
    stamp: int, velocity: tuple[float, float], yaw_rate: float, covariance: Sequence[float]
) -> bytes:
    """Return a ``geometry_msgs/msg/TwistWithCovarianceStamped``: velocity along x and y."""
    return _numbers(stamp, (BASE_FRAME,), (*velocity, 0.0, 0.0, 0.0, yaw_rate, *covariance))


def odometry(stamp: int, forward: float, yaw_rate: float, covariance: Sequence[float]) -> bytes:
    """Return a ``nav_msgs/msg/Odometry`` that states a twist only."""
    twist = forward, 0.0, 0.0, 0.0, 0.0, yaw_rate, *covariance
    return _numbers(stamp, ('odom', BASE_FRAME), (*_NO_POSE, *twist))


def imu(
    stamp: int,
    force: Sequence[float],
    rate: Sequence[float],
    attitude: Sequence[float] | None,
    variances: tuple[float, float, float] = (0.0, 0.0, 0.0),
    frame: str = BASE_FRAME,
) -> bytes:
    """Return a ``sensor_msgs/msg/Imu``; ``variances`` of attitude, angular rate and force."""
    of_attitude, of_rate, of_force = ([v, 0, 0, 0, v, 0, 0, 0, v] for v in variances)
    if attitude is None:
        attitude, of_attitude = _UPRIGHT, [-1.0] + [0.0] * 8
    return _numbers(stamp, (frame,), (*attitude, *of_attitude, *rate, *of_rate, *force, *of_force))


def slip_classes(classes: Sequence[int]) -> bytes:
    """Return a ``std_msgs/msg/UInt8MultiArray`` of one dimension, ``wheel``."""
    count, no_offset = len(classes), 0
    layout = struct.pack('<4I', count, count, no_offset, count)
    return _HEAD + _ONE_DIMENSION + layout + bytes(classes)


def flag(value: bool) -> bytes:
    """Return a ``std_msgs/msg/Bool``."""
    return _HEAD + bytes([value])


def direction(value: int) -> bytes:
    """Return a ``std_msgs/msg/Int8``."""
    return struct.pack('<4sb', _HEAD, value)


def diagnostic_array(stamp: int, statuses: Iterable[Status]) -> bytes:
    """Return a ``diagnostic_msgs/msg/DiagnosticArray``."""
    found = list(statuses)
    body = struct.pack('<iI', *divmod(stamp, 1_000_000_000)) + _string(BASE_FRAME)
    body = _padded(body, 4) + struct.pack('<I', len(found))
    for status in found:
        body += bytes([status.level])
        for text in (status.name, status.message, status.hardware_id):
            body = _padded(body, 4) + _string(text)
        body = _padded(body, 4) + struct.pack('<I', len(status.values))
        for text in chain.from_iterable(status.values):
            body = _padded(body, 4) + _string(text)
    return _HEAD + body


@cache
def _joint_layout(names: tuple[str, ...], counts: Sequence[int]) -> tuple[struct.Struct, bytes]:
    """Return how a message is packed, and what stands between its stamp and its numbers."""
    beginning = _padded(_string(BASE_FRAME), 4) + struct.pack('<I', len(names))
    for name in names:
        beginning = _padded(beginning, 4) + _string(name)
    beginning = _padded(beginning, 4)
    at = _AFTER_STAMP + len(beginning)
    form = f'<4siI{len(beginning)}s'
    for count in counts:
        form += 'I'
        at += 4
        if count:
            padding = -at % 8
            form += f'{padding}x{count}d'
            at += padding + 8 * count
    return struct.Struct(form), beginning


@cache
def _layout(strings: tuple[str, ...], count: int) -> tuple[struct.Struct, bytes]:
    """Return how so many numbers behind a stamp and strings are packed, and these strings."""
    beginning = b''
    for text in strings:
        beginning = _padded(beginning, 4) + _string(text)
    beginning = _padded(beginning, 8)
    return struct.Struct(f'<4siI{len(beginning)}s{count}d'), beginning


def _numbers(stamp: int, strings: tuple[str, ...], numbers: Sequence[float]) -> bytes:
    form, beginning = _layout(strings, len(numbers))
    return form.pack(_HEAD, *divmod(stamp, 1_000_000_000), beginning, *numbers)


def _string(text: str) -> bytes:
    content = text.encode() + b'\0'
    return struct.pack('<I', len(content)) + content


def _padded(content: bytes, size: int) -> bytes:
    """Fill up bytes behind the stamp (or the head) to a multiple of ``size``, which divides 8."""
    return content + bytes(-len(content) % size)


_ONE_DIMENSION = _padded(struct.pack('<I', 1) + _string('wheel'), 4)
"""Number and name of the dimensions of the slip classes."""
