# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A rosbag2 folder (MCAP) that is being written: whole, or not there."""

from __future__ import annotations

import mmap
import os
from collections import Counter
from collections.abc import Collection, Mapping
from contextlib import ExitStack, suppress
from pathlib import Path
from types import TracebackType
from typing import Any, TypeVar
from zlib import crc32

from wheel_terra_estimator.bags.salvage import mcap_records as mcap
from wheel_terra_estimator.bags.salvage.compression import unpack
from wheel_terra_estimator.bags.storage import jazzy_types
from wheel_terra_estimator.output_folder import new_folder

Self = TypeVar('Self', bound='BagFile')


class BagFile:
    """Writes messages to a new bag; a context manager.

    The bag is written beside its place and renamed when it is closed (see `output_folder`). Raises
    UserError where the path is taken or cannot be written.
    """

    def __init__(
        self,
        path: Path,
        topics: Mapping[str, str],  # full topic name to message type
        # Topics offered as transient local with depth 1; all others are volatile with depth 10
        latched: Collection[str] = (),
        overwrite: bool = False,
    ) -> None:
        self.path = path
        self.counts: Counter[str] = Counter()  # messages written, by topic
        self._topics = dict(topics)
        self._latched = latched
        self._overwrite = overwrite
        self._stack = ExitStack()

    def __enter__(self: Self) -> Self:
        from rosbags.rosbag2 import StoragePlugin, Writer

        folder = self._stack.enter_context(new_folder(self.path, self._overwrite))
        folder.rmdir()  # the library makes it
        self._writer = Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP)
        self._writer.open()
        self._connections = {
            topic: self._writer.add_connection(
                topic,
                kind,
                typestore=jazzy_types(),
                offered_qos_profiles=[_qos(topic in self._latched)],
            )
            for topic, kind in self._topics.items()
        }
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        with self._stack:
            storage: Any = self._writer.storage
            try:
                if error is not None:
                    raise error
                self._writer.close()
                add_checksums(storage.path)
            except BaseException:
                with suppress(OSError):
                    storage.bio.raw.close()  # what is buffered has no place any more
                raise

    def note(self, key: str, value: str) -> None:
        """State something about the bag in the `custom_data` of its metadata."""
        self._writer.set_custom_data(key, value)

    def write(self, topic: str, data: bytes | memoryview, log_time: int) -> None:
        """Append a message (CDR) at a log time [ns]."""
        self._writer.write(self._connections[topic], log_time, data)
        self.counts[topic] += 1


def add_checksums(path: Path) -> None:
    """Give chunks and summary of an MCAP file the checksums that the library leaves out."""
    with path.open('r+b') as file:
        place = file.fileno()
        with mmap.mmap(place, 0, access=mmap.ACCESS_READ) as content:
            end = len(content) - len(mcap.MAGIC)
            for item in mcap.records(content, len(mcap.MAGIC), end, mcap.Possible()):
                assert isinstance(item, mcap.Record)
                if item.opcode == mcap.CHUNK:
                    head = mcap.chunk_head(content, item.begin - mcap.HEAD, end)
                    assert head is not None
                    data = unpack(head.codec, content[head.begin : item.end], head.size).content
                    os.pwrite(place, crc32(data).to_bytes(4, 'little'), item.begin + 24)
                elif item.opcode == mcap.FOOTER:
                    begin = int.from_bytes(content[item.begin : item.begin + 8], 'little')
                    checksum = crc32(content[begin : item.begin + 16])
                    os.pwrite(place, checksum.to_bytes(4, 'little'), item.begin + 16)


def _qos(latched: bool) -> Any:
    """Return the profile that the node offers on a topic."""
    from rosbags.interfaces import (
        Qos,
        QosDurability,
        QosHistory,
        QosLiveliness,
        QosReliability,
        QosTime,
    )

    forever = QosTime(9223372036, 854775807)
    return Qos(
        history=QosHistory.KEEP_LAST,
        depth=1 if latched else 10,
        reliability=QosReliability.RELIABLE,
        durability=QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE,
        deadline=forever,
        lifespan=forever,
        liveliness=QosLiveliness.AUTOMATIC,
        liveliness_lease_duration=forever,
        avoid_ros_namespace_conventions=False,
    )
