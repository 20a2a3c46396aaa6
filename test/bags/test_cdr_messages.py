# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Messages that are unpacked quickly give the measurements that rosbags' own messages give."""

import random
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from estimate_sets import some_estimates

from wheel_terra_estimator.bags.message_factory import MessageFactory
from wheel_terra_estimator.bags.message_types import topic_messages
from wheel_terra_estimator.messages import cdr
from wheel_terra_estimator.messages.cdr import (
    TWIST,
    ClassPacker,
    DamagedMessageError,
    EstimatePacker,
    JointStatePacker,
    TopicMessages,
    TwistPacker,
)
from wheel_terra_estimator.messages.convert import INPUT_TYPES, InputConverter, input_layout

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


def measured(converter: InputConverter, name: str, message: Any) -> Any:
    if message is None:
        return None
    found = converter.convert(name, message)
    return found and [
        value.tobytes() if isinstance(value, np.ndarray) else repr(value)
        for value in vars(found).values()
    ]


def with_rosbags(store: Any, kind: str, data: bytes) -> Any:
    try:
        return store.deserialize_cdr(data, kind)
    except Exception:
        return None


def quickly(reader: TopicMessages, data: bytes) -> Any:
    try:
        return reader.unpack(data)
    except DamagedMessageError:
        return None


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('name', INPUT_TYPES)
@pytest.mark.parametrize('little', [True, False])
def test_measurements_are_those_of_rosbags(name, little, factory, rover):
    dice = random.Random(name)
    kind, store = INPUT_TYPES[name], factory.store
    reader = topic_messages(kind)
    ours, theirs = (InputConverter(input_layout(rover)) for _ in range(2))
    quick = 0
    for message in messages(factory, name, 150, dice):
        data = bytearray(store.serialize_cdr(message, kind, little_endian=little))
        for damage in (0, 0, 1, 3, 20):
            for _ in range(damage):
                if dice.random() < 0.7:
                    data[dice.randrange(len(data))] = dice.randrange(256)
                else:
                    at = dice.randrange(len(data))
                    data[at : at + dice.randrange(3)] = dice.randbytes(dice.randrange(5))
            found = quickly(reader, bytes(data))
            quick += type(found).__module__ == cdr.__name__
            assert measured(ours, name, found) == measured(
                theirs, name, with_rosbags(store, kind, bytes(data))
            )
    assert ours.rejected == theirs.rejected
    assert (quick > 150) == little


def test_every_field_that_anybody_reads(factory):
    dice = random.Random(1)
    for name in ('joint_states', 'imu/data', 'odom'):
        reader = topic_messages(INPUT_TYPES[name])
        *_, message = messages(factory, name, 9, dice)
        data = bytes(factory.store.serialize_cdr(message, INPUT_TYPES[name]))
        for _ in range(2):
            found = reader.unpack(data)
        assert type(found).__module__ == cdr.__name__
        assert_same(found, message)


def test_a_stamped_twist(factory):
    twist = factory.twist_with_covariance(0.3, -0.1, [float(i) for i in range(36)])
    message = factory.make(TWIST, header=factory.header(START), twist=twist)
    data = bytes(factory.store.serialize_cdr(message, TWIST))
    reader = topic_messages(TWIST)
    for _ in range(2):
        found = reader.unpack(data)
    assert type(found).__module__ == cdr.__name__
    assert_same(found, message)


@pytest.mark.parametrize('frame', ['', 'base_link', 'ab', 'ü'])
@pytest.mark.parametrize('names', [(), ('left', 'right'), ('a', 'ab', 'abc', 'abcd', 'ü')])
def test_packed_messages_are_the_bytes_of_rosbags(frame, names, factory):
    dice = random.Random(7)
    joint_states, twists = JointStatePacker(frame), TwistPacker(frame)
    for classes in ([], [0, 255], [3, 2, 1]):
        theirs = factory.store.serialize_cdr(
            factory.slip_class(classes), 'std_msgs/msg/UInt8MultiArray'
        )
        assert ClassPacker(len(classes)).packed(classes) == bytes(theirs)
    for lengths in ((0, 0, 0), (3, 0, 1), (1, 2, 3), (0, 4, 0), (1, 2, 3)):
        stamp = dice.randrange(2**60)
        values = [[dice.gauss(0, 1) for _ in range(length)] for length in lengths]
        header = factory.header(stamp, frame)
        theirs = factory.store.serialize_cdr(
            factory.joint_state(header, names, *values), INPUT_TYPES['joint_states']
        )
        assert joint_states.packed(stamp, names, *values) == bytes(theirs)
        covariance = [dice.random() for _ in range(36)]
        theirs = factory.store.serialize_cdr(
            factory.twist_stamped(header, 0.3, -0.2, covariance), TWIST
        )
        assert twists.packed(stamp, (0.3, 0.0), -0.2, covariance) == bytes(theirs)


