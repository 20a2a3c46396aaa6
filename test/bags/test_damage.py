# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Damaged recordings lose what is damaged, nothing else, and it is said what is lost."""

import itertools
import random
import re
import shutil
import struct
from collections import Counter
from pathlib import Path

import pytest
from recordings import contents

from wheel_terra_estimator.bags.salvage import RawMessage, limits, mcap_records
from wheel_terra_estimator.cli.main import main
from wheel_terra_estimator.errors import UserError
from wheel_terra_lab.studies.fuzzing.mcap_maker import Layout, Sample, make

DEMO = next(Path(__file__).resolve().parents[2].glob('**/demo/entrapment'), Path('absent'))
TYPES = {'/joint_states': 'sensor_msgs/msg/JointState', '/imu/data': 'sensor_msgs/msg/Imu'}
START = 1_700_000_000_000_000_000


def samples(count: int = 90) -> list[Sample]:
    topics = list(TYPES)
    return [
        Sample(START + 10_000_000 * i, topics[i % 2], b'\0\1\0\0' + struct.pack('<Q', i) * 8)
        for i in range(count)
    ]


@pytest.fixture
def read_mcap(tmp_path):
    """Write bytes as an MCAP file; return the messages that are found, and what is said."""

    def read(content: bytes) -> tuple[list[RawMessage], list[str]]:
        (tmp_path / 'a.mcap').write_bytes(content)
        return contents(tmp_path / 'a.mcap')

    return read


def damaged(folder: Path, source: Path, at: int, count: int = 512) -> Path:
    """Copy a bag and overwrite bytes of its file with zeros."""
    copy = folder / 'damaged'
    shutil.copytree(source, copy)
    (file,) = copy.glob('*.mcap')
    content = bytearray(file.read_bytes())
    content[at : at + count] = bytes(count)
    file.chmod(0o644)
    file.write_bytes(content)
    return copy


def test_demo_drive_with_a_lost_sector_keeps_every_intact_chunk(tmp_path):
    """The sector lies in the first of four chunks, which alone holds schemas and channels."""
    found, notes = contents(damaged(tmp_path, DEMO, 100_000))
    whole, _ = contents(DEMO)
    assert len(whole) == 10_190
    assert len(found) >= 7_205
    assert not Counter(found) - Counter(whole)
    lost = Counter(message.topic for message in whole) - Counter(m.topic for m in found)
    assert f'{len(found)} of 10190 whole messages recovered' in notes[0]
    said = {topic: int(n) for n, topic in re.findall(r'(\d+) of \d+ on (/[\w/]+)', notes[0])}
    assert said
    assert all(lost[topic] == count for topic, count in said.items())
    first, last = map(float, re.search(r'from ([\d.]+) s to ([\d.]+) s', notes[0]).groups())
    gone = sorted((m.log_time - whole[0].log_time) * 1e-9 for m in Counter(whole) - Counter(found))
    assert first <= gone[0] + 0.06
    assert last >= gone[-1] - 0.06
    assert last - first < gone[-1] - gone[0] + 0.2


def test_what_is_lost_before_all_that_is_read_is_at_no_time_of_it(tmp_path):
    _, notes = contents(damaged(tmp_path, DEMO.with_name('pathfinder'), 100))
    assert 'lost: 14' in notes[0] and notes[0].endswith('; before the first of these')


def test_every_command_says_what_is_damaged(make_bag, drive, config, tmp_path, capsys):
    """Of a bag that is cut in half; a check begins with the loss."""
    bag = make_bag(drive[:50])
    estimates = str(tmp_path / 'estimates')
    assert main(['replay', str(bag), *config, '-o', estimates]) == 0
    for folder in (bag, Path(estimates)):
        (file,) = folder.glob('*.mcap')
        file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    calibrated = str(tmp_path / 'calibrated.yaml')
    for command in (
        ['replay', str(bag), *config],
        ['check', str(bag), *config],
        ['check', str(bag), '--json'],
        ['calibrate', str(bag), *config, '-o', calibrated],
        ['compare', estimates, estimates],
        ['diagnose', str(bag), *config, '-o', str(tmp_path / 'd')],
    ):
        capsys.readouterr()
        main(command)
        said = capsys.readouterr()
        assert 'whole messages recovered' in said.out + said.err, command
        if command[0] == 'check' and '--json' not in command:
            _, note, finding, *_ = said.out.splitlines()
            assert 'whole messages recovered' in note and 'of the messages are lost' in finding


