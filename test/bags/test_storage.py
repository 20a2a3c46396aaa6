# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings in every shape and state give the messages that are whole."""

import shutil
from pathlib import Path
from typing import Any

import pytest
import yaml
from recordings import contents
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from wheel_terra_estimator.bags.salvage import RawMessage
from wheel_terra_estimator.bags.salvage.mcap_file import McapFile
from wheel_terra_estimator.bags.storage import jazzy_types, open_bag
from wheel_terra_estimator.errors import UserError


def messages(path: Path) -> list[RawMessage]:
    return contents(path)[0]


@pytest.fixture
def whole(make_bag):
    return messages(make_bag(name='whole'))


@pytest.mark.parametrize('storage', ['mcap', 'sqlite3'])
def test_folder_single_file_and_folder_without_metadata_are_the_same(make_bag, whole, storage):
    folder = make_bag(storage=storage)
    (file,) = (p for p in folder.iterdir() if p.suffix in ('.mcap', '.db3'))
    assert len(whole) == 84
    assert messages(folder) == whole
    assert messages(file) == whole
    (folder / 'metadata.yaml').unlink()
    found, notes = contents(folder)
    assert found == whole and 'metadata.yaml is missing' in notes[0]


def test_a_file_that_the_metadata_do_not_list_is_not_read_and_said(make_bag, drive, whole):
    folder, other = make_bag(), make_bag(drive[:6], 'another')
    (other / 'another.mcap').rename(folder / 'another.mcap')
    found, notes = contents(folder)
    assert found == whole
    assert notes == ['another.mcap is not listed in metadata.yaml and was not read']


def test_a_sound_file_is_read_by_its_index(make_bag, whole, monkeypatch):
    monkeypatch.setattr(McapFile, '_survey', lambda _: pytest.fail('read from front to end'))
    assert messages(make_bag()) == whole


@pytest.mark.parametrize('mode', ['FILE', 'MESSAGE', 'STORAGE'])
def test_compressed_bags(tmp_path, drive, whole, mode):
    store = jazzy_types()
    writer = Writer(tmp_path / 'bag', version=9, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(CompressionMode[mode], CompressionFormat.ZSTD)
    with writer:
        connections: dict[str, Any] = {}
        for topic, message, log_time in drive:
            kind = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(connections[topic], log_time, store.serialize_cdr(message, kind))
    assert messages(tmp_path / 'bag') == whole
    (tmp_path / 'bag' / 'metadata.yaml').unlink()
    assert messages(tmp_path / 'bag') == whole


def test_truncated_mcap_gives_the_messages_before_the_cut(make_bag, whole, tmp_path):
    (file,) = make_bag().glob('*.mcap')
    content = file.read_bytes()
    cut = tmp_path / 'cut.mcap'
    counts = []
    for size in range(len(content) // 3, len(content), len(content) // 40):
        cut.write_bytes(content[:size])
        found, notes = contents(cut)
        assert found == whole[: len(found)]
        assert notes or len(found) == len(whole)
        counts.append(len(found))
    assert counts == sorted(counts)
    assert counts[0] > 0
    with open_bag(cut) as bag:
        assert 'whole messages recovered' in bag.notes[0]


@pytest.mark.parametrize(
    ('name', 'content', 'words'),
    [
        ('gone', None, 'no such bag'),
        ('drive.bag', b'#ROSBAG V2.0\n', 'rosbags-convert --src'),
        ('notes.txt', b'hello', 'not a bag'),
        ('log.csv', b'time,rate', 'wheel-terra convert'),
        ('empty.mcap', b'', 'not one message can be read'),
        ('rubbish.mcap', b'rubbish' * 100, 'does not begin as an MCAP file'),
        ('rubbish.db3', b'rubbish' * 100, 'finds no recording in it'),
    ],
)
def test_what_is_no_recording_is_refused_by_name(tmp_path, name, content, words):
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(UserError) as error, open_bag(path):
        pass
    assert str(path) in str(error.value)
    assert words in str(error.value)
    assert '\n' not in str(error.value)


def test_empty_bag_and_empty_folder(make_bag, tmp_path):
    with pytest.raises(UserError, match='holds no messages'), open_bag(make_bag(messages=[])):
        pass
    empty = tmp_path / 'empty'
    empty.mkdir()
    with pytest.raises(UserError, match='not a bag'), open_bag(empty):
        pass


def test_split_bag_is_read_as_one(make_bag, drive, whole):
    wheels, others = (
        [row for row in drive if (row[0] == '/joint_states') is of_wheels]
        for of_wheels in (True, False)
    )
    first, second = make_bag(messages=wheels, name='first'), make_bag(others, name='second')
    for file in second.glob('*.mcap'):
        shutil.copy(file, first)
    (first / 'metadata.yaml').unlink()
    assert messages(first) == whole, 'in the order of log times, though the files overlap'


@pytest.mark.shared
def test_measured_bag_in_both_storages_is_the_same(shared):
    mcap = messages(shared / 'bags' / 'frostyboy_event_1_6_mcap')
    sqlite = messages(shared / 'bags' / 'frostyboy_event_1_6_db3')
    assert len(mcap) == 2570
    assert sorted(mcap) == sorted(sqlite)


def test_bags_of_the_tests_are_closed_as_the_library_does_it(make_bag, request):
    stated = []
    for number in range(2):
        if number:
            request.getfixturevalue('library_metadata')
        folder = make_bag(name=f'{number}')
        text = (folder / 'metadata.yaml').read_text()
        stated.append((yaml.safe_load(text.replace(f'{number}.mcap', 'x')), messages(folder)))
    assert stated[0] == stated[1]
