# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Output bags: names, types, quality of service, log times, and that they are always readable."""

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from estimate_sets import STAMP, some_estimates
from recordings import contents

from wheel_terra_estimator.bags.history import WHEEL_FIELDS, HistoryRecorder, read_estimates
from wheel_terra_estimator.bags.storage import jazzy_types, open_bag
from wheel_terra_estimator.bags.writer import EstimateBagWriter
from wheel_terra_estimator.estimation.estimates import SlipClass
from wheel_terra_estimator.frames import unit_of
from wheel_terra_estimator.reporting.comparison import compare

pytestmark = pytest.mark.usefixtures('library_metadata')

NAMES = ('left', 'right')
SECOND = 1_000_000_000


def sets(count: int = 25) -> list[Any]:
    return [
        some_estimates(
            stamp=STAMP + i * SECOND // 10,
            stuck=8 <= i < 15,
            stuck_direction=-1 if 8 <= i < 15 else 0,
            slip=np.array([0.01 * i, -0.02 * i]),
            slip_class=np.array([i % 4, 255], dtype=np.uint8),
            reasons=('slip; rover: digging in', 'at rest; rover: digging in'),
        )
        for i in range(count)
    ]


@pytest.fixture(scope='module')
def bag(library_metadata, tmp_path_factory):
    path = tmp_path_factory.mktemp('bag') / 'estimates'
    with EstimateBagWriter(path, NAMES) as writer:
        writer.write_stuck(False, 0, STAMP)
        for i, estimates in enumerate(sets()):
            writer.add(estimates, STAMP + i * SECOND // 10 + 7)
    return path


def messages(path: Path) -> list[tuple[int, str, Any]]:
    store = jazzy_types()
    with open_bag(path) as bag:
        return [
            (m.log_time, m.topic, store.deserialize_cdr(m.data, bag.topics[m.topic].type))
            for m in bag.messages(tuple(bag.topics))
        ]


def test_topics_have_full_names_and_their_types(bag):
    joint_state = 'sensor_msgs/msg/JointState'
    quantities = ('slip', 'sinkage', 'slip_stddev', 'sinkage_stddev', 'mobility', 'soil')
    quantities += ('slip_angle', 'slip_angle_stddev')
    with open_bag(bag) as opened:
        found = {name: (topic.type, topic.message_count) for name, topic in opened.topics.items()}
    own = '/wheel_terra_estimator'
    assert found == {
        **{f'{own}/{topic}': (joint_state, 25) for topic in quantities},
        f'{own}/slip_on_slope': (joint_state, 0),
        f'{own}/slip_class': ('std_msgs/msg/UInt8MultiArray', 25),
        f'{own}/twist': ('geometry_msgs/msg/TwistWithCovarianceStamped', 25),
        f'{own}/stuck': ('std_msgs/msg/Bool', 3),
        f'{own}/stuck_direction': ('std_msgs/msg/Int8', 3),
        # By the second (0, 1, 2), and whenever a class changed its level.
        '/diagnostics': ('diagnostic_msgs/msg/DiagnosticArray', found['/diagnostics'][1]),
    }
    assert 3 < found['/diagnostics'][1] <= 25


def test_messages_of_a_set_share_stamp_and_log_time(bag):
    by_time: dict[int, list[tuple[str, Any]]] = {}
    for log_time, topic, message in messages(bag):
        by_time.setdefault(log_time, []).append((topic, message))
    for i in range(25):
        row = by_time.pop(STAMP + i * SECOND // 10 + 7)
        topics = [topic.rpartition('/')[2] for topic, _ in row]
        assert topics[:2] == ['slip', 'slip_class']  # right after each slip
        for _, message in row:
            if hasattr(message, 'header'):
                stamp = message.header.stamp
                assert stamp.sec * SECOND + stamp.nanosec == STAMP + i * SECOND // 10
                assert message.header.frame_id == 'base_link'
    at_start = [topic.rpartition('/')[2] for topic, _ in by_time.pop(STAMP)]
    assert at_start == ['stuck_direction', 'stuck']
    assert not by_time


@pytest.mark.parametrize(('topic', 'led'), [('stuck', True), ('stuck_direction', -1)])
def test_stuck_and_its_direction_are_sent_at_start_and_on_change(bag, topic, led):
    found = [(t, m.data) for t, name, m in messages(bag) if name.endswith(f'/{topic}')]
    assert found == [
        (STAMP, 0),
        (STAMP + 8 * SECOND // 10 + 7, led),
        (STAMP + 15 * SECOND // 10 + 7, 0),
    ]


def test_quality_of_service_in_the_metadata(bag):
    metadata = yaml.safe_load((bag / 'metadata.yaml').read_text())['rosbag2_bagfile_information']
    assert metadata['storage_identifier'] == 'mcap'
    for topic in metadata['topics_with_message_count']:
        (profile,) = topic['topic_metadata']['offered_qos_profiles']
        latched = topic['topic_metadata']['name'].endswith(('/stuck', '/stuck_direction'))
        assert profile['reliability'] == 'reliable'
        assert profile['durability'] == ('transient_local' if latched else 'volatile')
        assert (profile['history'], profile['depth']) == ('keep_last', 1 if latched else 10)


def test_estimates_come_back_as_they_went(bag):
    recorder = HistoryRecorder(NAMES)
    for estimates in sets():
        recorder.add(estimates)
    direct = recorder.history()
    with open_bag(bag) as opened:
        stored = read_estimates(opened)
    assert stored.names == direct.names
    assert stored.warnings == direct.warnings
    assert direct.warnings[0].reason == 'digging in'
    np.testing.assert_array_equal(stored.stamp, direct.stamp)
    np.testing.assert_array_equal(stored.slip_class, direct.slip_class)
    np.testing.assert_array_equal(stored.forward_velocity, direct.forward_velocity)
    for name, values in direct.values.items():
        np.testing.assert_array_equal(stored.values[name], values, err_msg=name)


def test_a_bag_of_some_outputs_gives_those(bag, monkeypatch):
    """As ``ros2 bag record`` of some topics leaves it, or a version that knew fewer outputs."""
    with open_bag(bag) as opened:
        whole = read_estimates(opened)
        every, left_out = opened.messages, ('/mobility', '/slip_angle', '/slip_class', '/twist')
        monkeypatch.setattr(
            opened,
            'messages',
            lambda topics: (m for m in every(topics) if not m.topic.endswith(left_out)),
        )
        some = read_estimates(opened)
    np.testing.assert_array_equal(some.stamp, whole.stamp)
    gone = ('rim_travel_left', 'pull_margin', 'slip_angle', 'lateral_force')
    for name, values in whole.values.items():
        told = np.full_like(values, np.nan) if name in gone else values
        np.testing.assert_array_equal(some.values[name], told, err_msg=name)
    assert (some.slip_class == SlipClass.UNKNOWN).all()
    assert np.isnan(some.forward_velocity).all()
    names = ('whole', 'some')
    differences = compare(whole, some, names, None).differences
    assert [d.name for d in differences] == ['slip', 'sinkage', 'drawbar_pull', 'normal_load']
    assert all(d.rms == 0.0 for d in differences)


def test_chunks_carry_checksums(make_bag):
    """A bit is turned round. Of the summary: test_a_sound_file_is_read_by_its_index."""
    (file,) = make_bag().glob('*.mcap')
    content = bytearray(file.read_bytes())
    content[content.index(struct.pack('<d', 9.0))] ^= 1  # a rate
    file.write_bytes(content)
    assert 'a chunk with a wrong checksum' in contents(file)[1][0]


def test_every_column_of_a_wheel_has_its_unit_or_is_a_ratio():
    assert {name for name in WHEEL_FIELDS if unit_of(name) == '-'} == {'slip', 'slip_std'}
