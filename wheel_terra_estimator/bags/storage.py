# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Raw messages of a recording, whatever its shape and state.

A rosbag2 folder, a folder without ``metadata.yaml``, a single ``.mcap`` or ``.db3``, compressed or
cut off: `open_bag` gives the messages that are whole and says in words what was wrong. On damaged
files the libraries raise almost anything, hence the wide handlers here.
"""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple, Protocol

from wheel_terra_estimator.bags.mcap_recovery import RecoveredMessage, decompress_zstd, recover
from wheel_terra_estimator.errors import UserError

STORAGE_SUFFIXES = ('.mcap', '.db3', '.mcap.zstd', '.db3.zstd')
ZSTD_MAGIC = b'\x28\xb5\x2f\xfd'


class RawMessage(NamedTuple):
    """A message as it lies in the bag; ``log_time`` in ns, ``data`` in CDR."""

    log_time: int
    topic: str
    data: bytes


class Topic(NamedTuple):
    """A topic of the bag, ``type`` as in ``sensor_msgs/msg/Imu``."""

    name: str
    type: str
    message_count: int


class _Source(Protocol):
    topics: list[Topic]

    def messages(self, topics: Collection[str]) -> Iterator[RawMessage]: ...


class Bag:
    """An open recording.

    Attributes
    ----------
    topics : dict of str to Topic
        All topics, by name.
    notes : list of str
        What was wrong with the recording and what was done about it; grows while reading.
    """

    def __init__(self, path: Path, sources: list[_Source], notes: list[str]) -> None:
        self.path = path
        self.notes = notes
        self._sources = sources
        counts: Counter[str] = Counter()
        types: dict[str, str] = {}
        for source in sources:
            for topic in source.topics:
                counts[topic.name] += topic.message_count
                types[topic.name] = _normal_type(topic.type)
        self.topics = {name: Topic(name, types[name], counts[name]) for name in sorted(types)}

    @property
    def message_count(self) -> int:
        """Number of messages on all topics."""
        return sum(topic.message_count for topic in self.topics.values())

    def messages(self, topics: Collection[str]) -> Iterator[RawMessage]:
        """Yield the messages of some topics in the order of their log times."""
        sources = [source.messages(topics) for source in self._sources]
        merged = sources[0] if len(sources) == 1 else heapq.merge(*sources, key=lambda m: m[0])
        for message in merged:
            if message.data[:4] == ZSTD_MAGIC:  # compressed message by message, without metadata
                message = message._replace(data=decompress_zstd(message.data))
            yield message


@contextmanager
def open_bag(path: str | Path) -> Iterator[Bag]:
    """Open a recording.

    Raises
    ------
    UserError
        Nothing there, no recording, or one without a single message.
    """
    path = Path(path)
    notes: list[str] = []
    with ExitStack() as stack:
        bag = Bag(path, _open_sources(path, notes, stack), notes)
        if not bag.message_count:
            raise UserError(
                f'{path}: the bag holds no messages; was the recorder stopped before a publisher '
                'was found (look at `ros2 topic list`)?' + ''.join(f' ({note})' for note in notes)
            )
        yield bag


def _open_sources(path: Path, notes: list[str], stack: ExitStack) -> list[_Source]:
    """Open what can be opened, from the most to the least regular way."""
    if not path.exists():
        raise UserError(f'{path}: no such bag; give a rosbag2 folder, a .mcap or a .db3 file')
    if path.is_file():
        if not path.name.endswith(STORAGE_SUFFIXES):
            raise UserError(f'{path}: not a bag; give a rosbag2 folder, a .mcap or a .db3 file')
        return [_open_file(path, notes, stack)]
    files = sorted(p for p in path.iterdir() if p.name.endswith(STORAGE_SUFFIXES))
    if (path / 'metadata.yaml').exists():
        try:
            return [_Indexed(path, notes, stack)]
        except Exception as error:
            if not files:
                raise UserError(f'{path}: cannot be read ({error})') from None
            if len(files) > 1 or 'etadata' in str(error):
                notes.append(f'metadata.yaml was set aside ({error}); files read one by one')
    elif files:
        notes.append('metadata.yaml is missing; files read one by one')
    if not files:
        raise UserError(
            f'{path}: not a bag (no metadata.yaml, no .mcap, no .db3 in it); '
            'give a rosbag2 folder or a storage file'
        )
    return [_open_file(file, notes, stack) for file in files]


def _open_file(path: Path, notes: list[str], stack: ExitStack) -> _Source:
    """Open one storage file by its index, or else by reading it from the front."""
    if path.suffix == '.zstd':
        folder = Path(stack.enter_context(TemporaryDirectory()))
        unpacked = folder / path.stem
        try:
            unpacked.write_bytes(decompress_zstd(path.read_bytes()))
        except Exception as error:  # the library's own error class differs with its version
            raise UserError(f'{path}: cannot be unpacked ({error})') from None
        path = unpacked
    try:
        return _Indexed(path, notes, stack)
    except Exception as error:
        if path.suffix != '.mcap':
            raise UserError(
                f'{path}: cannot be read ({error}); try `sqlite3 {path.name} .recover`'
            ) from None
        return _Recovered(path, notes, str(error))


class _Indexed:
    """A folder or file that the library opens by its index."""

    def __init__(self, path: Path, notes: list[str], stack: ExitStack) -> None:
        from rosbags.rosbag2 import Reader

        self.path = path
        self.notes = notes
        self.reader = stack.enter_context(Reader(path))
        self.topics = [Topic(c.topic, c.msgtype, c.msgcount) for c in self.reader.connections]

    def messages(self, topics: Collection[str]) -> Iterator[RawMessage]:
        connections = [c for c in self.reader.connections if c.topic in topics]
        last = -1
        if not connections:
            return
        try:
            for connection, last, data in self.reader.messages(connections):
                yield RawMessage(last, connection.topic, bytes(data))
        except Exception as error:
            # The index was fine, the content is not: go on behind the damage where possible.
            files = sorted(self.path.glob('*.mcap')) if self.path.is_dir() else [self.path]
            if any(file.suffix != '.mcap' for file in files) or not files:
                self.notes.append(f'{self.path.name} is damaged ({error}); what follows is lost')
                return
            for file in files:
                for message in _Recovered(file, self.notes, str(error)).messages(topics):
                    if message.log_time > last:
                        yield message


class _Recovered:
    """An MCAP file that is read from the front because it has no (usable) index."""

    def __init__(self, path: Path, notes: list[str], reason: str) -> None:
        self._messages, damage = recover(path)
        notes.append(
            f'{path.name} was not closed or is damaged: {damage or reason.rstrip(".")}; '
            f'{len(self._messages)} whole messages recovered'
        )
        counts = Counter((message.topic, message.type) for message in self._messages)
        self.topics = [Topic(name, kind, count) for (name, kind), count in counts.items()]

    def messages(self, topics: Collection[str]) -> Iterator[RawMessage]:
        yield from (_raw(m) for m in self._messages if m.topic in topics)


def _raw(message: RecoveredMessage) -> RawMessage:
    return RawMessage(message.log_time, message.topic, message.data)


def _normal_type(name: str) -> str:
    """``sensor_msgs/Imu`` and ``sensor_msgs::msg::dds_::Imu_`` are ``sensor_msgs/msg/Imu``."""
    package, _, rest = name.replace('::', '/').partition('/')
    return f'{package}/msg/{rest.rpartition("/")[2].rstrip("_")}' if rest else name
