# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Raw messages of a recording, whatever its shape and state.

A rosbag2 folder, a folder without ``metadata.yaml``, a single ``.mcap`` or ``.db3``, compressed,
cut off or damaged: `open_bag` gives the messages that are whole and says what was wrong.
"""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeAlias

from wheel_terra_estimator.bags import bag_metadata
from wheel_terra_estimator.bags.salvage import RawMessage, Topic
from wheel_terra_estimator.bags.salvage.compression import ZSTD_MAGIC, unpack_file, unpack_message
from wheel_terra_estimator.bags.salvage.mcap_file import McapFile
from wheel_terra_estimator.bags.salvage.sqlite_file import SqliteFile
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.input_file import check_regular
from wheel_terra_estimator.messages.unpack import TYPES, DamagedMessageError, unpack

STORAGE_SUFFIXES = ('.mcap', '.db3', '.mcap.zstd', '.db3.zstd')
_ROS_1_SUFFIX = '.bag'
_Source: TypeAlias = McapFile | SqliteFile


def is_bag(path: Path) -> bool:
    """Return whether a path names a recording, and no table."""
    return path.is_dir() or path.name.endswith((*STORAGE_SUFFIXES, _ROS_1_SUFFIX))


class Bag:
    """An open recording."""

    def __init__(self, path: Path, sources: list[_Source], notes: list[str]) -> None:
        self.path = path
        self._notes = notes
        self._sources = sources
        counts: Counter[str] = Counter()
        types: dict[str, str] = {}
        for source in sources:
            for topic in source.topics:
                counts[topic.name] += topic.message_count
                if topic.name not in types or topic.message_count:
                    types[topic.name] = _normal_type(topic.type)
        self.topics = {name: Topic(name, types[name], counts[name]) for name in sorted(types)}

    @property
    def notes(self) -> list[str]:
        """What was wrong with the recording and what was done about it; grows while reading."""
        return [
            *self._notes,
            *(note for source in self._sources for note in source.losses.in_words()),
        ]

    @property
    def damaged(self) -> bool:
        """Whether something of a file was lost, as far as it is known by now."""
        return any(source.losses.in_words() for source in self._sources)

    @property
    def lost(self) -> float:
        """Share of the requested messages that are known to be lost [-]."""
        losses = [source.losses for source in self._sources]
        lost = sum(one.lost().total() for one in losses)
        return lost / max(lost + sum(sum(one.recovered.values()) for one in losses), 1)

    @property
    def message_count(self) -> int:
        """Number of messages on all topics."""
        return sum(topic.message_count for topic in self.topics.values())

    def messages(self, topics: Collection[str]) -> Iterator[RawMessage]:
        """Yield the messages of some topics in the order of their log times."""
        sources = [source.messages(topics) for source in self._sources]
        merged = sources[0] if len(sources) == 1 else heapq.merge(*sources, key=lambda m: m[0])
        for message in merged:
            if message.data[:4] == ZSTD_MAGIC:  # compressed message by message
                message = message._replace(data=unpack_message(message.data))
            yield message


@contextmanager
def open_bag(path: str | Path) -> Iterator[Bag]:
    """Open a recording.

    A `UserError` that is raised while it is open is completed by what is wrong with the recording.

    ``path``: folder or storage file. Raises UserError where there is nothing, no recording, or one
    without a single message.
    """
    path = Path(path)
    notes: list[str] = []
    with ExitStack() as stack:
        bag = Bag(path, _open_sources(path, notes, stack), notes)
        try:
            if not bag.message_count and bag.notes:
                raise UserError(
                    f'{path}: not one message can be read; copy the bag again from where it was '
                    'recorded'
                )
            if not bag.message_count:
                raise UserError(
                    f'{path}: the bag holds no messages; was the recorder stopped before a '
                    'publisher was found (look at `ros2 topic list`)?'
                )
            yield bag
        except UserError as error:
            if not bag.notes:
                raise
            raise UserError(f'{error} ({"; ".join(bag.notes)})') from None


def _open_sources(path: Path, notes: list[str], stack: ExitStack) -> list[_Source]:
    try:
        folder = path.is_dir()
        there = folder or path.exists()
    except OSError as error:
        raise UserError(f'{path}: cannot be read ({error.strerror})') from None
    if not there:
        raise UserError(f'{path}: no such bag; give a rosbag2 folder, a .mcap or a .db3 file')
    if not folder:
        if path.suffix == _ROS_1_SUFFIX:
            raise UserError(
                f'{path}: a bag of ROS 1; convert it: pip install rosbags, then rosbags-convert '
                f'--src {path} --dst {path.stem}'
            )
        if not path.name.endswith(STORAGE_SUFFIXES):
            raise UserError(
                f'{path}: not a bag; give a rosbag2 folder, a .mcap or a .db3 file (of a CSV log: '
                'wheel-terra convert)'
            )
        return [_open_file(path, notes, stack)]
    metadata = bag_metadata.read(path)
    files = _storage_files(path, metadata, notes)
    if not files:
        raise UserError(
            f'{path}: not a bag (no .mcap, no .db3 in it); give a rosbag2 folder or a storage file'
            + ''.join(f' ({note})' for note in notes)
        )
    sources = [_open_file(file, notes, stack) for file in files]
    _compare(metadata, sources, notes)
    return sources


def _storage_files(path: Path, metadata: bag_metadata.Metadata, notes: list[str]) -> list[Path]:
    """Return the files of a bag: those that its metadata list if they are there, else all."""
    try:
        found = sorted(p for p in path.iterdir() if p.name.endswith(STORAGE_SUFFIXES))
    except OSError as error:
        raise UserError(f'{path}: cannot be read ({error.strerror})') from None
    regular = [file for file in found if file.is_file()]
    others = (file.name for file in found if file not in regular)
    notes += [f'{name} is no regular file and was left out' for name in others]
    # A packed file beside the same one unpacked is not read twice.
    regular = [f for f in regular if f.suffix != '.zstd' or f.with_suffix('') not in regular]
    if metadata.fault:
        notes.append(f'{metadata.fault}; files read one by one')
        return regular
    names = {file.name: file for file in regular}
    missing = [name for name in metadata.files if name not in names]
    if missing or not metadata.files:
        lists = f'it lists {missing[0]}, which is not there' if missing else 'it lists no file'
        notes.append(f'{bag_metadata.NAME} was ignored ({lists}); files read one by one')
        return regular
    listed = list(dict.fromkeys(metadata.files))
    notes += [
        f'{name} is not listed in {bag_metadata.NAME} and was not read'
        for name in names
        if name not in listed
    ]
    return [names[name] for name in listed]


def _compare(metadata: bag_metadata.Metadata, sources: list[_Source], notes: list[str]) -> None:
    """Let the metadata say how much there should be, or say that they lie."""
    if metadata.fault:
        return
    if any(source.losses.in_words() for source in sources):
        if len(sources) == 1 and sources[0].losses.declared is None and metadata.counts:
            sources[0].losses.declared = dict(metadata.counts)
        return
    held: Counter[str] = Counter()
    for source in sources:
        held.update({topic.name: topic.message_count for topic in source.topics})
    stated = metadata.counts
    for topic in sorted({*held, *stated}):
        if held[topic] != stated.get(topic, 0):
            notes.append(
                f'{bag_metadata.NAME} was ignored (it states {stated.get(topic, 0)} messages on '
                f'{topic}, the files hold {held[topic]})'
            )
            return


def _open_file(path: Path, notes: list[str], stack: ExitStack) -> _Source:
    check_regular(path)
    if path.suffix == '.zstd':
        unpacked = Path(stack.enter_context(TemporaryDirectory())) / path.stem
        if damage := unpack_file(path, unpacked):
            notes.append(damage)
        try:
            return _open_file(unpacked, notes, stack)
        except UserError as error:
            words = f' ({damage})' if damage else ''
            raise UserError(f'{error}{words}'.replace(str(unpacked), str(path))) from None
    try:
        return (McapFile if path.suffix == '.mcap' else SqliteFile)(path, stack)
    except OSError as error:
        raise UserError(f'{path}: cannot be read ({error.strerror})') from None


def _normal_type(name: str) -> str:
    """``sensor_msgs/Imu`` and ``sensor_msgs::msg::dds_::Imu_`` are ``sensor_msgs/msg/Imu``."""
    package, _, rest = name.replace('::', '/').partition('/')
    return f'{package}/msg/{rest.rpartition("/")[2].rstrip("_")}' if rest else name


@cache
def jazzy_types() -> Any:
    """Return the types, which nobody changes: their (de)serialisers are compiled once a process."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_JAZZY)


def messages_of(bag: Bag, types: Mapping[str, str]) -> Iterator[tuple[int, str, Any]]:
    """Yield log time [ns], topic and message of topics with their types; damaged ones left out.

    A message is a `Message`, of types that the estimator does not hear one of rosbags.
    """
    for log_time, topic, data in bag.messages(tuple(types)):
        try:
            message = _message(types[topic], data)
        except DamagedMessageError:
            continue
        yield log_time, topic, message


def _message(kind: str, data: bytes) -> Any:
    if kind in TYPES:
        return unpack(kind, data)
    try:
        return jazzy_types().deserialize_cdr(data, kind)
    except Exception as error:  # the library lets many kinds through on damaged bytes
        raise DamagedMessageError(str(error)) from None
