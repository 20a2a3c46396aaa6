# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""SQLite recordings as rosbag2 writes them, with the place of every byte of every message.

The places are found by encoding each row anew and looking for its bytes in the file; nothing is
shared with the reader of the package (format: https://www.sqlite.org/fileformat2.html).
"""

from __future__ import annotations

import sqlite3
from collections.abc import Sequence
from pathlib import Path

from wheel_terra_lab.studies.fuzzing.mcap_maker import Sample

SCHEMA = """
CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL);
CREATE TABLE metadata(
  id INTEGER PRIMARY KEY, metadata_version INTEGER NOT NULL, metadata TEXT NOT NULL);
CREATE TABLE topics(
  id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,
  serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL,
  type_description_hash TEXT NOT NULL);
CREATE TABLE message_definitions(
  id INTEGER PRIMARY KEY, topic_type TEXT NOT NULL, encoding TEXT NOT NULL,
  encoded_message_definition TEXT NOT NULL, type_description_hash TEXT NOT NULL);
CREATE TABLE messages(
  id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL,
  data BLOB NOT NULL);
CREATE INDEX timestamp_idx ON messages (timestamp ASC);
INSERT INTO schema(schema_version, ros_distro) VALUES (4, 'jazzy');
"""

PAGE = 4096
"""Page of the file [byte]."""


def write(path: Path, samples: Sequence[Sample], types: dict[str, str]) -> None:
    """Write messages as rosbag2 does, on pages of `PAGE` bytes."""
    path.unlink(missing_ok=True)
    connection = sqlite3.connect(path)
    connection.executescript(
        f'PRAGMA page_size={PAGE}; PRAGMA journal_mode=OFF; PRAGMA synchronous=OFF;' + SCHEMA
    )
    connection.executemany(
        'INSERT INTO topics VALUES(?,?,?,?,?,?)',
        [
            (i, topic, kind, 'cdr', '', 'RIHS01_0')
            for i, (topic, kind) in enumerate(types.items(), 1)
        ],
    )
    topics = list(types)
    connection.executemany(
        'INSERT INTO messages(topic_id, timestamp, data) VALUES(?,?,?)',
        [(topics.index(s.topic) + 1, s.log_time, s.data) for s in samples],
    )
    connection.commit()
    connection.close()


def message_places(
    content: bytes, samples: Sequence[Sample], types: dict[str, str]
) -> list[list[tuple[int, int]]]:
    """Return for each message (begin, end) of all bytes that its row consists of."""
    topics = list(types)
    found = []
    begin = 0
    for number, sample in enumerate(samples, 1):
        record = _record(topics.index(sample.topic) + 1, sample)
        here = _local(len(record))
        cell = _varint(len(record)) + _varint(number) + record[:here]
        at = content.find(cell, begin)
        if at < 0:
            at = content.index(cell)
        else:
            begin = at // PAGE * PAGE  # rows that follow stand on this page or behind it
        places = [(at, at + len(cell) + 4 * (here < len(record)))]
        page = int.from_bytes(content[at + len(cell) :][:4], 'big')
        while here < len(record):
            piece = record[here : here + PAGE - 4]
            place = (page - 1) * PAGE
            assert content[place + 4 : place + 4 + len(piece)] == piece
            places.append((place, place + 4 + len(piece)))
            page = int.from_bytes(content[place : place + 4], 'big')
            here += len(piece)
        found.append(places)
    return found


def _record(topic: int, sample: Sample) -> bytes:
    kinds = b'\x00' + (b'\x09' if topic == 1 else b'\x01') + b'\x06'
    kinds += _varint(2 * len(sample.data) + 12)
    head = bytes([len(kinds) + 1]) + kinds
    number = b'' if topic == 1 else bytes([topic])
    return head + number + sample.log_time.to_bytes(8, 'big') + sample.data


def _local(size: int) -> int:
    """Return how many bytes of a record stand on the page of its row."""
    most, least = PAGE - 35, (PAGE - 12) * 32 // 255 - 23
    if size <= most:
        return size
    kept = least + (size - least) % (PAGE - 4)
    return kept if kept <= most else least


def _varint(value: int) -> bytes:
    out = [value & 127]
    while value := value >> 7:
        out.append(value & 127 | 128)
    return bytes(reversed(out))
