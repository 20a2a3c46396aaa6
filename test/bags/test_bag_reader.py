# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings as measurements: topics, remaps, names, damaged and unknown messages."""

import re
import sqlite3
from collections import Counter
from typing import Any

import pytest
from rosbags.interfaces import ConnectionExtRosbag2
from rosbags.rosbag2 import StoragePlugin, Writer

from wheel_terra_estimator.bags.reader import MeasurementReader, in_one_line, parse_remaps
from wheel_terra_estimator.bags.series_reader import read_series
from wheel_terra_estimator.bags.storage import jazzy_types, open_bag
from wheel_terra_estimator.bags.topic_choice import choose_topics
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.estimation.measurements import WheelOdometry


def read(path, remaps, configuration):
    with open_bag(path) as bag:
        yield from MeasurementReader(bag, remaps, configuration).measurements()


def kinds(measurements: Any) -> Counter[str]:
    return Counter(type(measurement).__name__ for measurement in measurements)


def test_a_drive_is_read_as_measurements(make_bag, rover):
    rows = list(read(make_bag(), {}, rover))
    assert kinds(rows) == {'WheelOdometry': 40, 'InertialReading': 40, 'ReferenceVelocity': 4}
    assert isinstance(rows[0], WheelOdometry)
    assert rows[0].rate.tolist() == [2.0, 2.0]


def test_remapped_topics(make_bag, rover, drive):
    moved = [
        (topic.replace('/reference_odom', '/truth/odometry'), message, time)
        for topic, message, time in drive
    ]
    bag = make_bag(moved)
    assert 'ReferenceVelocity' not in kinds(read(bag, {}, rover))
    remaps = parse_remaps(['reference_odom:=/truth/odometry'])
    assert kinds(read(bag, remaps, rover))['ReferenceVelocity'] == 4
    # Odometry in place of joint states.
    by_odometry = rover.replace({'wheel_odometry': 'odom'})
    found = kinds(read(make_bag(name='other'), {'odom': '/reference_odom'}, by_odometry))
    assert found['WheelOdometry'] == 4


def test_a_topic_that_is_named_for_two_inputs_is_checked_as_both(make_bag):
    """Odometry of the wheels named as the reference must not hide from the checks."""
    with open_bag(make_bag()) as bag:
        told = read_series(bag, {'odom': '/reference_odom', 'sinkage': '/joint_states'}, 'bag')
    assert len(told.reference.log_time) == len(told.wheel_odometry.log_time) == 4
    assert len(told.joints.log_time) == len(told.sinkage.log_time) == 40


def test_missing_wheel_odometry_says_which_and_what_is_there(make_bag, rover, drive):
    others = [row for row in drive if row[0] != '/joint_states']
    sinkage = [('/sinkage', *row[1:]) for row in drive if row[0] == '/joint_states']
    odometry = [('/wheel_odom', *row[1:]) for row in drive if row[0] == '/reference_odom']
    bag = make_bag(others + sinkage + odometry)  # joint states that are none of the wheels'
    with pytest.raises(UserError) as error:
        list(read(bag, {}, rover))
    text = str(error.value)
    assert str(bag) in text
    assert '/joint_states is not in the bag' in text
    assert '/imu/data (sensor_msgs/msg/Imu)' in text
    assert '-p wheel_odometry:=odom --remap odom:=/wheel_odom' in text  # the reference is none


def test_joint_states_of_which_none_can_be_read_are_no_wrong_names(make_bag, rover):
    with open_bag(make_bag()) as bag:
        bag.messages = lambda topics: iter([(1, topics[0], b'\0\1\0\0')])
        with pytest.raises(UserError, match='no message on /joint_states can be read'):
            MeasurementReader(bag, {}, rover)


@pytest.fixture
def open_topics(make_bag, drive):
    """Open a bag with a message on each of some topics, by name odometry, IMU or joint states."""
    first = {topic: message for topic, message, _ in reversed(drive)}

    def opened(*topics):
        like = {'odom': '/reference_odom', 'imu': '/imu/data', '': '/joint_states'}
        told = {t: first[next(like[part] for part in like if part in t)] for t in topics}
        return open_bag(make_bag((topic, message, 1) for topic, message in told.items()))

    return opened


def test_visual_odometry_is_the_reference_beside_joint_states(open_topics):
    with open_topics('/drive', '/zed/visual_odometry', '/wheel_odom') as bag:
        chosen = choose_topics(bag, {})
    assert chosen['joint_states'] == '/drive'
    assert chosen['reference_odom'] == '/zed/visual_odometry'
    assert chosen['odom'] == '/wheel_odom'


def test_of_two_rovers_in_a_bag_all_topics_are_of_one_and_the_other_is_named(open_topics, rover):
    rates, imu, reference = 'joint_states', 'imu/data', 'reference_odom'
    a = {rates: '/a/joint_states', imu: '/a/imu/data'}
    b = {rates: '/b/joint_states', imu: '/b/imu/data', reference: '/b/gps_odom'}
    with open_topics(*a.values(), *b.values()) as bag:
        assert choose_topics(bag, {}) == a
        assert choose_topics(bag, {imu: b[imu]}) == b
        mixed = {reference: b[reference], rates: a[rates]}
        assert choose_topics(bag, mixed) == {**a, **mixed}
        (other,) = read_series(bag, {}, 'bag').notes
        assert parse_remaps(re.findall(r'--remap (\S+)', other)) == b
        with pytest.raises(UserError, match='of another rover, with --remap joint_states:=/b/'):
            MeasurementReader(bag, {}, rover)


