# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Files that were made to cost time or memory: each ends soon, in an error of one line or notes."""

import resource
import struct
import time
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import pytest

from wheel_terra_estimator.bags.reader import MeasurementReader
from wheel_terra_estimator.bags.salvage import limits, mcap_records
from wheel_terra_estimator.bags.storage import open_bag
from wheel_terra_estimator.errors import UserError
from wheel_terra_lab.studies.fuzzing.mcap_maker import MAGIC, _pack, _record, _text

TIME = 1_700_000_000_000_000_000  # [ns]


def message(data: bytes = b'') -> bytes:
    return _record(5, struct.pack('<HIQQ', 1, 0, TIME, TIME) + data)


def described() -> bytes:
    kind = struct.pack('<H', 1) + _text('sensor_msgs/msg/Imu') + _text('ros2msg') + _text('')
    topic = struct.pack('<HH', 1, 1) + _text('/imu/data') + _text('cdr') + struct.pack('<I', 0)
    return _record(3, kind) + _record(4, topic)


def chunk(content: bytes, size: int | None = None) -> bytes:
    """A packed chunk that states a size."""
    packed = _pack(content, 'zstd')
    head = struct.pack('<QQQI', TIME, TIME + 10, len(content) if size is None else size, 0)
    return _record(6, head + _text('zstd') + struct.pack('<Q', len(packed)) + packed)


def mcap(body: bytes, size: int) -> bytes:
    content = MAGIC + described()
    return content + body * max((size - len(content)) // len(body), 1)


def zeros(size: int) -> bytes:
    """Bombs of 16 MB in 1.5 kB each."""
    return mcap(chunk(bytes(2**24)), size)


def lying_zeros(size: int) -> bytes:
    return mcap(chunk(bytes(2**24), 1000), size)


def packed_messages(size: int) -> bytes:
    data = message() * (2**24 // len(message()))
    return mcap(chunk(data), size)


def packed_gaps(size: int) -> bytes:
    data = (message(b'12') + b'\x05') * (2**23 // 34)
    return mcap(chunk(data), size)


def nested_chunks(size: int) -> bytes:
    """Each reaches to the end of the file."""
    parts, left = [], size
    while left > 100:
        content = left - 9
        head = struct.pack('<QQQI', TIME, TIME, 2**24, 0) + _text('zstd')
        parts.append(struct.pack('<BQ', 6, content) + head + struct.pack('<Q', content - 44))
        left -= len(parts[-1])
    return MAGIC + described() + b''.join(parts)


def nested_plain_chunks(size: int) -> bytes:
    return nested_chunks(size).replace(b'\x04\0\0\0zstd', b'\0\0\0\0' + b'zstd')


def nested_messages(size: int) -> bytes:
    parts, left = [], size
    while left > 100:
        parts.append(struct.pack('<BQHIQQ', 5, left - 9, 1, 0, TIME, TIME))
        left -= len(parts[-1])
    return MAGIC + described() + b''.join(parts)


def opcodes(size: int) -> bytes:
    """Each place looks like a record that does not fit."""
    return mcap(struct.pack('<BQ', 5, 200), size)


def short_messages(size: int) -> bytes:
    return mcap(message(), size)


def metadata(size: int) -> bytes:
    return mcap(_record(12, _text('a') + _text('b' * 1000)), size)


def many_topics(size: int) -> bytes:
    parts = [MAGIC]
    for n in range(size // 60):
        topic = struct.pack('<HH', n % 65536, n % 7) + _text(f'/t{n}') + _text('cdr')
        parts.append(_record(4, topic + struct.pack('<I', 0)))
    return b''.join(parts)


MCAPS = (zeros, lying_zeros, packed_messages, packed_gaps,
         nested_chunks, nested_plain_chunks, nested_messages, opcodes, short_messages, metadata,
         many_topics)  # fmt: skip


def walk() -> float:
    """Return the processor time of a plain walk over a chunk of messages, here and now [s]."""
    began = time.process_time()
    sum(1 for _ in struct.iter_unpack('<BQHIQQ', bytes(CHUNK // 31 * 31)))
    return time.process_time() - began


def read(path: Path, sender: Any) -> None:
    """Read a file; tell its cost in plain walks over a chunk, the memory [MB] and the words."""
    first = walk()
    before, began = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.process_time()
    try:
        with open_bag(path) as bag:
            count = sum(1 for _ in bag.messages(tuple(bag.topics)))
            words = '; '.join([f'{count} messages', *bag.notes])
    except UserError as error:
        words = str(error)
    used = time.process_time() - began
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    sender.send((used / (0.5 * (first + walk())), peak / 1024, words))


CHUNK = 2**24  # bytes
WALKS, ONCE = 5.0, 4
"""Plain walks that a chunk may cost; chunks that a file may cost whatever it unpacks to."""
PART = limits.HELD // 32
"""For small files: a bomb costs what is allowed, whatever its size."""
LARGE = [pytest.mark.slow, pytest.mark.timeout(900)]
# Quick elsewhere: zeros in test_input_file.py; short messages and other records cost what packed
# and wrong ones do.
ELSEWHERE = (zeros, lying_zeros, short_messages, metadata)
CASES = [
    pytest.param(make, size, id=f'{make.__name__}-{size}', marks=LARGE if size > 10**5 else ())
    for make in MCAPS
    for size in (10**5, 20 * 2**20)
    if size > 10**5 or make not in ELSEWHERE
]


@pytest.mark.parametrize(('make', 'size'), CASES)
def test_no_file_costs_much(tmp_path, monkeypatch, make, size):
    path = tmp_path / 'a.mcap'
    path.write_bytes(make(size))
    if size <= 10**5:
        monkeypatch.setattr(limits, 'HELD', PART)
    receiver, sender = get_context('fork').Pipe(False)
    process = get_context('fork').Process(target=read, args=(path, sender))
    process.start()
    used, memory, words = receiver.recv()
    process.join()
    assert '\n' not in words
    assert used < WALKS * (limits.work(size) / CHUNK + ONCE)
    assert memory < 1000.0


def test_sizes_in_words() -> None:
    sizes = (300, 5000, 2**28, 3 * 2**29)
    assert [limits.in_words(size) for size in sizes] == ['300 B', '4.88 kB', '256 MB', '1.5 GB']


def test_a_message_that_is_heard_has_a_limit_of_its_own(make_bag, rover, monkeypatch) -> None:
    monkeypatch.setattr(limits, 'MESSAGE', 200)
    with open_bag(make_bag()) as bag:
        reader = MeasurementReader(bag, {}, rover)
        assert list(reader.measurements())
    assert reader.rejected['imu/data', 'above 200 B']


OF_A_CHUNK = (mcap_records.SCHEMA, mcap_records.CHANNEL, mcap_records.MESSAGE)


def test_empty_records_in_a_chunk_are_not_held() -> None:
    empty = (bytes([mcap_records.SCHEMA]) + bytes(8)) * 1000
    found = list(mcap_records.records(empty, 0, len(empty), mcap_records.Possible(OF_A_CHUNK)))
    assert found == [mcap_records.Gap(0, len(empty))]
