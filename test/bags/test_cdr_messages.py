# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Bytes of messages are read as rosbags reads them, and written as rosbags writes them."""

import random
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from message_factory import MessageFactory, serialised

from wheel_terra_estimator.messages import pack
from wheel_terra_estimator.messages.convert import INPUT_TYPES
from wheel_terra_estimator.messages.diagnostics import Status
from wheel_terra_estimator.messages.pack import BASE_FRAME
from wheel_terra_estimator.messages.unpack import (
    IMU,
    JOINT_STATE,
    ODOMETRY,
    DamagedMessageError,
    Message,
    unpack,
)

START = 1_700_000_000_000_000_000


def messages(factory: MessageFactory, name: str, count: int, dice: random.Random) -> Iterator[Any]:
    """Messages of an input topic: numbers of all kinds, other frames and names now and then."""
    frames, groups = ('', 'base_link', 'ü'), (('left', 'right'), ('right', 'x', 'left'), ('arm',))

    def some(number: int) -> list[float]:
        odd = (float('nan'), float('inf'), -0.0, 5e-324)
        return [dice.choice((dice.gauss(0, 2), *odd)) for _ in range(number)]

    frame, names = 'base_link', ('left', 'right')
    for step in range(count):
        if dice.random() < 0.3:
            frame, names = dice.choice(frames), dice.choice(groups)
        header = factory.header(START + step * 10**7, frame)
        if name == 'imu/data':
            attitude = tuple(some(4)) if dice.random() < 0.3 else (0.0, 0.0, 0.0, 1.0)
            yield factory.imu(header, some(3), some(3), attitude)
        elif name in ('odom', 'reference_odom'):
            twist = factory.twist_with_covariance(*some(2), some(36))
            yield factory.odometry(header, twist)
        else:
            lengths = [dice.choice((0, len(names), len(names), 5)) for _ in range(3)]
            values = dict(zip(('position', 'velocity', 'effort'), map(some, lengths), strict=True))
            yield factory.joint_state(header, names, **values)


def with_rosbags(store: Any, kind: str, data: bytes, empty: int = 0) -> Message | None:
    """As `rmw_serialize` leaves them, four bytes for each empty list, and four, may follow."""
    try:
        message = store.deserialize_cdr(data, kind)
    except Exception:
        shorter = with_rosbags(store, kind, data[:-4], empty + 1) if empty < 4 else None
        lists = sum(not len(numbers) for numbers in shorter.numbers) if shorter else 0
        return shorter if lists and empty <= lists else None
    stamp = message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec
    if kind == JOINT_STATE:
        numbers = message.position, message.velocity, message.effort
        return Message(stamp, tuple(message.name), numbers)
    if kind == IMU:
        fields = [
            [*vector(message.orientation), message.orientation.w],
            message.orientation_covariance,
            vector(message.angular_velocity),
            message.angular_velocity_covariance,
            vector(message.linear_acceleration),
            message.linear_acceleration_covariance,
        ]
    else:
        twist = message.twist.twist
        fields = [vector(twist.linear), vector(twist.angular), message.twist.covariance]
    place = [] if kind != ODOMETRY else [np.array(vector(message.pose.pose.position))]
    return Message(stamp, (), (np.concatenate(fields), *place))


def vector(value: Any) -> list[float]:
    return [value.x, value.y, value.z]


def with_ours(kind: str, data: bytes) -> Message | None:
    try:
        return unpack(kind, data)
    except DamagedMessageError:
        return None


def shown(message: Message | None) -> Any:
    return message and (*message[:2], [[repr(v) for v in n.tolist()] for n in message.numbers])


@pytest.mark.parametrize('name', INPUT_TYPES)
@pytest.mark.parametrize('little', [True, False])
def test_numbers_are_those_of_rosbags(name, little, factory):
    """Whole or damaged; what rosbags refuses is refused."""
    dice = random.Random(name)
    kind, store = INPUT_TYPES[name], factory.store
    read = 0
    for message in messages(factory, name, 100, dice):
        data = bytearray(store.serialize_cdr(message, kind, little_endian=little))
        for damage in (0, 0, 1, 3, 20):
            for _ in range(damage):
                if dice.random() < 0.7:
                    data[dice.randrange(len(data))] = dice.randrange(256)
                else:
                    at = dice.randrange(len(data))
                    data[at : at + dice.randrange(3)] = dice.randbytes(dice.randrange(5))
            found = with_ours(kind, bytes(data))
            assert shown(found) == shown(with_rosbags(store, kind, bytes(data)))
            read += found is not None
    assert read > 200


