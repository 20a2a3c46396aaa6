# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Messages of an MCAP file, whole or damaged, in the order of their log times.

A file is a number of pieces: chunks, or stretches of messages outside of chunks. They come from the
index of a summary whose checksum is right, else from a survey of the whole file, in which behind
damage the next record is looked for. A piece is held only while its messages are due.
"""

from __future__ import annotations

import heapq
import mmap
import re
from bisect import bisect_left
from collections import Counter, defaultdict
from collections.abc import Collection, Iterator
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from itertools import accumulate
from pathlib import Path
from typing import Any, NamedTuple
from zlib import crc32

from wheel_terra_estimator.bags.salvage import RawMessage, Topic, limits
from wheel_terra_estimator.bags.salvage import mcap_records as mcap
from wheel_terra_estimator.bags.salvage.compression import bomb, unpack
from wheel_terra_estimator.bags.salvage.limits import MEGABYTE, in_words
from wheel_terra_estimator.bags.salvage.losses import Losses
from wheel_terra_estimator.errors import UserError

_FOOTER = mcap.HEAD + 20 + len(mcap.MAGIC)  # [byte], with the closing magic
_IN_CHUNK = (mcap.SCHEMA, mcap.CHANNEL, mcap.MESSAGE)
_LONGEST_STRETCH = 4 * MEGABYTE  # of messages outside of chunks that are read at once
_GAP_WORK = 2**14  # what the search in or behind damage costs, in bytes unpacked
_FORGET_AFTER = 32 * MEGABYTE  # of the file that was looked at
# Votes of a copy of a definition, by where it stands:
_SOUND = 100  # in a chunk whose checksum is right: no number of others outvotes it
_UNPACKED = 3  # in a compressed chunk without checksum that unpacked without an error
_PLAIN = 2
_DAMAGED = 1  # in a chunk whose checksum is wrong, or that cannot be unpacked to its end
_TOPIC = re.compile(r'[/~A-Za-z_][A-Za-z0-9_/~{}.-]*')
_TYPE = re.compile(r'[A-Za-z][A-Za-z0-9_]*(/|::)[A-Za-z0-9_/:.-]+')


@dataclass
class Piece:
    """A chunk (``head`` given) or a stretch of messages; log times in ns."""

    begin: int
    end: int
    head: mcap.ChunkHead | None
    start: int
    last: int
    channels: frozenset[int] | None = None  # None: may be any
    listed: int = 0  # messages that the index behind a chunk lists; 0: there is none


class Content(NamedTuple):
    """A piece as it stands in the file, unpacked; ``damage`` in words, empty if there is none."""

    data: bytes
    damage: str
    sound: bool  # a checksum is there and right
    wrong_checksum: bool


@dataclass
class Reading:
    """What one pass over a piece found."""

    counts: Counter[int] = field(default_factory=Counter)  # messages by channel
    start: int = mcap.LATEST  # log times [ns]
    last: int = 0
    definitions: list[mcap.Record] = field(default_factory=list)
    lost_bytes: int = 0
    # Log times between which a gap lies; None: before the first, behind the last message.
    lost_between: list[tuple[int | None, int | None]] = field(default_factory=list)
    rows: list[Row] = field(default_factory=list)


Row = tuple[int, int, int, bytes]
"""Log time [ns], place in the file, channel and data of a message."""

_ROW_SIZE = 250  # memory that a row takes beside its data [byte]


class McapFile:
    """One ``.mcap`` file."""

    def __init__(self, path: Path, stack: ExitStack) -> None:
        self.path = path
        self.losses = Losses(path.name)
        self._pieces: list[Piece] = []
        self._definitions = _Definitions()
        self._counts: Counter[int] = Counter()
        self._statistics: dict[int, int] | None = None  # messages by channel, as the file states
        self._touched = 0
        self._work = 0  # [byte] unpacked and looked at in this pass
        self._size = path.stat().st_size
        self._map = self._open(stack)
        if not self._size:
            self.losses.state = 'is empty'
        elif self._map[: len(mcap.MAGIC)] != mcap.MAGIC and not self._looks_like_one():
            self.losses.state = 'does not begin as an MCAP file'
        elif not self._read_index():
            self._survey()
        self.channels = self._definitions.channels()
        self.losses.left_out += self._definitions.undecided()
        if self._pieces:
            self.losses.start = min(piece.start for piece in self._pieces)
            self.losses.last = max(piece.last for piece in self._pieces)
        self._count_topics()

    def messages(self, topics: Collection[str]) -> Iterator[RawMessage]:
        """Yield the messages of some topics in the order of their log times."""
        self._work = 0
        wanted = {number: topic for number, (topic, _) in self.channels.items() if topic in topics}
        counts = Counter(dict.fromkeys(wanted.values(), 0))
        for log_time, _, channel, data in self._merged(frozenset(wanted)):
            topic = wanted[channel]
            counts[topic] += 1
            yield RawMessage(log_time, topic, data)
        self.losses.recovered.update(counts)

    def _open(self, stack: ExitStack) -> mcap.Buffer:
        if not self._size:
            return b''
        file = stack.enter_context(self.path.open('rb'))
        found = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        stack.callback(_close, found)
        return found

    def _looks_like_one(self) -> bool:
        """Return whether a file with damaged first bytes has the end or the records of MCAP."""
        if self._map[-len(mcap.MAGIC) :] == mcap.MAGIC:
            return True
        near = mcap.Possible(opcodes=(mcap.CHUNK, mcap.SCHEMA, mcap.CHANNEL))
        end = min(self._size, 2 * MEGABYTE)
        return any(isinstance(item, mcap.Record) for item in mcap.records(self._map, 0, end, near))

    # --- The way of a whole file: by its index. ---

    def _read_index(self) -> bool:
        """Take pieces and channels from the summary; False unless it is consistent."""
        content = self._map
        foot = self._size - _FOOTER
        if foot < len(mcap.MAGIC) or content[-len(mcap.MAGIC) :] != mcap.MAGIC:
            return False
        if content[foot : foot + mcap.HEAD] != b'\x02' + (20).to_bytes(8, 'little'):
            return False
        begin = int.from_bytes(content[foot + 9 : foot + 17], 'little')
        checksum = int.from_bytes(content[foot + 25 : foot + 29], 'little')
        if not checksum or not len(mcap.MAGIC) < begin <= foot:
            return False
        if crc32(content[begin : foot + 25]) != checksum:
            return False
        definitions, pieces = _Definitions(), []
        counts: dict[int, int] | None = None
        for item in mcap.records(content, begin, foot, mcap.Possible()):
            try:
                if isinstance(item, mcap.Gap):
                    return False
                definitions.add(content, item)
                if item.opcode == mcap.CHUNK_INDEX:
                    pieces.append(self._indexed_piece(item))
                elif item.opcode == mcap.STATISTICS:
                    counts = mcap.channel_counts(content, item)
            except ValueError:
                return False
        if counts is None or (any(counts.values()) and not pieces):
            return False
        self._definitions, self._pieces, self._counts = definitions, pieces, Counter(counts)
        self._declare(counts)
        return True

    def _indexed_piece(self, record: mcap.Record) -> Piece:
        begin, end, channels = mcap.indexed_chunk(self._map, record)
        head = mcap.chunk_head(self._map, begin, self._size)
        if head is None or head.begin + head.packed != end:
            raise ValueError('the index points to no chunk')
        return Piece(begin, end, head, head.start, head.end, channels)

    # --- The way of every other file: from front to end. ---

    def _survey(self) -> None:
        content = self._map
        closed = content[-len(mcap.MAGIC) :] == mcap.MAGIC
        begin = len(mcap.MAGIC) if content[: len(mcap.MAGIC)] == mcap.MAGIC else 0
        end = self._size - len(mcap.MAGIC) if closed and self._size > begin else self._size
        if not closed:
            self.losses.state = 'was not closed'
        gaps: list[mcap.Gap] = []
        self._take_records(begin, end, gaps)
        damaged = []
        for piece in self._pieces:  # grows
            if not self._count(piece, again=False):
                damaged.append(piece)
                self._look_inside(piece, gaps)
        self._pieces.sort(key=lambda piece: piece.begin)
        for piece in damaged:  # now every channel is known
            self._count(piece, again=True)
        self._pieces = [piece for piece in self._pieces if piece.start <= piece.last]
        if any(piece.head for piece in self._pieces):
            # Recorders put messages into chunks or do not: these have lost the head of theirs.
            loose = (piece for piece in self._pieces if not piece.head)
            gaps += [mcap.Gap(piece.begin, piece.begin) for piece in loose]
        self._add_gaps(gaps)
        if self._statistics is not None:
            self._declare(self._statistics)

    def _take_records(self, begin: int, end: int, gaps: list[mcap.Gap]) -> None:
        """Note what stands between two places, and the gaps."""
        content = self._map
        possible = mcap.Possible(longest=limits.CHUNK)
        for item in mcap.records(content, begin, end, possible):
            self._forget(item.end - item.begin)
            if isinstance(item, mcap.Gap):
                self._add_work(_GAP_WORK)
                gaps.append(item)
            elif item.opcode == mcap.CHUNK:
                self._add_chunk(item)
            elif item.opcode == mcap.MESSAGE:
                self._add_loose(item)
            elif item.opcode == mcap.MESSAGE_INDEX:
                self._add_message_index(item, gaps)
            else:
                try:
                    if item.opcode == mcap.STATISTICS:
                        self._statistics = mcap.channel_counts(content, item)
                    self._definitions.add(content, item)
                except ValueError:
                    gaps.append(mcap.Gap(item.begin, item.end))

    def _look_inside(self, piece: Piece, gaps: list[mcap.Gap]) -> None:
        """Find what a packed chunk seems to hold that reaches too far, as it lost bytes."""
        if piece.head is None or not piece.head.codec or not self._content(piece).damage:
            return
        at = mcap.next_outside(self._map, piece.head.begin, piece.end, self._size)
        if at < piece.end:
            end, piece.end, piece.listed = piece.end, at, 0
            self._take_records(at, end, gaps)

    def _add_chunk(self, record: mcap.Record) -> None:
        at = record.begin - mcap.HEAD
        head = mcap.chunk_head(self._map, at, self._size)
        assert head is not None
        if head.begin + head.packed > record.end:
            self._add_work(_GAP_WORK)
        self._pieces.append(Piece(at, record.end, head, head.start, head.end))

    def _add_message_index(self, record: mcap.Record, gaps: list[mcap.Gap]) -> None:
        """Add to what the last chunk should hold; an index of other messages is a damage."""
        head = self._pieces[-1].head if self._pieces else None
        try:
            times = mcap.indexed_times(self._map, record)
        except ValueError:
            times = [0]
        if head is None or not all(head.start <= time <= head.end for time in times):
            gaps.append(mcap.Gap(record.begin, record.end))
        else:
            self._pieces[-1].listed += len(times)

    def _add_loose(self, record: mcap.Record) -> None:
        """Lengthen the last stretch of messages, or begin a new one."""
        time = record.log_time
        at = record.begin - mcap.HEAD
        last = self._pieces[-1] if self._pieces else None
        if (
            last is not None
            and last.head is None
            and last.end == at
            and at - last.begin < _LONGEST_STRETCH
        ):
            last.end = record.end
            last.start, last.last = min(last.start, time), max(last.last, time)
        else:
            self._pieces.append(Piece(at, record.end, None, time, time))

    def _count(self, piece: Piece, again: bool) -> bool:
        """Count the messages of a piece and take its definitions.

        Returns False if the piece is damaged and has to be read again when all channels are known.
        """
        content = self._content(piece)
        reading = self._read(piece, content)
        whole = not (reading.lost_bytes or content.damage or content.wrong_checksum)
        if not again:
            for record in reading.definitions:
                try:
                    self._definitions.add(content.data, record, _votes(piece, content))
                except ValueError:
                    whole = False
            if not whole:
                return False
        self._counts += reading.counts
        self._note_damage(piece, content, reading)
        if piece.listed and piece.listed != reading.counts.total():
            self.losses.spans.setdefault(piece.begin, _span(piece, reading.start, reading.last))
        # The index and the head of a chunk may lie; its messages do not.
        piece.start, piece.last = reading.start, reading.last
        return True

    def _add_gaps(self, gaps: list[mcap.Gap]) -> None:
        """Report the log times between which pieces are missing."""
        begins = [piece.begin for piece in self._pieces]
        latest = list(accumulate((piece.last for piece in self._pieces), max))
        earliest = list(accumulate((piece.start for piece in reversed(self._pieces)), min))[::-1]
        for gap in gaps:
            behind = bisect_left(begins, gap.begin)
            before = latest[behind - 1 : behind] if behind else []
            times = [*before, *earliest[behind : behind + 1]]
            self.losses.spans[gap.begin] = (times[0], max(times)) if times else None

    # --- Reading pieces. ---

    def _merged(self, wanted: frozenset[int]) -> Iterator[Row]:
        """Yield the messages of some channels of all pieces in order."""
        waiting = sorted(
            (p for p in self._pieces if p.channels is None or p.channels & wanted),
            key=lambda p: (p.start, p.begin),
        )
        heap: list[Row] = []
        held = 0  # [byte]
        for piece in waiting:
            while heap and heap[0][0] < piece.start:
                row = heapq.heappop(heap)
                held -= _size(row)
                yield row
            content = self._content(piece)
            reading = self._read(piece, content, wanted, limits.HELD - held)
            self._note_damage(piece, content, reading)
            for row in reading.rows:
                heapq.heappush(heap, row)
                held += _size(row)
        while heap:
            yield heapq.heappop(heap)

    def _content(self, piece: Piece) -> Content:
        """Return the bytes of a piece; a copy, so that nothing of the file stays in memory."""
        head = piece.head
        self._forget(piece.end - piece.begin)
        if head is None:
            return Content(self._map[piece.begin : piece.end], '', False, False)
        packed = self._map[head.begin : min(head.begin + head.packed, piece.end)]
        data, damage = unpack(head.codec, packed, head.size)
        self._add_work(len(packed) + len(data))
        right = bool(head.checksum) and not damage and crc32(data) == head.checksum
        return Content(data, damage, right, bool(head.checksum) and not damage and not right)

    def _read(
        self, piece: Piece, content: Content, wanted: Collection[int] = (), allowed: int = 0
    ) -> Reading:
        """Read the records of a piece.

        ``wanted``: channels whose messages are kept. ``allowed``: greatest memory that they may
        take [byte].
        """
        known = () if content.sound else self._definitions.numbers()
        opcodes = (mcap.MESSAGE,) if piece.head is None else _IN_CHUNK
        possible = mcap.Possible(opcodes, known)
        found = self._pass(piece.begin, content.data, possible, wanted, allowed)
        self._add_work(_ROW_SIZE * found.counts.total())
        return found

    def _pass(
        self,
        place: int,
        data: bytes,
        possible: mcap.Possible,
        wanted: Collection[int],
        allowed: int,
    ) -> Reading:
        found = Reading()
        rows = found.rows
        counts: dict[int, int] = defaultdict(int)
        start, last = found.start, found.last
        time: int | None = None
        gap_after: tuple[int | None] | None = None
        for item in mcap.records(data, 0, len(data), possible):
            if isinstance(item, mcap.Gap):
                found.lost_bytes += item.end - item.begin
                self._add_work(_GAP_WORK)
                gap_after = gap_after or (time,)
            elif item.opcode == mcap.MESSAGE:
                _, head, end, channel, time = item
                begin = head + mcap.MESSAGE_HEAD
                counts[channel] += 1
                start = time if time < start else start
                last = time if time > last else last
                if gap_after:
                    found.lost_between.append((gap_after[0], time))
                    gap_after = None
                if channel in wanted:
                    rows.append((time, place + begin, channel, data[begin:end]))
                    allowed -= end - begin + _ROW_SIZE
                    if allowed < 0:
                        raise UserError(
                            f'{self.path}: more than {in_words(limits.HELD)} of messages would be '
                            'held to bring them into order; sort it first (ros2 bag convert)'
                        )
            else:
                found.definitions.append(item)
        if gap_after:
            found.lost_between.append((gap_after[0], None))
        found.counts.update(counts)
        found.start, found.last = start, last
        return found

    def _note_damage(self, piece: Piece, content: Content, reading: Reading) -> None:
        losses = self.losses
        if content.wrong_checksum:
            losses.doubtful[piece.begin] = sum(reading.counts.values())
        left_out = f'{content.damage} and was left out'
        if 'above' in content.damage and left_out not in losses.left_out:
            losses.left_out.append(left_out)
        between = list(reading.lost_between)
        if content.damage:
            between.append((reading.last if reading.counts else None, None))
        for number, times in enumerate(between):
            losses.spans[piece.begin + number] = _span(piece, *times)

    def _add_work(self, count: int) -> None:
        self._work += count
        if self._work > limits.work(self._size):
            raise bomb(self.path)

    def _forget(self, count: int) -> None:
        """Let go of the pages of the file that were looked at: they count as memory of ours."""
        self._touched += count
        if self._touched > _FORGET_AFTER and hasattr(mmap, 'MADV_DONTNEED'):
            assert isinstance(self._map, mmap.mmap)
            self._map.madvise(mmap.MADV_DONTNEED)
            self._touched = 0

    # --- Topics. ---

    def _declare(self, counts: dict[int, int]) -> None:
        declared: Counter[str] = Counter()
        for number, (topic, _) in self._definitions.channels().items():
            declared[topic] += counts.get(number, 0)
        self.losses.declared = declared

    def _count_topics(self) -> None:
        counts: Counter[str] = Counter()
        types: dict[str, Counter[str]] = defaultdict(Counter)
        for number, (topic, kind) in self.channels.items():
            counts[topic] += self._counts[number]
            types[topic][kind] += 1 + self._counts[number]
        # With the number of messages that can be read (with an index: that it states)
        self.topics = [
            Topic(topic, types[topic].most_common(1)[0][0], counts[topic]) for topic in counts
        ]
        unknown = sum(n for number, n in self._counts.items() if number not in self.channels)
        if unknown:
            self.losses.left_out.append(f'{unknown} messages of channels that are not described')
        if all(piece.channels is None for piece in self._pieces):  # no index
            self.losses.recovered.update(counts)


class _Definitions:
    """Schemas and channels, gathered from all copies in a file; the majority decides."""

    def __init__(self) -> None:
        self._schemas: dict[int, Counter[str]] = defaultdict(Counter)
        self._channels: dict[int, Counter[tuple[int, str]]] = defaultdict(Counter)

    def add(self, content: Any, record: mcap.Record, votes: int = _PLAIN) -> None:
        """Count a definition; ``ValueError`` if it is damaged."""
        if record.opcode == mcap.SCHEMA:
            number, name = mcap.schema(content, record)
            if _TYPE.fullmatch(name):
                self._schemas[number][name] += votes
        elif record.opcode == mcap.CHANNEL:
            number, schema, topic = mcap.channel(content, record)
            if _TOPIC.fullmatch(topic):
                self._channels[number][schema, topic] += votes

    def numbers(self) -> frozenset[int]:
        """Return the identifiers of the known channels."""
        return frozenset(self._channels)

    def channels(self) -> dict[int, tuple[str, str]]:
        """Return identifier -> topic, type."""
        found = {}
        for number, votes in self._channels.items():
            schema, topic = _most(votes)
            names = self._schemas.get(schema)
            found[number] = (topic, _most(names) if names else '')
        return found

    def undecided(self) -> list[str]:
        """Return the channels whose copies differ while no checksum decides which is right.

        Flipped bits may leave packed bytes that still unpack, so a majority is no proof.
        """
        found = []
        for number, votes in sorted(self._channels.items()):
            topics = sorted({topic for _, topic in votes})
            if len(topics) > 1 and max(votes.values()) < _SOUND:
                found.append(f'copies of channel {number} differ: {" or ".join(topics)}')
        return found


def _most(votes: Counter[Any]) -> Any:
    return max(votes, key=votes.__getitem__)


def _votes(piece: Piece, content: Content) -> int:
    """Return how much a definition in a piece is to be relied on."""
    if content.sound:
        return _SOUND
    if content.damage or content.wrong_checksum:
        return _DAMAGED
    return _UNPACKED if piece.head is not None and piece.head.codec else _PLAIN


def _size(row: Row) -> int:
    return len(row[3]) + _ROW_SIZE


def _span(piece: Piece, first: int | None, last: int | None) -> tuple[int, int] | None:
    """Return the log times between which something is missing in a piece."""
    head = piece.head
    if head is not None and head.start <= head.end <= mcap.LATEST:
        first = head.start if first is None else first
        last = head.end if last is None else last
    if first is None or last is None:
        return None
    return first, max(first, last)


def _close(content: mmap.mmap) -> None:
    with suppress(BufferError):  # a search that was given up still looks at it
        content.close()