def test_a_set_is_packed_for_the_topics_that_are_wanted():
    estimates = some_estimates()
    packer = EstimatePacker(('left', 'right'))
    whole = dict(packer.packed(estimates))
    assert list(whole) == [
        'slip', 'slip_class', 'sinkage', 'slip_stddev', 'sinkage_stddev', 'mobility', 'soil',
        'slip_angle', 'slip_angle_stddev', 'twist',
    ]  # fmt: skip
    some = {'twist', 'slip_class', 'mobility', 'slip_on_slope'}  # the last one is not due
    assert dict(packer.packed(estimates, some)) == {t: whole[t] for t in some & whole.keys()}
    read = topic_messages('std_msgs/msg/UInt8MultiArray').unpack(whole['slip_class'])
    assert read.data.tolist() == estimates.slip_class.tolist()
    twist = topic_messages(TWIST).unpack(whole['twist']).twist.twist
    assert twist.linear.x == estimates.forward_velocity
    assert twist.angular.z == estimates.yaw_rate


def assert_same(found: Any, message: Any) -> None:
    """Compare the fields of a quick message, down to the numbers, with those of the whole one."""
    for field in found._fields:
        ours, theirs = getattr(found, field), getattr(message, field)
        if hasattr(ours, '_fields'):
            assert_same(ours, theirs)
        elif isinstance(ours, tuple | np.ndarray):
            assert list(map(repr, map(plain, ours))) == list(map(repr, map(plain, theirs)))
        else:
            assert repr(ours) == repr(plain(theirs))


def plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value


@pytest.mark.parametrize('name', ['joint_states', 'imu/data', 'odom'])
@pytest.mark.parametrize('little', [True, False])
def test_many_at_once_hold_what_each_alone_holds(name, little, factory):
    dice = random.Random(7)
    kind = INPUT_TYPES[name]
    data = []
    for message in messages(factory, name, 300, dice):
        whole = bytearray(factory.store.serialize_cdr(message, kind, little_endian=little))
        if dice.random() < 0.2:
            whole[dice.randrange(len(whole))] = dice.randrange(256)
        data.append(bytes(whole))
    found = {}
    for alike in topic_messages(kind).unpack_alike(data):
        for row, index in enumerate(alike.order.tolist()):
            fields = [field[row].tolist() for field in alike.numbers]
            found[index] = (int(alike.stamps[row]), alike.names, fields)
    alone = {}
    for index, whole in enumerate(data):
        message = quickly(topic_messages(kind), whole)
        if message is not None:
            alone[index] = fields_of(message)
    assert repr(sorted(found.items())) == repr(sorted(alone.items()))
    assert len(found) > 250


def fields_of(message: Any) -> tuple[int, tuple[str, ...], list[list[float]]]:
    stamp = message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec
    if hasattr(message, 'name'):
        fields = [message.position, message.velocity, message.effort]
        return stamp, tuple(message.name), [[float(v) for v in field] for field in fields]
    if hasattr(message, 'twist'):
        linear, angular = message.twist.twist.linear, message.twist.twist.angular
        numbers = [linear.x, linear.y, linear.z, angular.x, angular.y, angular.z]
        return stamp, (), [[float(v) for v in (*numbers, *message.twist.covariance)]]
    q, w, f = message.orientation, message.angular_velocity, message.linear_acceleration
    numbers = [q.x, q.y, q.z, q.w, *message.orientation_covariance]
    numbers += [w.x, w.y, w.z, *message.angular_velocity_covariance]
    numbers += [f.x, f.y, f.z, *message.linear_acceleration_covariance]
    return stamp, (), [[float(v) for v in numbers]]