@pytest.mark.ros
@pytest.mark.parametrize('lists', [(), ('velocity',), ('velocity', 'effort'), ('position',)])
def test_messages_that_rclpy_serialised_are_read(lists):
    """Its bytes end with what was in the memory, as in bags of rosbag2's writer."""
    pytest.importorskip('rclpy')
    from rclpy.serialization import serialize_message
    from sensor_msgs.msg import JointState

    dice = random.Random(5)
    for count in (*range(14), *range(14)):
        names = ['w' * dice.randrange(1, 25) for _ in range(count)]
        values = [float(i) for i in range(count)]
        message = JointState(name=names, **dict.fromkeys(lists, values))
        message.header.frame_id = 'f' * dice.randrange(12)
        data = serialize_message(message)
        message = unpack(JOINT_STATE, data)
        assert message.names == tuple(names)
        for numbers, name in zip(message.numbers, ('position', 'velocity', 'effort'), strict=True):
            assert numbers.tolist() == (values if name in lists else [])


@pytest.mark.parametrize('names', [(), ('left', 'right'), ('a', 'ab', 'abc', 'abcd', 'ü')])
def test_packed_messages_are_the_bytes_of_rosbags(names, factory):
    dice = random.Random(7)
    for classes in ([], [0, 255], [3, 2, 1]):
        assert pack.slip_classes(classes) == serialised(factory.slip_class(classes))
    for lengths in ((0, 0, 0), (3, 0, 1), (1, 2, 3), (0, 4, 0), (1, 2, 3)):
        stamp = dice.randrange(2**60)
        values = [[dice.gauss(0, 1) for _ in range(length)] for length in lengths]
        header = factory.header(stamp, BASE_FRAME)
        theirs = factory.joint_state(header, names, *values)
        assert pack.joint_state(stamp, names, *values) == serialised(theirs)
        covariance = [dice.random() for _ in range(36)]
        theirs = factory.twist_stamped(header, 0.3, -0.2, covariance)
        assert pack.twist_stamped(stamp, (0.3, 0.0), -0.2, covariance) == serialised(theirs)


@pytest.mark.parametrize('frame', ['base_link', 'ab', 'ü', ''])
@pytest.mark.parametrize('attitude', [None, (0.1, 0.2, 0.3, 0.9)])
def test_inputs_are_packed_as_rosbags_packs_them(frame, attitude, factory):
    force, rate, variances = (1.0, 2.0, 3.0), (4.0, 5.0, 6.0), (7.0, 8.0, 9.0)
    theirs = factory.imu(factory.header(START, frame), force, rate, attitude, variances)
    assert pack.imu(START, force, rate, attitude, variances, frame) == serialised(theirs)
    covariance = [float(i) for i in range(36)]
    twist = factory.twist_with_covariance(0.3, -0.1, covariance)
    theirs = factory.odometry(factory.header(START, 'odom'), twist)
    assert pack.odometry(START, 0.3, -0.1, covariance) == serialised(theirs)


def test_warnings_and_diagnostics_are_packed_as_rosbags_packs_them(factory):
    for value in (True, False):
        theirs = factory.make('std_msgs/msg/Bool', data=value)
        assert pack.flag(value) == serialised(theirs)
    for value in (-1, 0, 1):
        theirs = factory.make('std_msgs/msg/Int8', data=value)
        assert pack.direction(value) == serialised(theirs)
    statuses = [
        Status(2, 'node', 'ü' * length, 'id', [('a', '1'), ('key', '')][:length])
        for length in range(4)
    ]
    for some in ([], statuses[:1], statuses):
        theirs = factory.diagnostic_array(factory.header(START), some)
        assert pack.diagnostic_array(START, some) == serialised(theirs)
