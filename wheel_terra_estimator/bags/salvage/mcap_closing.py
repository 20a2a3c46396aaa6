# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What the writing library leaves out of an MCAP file: checksums, and an end on a full disk."""

from __future__ import annotations

import errno
import mmap
import os
import struct
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple
from zlib import crc32

from wheel_terra_estimator.bags.salvage import mcap_records as mcap
from wheel_terra_estimator.bags.salvage.compression import unpack

ROOM = 2**16
"""Left free for the summary and the metadata [byte]; an entry of the index takes `PER_CHUNK`."""
PER_CHUNK = 512


class Kept(NamedTuple):
    """What the file holds in the end: messages by channel, first and last log time [ns]."""

    counts: Counter[int]
    start: int
    end: int


@dataclass
class _Chunk:
    begin: int
    end: int  # of the chunk record
    head: mcap.ChunkHead
    behind: int = 0  # end of its message indexes
    indexes: list[tuple[int, int, int]] = field(default_factory=list)  # channel, place, messages


def add_checksums(path: Path) -> None:
    """Give the chunks and the summary of a whole file their checksums, in place."""
    with path.open('r+b') as file:
        place = file.fileno()
        with mmap.mmap(place, 0, access=mmap.ACCESS_READ) as content:
            end = len(content) - len(mcap.MAGIC)
            for item in mcap.records(content, len(mcap.MAGIC), end, mcap.Possible()):
                if isinstance(item, mcap.Gap):
                    continue
                if item.opcode == mcap.CHUNK:
                    head = mcap.chunk_head(content, item.begin - mcap.HEAD, end)
                    assert head is not None
                    data = unpack(head.codec, content[head.begin : item.end], head.size).content
                    os.pwrite(place, crc32(data).to_bytes(4, 'little'), item.begin + 24)
                elif item.opcode == mcap.FOOTER:
                    begin = int.from_bytes(content[item.begin : item.begin + 8], 'little')
                    checksum = crc32(content[begin : item.begin + 16])
                    os.pwrite(place, checksum.to_bytes(4, 'little'), item.begin + 16)


def close_cut_file(path: Path) -> Kept:
    """Cut a file that could not be written to its end, and close it as the format asks.

    Raises OSError where there is no whole chunk to be kept, or not even the summary can be written.
    """
    with path.open('r+b') as file:
        size = os.fstat(file.fileno()).st_size
        chunks, definitions = _whole_chunks(file.fileno(), size)
        room = ROOM + PER_CHUNK * len(chunks)
        chunks = [chunk for chunk in chunks if chunk.behind <= size - room]
        if not chunks:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        kept = Kept(
            counts=_counts(chunks),
            start=min(chunk.head.start for chunk in chunks),
            end=max(chunk.head.end for chunk in chunks),
        )
        file.truncate(chunks[-1].behind)
        file.seek(0, os.SEEK_END)
        file.write(_end(chunks, definitions, kept, file.tell()))
        file.flush()
        os.fsync(file.fileno())
    return kept


def _whole_chunks(descriptor: int, size: int) -> tuple[list[_Chunk], dict[tuple[int, int], bytes]]:
    """Return the whole chunks with their indexes, and the schemas and channels in them."""
    chunks: list[_Chunk] = []
    definitions: dict[tuple[int, int], bytes] = {}
    if not size:
        return chunks, definitions
    with mmap.mmap(descriptor, size, access=mmap.ACCESS_READ) as content:
        for item in mcap.records(content, len(mcap.MAGIC), size, mcap.Possible()):
            if isinstance(item, mcap.Gap):
                break
            if item.opcode == mcap.CHUNK:
                head = mcap.chunk_head(content, item.begin - mcap.HEAD, size)
                if head is None or head.begin + head.packed != item.end:
                    break
                chunks.append(_Chunk(item.begin - mcap.HEAD, item.end, head, item.end))
                data = unpack(head.codec, content[head.begin : item.end], head.size).content
                _define(data, definitions)
            elif item.opcode == mcap.MESSAGE_INDEX:
                channel = int.from_bytes(content[item.begin : item.begin + 2], 'little')
                entry = (channel, item.begin - mcap.HEAD, (item.end - item.begin - 6) // 16)
                chunks[-1].indexes.append(entry)
                chunks[-1].behind = item.end
    return chunks, definitions


def _define(data: bytes, definitions: dict[tuple[int, int], bytes]) -> None:
    possible = mcap.Possible((mcap.SCHEMA, mcap.CHANNEL, mcap.MESSAGE))
    for item in mcap.records(data, 0, len(data), possible):
        if isinstance(item, mcap.Record) and item.opcode != mcap.MESSAGE:
            number = int.from_bytes(data[item.begin : item.begin + 2], 'little')
            definitions[item.opcode, number] = data[item.begin - mcap.HEAD : item.end]


def _counts(chunks: list[_Chunk]) -> Counter[int]:
    counts: Counter[int] = Counter()
    for chunk in chunks:
        for channel, _, messages in chunk.indexes:
            counts[channel] += messages
    return counts


def _end(
    chunks: list[_Chunk], definitions: dict[tuple[int, int], bytes], kept: Kept, place: int
) -> bytes:
    """Return the end of data, the summary, the footer and the closing magic."""
    data_end = _record(mcap.DATA_END, bytes(4))
    summary = b''.join(definitions[key] for key in sorted(definitions))
    for chunk in chunks:
        summary += _record(mcap.CHUNK_INDEX, _index(chunk))
    by_channel = b''.join(struct.pack('<HQ', *item) for item in sorted(kept.counts.items()))
    summary += _record(
        mcap.STATISTICS,
        struct.pack(
            '<QHIIIIQQI',
            sum(kept.counts.values()),
            sum(opcode == mcap.SCHEMA for opcode, _ in definitions),
            sum(opcode == mcap.CHANNEL for opcode, _ in definitions),
            0,
            0,
            len(chunks),
            kept.start,
            kept.end,
            len(by_channel),
        )
        + by_channel,
    )
    foot = struct.pack('<BQQQ', mcap.FOOTER, 20, place + len(data_end), 0)
    return data_end + summary + foot + struct.pack('<I', crc32(summary + foot)) + mcap.MAGIC


def _index(chunk: _Chunk) -> bytes:
    head = chunk.head
    offsets = b''.join(struct.pack('<HQ', channel, place) for channel, place, _ in chunk.indexes)
    codec = head.codec.encode()
    return (
        struct.pack(
            '<QQQQI', head.start, head.end, chunk.begin, chunk.end - chunk.begin, len(offsets)
        )
        + offsets
        + struct.pack('<QI', chunk.behind - chunk.end, len(codec))
        + codec
        + struct.pack('<QQ', head.packed, head.size)
    )


def _record(opcode: int, content: bytes) -> bytes:
    return struct.pack('<BQ', opcode, len(content)) + content
