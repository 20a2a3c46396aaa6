# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Records of an MCAP file, found again behind damage (format: https://mcap.dev/spec).

A record is an opcode (1 byte), its length (8) and its content. Where a record cannot be one - an
unknown opcode, a length that does not fit, a message of an impossible time - the next place is
looked for at which one can.
"""

from __future__ import annotations

import struct
from collections.abc import Container, Iterator
from dataclasses import dataclass
from mmap import mmap
from typing import NamedTuple, TypeAlias

import numpy as np

from wheel_terra_estimator.bags.salvage.compression import CODECS

MAGIC = b'\x89MCAP0\r\n'
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK = 0x01, 0x02, 0x03, 0x04, 0x05, 0x06
MESSAGE_INDEX, CHUNK_INDEX, ATTACHMENT, STATISTICS = 0x07, 0x08, 0x09, 0x0B
ATTACHMENT_INDEX, METADATA, METADATA_INDEX = 0x0A, 0x0C, 0x0D
SUMMARY_OFFSET, DATA_END = 0x0E, 0x0F

HEAD = 9  # opcode and length [byte]
MESSAGE_HEAD = 22  # channel, sequence number, log time and publish time [byte]
CHUNK_HEAD = 40  # times, size, checksum and two lengths, without the name of the compression [byte]

LATEST = 2**63 - 1  # latest log time [ns] that is one

_EARLIEST = 10**18  # log time [ns] of a recording: the year 2001
_LONGEST_WAY = 60 * 10**9  # from the publisher to the recorder [ns]

# What the lengths of the other records have to be: bytes before so many strings that fill the
# rest; bytes before a list, its own length included, that fills it; least and most.
_STRINGS = {HEADER: (0, 2), SCHEMA: (2, 3), CHANNEL: (4, 3), METADATA: (0, 2)}
_MAPS = {MESSAGE_INDEX: 6, STATISTICS: 46, METADATA_INDEX: 20}
_LENGTHS = {
    FOOTER: (20, 20),
    CHUNK_INDEX: (64, 2**20),
    ATTACHMENT: (40, 2**32),
    ATTACHMENT_INDEX: (48, 2**16),
    SUMMARY_OFFSET: (17, 17),
    DATA_END: (4, 4),
}

_RECORD = struct.Struct('<BQ')
_MESSAGE = struct.Struct('<BQHIQQ')
_CHUNK = struct.Struct('<BQQQQII')
_WINDOWS = (2**12, 2**20)
"""Bytes that a search through damage looks at together: at first, and at most."""

Buffer: TypeAlias = 'bytes | mmap'


class Record(NamedTuple):
    """A record: its opcode, where its content begins and ends, two fields of a message."""

    opcode: int
    begin: int
    end: int
    channel: int = 0
    log_time: int = 0


class Gap(NamedTuple):
    """Bytes in which no record can be found."""

    begin: int
    end: int


class ChunkHead(NamedTuple):
    """What stands before the packed records of a chunk."""

    start: int  # log times [ns]
    end: int
    size: int  # unpacked [byte]
    checksum: int  # CRC-32 of the unpacked records, 0: none
    codec: str
    begin: int  # of the packed records
    packed: int  # [byte]


@dataclass
class Possible:
    """What a record can be at some place of the file."""

    opcodes: Container[int] = range(1, 0x10)  # kinds of records there
    channels: Container[int] = ()  # known channels; every one is possible while there is none
    longest: int = 2**32  # message [byte]


def records(content: Buffer, begin: int, end: int, possible: Possible) -> Iterator[Record | Gap]:
    """Yield the records between two places, and the gaps between them."""
    at = begin
    unpack = _MESSAGE.unpack_from
    channels = possible.channels
    any_channel = not channels
    before: Record | None = None  # found, but damage behind it may show that it is none
    behind_damage = False  # messages of a chunk that lost its head: bytes may be missing in one
    while at < end:
        record: Record | None = None
        # The usual case first: a message that fits, followed by a record that fits.
        if content[at] == MESSAGE and at + HEAD + MESSAGE_HEAD <= end:
            _, length, channel, _, log_time, _ = unpack(content, at)
            after = at + HEAD + length
            if (
                after <= end
                and length >= MESSAGE_HEAD
                and log_time <= LATEST
                and (any_channel or channel in channels)
                and (after == end or _head_fits(content, after, end, possible))
            ):
                record = Record(MESSAGE, at + HEAD, after, channel, log_time)
        record = record or _record(content, at, end, possible)
        if record is not None and behind_damage and CHUNK in possible.opcodes:
            behind_damage = record.opcode != CHUNK
            if record.opcode == MESSAGE:  # one that lost some bytes may reach over a chunk
                chunk = _next(content, record.begin, record.end, end, Possible((CHUNK,)))
                record = record if chunk >= record.end else None
        if record is None and before is not None:
            inside = _inside(content, before, at, end, possible)
            if inside < at:  # bytes are missing in the record before, so it reached too far
                at = before.begin - HEAD
                yield Gap(at, inside)
                at, before = inside, None
                continue
        if before is not None:
            yield before
        before = record
        if record is None:
            found = _next(content, at + 1, end, end, possible)
            yield Gap(at, found)
            at, behind_damage = found, True
        else:
            at = record.end
    if before is not None:
        yield before


def _record(content: Buffer, at: int, end: int, possible: Possible) -> Record | None:
    """Return the record at a place if one can be there."""
    if not _fits(content, at, end, possible):
        return None
    opcode, length = _RECORD.unpack_from(content, at)
    after = at + HEAD + length
    record = Record(opcode, at + HEAD, min(after, end))
    if opcode == MESSAGE:
        _, _, channel, _, log_time, _ = _MESSAGE.unpack_from(content, at)
        record = record._replace(channel=channel, log_time=log_time)
    if after < end and _fits(content, after, end, possible):
        return record
    if after == end and opcode != CHUNK:  # no closed file ends with a chunk
        return record
    # What follows is damaged, or bytes are missing here: then other records stand inside.
    if opcode == CHUNK:
        head = chunk_head(content, at, end)
        if head is None or not head.codec:
            return None  # its records can be read one by one
    inside = _inside(content, record, record.end, end, possible)
    if opcode == CHUNK:
        return record._replace(end=inside)
    return record if inside == record.end else None


def next_outside(content: Buffer, begin: int, stop: int, end: int) -> int:
    """Return where a record that stands outside of chunks can begin before ``stop``, else it."""
    return _next(content, begin, stop, end, Possible((CHUNK, SCHEMA, CHANNEL)))


def _inside(content: Buffer, record: Record, stop: int, end: int, possible: Possible) -> int:
    """Return where a record begins that cannot be part of the one given, else ``stop``."""
    if record.opcode == CHUNK:  # none of those stands in packed bytes
        return next_outside(content, record.begin, stop, end)
    return _next(content, record.begin, stop, end, possible)


def _next(content: Buffer, begin: int, stop: int, end: int, possible: Possible) -> int:
    """Return where the next record can begin before ``stop``, else ``stop``."""
    for at in _candidates(content, begin, min(stop + HEAD - 1, end)):
        if _fits(content, at, end, possible):
            after = at + HEAD + _RECORD.unpack_from(content, at)[1]
            surely = content[at] == CHUNK or (content[at] == MESSAGE and _times_agree(content, at))
            if surely or after == end or _head_fits(content, after, end, possible):
                return at
    return stop


def _times_agree(content: Buffer, at: int) -> bool:
    """Whether log time and publish time of a message are of this age and near one another."""
    _, _, _, _, log_time, publish_time = _MESSAGE.unpack_from(content, at)
    return log_time > _EARLIEST and abs(log_time - publish_time) < _LONGEST_WAY


def _candidates(content: Buffer, begin: int, end: int) -> Iterator[int]:
    """Yield the places of an opcode that is followed by a length below 4 GB."""
    at, window = begin, _WINDOWS[0]
    while at + HEAD <= end:
        count = min(window + HEAD - 1, end - at)
        byte = np.frombuffer(content, np.uint8, count, at)
        if byte.any():
            last = count - HEAD + 1
            found = (byte[:last] - np.uint8(1)) < np.uint8(DATA_END)  # 0 becomes 255
            for place in range(5, HEAD):
                found &= byte[place : place + last] == 0
            del byte
            for step in np.flatnonzero(found).tolist():
                yield at + step
        at += window
        window = min(2 * window, _WINDOWS[1])


def _head_fits(content: Buffer, at: int, end: int, possible: Possible) -> bool:
    """Whether an opcode and a length that fit stand at a place."""
    if at + HEAD > end:
        return False
    opcode, length = _RECORD.unpack_from(content, at)
    return opcode in possible.opcodes and at + HEAD + length <= end


def _fits(content: Buffer, at: int, end: int, possible: Possible) -> bool:
    """Whether a record can stand at a place, by its opcode, its length and its first fields."""
    if content[at] == CHUNK and CHUNK in possible.opcodes:
        return chunk_head(content, at, end) is not None
    if not _head_fits(content, at, end, possible):
        return False
    opcode, length = _RECORD.unpack_from(content, at)
    if opcode == MESSAGE:
        if not MESSAGE_HEAD <= length <= possible.longest:
            return False
        _, _, channel, _, log_time, _ = _MESSAGE.unpack_from(content, at)
        known = not possible.channels or channel in possible.channels
        return known and log_time <= LATEST
    if opcode in _STRINGS:
        skipped, count = _STRINGS[opcode]
        return _strings_fill(content, at + HEAD + skipped, at + HEAD + length, count)
    if opcode in _MAPS:
        before = _MAPS[opcode]
        return length >= before and length == before + _uint32(content, at + HEAD + before - 4)
    least, most = _LENGTHS.get(opcode, (1, 0))
    return least <= length <= most


def chunk_head(content: Buffer, at: int, end: int) -> ChunkHead | None:
    """Return the head of a chunk record at a place, None if there cannot be one.

    The packed records may reach beyond ``end``: then the file is cut.
    """
    if at + HEAD + CHUNK_HEAD > end:
        return None
    opcode, length, start, last, size, checksum, letters = _CHUNK.unpack_from(content, at)
    begin = at + HEAD + CHUNK_HEAD + letters
    if opcode != CHUNK or letters > 8 or begin > end or length < CHUNK_HEAD + letters:
        return None
    codec = bytes(content[begin - 8 - letters : begin - 8]).decode('ascii', 'replace')
    packed = int.from_bytes(content[begin - 8 : begin], 'little')
    if codec not in CODECS or packed != length - CHUNK_HEAD - letters:
        return None
    return ChunkHead(start, last, size, checksum, codec, begin, packed)


def schema(content: Buffer, record: Record) -> tuple[int, str]:
    """Return identifier and name of a schema.

    Raises ValueError where the record is damaged (as in the functions below).
    """
    return _uint16(content, record.begin), _string(content, record.begin + 2, record.end)


def channel(content: Buffer, record: Record) -> tuple[int, int, str]:
    """Return identifier, schema and topic of a channel."""
    topic = _string(content, record.begin + 4, record.end)
    return _uint16(content, record.begin), _uint16(content, record.begin + 2), topic


def channel_counts(content: Buffer, record: Record) -> dict[int, int]:
    """Return the number of messages of each channel, out of a statistics record."""
    return dict(_listed(content, record, _MAPS[STATISTICS], '<HQ'))


def indexed_times(content: Buffer, record: Record) -> list[int]:
    """Return the log times [ns] of the messages that a message index record lists."""
    return [time for time, _ in _listed(content, record, _MAPS[MESSAGE_INDEX], '<QQ')]


def _listed(content: Buffer, record: Record, skipped: int, row: str) -> Iterator[tuple[int, int]]:
    """Return the rows of the list that fills a record behind some bytes."""
    at = record.begin + skipped
    length = record.end - at
    if length < 0 or _uint32(content, at - 4) != length or length % struct.calcsize(row):
        raise ValueError('the list in a record is damaged')
    return struct.iter_unpack(row, bytes(content[at : record.end]))


def indexed_chunk(content: Buffer, record: Record) -> tuple[int, int, frozenset[int]]:
    """Return where the chunk of a chunk index record begins and ends, and the channels in it."""
    at = record.begin + 36
    if record.end < at or at + _uint32(content, at - 4) > record.end:
        raise ValueError('a chunk index record is damaged')
    begin, length, size = struct.unpack_from('<QQI', content, record.begin + 16)
    channels = struct.iter_unpack('<HQ', bytes(content[at : at + size - size % 10]))
    return begin, begin + length, frozenset(number for number, _ in channels)


def _strings_fill(content: Buffer, at: int, end: int, count: int) -> bool:
    """Whether ``count`` strings with their lengths fill the bytes exactly."""
    for _ in range(count):
        if at + 4 > end:
            return False
        at += 4 + _uint32(content, at)
    return at == end


def _string(content: Buffer, at: int, end: int) -> str:
    if at + 4 > end or at + 4 + _uint32(content, at) > end:
        raise ValueError('a string is longer than its record')
    return bytes(content[at + 4 : at + 4 + _uint32(content, at)]).decode()


def _uint16(content: Buffer, at: int) -> int:
    return int.from_bytes(content[at : at + 2], 'little')


def _uint32(content: Buffer, at: int) -> int:
    return int.from_bytes(content[at : at + 4], 'little')
