# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Messages of a rosbag2 SQLite file, whole or damaged, in the order of their log times.

A file in which SQLite finds no fault is read by SQLite; of another one the rows are found by their
own bytes (`sqlite_rows`).
"""

from __future__ import annotations

import mmap
import shutil
import sqlite3
from array import array
from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import ExitStack, closing, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from urllib.parse import quote

import numpy as np

from wheel_terra_estimator.bags.salvage.limits import LIMITS, Limits
from wheel_terra_estimator.bags.salvage.losses import Losses
from wheel_terra_estimator.bags.salvage.raw_messages import RawMessage, Topic
from wheel_terra_estimator.bags.salvage.sqlite_rows import find_rows
from wheel_terra_estimator.errors import UserError

# Damaged text may stand in the library's own message, which is decoded as UTF-8.
_UNREADABLE = (sqlite3.Error, UnicodeDecodeError, MemoryError, OverflowError)
_MOST_GAPS = 100  # in the numbers of the rows that damage explains
_Message = tuple[int, int, bytes]  # number of the topic, log time [ns], data


class SqliteFile:
    """One ``.db3`` file; attributes as of `McapFile`.

    Raises UserError where it is no rosbag2 file, or nothing of one is left.
    """

    def __init__(self, path: Path, stack: ExitStack, limits: Limits = LIMITS) -> None:
        self.path = path
        self.losses = Losses()
        readable, log = _with_log(path, stack)
        self._table: _WholeTable | _DamagedTable
        try:
            self._table = _WholeTable(readable, log, stack, limits, self.losses)
        except _UNREADABLE as error:
            self._table = _DamagedTable(readable, log, stack, limits, self.losses)
            if not (self._table.topics or self._table.counts):
                raise UserError(
                    f'{path}: cannot be read ({error}), and nothing of a recording is left in it; '
                    'copy it anew from where it was recorded'
                ) from None
        topics, counts = self._table.topics, self._table.counts
        self.topics = [Topic(*described, counts[number]) for number, described in topics.items()]
        for topic in self.topics:
            found = self.losses.recovered.get(topic.name, 0)
            self.losses.recovered[topic.name] = found + topic.message_count
        if unknown := sum(count for number, count in counts.items() if number not in topics):
            self.losses.left_out.append(f'{unknown} messages of topics that are not described')

    def notes(self) -> list[str]:
        """Return what is wrong with the file."""
        return self.losses.in_words(self.path.name)

    def messages(self, topics: Collection[str]) -> Iterator[RawMessage]:
        """Yield the messages of some topics in the order of their log times."""
        wanted = {n: name for n, (name, _) in self._table.topics.items() if name in topics}
        for topic, time, data in self._table.rows(wanted):
            yield RawMessage(time, wanted[topic], data)


def _with_log(path: Path, stack: ExitStack) -> tuple[Path, Path | None]:
    """Return a file to be read and its write-ahead log, if it has one: copies of both."""
    log = path.with_name(f'{path.name}-wal')
    if not log.is_file() or not log.stat().st_size:
        return path, None
    # The newest messages are in the log; SQLite writes beside a file that has one.
    folder = Path(stack.enter_context(TemporaryDirectory()))
    try:
        for file in (path, log):
            shutil.copyfile(file, folder / file.name)
    except OSError as error:
        raise UserError(f'{path}: cannot be copied ({error.strerror})') from None
    return folder / path.name, folder / log.name


class _WholeTable:
    """The messages as SQLite gives them.

    Raises sqlite3.Error or another of `_UNREADABLE` where the file is damaged, or holds no
    recording.
    """

    def __init__(
        self, path: Path, log: Path | None, stack: ExitStack, limits: Limits, losses: Losses
    ) -> None:
        self._number = array('q')  # of the row, and its log time: only where the order differs
        self._time = array('q')
        address = f'file:{quote(str(path.absolute()))}?mode=ro'
        connection = sqlite3.connect(address + ('' if log else '&immutable=1'), uri=True)
        stack.callback(connection.close)
        self._run = connection.execute
        self._run('PRAGMA trusted_schema=OFF')
        self._run('PRAGMA ignore_check_constraints=ON')
        if (fault := self._run('PRAGMA quick_check(1)').fetchone()[0]) != 'ok':
            raise sqlite3.DatabaseError(fault.splitlines()[-1])
        # Anything may stand in the columns of a row, and is then no message.
        self._whole = (
            "typeof(id) = 'integer' AND typeof(topic_id) = 'integer' AND typeof(data) = 'blob' "
            "AND typeof(timestamp) = 'integer' AND timestamp >= 0 "
            f'AND length(data) <= {limits.chunk}'
        )
        for table in ('topics', 'messages'):
            kind = self._run(
                "SELECT sql FROM sqlite_master WHERE type='table' AND name=?", (table,)
            )
            if 'virtual' in (kind.fetchone() or ('virtual',))[0].lower()[:32]:
                raise sqlite3.DatabaseError(f'no table {table}')
        # Number -> name and type
        self.topics = {
            number: (str(name), str(kind))
            for number, name, kind in self._run('SELECT id, name, type FROM topics')
        }
        self.counts = self._survey(losses)  # messages by number of the topic

    def rows(self, wanted: Collection[int]) -> Iterator[_Message]:
        """Yield the messages of some topics in the order of their log times."""
        text = f'SELECT topic_id, timestamp, data FROM messages WHERE {self._whole}'
        if self._number:
            found: Iterator[_Message]
            order = np.argsort(np.asarray(self._time), kind='stable')
            numbers = np.asarray(self._number)[order].tolist()
            found = (self._run(f'{text} AND id = ?', (n,)).fetchone() for n in numbers)
        else:
            found = iter(self._run(f'{text} ORDER BY id'))
        return (row for row in found if row[0] in wanted)

    def _survey(self, losses: Losses) -> Counter[int]:
        """Count the messages of each topic and learn whether they stand in the order of time."""
        counts: Counter[int] = Counter()
        last, ordered = -1, True
        text = f'SELECT id, topic_id, timestamp FROM messages WHERE {self._whole} ORDER BY id'
        for number, topic, time in self._run(text):
            counts[topic] += 1
            ordered = ordered and time >= last
            last = time
            self._number.append(number)
            self._time.append(time)
        if self._time:
            losses.start, losses.last = min(self._time), max(self._time)
        if ordered:
            self._number = self._time = array('q')
        others = self._run('SELECT count(*) FROM messages').fetchone()[0] - counts.total()
        if others:
            losses.left_out.append(f'{others} rows that are no messages left out')
        return counts


class _DamagedTable:
    """The messages that are found in the bytes of a file; attributes as of `_WholeTable`."""

    def __init__(
        self, path: Path, log: Path | None, stack: ExitStack, limits: Limits, losses: Losses
    ) -> None:
        self._content = b'' if not path.stat().st_size else _mapped(path, log, stack)
        self._rows = rows = find_rows(self._content, limits.chunk)
        self.topics = rows.topics
        numbers, counts = np.unique(rows.topic, return_counts=True)
        self.counts = Counter(dict(zip(numbers.tolist(), counts.tolist(), strict=True)))
        losses.state = 'is cut off' if rows.cut else 'is damaged'
        if len(rows.time):
            losses.start, losses.last = int(rows.time.min()), int(rows.time.max())
        if rows.given_up:
            losses.left_out.append('it looks made up: too many places where rows may begin')
        if rows.free_unknown:
            losses.left_out.append('deleted rows may be among them: the list of free pages is lost')
        self._note_missing_numbers(losses)

    def rows(self, wanted: Collection[int]) -> Iterator[_Message]:
        """Yield the messages of some topics in the order of their log times."""
        rows = self._rows
        for place in np.lexsort((rows.number, rows.time)).tolist():
            if (topic := int(rows.topic[place])) in wanted:
                yield topic, int(rows.time[place]), rows.data(self._content, place)

    def _note_missing_numbers(self, losses: Losses) -> None:
        """Say between which log times rows are missing; many gaps are rows that were taken out.

        Recorders number the rows of a file from 1 on, without a gap.
        """
        number, time = self._rows.number, self._rows.time
        gaps = np.flatnonzero(np.diff(number, prepend=0) > 1)
        if len(gaps) > _MOST_GAPS:
            return
        for gap in gaps.tolist():
            span = sorted(time[max(gap - 1, 0) : gap + 1].tolist())
            losses.spans[gap] = span[0], span[-1]


def _mapped(path: Path, log: Path | None, stack: ExitStack) -> mmap.mmap:
    """Return the bytes of a file, those of its log brought in and behind it."""
    if log:
        frames = log.read_bytes()
        with suppress(*_UNREADABLE), closing(sqlite3.connect(path)) as connection:
            connection.execute('PRAGMA wal_checkpoint(TRUNCATE)')
        with path.open('ab') as more:
            more.write(frames)
    file = stack.enter_context(path.open('rb'))
    return stack.enter_context(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ))
