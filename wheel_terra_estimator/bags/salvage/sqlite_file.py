# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Messages of a rosbag2 SQLite file, whole or damaged, in the order of their log times.

SQLite reads the file; rows on which it stops are passed by, one number after the other.
"""

from __future__ import annotations

import shutil
import sqlite3
from array import array
from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from urllib.parse import quote

import numpy as np

from wheel_terra_estimator.bags.salvage import RawMessage, Topic, limits
from wheel_terra_estimator.bags.salvage.losses import Losses
from wheel_terra_estimator.errors import UserError

# Damaged text may stand in the library's own message, which is decoded as UTF-8.
_UNREADABLE = (sqlite3.Error, UnicodeDecodeError, MemoryError, OverflowError)
_MOST_GAPS = 100  # in the numbers of the rows that damage explains
_MOST_PASSED = 100_000  # numbers that are tried behind damaged rows: only made-up files need more
_WIDENING = 100  # passed rows after which every second number is tried, twice as many: third, ...
_LARGEST_NUMBER = 2**63 - 1


class SqliteFile:
    """One ``.db3`` file; attributes as of `McapFile`.

    Raises UserError where it is no rosbag2 file, or none of its messages is left.
    """

    def __init__(self, path: Path, stack: ExitStack) -> None:
        self.losses = Losses(path.name)
        self._number = array('q')  # of the row, and its log time: only where the order differs
        self._time = array('q')
        self._topics: dict[int, tuple[str, str]] = {}  # number -> name and type
        # Anything may stand in the columns of a row, and is then no message.
        self._whole = (
            "typeof(topic_id) = 'integer' AND typeof(data) = 'blob' "
            "AND typeof(timestamp) = 'integer' AND timestamp >= 0 "
            f'AND length(data) <= {limits.CHUNK}'
        )
        try:
            fault = self._open(path, stack)
            counts = self._survey(fault)
        except _UNREADABLE as error:
            fault, counts = str(error), Counter[int]()
        if fault and not (self._topics and counts):
            raise UserError(
                f'{path}: SQLite finds no recording in it ({fault}); '
                'copy it again from where it was recorded, or: sqlite3 FILE .recover'
            )
        self.topics = [Topic(*it, counts[number]) for number, it in self._topics.items()]
        for topic in self.topics:
            found = self.losses.recovered.get(topic.name, 0)
            self.losses.recovered[topic.name] = found + topic.message_count
        if unknown := sum(n for number, n in counts.items() if number not in self._topics):
            self.losses.left_out.append(f'{unknown} messages of topics that are not described')

    def messages(self, topics: Collection[str]) -> Iterator[RawMessage]:
        """Yield the messages of some topics in the order of their log times."""
        wanted = {n: name for n, (name, _) in self._topics.items() if name in topics}
        for _, topic, time, data in self._rows():
            if topic in wanted:
                yield RawMessage(time, wanted[topic], data)

    def _rows(self) -> Iterator[tuple[Any, ...]]:
        if not self._number:
            yield from self._walk('data')
            return
        order = np.argsort(np.asarray(self._time), kind='stable')
        text = f'SELECT id, topic_id, timestamp, data FROM messages WHERE id = ? AND {self._whole}'
        for number in np.asarray(self._number)[order].tolist():
            yield from self._run(text, (number,))

    def _open(self, path: Path, stack: ExitStack) -> str:
        """Open the file and read its topics; return what SQLite finds wrong with it, if anything.

        Raises sqlite3.Error or another of `_UNREADABLE` where it holds no recording.
        """
        readable, logged = _with_log(path, stack)
        address = f'file:{quote(str(readable.absolute()))}?mode=ro'
        connection = sqlite3.connect(address + ('' if logged else '&immutable=1'), uri=True)
        stack.callback(connection.close)
        self._run = connection.execute
        self._run('PRAGMA trusted_schema=OFF')
        self._run('PRAGMA ignore_check_constraints=ON')
        self._run('PRAGMA writable_schema=ON')  # else a file that was cut off is refused
        for table in ('topics', 'messages'):
            kind = self._run(
                "SELECT sql FROM sqlite_master WHERE type='table' AND name=?", (table,)
            )
            if 'virtual' in (kind.fetchone() or ('virtual',))[0].lower()[:32]:
                raise sqlite3.DatabaseError(f'no table {table}')
        try:
            fault = str(self._run('PRAGMA quick_check(1)').fetchone()[0]).splitlines()[-1]
        except _UNREADABLE as error:
            fault = str(error)
        with suppress(*_UNREADABLE):
            for number, name, kind in self._run('SELECT id, name, type FROM topics'):
                self._topics[number] = str(name), str(kind)
        if fault == 'ok':
            return ''
        with readable.open('rb') as file:
            pages = int.from_bytes(file.read(32)[28:], 'big')
        stated = pages * int(self._run('PRAGMA page_size').fetchone()[0])
        cut = not logged and stated > readable.stat().st_size
        self.losses.state = 'is cut off' if cut else 'is damaged'
        return fault

    def _walk(self, last_column: str) -> Iterator[tuple[Any, ...]]:
        """Yield number, topic, log time and another column of all messages, by number.

        Behind a row that cannot be read the next number is tried, after many of them wider steps.
        """
        text = (
            f'SELECT id, topic_id, timestamp, {last_column} FROM messages '
            f'WHERE id >= ? AND {self._whole} ORDER BY id'
        )
        begin = wanted = passed = 0  # begin: behind the last row that was read
        limit = ''
        while wanted < _LARGEST_NUMBER and passed < _MOST_PASSED:
            there = begin
            try:
                for row in self._run(text + limit, (wanted,)):
                    if row[0] < wanted:
                        raise sqlite3.DatabaseError('numbers of rows fall')
                    begin = wanted = row[0] + 1
                    yield row
                if begin == there or not limit:
                    return
                limit = ''
            except _UNREADABLE:
                if limit:
                    passed += 1
                    wanted = min(wanted + 1 + (wanted - begin) // _WIDENING, _LARGEST_NUMBER)
                limit = ' LIMIT 1'  # the library looks one row ahead, and loses the one before

    def _survey(self, fault: str) -> Counter[int]:
        """Count the messages of each topic and learn whether they stand in the order of time."""
        counts: Counter[int] = Counter()
        last, ordered = -1, True
        for number, topic, time, _ in self._walk('data' if fault else 'NULL'):
            counts[topic] += 1
            ordered = ordered and time >= last
            last = time
            self._number.append(number)
            self._time.append(time)
        if self._time:
            self.losses.start, self.losses.last = min(self._time), max(self._time)
        if fault:
            self._note_missing_numbers()
        elif others := self._run('SELECT count(*) FROM messages').fetchone()[0] - counts.total():
            self.losses.left_out.append(f'{others} rows that are not messages were skipped')
        if ordered:
            self._number = self._time = array('q')
        return counts

    def _note_missing_numbers(self) -> None:
        """Report the log times between which rows are missing; many gaps: rows were deleted.

        Recorders number the rows of a file from 1 on, without a gap.
        """
        time = np.asarray(self._time)
        gaps = np.flatnonzero(np.diff(np.asarray(self._number), prepend=0) > 1)
        for gap in gaps.tolist() if len(gaps) <= _MOST_GAPS else ():
            span = sorted(time[max(gap - 1, 0) : gap + 1].tolist())
            self.losses.spans[gap] = span[0], span[-1]


def _with_log(path: Path, stack: ExitStack) -> tuple[Path, bool]:
    """Return a file to be read and whether it has a write-ahead log: then both are copies."""
    log = path.with_name(f'{path.name}-wal')
    if not log.is_file() or not log.stat().st_size:
        return path, False
    # The newest messages are in the log; SQLite writes beside a file that has one.
    folder = Path(stack.enter_context(TemporaryDirectory()))
    try:
        for file in (path, log):
            shutil.copyfile(file, folder / file.name)
    except OSError as error:
        raise UserError(f'{path}: cannot be copied ({error.strerror})') from None
    return folder / path.name, True
