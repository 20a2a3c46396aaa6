# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Whole messages out of an MCAP file that was cut off or damaged (power loss, full disk).

An MCAP without its summary cannot be opened by index, but its records follow one another, so they
can be read from the front until the damage. Format: https://mcap.dev/spec.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple
from zlib import crc32

MAGIC = b'\x89MCAP0\r\n'
SCHEMA, CHANNEL, MESSAGE, CHUNK = 0x03, 0x04, 0x05, 0x06


class RecoveredMessage(NamedTuple):
    """A message that is whole: its topic, type, log time [ns] and CDR bytes."""

    topic: str
    type: str
    log_time: int
    data: bytes


def recover(path: Path) -> tuple[list[RecoveredMessage], str]:
    """Read all whole messages of an MCAP file, sorted by log time.

    Returns
    -------
    messages : list of RecoveredMessage
    damage : str
        What is wrong with the file, in words; empty when every record was whole.
    """
    content = path.read_bytes()
    if content[: len(MAGIC)] != MAGIC:
        return [], 'it is empty' if not content else 'it does not begin as an MCAP file'
    scan = _Scan()
    scan.records(memoryview(content)[len(MAGIC) :])
    scan.messages.sort(key=lambda message: message.log_time)
    return scan.messages, '; '.join(scan.damage)


class _Scan:
    """State of one pass over the records of a file."""

    def __init__(self) -> None:
        self.schemas: dict[int, str] = {}
        self.channels: dict[int, tuple[str, str]] = {}  # id -> topic, type
        self.messages: list[RecoveredMessage] = []
        self.damage: list[str] = []

    def records(self, content: memoryview) -> None:
        """Go through the records of a file, or of a chunk."""
        for code, record, whole in _split(content):
            if code == CHUNK:
                self._chunk(record, whole)
            elif not whole:
                self.damage.append('it ends in the middle of a record')
            elif code == SCHEMA:
                name, _ = _string(record, 2)
                self.schemas[struct.unpack_from('<H', record)[0]] = name
            elif code == CHANNEL:
                channel, schema = struct.unpack_from('<HH', record)
                topic, _ = _string(record, 4)
                self.channels[channel] = (topic, self.schemas.get(schema, ''))
            elif code == MESSAGE and len(record) >= 22:
                channel, _, log_time, _ = struct.unpack_from('<HIQQ', record)
                if channel in self.channels:
                    topic, message_type = self.channels[channel]
                    self.messages.append(
                        RecoveredMessage(topic, message_type, log_time, bytes(record[22:]))
                    )

    def _chunk(self, record: memoryview, whole: bool) -> None:
        """Unpack a chunk, as far as it reaches, and read the records in it."""
        if len(record) < 32:
            self.damage.append('it ends in the head of a chunk')
            return
        size, checksum = struct.unpack_from('<QI', record, 16)
        try:
            compression, at = _string(record, 28)
            packed = record[at + 8 :]
            content = _decompress(compression, bytes(packed))
        except (UnicodeDecodeError, struct.error, ValueError) as error:
            self.damage.append(f'a chunk cannot be unpacked ({error})')
            return
        if whole and checksum and crc32(content) != checksum:
            self.damage.append('a chunk has a wrong checksum and was left out')
            return
        damage = len(self.damage)
        self.records(memoryview(content))
        if not whole or len(content) < size:
            self.damage[damage:] = ['it ends in the middle of a chunk']


def _split(content: memoryview) -> Iterator[tuple[int, memoryview, bool]]:
    """Yield code, content and wholeness of each record; only the last one can be cut."""
    at = 0
    while at + 9 <= len(content):
        code = content[at]
        (length,) = struct.unpack_from('<Q', content, at + 1)
        record = content[at + 9 : at + 9 + length]
        if code == 0:  # no such record: what is left is the closing magic or rubbish
            return
        yield code, record, len(record) == length
        at += 9 + length


def _string(record: memoryview, at: int) -> tuple[str, int]:
    (length,) = struct.unpack_from('<I', record, at)
    return bytes(record[at + 4 : at + 4 + length]).decode(), at + 4 + length


def _decompress(compression: str, packed: bytes) -> bytes:
    """Unpack a chunk that may be cut; ``ValueError`` when that cannot be done."""
    if not compression:
        return packed
    try:
        if compression == 'zstd':
            return decompress_zstd(packed)
        if compression == 'lz4':
            from lz4.frame import LZ4FrameDecompressor

            return bytes(LZ4FrameDecompressor().decompress(packed))
    except Exception as error:  # each library has an error class of its own
        raise ValueError(f'{compression}: {error}') from None
    raise ValueError(f'compression {compression!r} is not known')


def decompress_zstd(packed: bytes) -> bytes:
    """Unpack Zstandard data as far as it reaches (the library came with rosbags)."""
    try:
        from compression import zstd  # type: ignore[import-not-found,unused-ignore]
    except ImportError:
        from backports import zstd
    return bytes(zstd.ZstdDecompressor().decompress(packed))
