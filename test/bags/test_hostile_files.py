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

from wheel_terra_estimator.bags.salvage import limits, mcap_records
from wheel_terra_estimator.bags.storage import open_bag
from wheel_terra_estimator.errors import UserError

MAGIC = b'\x89MCAP0\r\n'
TIME = 1_700_000_000_000_000_000  # [ns]


def zstd() -> Any:
    try:
        from compression import zstd
    except ImportError:
        from backports import zstd
    return zstd


def record(opcode: int, content: bytes) -> bytes:
    return struct.pack('<BQ', opcode, len(content)) + content


def message(data: bytes = b'') -> bytes:
    return record(5, struct.pack('<HIQQ', 1, 0, TIME, TIME) + data)


def text(words: str) -> bytes:
    return struct.pack('<I', len(words)) + words.encode()


def described() -> bytes:
    kind = struct.pack('<H', 1) + text('sensor_msgs/msg/Imu') + text('ros2msg') + text('')
    topic = struct.pack('<HH', 1, 1) + text('/imu/data') + text('cdr') + struct.pack('<I', 0)
    return record(3, kind) + record(4, topic)


def chunk(packed: bytes, size: int, codec: str = 'zstd', checksum: int = 0) -> bytes:
    head = struct.pack('<QQQI', TIME, TIME + 10, size, checksum) + text(codec)
    return record(6, head + struct.pack('<Q', len(packed)) + packed)


def mcap(body: bytes, size: int) -> bytes:
    content = MAGIC + described()
    return content + body * max((size - len(content)) // len(body), 1)


def zeros(size: int) -> bytes:
    """Bombs of 16 MB in 1.5 kB each."""
    return mcap(chunk(zstd().compress(bytes(2**24)), 2**24), size)


def lying_zeros(size: int) -> bytes:
    return mcap(chunk(zstd().compress(bytes(2**24)), 1000), size)


def packed_messages(size: int) -> bytes:
    data = message() * (2**24 // len(message()))
    return mcap(chunk(zstd().compress(data), len(data)), size)


def packed_gaps(size: int) -> bytes:
    data = (message(b'12') + b'\x05') * (2**23 // 34)
    return mcap(chunk(zstd().compress(data), len(data)), size)


def headless(size: int) -> bytes:
    return mcap(b'\x28\xb5\x2f\xfd', size)


def headless_bombs(size: int) -> bytes:
    return mcap(zstd().compress(bytes(2**24)), size)


def nested_chunks(size: int) -> bytes:
    """Each reaches to the end of the file."""
    parts, left = [], size
    while left > 100:
        content = left - 9
        head = struct.pack('<QQQI', TIME, TIME, 2**24, 0) + text('zstd')
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
    return mcap(record(12, text('a') + text('b' * 1000)), size)


def many_topics(size: int) -> bytes:
    parts = [MAGIC]
    for n in range(size // 60):
        topic = struct.pack('<HH', n % 65536, n % 7) + text(f'/t{n}') + text('cdr')
        parts.append(record(4, topic + struct.pack('<I', 0)))
    return b''.join(parts)


MCAPS = (zeros, lying_zeros, packed_messages, packed_gaps, headless, headless_bombs,
         nested_chunks, nested_plain_chunks, nested_messages, opcodes, short_messages, metadata,
         many_topics)  # fmt: skip


def read(path: Path, sender: Any) -> None:
    """Read a file, and tell the processor time [s], the memory [MB] that it took and the words."""
    before, began = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.process_time()
    try:
        with open_bag(path) as bag:
            count = sum(1 for _ in bag.messages(tuple(bag.topics)))
            words = '; '.join([f'{count} messages', *bag.notes])
    except UserError as error:
        words = str(error)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    sender.send((time.process_time() - began, peak / 1024, words))


EIGHTH = limits.HELD // 8
"""For small files: a bomb costs what is allowed, whatever its size."""
LARGE = [pytest.mark.slow, pytest.mark.timeout(900)]
ELSEWHERE = (zeros, lying_zeros)  # quick in test_input_file.py: a file costs the limit at any size
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
    held, longest = (EIGHTH, 4.0) if size <= 10**5 else (limits.HELD, 10.0)
    monkeypatch.setattr(limits, 'HELD', held)
    receiver, sender = get_context('fork').Pipe(False)
    process = get_context('fork').Process(target=read, args=(path, sender))
    process.start()
    used, memory, words = receiver.recv()
    process.join()
    assert '\n' not in words
    assert used < longest
    assert memory < 1000.0


def test_a_chunk_without_a_checksum_is_read_straight_on() -> None:
    """What stands record behind record is not doubted: dense chunks cost a third."""
    data = message(b'12') * 50
    possible = mcap_records.Possible(
        (mcap_records.SCHEMA, mcap_records.CHANNEL, mcap_records.MESSAGE)
    )
    straight = list(mcap_records.straight_records(data, possible))
    assert (
        straight == list(mcap_records.records(data, 0, len(data), possible)) and len(straight) == 50
    )
    other = mcap_records.Possible(possible.opcodes, start=straight[0].log_time + 1)
    assert list(mcap_records.straight_records(data, other)) == [mcap_records.Gap(0, len(data))]
