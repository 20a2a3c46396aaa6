# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Damaged recordings lose what is damaged, nothing else, and it is said what is lost."""

import random
import re
import shutil
import sqlite3
import struct
from collections import Counter
from pathlib import Path

import pytest
from recordings import contents

from wheel_terra_estimator.bags.salvage import RawMessage, limits
from wheel_terra_estimator.cli.main import main
from wheel_terra_estimator.errors import UserError
from wheel_terra_lab.studies.fuzzing import sqlite_maker
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


def test_every_command_says_what_is_damaged(make_bag, config, tmp_path, capsys):
    bag = make_bag()
    estimates = str(tmp_path / 'estimates')
    assert main(['replay', str(bag), *config, '-o', estimates]) == 0
    for folder in (bag, Path(estimates)):
        (file,) = folder.glob('*.mcap')
        file.write_bytes(file.read_bytes()[:-200])
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


@pytest.mark.parametrize('closed', [True, False])
@pytest.mark.parametrize('chunk_size', [0, 900])
def test_a_file_by_topic_without_index_gives_all_topics_in_order(read_mcap, chunk_size, closed):
    layout = Layout(chunk_size, summary=False, by_topic=True, closed=closed)
    found, notes = read_mcap(make(samples(), TYPES, layout).content)
    assert [tuple(m) for m in found] == [tuple(s) for s in samples()]
    assert bool(notes) is not closed


@pytest.mark.parametrize('codec', ['', 'zstd', 'lz4'])
def test_channels_from_the_summary_and_chunks_behind_the_damage(read_mcap, codec):
    made = make(samples(), TYPES, Layout(900, codec))
    begin, end, lost = made.parts[0]
    content = made.content[:begin] + bytes(end - begin) + made.content[end:]
    found, notes = read_mcap(content)
    assert [tuple(m) for m in found] == [tuple(s) for s in samples()[len(lost) :]]
    assert f'lost: {(len(lost) + 1) // 2} of 45 on /joint_states' in notes[0]


def test_records_behind_a_damage_within_a_chunk_are_found(read_mcap):
    made = make(samples(), TYPES, Layout(100_000))
    at = made.content.index(struct.pack('<Q', 40) * 8)
    content = made.content[: at - 3] + b'\xff' * 8 + made.content[at + 5 :]
    found, notes = read_mcap(content)
    # Only the values are damaged: the message is there, and that its chunk is doubtful is said.
    assert len(found) == 90
    assert '90 of them stand in a chunk with a wrong checksum' in notes[0]
    head = at - 4 - 31
    content = made.content[:head] + bytes(31) + made.content[head + 31 :]
    found, notes = read_mcap(content)
    assert [tuple(m) for m in found] == [tuple(s) for i, s in enumerate(samples()) if i != 40]
    assert 'lost: 1 of 45 on /joint_states; from 0.4 s to 0.4 s' in notes[0]


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
    assert read_mcap(b'?' + made.content)[0] == [RawMessage(*sample) for sample in whole]


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
    assert all(RawMessage(*sample) in found for part in intact for sample in part)


def test_two_copies_of_a_channel_that_differ_are_said(read_mcap):
    """No checksum tells which of them is right."""
    made = make(samples(), TYPES, Layout(checksums=False))
    content = made.content.replace(b'/joint_states', b'/joint_statas', 1)
    found, notes = read_mcap(content)
    assert len(found) == 90
    assert 'copies of channel 1 differ: /joint_statas or /joint_states' in notes[0]


@pytest.mark.parametrize('codec', ['zstd', 'lz4'])
def test_a_channel_in_a_chunk_that_unpacks_decides(read_mcap, codec):
    made = make(samples(), TYPES, Layout(codec=codec, checksums=False))
    at = made.content.rindex(b'/joint_states')
    content = made.content[:at] + b'/joint_statas' + made.content[at + 13 :]
    found, notes = read_mcap(content)
    assert found == [RawMessage(*sample) for sample in samples()]
    # Damaged bytes may unpack as well: without a checksum it is no proof.
    assert 'copies of channel 1 differ: /joint_statas or /joint_states' in notes[0]


def test_a_channel_in_a_chunk_with_a_wrong_checksum_yields(read_mcap):
    made = make(samples(), TYPES, Layout(900, 'lz4'))
    content = bytearray(made.content.replace(b'imu/data', b'imu/datc', 1))
    assert content.index(b'imu/datc') < made.parts[0][1]
    content[-20] ^= 1  # in the footer: the index is not relied on, its definitions are read
    found, notes = read_mcap(content)
    assert found == [RawMessage(*sample) for sample in samples()]
    assert 'copies of channel 2 differ' in notes[0]


def test_messages_whose_chunk_lost_its_head_are_said(read_mcap):
    """Bytes are missing, by chance so many that a record ends where another begins."""
    made = make(samples(), TYPES, Layout(900, checksums=False, summary=False))
    begin, _, part = made.parts[2]
    third = made.content.index(part[2].data) - 31
    found, notes = read_mcap(made.content[:begin] + made.content[third:])
    assert not Counter(found) - Counter(RawMessage(*sample) for sample in samples())
    assert len(found) == 88
    assert 'lost from' in notes[0]


def test_the_index_alone_decides_nothing(read_mcap):
    """A chunk index entry that points elsewhere, in a file without checksums."""
    made = make(samples(), TYPES, Layout(900, checksums=False))
    content = bytearray(made.content)
    begin = made.parts[2][0]
    entry = content.index(struct.pack('<Q', begin), made.definitions[-1][1])
    content[entry : entry + 8] = struct.pack('<Q', begin + 5)
    found, _ = read_mcap(content)
    assert [tuple(m) for m in found] == [tuple(s) for s in samples()]


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
    assert 'metadata.yaml was set aside' in notes[0]