@pytest.mark.parametrize('closed', [True, False])
@pytest.mark.parametrize('chunk_size', [0, 900])
def test_a_file_by_topic_without_index_gives_all_topics_in_order(read_mcap, chunk_size, closed):
    layout = Layout(chunk_size, summary=False, by_topic=True, closed=closed)
    found, notes = read_mcap(make(samples(), TYPES, layout).content)
    assert found == samples()
    assert bool(notes) is not closed


@pytest.mark.parametrize('codec', ['', 'zstd', 'lz4'])
def test_channels_from_the_summary_and_chunks_behind_the_damage(read_mcap, codec):
    made = make(samples(), TYPES, Layout(900, codec))
    begin, end, lost = made.parts[0]
    content = made.content[:begin] + bytes(end - begin) + made.content[end:]
    found, notes = read_mcap(content)
    assert found == samples()[len(lost) :]
    assert f'lost: {(len(lost) + 1) // 2} of 45 on /joint_states' in notes[0]


def test_damaged_names_are_no_traceback(read_mcap):
    made = make(samples(), TYPES, Layout(900, summary=False))
    content = made.content.replace(b'/imu/data', b'/imu\xff\xfe\xfa\xf0a')
    found, notes = read_mcap(content)
    assert {m.topic for m in found} == {'/joint_states'}
    assert len(found) == 45
    assert 'messages of channels that are not described' in notes[0]


def test_loose_messages_are_read_behind_a_damaged_beginning(read_mcap):
    whole = samples()
    made = make(whole, TYPES, Layout(chunk_size=0, closed=False))
    assert read_mcap(b'?' + made.content)[0] == whole


def test_a_chunk_that_seems_to_end_with_another_does_not_hide_it(read_mcap):
    """As many bytes are missing as bring the end of a later chunk to where this one should end."""
    dice = random.Random(1)
    whole = [sample._replace(data=dice.randbytes(200)) for sample in samples()]
    made = make(whole, TYPES, Layout(900, 'zstd', checksums=False, definitions=False))
    (begin, end, _), (first, last, _) = made.parts[2], made.parts[-1]
    inside = begin + 80
    assert inside + last - end <= first  # the last chunk is whole
    found = Counter(read_mcap(made.content[:inside] + made.content[inside + last - end :])[0])
    intact = [part for _, _, part in (*made.parts[:2], made.parts[-1])]
    assert all(sample in found for part in intact for sample in part)


@pytest.mark.parametrize('codec', ['zstd', 'lz4'])
def test_a_channel_in_a_chunk_that_unpacks_decides(read_mcap, codec):
    made = make(samples(), TYPES, Layout(codec=codec, checksums=False))
    at = made.content.rindex(b'/joint_states')
    content = made.content[:at] + b'/joint_statas' + made.content[at + 13 :]
    found, notes = read_mcap(content)
    assert found == samples()
    # Damaged bytes may unpack as well: without a checksum it is no proof.
    assert 'copies of channel 1 differ: /joint_statas or /joint_states' in notes[0]


def test_a_channel_in_a_chunk_with_a_wrong_checksum_yields(read_mcap):
    made = make(samples(), TYPES, Layout(900, 'lz4'))
    content = bytearray(made.content.replace(b'imu/data', b'imu/datc', 1))
    assert content.index(b'imu/datc') < made.parts[0][1]
    content[-20] ^= 1  # in the footer: the index is not relied on, its definitions are read
    found, notes = read_mcap(content)
    assert found == samples()
    assert 'copies of channel 2 differ' in notes[0]


def test_messages_whose_chunk_lost_its_head_are_said(read_mcap):
    """Bytes are missing, by chance so many that a record ends where another begins."""
    made = make(samples(), TYPES, Layout(900, checksums=False, summary=False))
    begin, _, part = made.parts[2]
    third = made.content.index(part[2].data) - 31
    found, notes = read_mcap(made.content[:begin] + made.content[third:])
    assert not Counter(found) - Counter(samples())
    assert len(found) == 88
    assert 'lost from' in notes[0]


def lying(text: str, old: str, new: str) -> str:
    assert re.search(old, text)
    return re.sub(old, new, text)


