# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Rows of damaged SQLite files: those that SQLite still finds, before and behind the damage."""

import random
import shutil
import sqlite3
from collections import Counter
from pathlib import Path

import pytest
from recordings import contents

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
    found, notes = contents(path)
    return Counter(map(tuple, found)), notes


def zeroed(path: Path, begin: int, count: int) -> None:
    content = bytearray(path.read_bytes())
    content[begin : begin + count] = bytes(count)
    path.write_bytes(content)


@pytest.mark.parametrize('share', [0.4, 0.9])
def test_all_rows_before_the_cut_are_read(tmp_path, share):
    """The pages of the table stand in the order of its rows."""
    path = tmp_path / 'a.db3'
    samples = made(path)
    content = path.read_bytes()
    kept = int(share * len(content))
    path.write_bytes(content[:kept])
    places = sqlite_maker.message_places(content, samples, TYPES)
    whole = [
        tuple(sample)
        for sample, pieces in zip(samples, places, strict=True)
        if all((end + PAGE - 1) // PAGE * PAGE <= kept for _, end in pieces)
    ]
    found, notes = read(path)
    assert not Counter(whole) - found
    assert not found - Counter(map(tuple, samples))
    assert f'is cut off: {found.total()} whole messages recovered' in notes[0]


def test_numbers_far_apart_behind_damage_cost_no_time(tmp_path):
    path = tmp_path / 'a.db3'
    samples = made(path)
    with sqlite3.connect(path) as connection:
        connection.execute('UPDATE messages SET id = id + 4000000000000 WHERE id > 300')
    connection.close()
    content = path.read_bytes()
    zeroed(path, content.index(samples[250].data) // PAGE * PAGE, PAGE)
    assert read(path)[0].total() > 500


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
    with pytest.raises(UserError, match='finds no recording in it'):
        read(path)