def big_sqlite(tmp_path: Path, count: int = 4000) -> tuple[Path, list[RawMessage]]:
    path, found = tmp_path / 'a.db3', samples(count)
    sqlite_maker.write(path, found, TYPES)
    return path, [RawMessage(*s) for s in found]


def test_rows_behind_damaged_pages_of_sqlite_are_read(tmp_path):
    path, whole = big_sqlite(tmp_path)
    assert contents(path) == (whole, [])
    content = bytearray(path.read_bytes())
    middle = content.index(struct.pack('<Q', 2000) * 8) // 4096 * 4096
    content[middle : middle + 8192] = bytes(8192)
    path.write_bytes(content)
    found, notes = contents(path)
    assert not Counter(found) - Counter(whole)
    assert len(found) > len(whole) - 200
    assert 'is damaged' in notes[0]
    assert 'from 19.' in notes[0] or 'from 20.' in notes[0]


def test_a_damaged_row_number_of_sqlite_hides_no_row_behind(tmp_path):
    """The rows of a page have great numbers and no data, the last of them cannot be read."""
    path, whole = big_sqlite(tmp_path)
    content = bytearray(path.read_bytes())
    begin = content.index(whole[2000].data) // 4096 * 4096
    count = int.from_bytes(content[begin + 3 : begin + 5], 'big')
    places = [int.from_bytes(content[begin + 8 + 2 * i :][:2], 'big') for i in range(count)]
    pages = [content.index(message.data) // 4096 * 4096 for message in whole]
    for place in places:  # length 2, number 12343, a head of 2 bytes, nothing
        content[begin + place : begin + place + 5] = b'\x02\xe0\x37\x02\x00'
    content[begin + places[-1] : begin + places[-1] + 9] = b'\xff' * 9
    path.write_bytes(content)
    found, notes = contents(path)
    assert Counter(found) == Counter(
        message for message, page in zip(whole, pages, strict=True) if page != begin
    )
    assert 'is damaged' in notes[0]


def test_pages_that_sqlite_does_not_miss_are_said(tmp_path):
    """The page that lists the pages of the table states too few of them, which is no error."""
    path, whole = big_sqlite(tmp_path)
    content = bytearray(path.read_bytes())
    interior = next(at for at in range(4096, len(content), 4096) if content[at] == 5)
    count = int.from_bytes(content[interior + 3 : interior + 5], 'big')
    assert count > 20
    content[interior + 3 : interior + 5] = (count - 9).to_bytes(2, 'big')
    path.write_bytes(content)
    found, notes = contents(path)
    assert not Counter(found) - Counter(whole)
    assert f'is damaged: {len(found)} whole messages recovered' in notes[0]
    assert 'of the recording' in notes[0]


def test_an_index_of_sqlite_that_lies_hides_no_row(tmp_path):
    path, whole = big_sqlite(tmp_path)
    with sqlite3.connect(path) as connection:
        connection.execute('PRAGMA writable_schema=ON')
        connection.execute("DELETE FROM sqlite_master WHERE name='timestamp_idx'")
        connection.execute('PRAGMA writable_schema=OFF')
    connection.close()
    assert contents(path)[0] == whole


def test_rows_of_sqlite_out_of_order_are_sorted(tmp_path):
    path, whole = big_sqlite(tmp_path, 50)
    with sqlite3.connect(path) as connection:
        connection.execute('UPDATE messages SET timestamp = ? WHERE id = 30', (START - 5,))
    connection.close()
    found, _ = contents(path)
    assert found[0].log_time == START - 5
    assert [m.log_time for m in found] == sorted(m.log_time for m in found)
    assert len(found) == len(whole)


def test_the_write_ahead_log_of_a_recorder_that_died_is_read(tmp_path):
    path, whole = big_sqlite(tmp_path, 50)
    live = sqlite3.connect(path)
    live.execute('PRAGMA journal_mode=WAL')
    live.execute('PRAGMA wal_autocheckpoint=0')
    live.execute('INSERT INTO messages VALUES(99, 1, ?, ?)', (START + 10**12, b'last'))
    live.commit()
    other = tmp_path / 'copy'
    other.mkdir()
    for file in tmp_path.glob('a.db3*'):
        shutil.copy(file, other)
    live.close()
    (other / 'a.db3-shm').unlink(missing_ok=True)
    before = sorted(p.name for p in other.iterdir())
    found, _ = contents(other / 'a.db3')
    assert found[-1].data == b'last'
    assert len(found) == len(whole) + 1
    assert sorted(p.name for p in other.iterdir()) == before


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


def test_garbage_in_a_damaged_recording_is_not_put_down_to_the_driver(make_bag, capsys):
    """Stamps of 0 on four messages, in a file that was cut off."""
    folder = make_bag()
    (file,) = folder.glob('*.mcap')
    content = bytearray(file.read_bytes()[:-200])
    messages, _ = contents(folder)
    for message in [m for m in messages if m.topic == '/imu/data'][5:9]:
        at = content.index(message.data)
        content[at + 4 : at + 12] = bytes(8)
    file.write_bytes(content)
    main(['check', str(folder)])
    said = capsys.readouterr().out
    assert '4 damaged messages on /imu/data were left out' in said
    assert 'stamp each message' not in said