def test_topics_of_estimates_are_named_as_such_and_together():
    kind = 'sensor_msgs/msg/JointState'
    topics = [(f'/wheel_terra_estimator/{name}', kind) for name in ('slip', 'sinkage', 'soil')]
    said = in_one_line([('/odom', 'nav_msgs/msg/Odometry'), *topics])
    assert said.startswith('/odom (nav_msgs/msg/Odometry), 3 topics of estimates')
    assert kind not in said


def test_what_is_missing_is_told_with_what_it_costs(make_bag, rover, drive):
    with open_bag(make_bag(row for row in drive if row[0] == '/joint_states')) as bag:
        absent, cost = MeasurementReader(bag, {}, rover).notes
    assert 'imu/data' in absent and 'reference_odom' in absent
    assert 'without a reference velocity slip can be wrong' in cost


def test_remap_to_a_topic_that_is_not_there_or_of_another_type(make_bag, rover, drive):
    arm = [('/arm', *row[1:]) for row in drive if row[0] == '/joint_states']
    bag = make_bag([*arm, *drive])
    right = '--remap reference_odom:=/reference_odom'
    with pytest.raises(UserError, match=f'/vo is not in the bag.*{right}'):
        list(read(bag, {'reference_odom': '/vo'}, rover))
    with pytest.raises(UserError, match=r'/imu/data has type sensor_msgs/msg/Imu, sinkage needs'):
        list(read(bag, {'sinkage': '/imu/data'}, rover))


def test_a_reference_of_another_type_is_told_how_to_become_one(make_bag, rover, drive, factory):
    """A twist beside the drive is offered; commands, which come from no sensor, are not."""
    rows = [row for row in drive if row[0] != '/reference_odom']
    at = rows[0][2]
    twist = factory.twist_stamped(factory.header(at), 0.1, 0.0, [0.0] * 36)
    bag = make_bag([*rows, ('/dvl', twist, at), ('/cmd_vel', twist, at)])
    with open_bag(bag) as opened:
        told = MeasurementReader(opened, {}, rover).notes[-1]
        assert read_series(opened, {}, 'drive').notes[-1] == told
    assert '/dvl (geometry_msgs' in told and 'nav_msgs/msg/Odometry' in told
    assert '/cmd_vel' not in told
    with pytest.raises(UserError, match=r'/dvl.*publish it as nav_msgs/msg/Odometry'):
        list(read(bag, {'reference_odom': '/dvl'}, rover))


def test_wheel_names_that_do_not_match_are_told_with_both_lists(make_bag, rover):
    other = rover.replace({'wheels.names': ['front_left', 'front_right']})
    with pytest.raises(UserError) as error:
        list(read(make_bag(), {}, other))
    assert 'front_left, front_right' in str(error.value)
    assert 'arm, left, right' in str(error.value)


def test_damaged_and_unknown_messages_are_counted_and_the_rest_is_used(rover, drive, tmp_path):
    """Types that nobody knows are never unpacked; a damaged message costs itself alone."""
    store = jazzy_types()
    path = tmp_path / 'odd'
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        joints = writer.add_connection(
            '/joint_states', 'sensor_msgs/msg/JointState', typestore=store
        )
        strange = writer.add_connection(
            '/strange', 'my_msgs/msg/Strange', msgdef='int32 number', rihs01='RIHS01_00'
        )
        assert isinstance(strange.ext, ConnectionExtRosbag2)
        for topic, message, time in drive:
            if topic == '/joint_states':
                data = bytes(store.serialize_cdr(message, 'sensor_msgs/msg/JointState'))
                writer.write(joints, time, data)
                writer.write(joints, time + 1, data[:40])
                writer.write(strange, time, b'\x00\x01\x00\x00\x01\x00\x00\x00')
    with open_bag(path) as bag:
        reader = MeasurementReader(bag, {}, rover)
        assert kinds(reader.measurements()) == {'WheelOdometry': 40}
        assert reader.rejected == {('joint_states', 'damaged message'): 40}
        assert reader.absent == ['imu/data', 'sinkage', 'leaving_angle', 'reference_odom']


def test_bag_without_message_definitions(make_bag, rover):
    """SQLite recordings of Foxy and Humble have none: Jazzy's own are used."""
    bag = make_bag(storage='sqlite3')
    (file,) = bag.glob('*.db3')
    with sqlite3.connect(file) as connection:
        connection.execute('DELETE FROM message_definitions')
    assert kinds(read(bag, {}, rover))['WheelOdometry'] == 40


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('reference_odom', 'give FROM:=TO'),
        ('joint_state:=/x', 'nearest: joint_states'),
        ('slip:=/x', 'does not listen to slip'),
    ],
)
def test_remaps_are_checked(text, words):
    with pytest.raises(UserError, match=words):
        parse_remaps([text])
    assert parse_remaps(['/imu/data:=imu', 'odom:=/a']) == {'imu/data': '/imu', 'odom': '/a'}
