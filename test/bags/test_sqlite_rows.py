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
from test_damage import START, samples
from test_damage import TYPES as SMALL

from wheel_terra_estimator.errors import UserError
from wheel_terra_lab.studies.fuzzing import sqlite_maker
from wheel_terra_lab.studies.fuzzing.mcap_maker import Sample

TYPES = {'/joint_states': 'sensor_msgs/msg/JointState', '/camera': 'sensor_msgs/msg/Image'}
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


def zeroed(path: Path, begin: int, count: int) -> None:
    content = bytearray(path.read_bytes())
    content[begin : begin + count] = bytes(count)
    path.write_bytes(content)


def big(tmp_path: Path, count: int = 4000) -> tuple[Path, list[Sample]]:
    """Write small messages alone, on pages of many rows."""
    path, found = tmp_path / 'a.db3', samples(count)
    sqlite_maker.write(path, found, SMALL)
    return path, found


def executed(path: Path, *statements: str) -> None:
    with sqlite3.connect(path) as connection:
        for statement in statements:
            connection.execute(statement)
    connection.close()


def test_a_damaged_row_number_hides_no_row_behind(tmp_path):
    """The rows of a page have great numbers and no data, the last of them cannot be read."""
    path, whole = big(tmp_path, 1200)
    content = bytearray(path.read_bytes())
    begin = content.index(whole[600].data) // PAGE * PAGE
    count = int.from_bytes(content[begin + 3 : begin + 5], 'big')
    places = [int.from_bytes(content[begin + 8 + 2 * i :][:2], 'big') for i in range(count)]
    pages = [content.index(message.data) // PAGE * PAGE for message in whole]
    for place in places:  # length 2, number 12343, a head of 2 bytes, nothing
        content[begin + place : begin + place + 5] = b'\x02\xe0\x37\x02\x00'
    content[begin + places[-1] : begin + places[-1] + 9] = b'\xff' * 9
    path.write_bytes(content)
    found, notes = contents(path)
    left = (message for message, page in zip(whole, pages, strict=True) if page != begin)
    assert Counter(found) == Counter(left)
    assert 'is damaged' in notes[0]


def test_pages_that_sqlite_does_not_miss_are_said(tmp_path):
    """The page that lists the pages of the table states too few of them, which is no error."""
    path, whole = big(tmp_path)
    content = bytearray(path.read_bytes())
    interior = next(at for at in range(PAGE, len(content), PAGE) if content[at] == 5)
    count = int.from_bytes(content[interior + 3 : interior + 5], 'big')
    assert count > 20
    content[interior + 3 : interior + 5] = (count - 9).to_bytes(2, 'big')
    path.write_bytes(content)
    found, notes = contents(path)
    assert not Counter(found) - Counter(whole)
    assert f'is damaged: {len(found)} whole messages recovered' in notes[0]
    assert 'of the recording' in notes[0]


def test_missing_numbers_are_told_by_the_times_beside_them(tmp_path):
    """A message a second; those of 10 and 11 s, the first and the last but one are not there."""
    path = tmp_path / 'a.db3'
    seconds = [Sample(START + 10**9 * i, s.topic, s.data) for i, s in enumerate(samples(30))]
    sqlite_maker.write(path, seconds, SMALL)
    executed(path, 'DELETE FROM messages WHERE id IN (1, 11, 12, 29)', 'CREATE TABLE other(a)')
    zeroed(path, path.stat().st_size - PAGE, PAGE)  # of the other table: something is damaged
    found, notes = contents(path)
    assert len(found) == 26
    assert 'lost before the first of these, from 8.0 s to 11.0 s, from 26.0 s on' in notes[0]


def test_an_index_that_lies_hides_no_row_and_rows_out_of_order_are_sorted(tmp_path):
    path, whole = big(tmp_path, 50)
    gone = "DELETE FROM sqlite_master WHERE name='timestamp_idx'"
    executed(path, 'PRAGMA writable_schema=ON', gone, 'PRAGMA writable_schema=OFF')
    assert contents(path)[0] == whole
    path, whole = big(tmp_path, 50)
    executed(path, f'UPDATE messages SET timestamp = {START - 5} WHERE id = 30')
    found, _ = contents(path)
    assert found[0].log_time == START - 5
    assert [m.log_time for m in found] == sorted(m.log_time for m in found)
    assert len(found) == len(whole)


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
        sample
        for sample, pieces in zip(samples, places, strict=True)
        if all((end + PAGE - 1) // PAGE * PAGE <= kept for _, end in pieces)
    ]
    found, notes = contents(path)
    assert not Counter(whole) - Counter(found)
    assert not Counter(found) - Counter(samples)
    assert f'is cut off: {len(found)} whole messages recovered' in notes[0]


def test_numbers_far_apart_behind_damage_cost_no_time(tmp_path):
    path = tmp_path / 'a.db3'
    samples = made(path)
    executed(path, 'UPDATE messages SET id = id + 4000000000000 WHERE id > 300')
    zeroed(path, path.read_bytes().index(samples[250].data) // PAGE * PAGE, PAGE)
    assert len(contents(path)[0]) > 500


def test_a_large_message_whose_page_is_another_s_is_left_out(tmp_path):
    path = tmp_path / 'a.db3'
    samples = made(path)
    content = bytearray(path.read_bytes())
    places = sqlite_maker.message_places(bytes(content), samples, TYPES)
    pointer = places[105][0][1] - 4
    content[pointer : pointer + 4] = (places[205][1][0] // PAGE + 1).to_bytes(4, 'big')
    path.write_bytes(content)
    found, _ = contents(path)
    assert not Counter(found) - Counter(samples)
    assert samples[105] not in found


@pytest.mark.parametrize('damaged', [False, True])
def test_the_write_ahead_log_of_a_recorder_that_died_is_read(tmp_path, damaged):
    samples = made(tmp_path / 'live.db3')
    live = sqlite3.connect(tmp_path / 'live.db3')
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
    path, lost = tmp_path / 'a.db3', 0
    if damaged:
        content = path.read_bytes()
        page = content.index(samples[100].data) // PAGE * PAGE
        places = sqlite_maker.message_places(content, samples, TYPES)
        lost = sum(any(page <= begin < page + PAGE for begin, _ in pieces) for pieces in places)
        zeroed(path, page, PAGE)
    before = {file: file.read_bytes() for file in tmp_path.glob('a.db3*')}
    assert len(contents(path)[0]) == 900 - lost
    assert {file: file.read_bytes() for file in tmp_path.glob('a.db3*')} == before


def test_what_is_left_of_other_files_is_no_recording(tmp_path):
    path = tmp_path / 'a.db3'
    executed(path, 'CREATE TABLE notes(id INTEGER PRIMARY KEY, text)')
    with pytest.raises(UserError, match='finds no recording in it'):
        contents(path)
