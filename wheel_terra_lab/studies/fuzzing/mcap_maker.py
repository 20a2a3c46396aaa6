# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""MCAP files of every layout that recorders write, with the place of every message in them.

It shares nothing with the reader of the package, so that it can tell what the reader should find.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple
from zlib import crc32

MAGIC = b'\x89MCAP0\r\n'


class Sample(NamedTuple):
    """A message to be recorded."""

    log_time: int
    topic: str
    data: bytes


@dataclass(frozen=True)
class Layout:
    """How a file is laid out."""

    chunk_size: int = 4000  # unpacked [byte]; 0: messages outside of chunks
    codec: str = ''  # '', zstd, lz4
    checksums: bool = True  # of chunks and summary
    summary: bool = True  # schemas, channels, index and statistics at the end
    definitions: bool = True  # schemas and channels before the first message, too
    by_topic: bool = False  # one topic after the other
    closed: bool = True  # whether there is an end at all


@dataclass
class Made:
    """A file and what stands where in it."""

    content: bytes
    # Begin, end and messages of each chunk, or of each message outside of chunks
    parts: list[tuple[int, int, list[Sample]]] = field(default_factory=list)
    # For each copy of the schemas and channels the places on which it depends
    definitions: list[tuple[int, int]] = field(default_factory=list)
    # Begin, end and message, for each: its record, or the packed bytes in which it stands
    messages: list[tuple[int, int, Sample]] = field(default_factory=list)


def make(samples: Sequence[Sample], types: dict[str, str], layout: Layout) -> Made:
    """Write messages, in the order of their log times, as an MCAP file; `types` by topic."""
    made = Made(b'')
    topics = list(types)
    definitions = _definitions(types)
    out = bytearray(MAGIC + _record(1, _text('ros2') + _text('maker')))
    ordered = sorted(samples, key=lambda s: topics.index(s.topic)) if layout.by_topic else samples
    index: list[bytes] = []
    if layout.chunk_size:
        for number, group in enumerate(_groups(ordered, layout.chunk_size)):
            begin = len(out)
            first = definitions if number == 0 and layout.definitions else b''
            entry, more = _chunk(group, first, topics, layout, begin)
            out += entry
            made.parts.append((begin, len(out), group))
            if first and layout.codec:
                made.definitions.append((begin, len(out)))
            elif first:
                at = begin + 9 + 40
                made.definitions.append((at, at + len(first)))
            _note_places(made, bytes(out[begin:]), group, layout)
            out += more[0]
            index.append(_record(8, more[1]))
    else:
        if layout.definitions:
            begin = len(out)
            out += definitions
            made.definitions.append((begin, len(out)))
        for number, sample in enumerate(ordered):
            begin = len(out)
            out += _message(sample, topics, number)
            made.parts.append((begin, len(out), [sample]))
            made.messages.append((begin, len(out), sample))
    if layout.closed:
        _close(out, made, ordered, types, index, layout)
    made.content = bytes(out)
    return made


def _close(
    out: bytearray,
    made: Made,
    samples: Sequence[Sample],
    types: dict[str, str],
    index: list[bytes],
    layout: Layout,
) -> None:
    topics = list(types)
    out += _record(0x0F, bytes(4))
    begin = len(out)
    if layout.summary:
        out += _definitions(types)
        made.definitions.append((begin, len(out)))
        out += b''.join(index)
        counts = [sum(s.topic == topic for s in samples) for topic in topics]
        statistics = struct.pack(
            '<QHIIIIQQI',
            len(samples),
            len(set(types.values())),
            len(topics),
            0,
            0,
            len(index),
            min(s.log_time for s in samples),
            max(s.log_time for s in samples),
            10 * len(topics),
        ) + b''.join(struct.pack('<HQ', i + 1, n) for i, n in enumerate(counts))
        out += _record(0x0B, statistics)
    foot = struct.pack('<BQQQ', 2, 20, begin if layout.summary else 0, 0)
    checksum = crc32(bytes(out[begin:]) + foot) if layout.checksums and layout.summary else 0
    out += foot + struct.pack('<I', checksum) + MAGIC


def _note_places(made: Made, chunk: bytes, group: list[Sample], layout: Layout) -> None:
    begin, end, _ = made.parts[-1]
    at = end
    for sample in reversed(group):
        if layout.codec:
            made.messages.append((begin + 49 + len(layout.codec), end, sample))
        else:  # the records stand one behind the other, up to the end of the chunk
            at -= 31 + len(sample.data)
            made.messages.append((at, at + 31 + len(sample.data), sample))
            assert chunk[at - begin] == 5


def _groups(samples: Sequence[Sample], size: int) -> list[list[Sample]]:
    groups: list[list[Sample]] = [[]]
    held = 0
    for sample in samples:
        if held > size:
            groups.append([])
            held = 0
        groups[-1].append(sample)
        held += 31 + len(sample.data)
    return groups


def _chunk(
    group: list[Sample], first: bytes, topics: list[str], layout: Layout, place: int
) -> tuple[bytes, tuple[bytes, bytes]]:
    """Return the chunk, the message indexes behind it and its entry in the chunk index."""
    content = bytearray(first)
    offsets: dict[int, bytes] = {}
    for number, sample in enumerate(group):
        channel = topics.index(sample.topic) + 1
        entry = struct.pack('<QQ', sample.log_time, len(content))
        offsets[channel] = offsets.get(channel, b'') + entry
        content += _message(sample, topics, number)
    packed = _pack(bytes(content), layout.codec)
    times = [sample.log_time for sample in group]
    head = struct.pack(
        '<QQQI',
        min(times),
        max(times),
        len(content),
        crc32(content) if layout.checksums else 0,
    )
    chunk = _record(6, head + _text(layout.codec) + struct.pack('<Q', len(packed)) + packed)
    behind, where = b'', b''
    for channel, entries in offsets.items():
        where += struct.pack('<HQ', channel, place + len(chunk) + len(behind))
        behind += _record(7, struct.pack('<HI', channel, len(entries)) + entries)
    index = struct.pack('<QQQQI', min(times), max(times), place, len(chunk), len(where)) + where
    index += struct.pack('<Q', len(behind)) + _text(layout.codec)
    return chunk, (behind, index + struct.pack('<QQ', len(packed), len(content)))


def _definitions(types: dict[str, str]) -> bytes:
    kinds = list(dict.fromkeys(types.values()))
    out = b''.join(
        _record(3, struct.pack('<H', i + 1) + _text(kind) + _text('ros2msg') + _text('# fields'))
        for i, kind in enumerate(kinds)
    )
    for i, (topic, kind) in enumerate(types.items()):
        ids = struct.pack('<HH', i + 1, kinds.index(kind) + 1)
        out += _record(4, ids + _text(topic) + _text('cdr') + struct.pack('<I', 0))
    return out


def _message(sample: Sample, topics: list[str], number: int) -> bytes:
    head = struct.pack(
        '<HIQQ', topics.index(sample.topic) + 1, number, sample.log_time, sample.log_time
    )
    return _record(5, head + sample.data)


def _record(opcode: int, content: bytes) -> bytes:
    return struct.pack('<BQ', opcode, len(content)) + content


def _text(text: str) -> bytes:
    return struct.pack('<I', len(text.encode())) + text.encode()


def _pack(content: bytes, codec: str) -> bytes:
    if codec == 'zstd':
        try:
            from compression import zstd
        except ImportError:
            from backports import zstd
        return zstd.compress(content)
    if codec == 'lz4':
        from lz4.frame import compress

        return compress(content)
    return content
