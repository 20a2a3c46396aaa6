# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A rosbag2 folder (MCAP, or SQLite3) that is being written, closed whatever happens."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Mapping
from contextlib import ExitStack, suppress
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, TypeVar

from wheel_terra_estimator.bags.message_factory import MessageFactory
from wheel_terra_estimator.bags.salvage.mcap_closing import add_checksums, close_cut_file
from wheel_terra_estimator.output_folder import check_folder, new_folder

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
        storage: str = 'mcap',
        # What is read meanwhile: the bag is never written into it or over it
        inputs: Iterable[Path] = (),
    ) -> None:
        self.path = path
        self.messages = MessageFactory()
        self.counts: Counter[str] = Counter()  # messages written, by topic
        self._topics = dict(topics)
        self._latched = latched
        self._storage = storage
        self._overwrite = overwrite
        self._inputs = tuple(inputs)
        self._stack = ExitStack()
        check_folder(path, overwrite, self._inputs)

    def __enter__(self: Self) -> Self:
        from rosbags.rosbag2 import StoragePlugin, Writer

        folder = self._stack.enter_context(
            new_folder(self.path, self._overwrite, self._inputs, keep_partial=True)
        )
        folder.rmdir()  # the library makes it
        self._writer = Writer(
            folder, version=9, storage_plugin=StoragePlugin[self._storage.upper()]
        )
        self._writer.open()
        self._connections = {
            topic: self._writer.add_connection(
                topic,
                kind,
                typestore=self.messages.store,
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
            if isinstance(error, OSError):
                self._close_cut()
            else:  # not the library's own exit, which leaves a file without index after an error
                storage: Any = self._writer.storage
                try:
                    self._writer.close()
                    if self._storage == 'mcap':
                        add_checksums(storage.path)
                except OSError:
                    self._close_cut()
                    raise
            self._stack.__exit__(kind, error, trace)

    def _close_cut(self) -> None:
        """Close the bag on a disk that takes no more: it keeps all chunks that are whole.

        Without one it keeps nothing: a file that only a recovery could read is no bag.
        """
        storage: Any = self._writer.storage
        if self._storage != 'mcap' or storage is None:
            return
        with suppress(OSError):  # the first error is the one to be said
            storage.bio.raw.close()  # what is buffered has no place any more
            path: Path = storage.path
            try:
                kept = close_cut_file(path)
            except OSError:
                path.unlink()
                return
            self._writer.counts = {c.id: kept.counts[c.id] for c in self._connections.values()}
            self._writer.min_timestamp, self._writer.max_timestamp = kept.start, kept.end
            writer: Any = self._writer
            writer.storage = _ClosedFile(path)
            self._writer.close()  # writes the metadata
            add_checksums(path)

    def note(self, key: str, value: str) -> None:
        """State something about the bag in the `custom_data` of its metadata."""
        self._writer.set_custom_data(key, value)

    def write(self, topic: str, message: Any, log_time: int) -> None:
        """Append a message at a log time [ns]."""
        data = self.messages.store.serialize_cdr(message, self._topics[topic])
        self.write_raw(topic, data, log_time)

    def write_raw(self, topic: str, data: bytes | memoryview, log_time: int) -> None:
        """Append a message that is serialised already (CDR)."""
        self._writer.write(self._connections[topic], log_time, data)
        self.counts[topic] += 1


class _ClosedFile(NamedTuple):
    """Stands for a storage file that needs no closing."""

    path: Path

    def close(self, version: int, metadata: str) -> None:
        """Do nothing."""


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
