# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Messages of a rosbag2 SQLite file, whole or damaged, in the order of their log times.

Only the table of messages is read, row by row; no index of the file is relied on. Where a page is
damaged the rows behind it are looked for.
"""

from __future__ import annotations

import shutil
import sqlite3
from array import array
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from urllib.parse import quote

import numpy as np

from wheel_terra_estimator.bags.limits import LIMITS, Limits
from wheel_terra_estimator.bags.losses import Losses
from wheel_terra_estimator.bags.raw_messages import RawMessage, Topic
from wheel_terra_estimator.errors import UserError

_LAST_ROW = 2**63 - 1
# Damaged text may stand in the library's own message, which is decoded as UTF-8.
_UNREADABLE = (sqlite3.Error, UnicodeDecodeError, MemoryError, OverflowError)
_MOST_GAPS = 100  # in the numbers of the rows that damage explains
_ONE_BY_ONE = 1000  # numbers tried behind damage before the search takes longer steps


class SqliteFile:
    """One ``.db3`` file; attributes as of `McapFile`.

    Raises
    ------
    UserError
        It is no rosbag2 file, or so damaged that SQLite cannot find its tables.
    """

    def __init__(self, path: Path, stack: ExitStack, limits: Limits = LIMITS) -> None:
        self.path = path
        self.losses = Losses()
        self._limits = limits
        self._connection = self._open(stack)
        self._number = array('q')  # of the row, and its log time: only where the order differs
        self._time = array('q')
        self._ordered = True
        self._size = 0  # of all messages [byte]
        try:
            described = self._read_topics()
        except _UNREADABLE as error:
            raise UserError(
                f'{path}: cannot be read ({error}); try `sqlite3 {path.name} .recover`'
            ) from None
        self._topic = {number: topic for number, (topic, _) in described.items()}
        self._damaged_rows = 0
        counts = self._survey()
        self.topics = [
            Topic(topic, kind, counts[number]) for number, (topic, kind) in described.items()
        ]
        for topic in self.topics:
            found = self.losses.recovered.get(topic.name, 0)
            self.losses.recovered[topic.name] = found + topic.message_count
        unknown = sum(count for number, count in counts.items() if number not in described)
        if unknown:
            self.losses.left_out.append(f'{unknown} messages of topics that are not described')
        if self._damaged_rows:
            self.losses.left_out.append(f'{self._damaged_rows} rows that are no messages left out')

    def notes(self) -> list[str]:
        """Return what is wrong with the file."""
        return self.losses.in_words(self.path.name)

    def messages(self, topics: Collection[str]) -> Iterator[RawMessage]:
        """Yield the messages of some topics in the order of their log times."""
        wanted = {number: name for number, name in self._topic.items() if name in topics}
        if self._ordered:
            fetch = self._in_rows()
        elif self.losses.spans and self._size <= self._limits.held:
            # A row on a damaged page need not be found by its number.
            fetch = iter(sorted(self._in_rows(), key=lambda row: row[1]))
        else:
            fetch = self._by_number()
        for topic, time, data in fetch:
            if topic in wanted:
                yield RawMessage(time, wanted[topic], data)

    def _open(self, stack: ExitStack) -> sqlite3.Connection:
        """Open the file without writing to its folder, its write-ahead log included."""
        path = self.path
        log = path.with_name(f'{path.name}-wal')
        immutable = '&immutable=1'
        if log.is_file() and log.stat().st_size:
            # The newest messages are in the log; SQLite writes beside a file that has one.
            folder = Path(stack.enter_context(TemporaryDirectory()))
            try:
                for file in (path, log):
                    shutil.copyfile(file, folder / file.name)
            except OSError as error:
                raise UserError(f'{path}: cannot be copied ({error.strerror})') from None
            path, immutable = folder / path.name, ''
        try:
            connection = sqlite3.connect(
                f'file:{quote(str(path.absolute()))}?mode=ro{immutable}', uri=True
            )
        except sqlite3.Error as error:
            raise UserError(f'{self.path}: cannot be read ({error})') from None
        stack.callback(connection.close)
        connection.text_factory = bytes  # names may be damaged
        return connection

    def _read_topics(self) -> dict[int, tuple[str, str]]:
        """Return number -> name, type."""
        run = self._connection.execute
        run('PRAGMA trusted_schema=OFF')
        run('PRAGMA writable_schema=ON')  # else a file that is cut off is refused as a whole
        tables = {
            name: text or b''
            for name, text in run("SELECT name, sql FROM sqlite_master WHERE type = 'table'")
        }
        for table in (b'topics', b'messages'):
            if table not in tables or b'virtual' in tables[table].lower()[:32]:
                raise sqlite3.DatabaseError(f'no table {table.decode()}')
        found = {}
        text = 'SELECT id, id, name, type FROM topics'
        rows = _Table(self._connection, text, _is_topic, self._note_gap).rows()
        for number, name, kind in rows:
            if _is_topic((number, name, kind)):
                found[number] = (name.decode('utf-8', 'replace'), kind.decode('utf-8', 'replace'))
        return found

    def _survey(self) -> Counter[int]:
        """Count the rows of each topic, find damage and learn whether rows stand in time order."""
        counts: Counter[int] = Counter()
        last = -1
        text = 'SELECT id, id, topic_id, timestamp, length(data), typeof(data) FROM messages'
        rows = _Table(self._connection, text, _is_survey_row, self._note_gap).rows()
        for number, topic, time, size, kind in rows:
            if not (_is_message(topic, time) and kind == b'blob' and size <= self._limits.chunk):
                self._damaged_rows += 1
                continue
            counts[topic] += 1
            self._ordered = self._ordered and time >= last
            last = time
            self._size += size
            self._number.append(number)
            self._time.append(time)
            losses = self.losses
            losses.start = time if losses.start is None else min(losses.start, time)
            losses.last = time if losses.last is None else max(losses.last, time)
        self._note_missing_numbers()
        if self._ordered:
            self._number = self._time = array('q')
        return counts

    def _note_missing_numbers(self) -> None:
        """Find rows that SQLite does not miss: their page is left out where the pages are listed.

        Recorders number rows without a gap. Many gaps are no damage: rows were taken out.
        """
        number, time = np.asarray(self._number), np.asarray(self._time)
        order = np.argsort(number, kind='stable')
        number, time = number[order], time[order]
        gaps = np.flatnonzero(np.diff(number) > 1)
        if len(gaps) > _MOST_GAPS:
            return
        for gap in gaps.tolist():
            start, end = sorted(time[gap : gap + 2].tolist())
            self.losses.spans.setdefault(int(number[gap]), (start, end))

    def _note_gap(self, number: int) -> None:
        """Remember that rows behind a number cannot be read; the log times around say when."""
        time = self._time[-1] if self._time else None
        # Looked through again behind a jump of numbers, a place keeps its time.
        self.losses.spans.setdefault(number, None if time is None else (time, time))

    def _in_rows(self) -> Iterator[tuple[int, int, bytes]]:
        text = (
            'SELECT id, topic_id, timestamp, typeof(data), '
            f'CASE WHEN length(data) <= {self._limits.chunk} THEN data END FROM messages'
        )
        for topic, time, kind, data in _Table(self._connection, text, _is_data_row).rows():
            if _is_message(topic, time) and kind == b'blob' and data is not None:
                yield topic, time, data

    def _by_number(self) -> Iterator[tuple[int, int, bytes]]:
        numbers = np.asarray(self._number)[np.argsort(np.asarray(self._time), kind='stable')]
        run = self._connection.execute
        for number in numbers.tolist():
            try:
                row = run(
                    'SELECT topic_id, timestamp, data FROM messages WHERE id = ?', (number,)
                ).fetchone()
            except _UNREADABLE:
                continue
            if row is not None and _is_message(row[0], row[1]) and isinstance(row[2], bytes):
                yield row


def _is_message(topic: Any, time: Any) -> bool:
    return isinstance(topic, int) and isinstance(time, int) and time >= 0


def _is_topic(row: tuple[Any, ...]) -> bool:
    number, name, kind = row
    return isinstance(name, bytes) and isinstance(kind, bytes) and isinstance(number, int)


def _is_survey_row(row: tuple[Any, ...]) -> bool:
    _, topic, time, _, kind = row
    return _is_message(topic, time) and kind == b'blob'


def _is_data_row(row: tuple[Any, ...]) -> bool:
    topic, time, kind, _ = row
    return _is_message(topic, time) and kind == b'blob'


@dataclass
class _Table:
    """A table whose rows are read in the order of their numbers, those behind damage too.

    Attributes
    ----------
    connection : sqlite3.Connection
        The file.
    text : str
        A ``SELECT`` whose first column is the number of the row; `rows` leaves it out.
    is_whole : callable
        Whether the other columns can be a row: the number of another one may be damaged as well,
        so nothing is concluded from it.
    on_gap : callable
        Told the last number before each damage.
    """

    connection: sqlite3.Connection
    text: str
    is_whole: Callable[[tuple[Any, ...]], bool]
    on_gap: Callable[[int], None] = lambda number: None

    def rows(self) -> Iterator[tuple[Any, ...]]:
        """Yield the rows."""
        # A damaged number may be too great: what it seems to jump over is looked for afterwards.
        jumped = [(-1, _LAST_ROW)]
        while jumped:
            yield from self._between(*jumped.pop(), jumped)

    def _between(
        self, last: int, end: int, jumped: list[tuple[int, int]]
    ) -> Iterator[tuple[Any, ...]]:
        """Yield the rows behind number ``last`` and before ``end``; note where numbers jump."""
        run = self.connection.execute
        text = f'{self.text} WHERE id > ? AND id < ? ORDER BY id'
        while True:
            jump: tuple[int, int] | None = None
            try:
                for row in run(text, (last, end)):
                    if self.is_whole(row[1:]):
                        if row[0] > last + 1:
                            jump = last, row[0]
                        last = row[0]
                    yield row[1:]
                return
            except _UNREADABLE:
                pass
            if jump:
                jumped.append(jump)
            # The cursor runs ahead: what stands before the damage comes one by one.
            while (found := self._row(last + 1, end)) is not None:
                if found[0] > last + 1:
                    jumped.append((last, found[0]))
                last = found[0]
                yield found[1:]
            self.on_gap(last)
            behind = self._number_behind(last, end)
            if behind is None:
                return
            jumped.append((last, behind))
            last = behind - 1

    def _row(self, number: int, end: int) -> tuple[Any, ...] | None:
        """Return the first row from a number on; None if none is there, or it cannot be read."""
        text = f'{self.text} WHERE id >= ? AND id < ? ORDER BY id LIMIT 1'
        try:
            cursor = self.connection.execute(text, (number, end))
            found: tuple[Any, ...] | None = cursor.fetchone()
        except _UNREADABLE:
            return None
        return found if found is not None and self.is_whole(found[1:]) else None

    def _number_behind(self, last: int, end: int) -> int | None:
        """Return the number of the first row behind damage that can be read, None without one."""
        # Rows between two damaged pages would be jumped over: at first no number is left out.
        for number in range(last + 2, min(last + 2 + _ONE_BY_ONE, end)):
            if (found := self._row(number, end)) is not None:
                return int(found[0])
        low, step = last + 1 + _ONE_BY_ONE, 1  # the row from `low` on cannot be read
        while low + step < end and (found := self._row(low + step, end)) is None:
            low += step
            step *= 2
        if low + step >= end or found is None:
            return None
        high, number = low + step, int(found[0])
        while high - low > 1:
            middle = (low + high) // 2
            nearer = self._row(middle, end)
            if nearer is None:
                low = middle
            else:
                high, number = middle, int(nearer[0])
        return number
