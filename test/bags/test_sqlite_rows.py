# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Rows of damaged SQLite files: all that are intact, none that was deleted, none twice."""

import random
import shutil
import sqlite3
from collections import Counter
from pathlib import Path

import pytest

from wheel_terra_estimator.bags.storage import open_bag
from wheel_terra_estimator.errors import UserError
from wheel_terra_lab.studies.fuzzing import sqlite_maker
from wheel_terra_lab.studies.fuzzing.mcap_maker import Sample

TYPES = {'/joint_states': 'sensor_msgs/msg/JointState', '/camera': 'sensor_msgs/msg/Image'}
START = 1_700_000_000_000_000_000
PAGE = sqlite_maker.PAGE


def made(path: Path, count: int = 600) -> list[Sample]:
    """Write messages of 100 bytes, and every tenth of 5 to 20 kB on several pages."""
    dice = random.Random(3)
    samples = [
        Sample(START + 10_000_000 * i, '/camera', dice.randbytes(dice.randrange(5_000, 20_000)))
        if i % 10 == 5
        else Sample(START + 10_000_000 * i, '/joint_states', dice.randbytes(100))
        for i in range(count)
    ]
    sqlite_maker.write(path, samples, TYPES)
    return samples


def read(path: Path) -> tuple[Counter[tuple[int, str, bytes]], list[str]]:
    with open_bag(path) as bag:
        return Counter(map(tuple, bag.messages(tuple(bag.topics)))), bag.notes


def root_of(path: Path, name: str) -> int:
    """Return where the root page of a table begins."""
    connection = sqlite3.connect(path)
    (page,) = connection.execute('SELECT rootpage FROM sqlite_master WHERE name=?', (name,))
    connection.close()
    return (page[0] - 1) * PAGE


def zeroed(path: Path, begin: int, count: int) -> None:
    content = bytearray(path.read_bytes())
    content[begin : begin + count] = bytes(count)
    path.write_bytes(content)


def test_nothing_is_lost_with_the_page_that_lists_all_others(tmp_path):
    path = tmp_path / 'a.db3'
    samples = made(path)
    zeroed(path, root_of(path, 'messages'), PAGE)
    found, notes = read(path)
    assert found == Counter(map(tuple, samples))
    assert 'a.db3 is damaged: 600 whole messages recovered' in notes[0]


def test_nothing_is_lost_with_the_header_of_the_file(tmp_path):
    path = tmp_path / 'a.db3'
    samples = made(path)
    zeroed(path, 0, PAGE)
    found, notes = read(path)
    assert found == Counter(map(tuple, samples))
    assert 'deleted rows may be among them' in notes[0]


@pytest.mark.parametrize('size', [512, 1024, 65536])
def test_the_size_of_pages_is_learnt_where_the_header_is_lost(tmp_path, size, monkeypatch):
    monkeypatch.setattr(sqlite_maker, 'PAGE', size)
    path = tmp_path / 'a.db3'
    samples = made(path)
    zeroed(path, 0, 64)
    assert read(path)[0] == Counter(map(tuple, samples))


def deleted(path: Path, condition: str) -> None:
    with sqlite3.connect(path) as connection:
        connection.execute('PRAGMA secure_delete=OFF')
        connection.execute(f'DELETE FROM messages WHERE {condition}')
    connection.close()


@pytest.mark.parametrize('condition', ['id > 200 AND id <= 400', 'id % 2 = 0', 'topic_id = 2'])
def test_deleted_rows_do_not_come_back(tmp_path, condition):
    """Their bytes stand on free pages and in the gaps of used ones."""
    path = tmp_path / 'a.db3'
    samples = made(path)
    deleted(path, condition)
    kept, _ = read(path)
    assert 0 < kept.total() < len(samples)
    content = path.read_bytes()
    assert sum(sample.data[:60] in content for sample in samples) > kept.total()
    zeroed(path, root_of(path, 'messages'), PAGE)
    assert read(path)[0] == kept


def test_without_the_list_of_free_pages_it_is_said_that_deleted_rows_may_come_back(
    tmp_path,
):
    path = tmp_path / 'a.db3'
    made(path)
    deleted(path, 'id > 200 AND id <= 400')
    content = path.read_bytes()
    trunk = int.from_bytes(content[32:36], 'big')
    zeroed(path, (trunk - 1) * PAGE, 8)
    assert 'deleted rows may be among them' in read(path)[1][0]


def test_no_row_comes_twice(tmp_path):
    """A page that stands in the file a second time, as a file system may leave it."""
    path = tmp_path / 'a.db3'
    samples = made(path)
    content = bytearray(path.read_bytes())
    page = content.index(samples[300].data) // PAGE * PAGE
    root = root_of(path, 'messages')
    content[root : root + PAGE] = content[page : page + PAGE]
    path.write_bytes(content)
    assert read(path)[0] == Counter(map(tuple, samples))


def test_a_large_message_whose_page_is_another_s_is_left_out(tmp_path):
    path = tmp_path / 'a.db3'
    samples = made(path)
    content = bytearray(path.read_bytes())
    places = sqlite_maker.message_places(bytes(content), samples, TYPES)
    pointer = places[105][0][1] - 4
    content[pointer : pointer + 4] = (places[205][1][0] // PAGE + 1).to_bytes(4, 'big')
    path.write_bytes(content)
    found, _ = read(path)
    assert not found - Counter(map(tuple, samples))
    assert tuple(samples[105]) not in found


def test_rows_in_the_write_ahead_log_of_a_damaged_file(tmp_path):
    path = tmp_path / 'live.db3'
    samples = made(path)
    live = sqlite3.connect(path)
    live.execute('PRAGMA journal_mode=WAL')
    live.execute('PRAGMA wal_autocheckpoint=0')
    live.executemany(
        'INSERT INTO messages(topic_id, timestamp, data) VALUES(1, ?, ?)',
        [(START + 10**12 + i, b'newest' + bytes(100)) for i in range(300)],
    )
    live.commit()
    for file in tmp_path.glob('live.db3*'):
        if not file.name.endswith('-shm'):
            shutil.copy(file, tmp_path / file.name.replace('live', 'a'))
    live.close()
    broken = tmp_path / 'a.db3'
    content = broken.read_bytes()
    page = content.index(samples[100].data) // PAGE * PAGE
    places = sqlite_maker.message_places(content, samples, TYPES)
    lost = sum(any(page <= begin < page + PAGE for begin, _ in pieces) for pieces in places)
    zeroed(broken, page, PAGE)
    before = {file: file.read_bytes() for file in tmp_path.glob('a.db3*')}
    found, _ = read(broken)
    assert found.total() == 900 - lost
    assert {file: file.read_bytes() for file in tmp_path.glob('a.db3*')} == before


def test_what_is_left_of_other_files_is_no_recording(tmp_path):
    path = tmp_path / 'a.db3'
    with sqlite3.connect(path) as connection:
        connection.execute('CREATE TABLE notes(id INTEGER PRIMARY KEY, text)')
    connection.close()
    with pytest.raises(UserError, match='nothing of a recording is left'):
        read(path)