@pytest.mark.parametrize(
    ('old', 'new'),
    [
        ('message_count: [0-9]+', 'message_count: 0'),
        ('name: /joint_states', 'name: /wheel_speeds'),
        (r'topics_with_message_count:', 'topics_with_message_count: null\n  old:'),
        ('message_count: [0-9]+', 'message_count: ' + '9' * 5000),
        ('name: /joint_states', 'name: null'),
        ('relative_file_paths:', 'relative_file_paths: [gone.mcap]\n  old:'),
        ('(?s).+', 'rosbag2_bagfile_information: {version: 9}\n'),
    ],
)
def test_metadata_that_lie_are_set_aside_and_said(make_bag, old, new):
    folder = make_bag()
    whole, notes = contents(folder)
    assert len(whole) == 84
    assert not notes
    metadata = folder / 'metadata.yaml'
    metadata.write_text(lying(metadata.read_text(), old, new))
    found, notes = contents(folder)
    assert found == whole
    assert 'metadata.yaml was ignored' in notes[0]


def test_a_chunk_above_the_limit_is_left_out_and_said(read_mcap, monkeypatch):
    few = samples()
    few.insert(45, Sample(few[44].log_time + 1, '/imu/data', bytes(50_000)))
    monkeypatch.setattr(limits, 'CHUNK', 20_000)
    found, notes = read_mcap(make(few, TYPES, Layout(900, 'zstd')).content)
    assert 80 <= len(found) < 90
    assert 'was left out' in notes[0]


def test_more_than_can_be_held_is_refused_not_swapped(read_mcap, monkeypatch):
    layout = Layout(900, by_topic=True)
    monkeypatch.setattr(limits, 'HELD', 5_000)
    with pytest.raises(UserError, match='sort it first'):
        read_mcap(make(samples(900), TYPES, layout).content)


FIELDS = {  # of a chunk's record: offset and size [byte]
    'opcode': (0, 1),
    'length': (1, 8),
    'unpacked size': (25, 8),
    'checksum': (33, 4),
    'letters of the compression': (37, 4),
    'packed size': (41, 8),  # without the letters of the compression
}
NEEDED = 'opcode', 'length', 'letters of the compression', 'packed size'


@pytest.mark.parametrize('summary', [True, False])
@pytest.mark.parametrize('codec', ['', 'zstd', 'lz4'])
def test_messages_of_a_chunk_with_a_damaged_head(read_mcap, codec, summary):
    """Packed ones are lost, and it is said, where nothing tells that there is a chunk."""
    dice = random.Random(2)
    whole = [s._replace(data=b'\0\1\0\0' + dice.randbytes(80)) for s in samples(200)]
    made = make(whole, TYPES, Layout(4000, codec, summary=summary))
    for name, value in itertools.product(FIELDS, (b'\0', b'\xff', b'\x11')):
        offset, size = FIELDS[name]
        at = made.parts[1][0] + offset + (len(codec) if name == 'packed size' else 0)
        found, notes = read_mcap(made.content[:at] + value * size + made.content[at + size :])
        lost = made.parts[1][2] if codec and name in NEEDED else []
        assert found == [sample for sample in whole if sample not in lost], (name, value)
        assert notes or (value == b'\0' and not lost), name  # no checksum, no size stated
        assert 'GB' not in ' '.join(notes)


def test_messages_outside_of_the_times_of_their_chunk_are_said(read_mcap):
    """No checksum covers them; the index behind the chunk lists times that its head excludes."""
    whole, layout = samples(200), Layout(4000, 'lz4', checksums=False)
    first = make(whole, TYPES, layout).parts[1][2][0]
    whole[60] = whole[60]._replace(log_time=START)
    made = make(whole, TYPES, layout)
    begin, _, part = made.parts[1]
    assert whole[60] in part
    content = bytearray(made.content)
    content[begin + 9 : begin + 17] = first.log_time.to_bytes(8, 'little')
    found, notes = read_mcap(content)
    assert len(found) == 200
    assert notes[0].startswith('a.mcap is damaged')


def test_fields_that_reach_beyond_their_record_are_none():
    short = struct.pack('<HI', 1, 9) + b'eight...'
    with pytest.raises(ValueError, match='longer than its record'):
        mcap_records.schema(short, mcap_records.Record(mcap_records.SCHEMA, 0, len(short)))
    index = bytes(32) + struct.pack('<I', 29) + bytes(28)
    with pytest.raises(ValueError, match='a chunk index record is damaged'):
        mcap_records.indexed_chunk(index, mcap_records.Record(8, 0, len(index)))
