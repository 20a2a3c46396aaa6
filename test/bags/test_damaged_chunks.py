# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Whatever field of a chunk's head is damaged, its messages are found."""

import random

import pytest
from recordings import contents

from wheel_terra_estimator.bags.salvage import mcap_file
from wheel_terra_lab.studies.fuzzing.mcap_maker import Layout, Sample, make

TYPES = {'/joint_states': 'sensor_msgs/msg/JointState', '/imu/data': 'sensor_msgs/msg/Imu'}
START = 1_700_000_000_000_000_000
FIELDS = {  # of a chunk's record: offset and size [byte]
    'opcode': (0, 1),
    'length': (1, 8),
    'unpacked size': (25, 8),
    'checksum': (33, 4),
    'letters of the compression': (37, 4),
    'packed size': (41, 8),  # without the letters of the compression
}


@pytest.mark.parametrize('value', [b'\0', b'\xff', b'\x11'])
@pytest.mark.parametrize('summary', [True, False])
@pytest.mark.parametrize('codec', ['', 'zstd', 'lz4'])
@pytest.mark.parametrize('name', FIELDS)
def test_messages_of_a_chunk_with_a_damaged_head(tmp_path, name, codec, summary, value):
    dice = random.Random(2)
    topics = list(TYPES)
    samples = [
        Sample(START + 10_000_000 * i, topics[i % 2], b'\0\1\0\0' + dice.randbytes(80))
        for i in range(200)
    ]
    made = make(samples, TYPES, Layout(4000, codec, summary=summary))
    offset, size = FIELDS[name]
    if name == 'packed size':
        offset += len(codec)
    at = made.parts[1][0] + offset
    path = tmp_path / 'a.mcap'
    path.write_bytes(made.content[:at] + value * size + made.content[at + size :])
    found, notes = contents(path)
    assert [tuple(message) for message in found] == [tuple(sample) for sample in samples]
    assert notes or value == b'\0'  # no checksum, no size stated
    assert 'GB' not in ' '.join(notes)


def test_messages_outside_of_the_times_of_their_chunk_are_said(tmp_path):
    """No checksum covers them; the head of the chunk states between which times they lie."""
    samples = [Sample(START + 10_000_000 * i, '/imu/data', bytes(80)) for i in range(200)]
    layout = Layout(4000, 'lz4', checksums=False)
    first, moved = make(samples, TYPES, layout).parts[1][2][0], samples[60]
    samples[60] = moved._replace(log_time=START)
    made = make(samples, TYPES, layout)
    begin, _, part = made.parts[1]
    assert samples[60] in part
    content = bytearray(made.content)
    content[begin + 9 : begin + 17] = first.log_time.to_bytes(8, 'little')
    path = tmp_path / 'a.mcap'
    path.write_bytes(content)
    found, notes = contents(path)
    assert len(found) == 200
    assert notes[0].startswith('a.mcap is damaged')
    assert f'from {(first.log_time - START) * 1e-9:.1f} s' in notes[0]


@pytest.mark.parametrize(('most', 'left_out'), [(1, 1), (3, 0)])
def test_chunks_without_their_heads_are_tried_up_to_a_number(tmp_path, monkeypatch, most, left_out):
    """Two of them, with a sound chunk between: each gap takes from what all of them may."""
    monkeypatch.setattr(mcap_file, '_MOST_HEADLESS', most)
    samples = [
        Sample(START + 10_000_000 * i, '/imu/data', b'\0\1\0\0' + bytes(80)) for i in range(200)
    ]
    made = make(samples, TYPES, Layout(4000, 'zstd', summary=False))
    content = bytearray(made.content)
    lost = made.parts[1], made.parts[3]
    for place, *_ in lost:
        content[place : place + 29] = bytes(29)
    path = tmp_path / 'a.mcap'
    path.write_bytes(content)
    found, notes = contents(path)
    assert len(samples) - len({message[0] for message in found}) == left_out * len(lost[1][2])
    assert ('pieces without a head left out' in ' '.join(notes)) == bool(left_out)
