# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Rows of a damaged rosbag2 SQLite file, found by their own bytes.

Neither the tree of pages nor their alignment is relied on: every place at which a row of the
tables ``messages`` or ``topics`` can begin is tried. A row states its size as a whole and column
by column; where both agree it is one. What an intact page no longer lists, or the file lists as
free, was deleted and is left out (format: https://www.sqlite.org/fileformat2.html).
"""

from __future__ import annotations

import math
import re
import struct
from array import array
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice, pairwise
from mmap import mmap
from typing import Any, NamedTuple, TypeAlias

import numpy as np

Buffer: TypeAlias = 'bytes | mmap'

MAGIC = b'SQLite format 3\0'
_USUAL_PAGE = 4096  # [byte]
_PAGE_SIZES = tuple(2**power for power in range(9, 17))  # that there are [byte]
_HEADER = 100  # of the file [byte]

_LEAF, _INTERIOR, _INDEX_LEAF, _INDEX_INTERIOR = 13, 5, 10, 2  # kinds of pages
_PAGE_HEAD = {_LEAF: 8, _INDEX_LEAF: 8, _INTERIOR: 12, _INDEX_INTERIOR: 12}  # [byte]
_FRAGMENTS = 60  # most bytes that are lost between the rows of a page
_INDEX_HEAD = 3  # of a row of the index: its length, the kinds of time and number [byte]

# Head of a row: its length, nothing for the number (which stands before the row), then the kinds
# of the columns: two whole numbers and a blob, or two texts and more.
_MESSAGE = range(5, 10), re.compile(rb'[\x01-\x06\x08\x09][\x01-\x06\x08\x09]')
_TOPIC = (
    range(4, 33),
    re.compile(rb'(?:[\x0f-\x7f]|[\x81-\x9f][\x00-\x7f])[\x0f-\x7f\x81-\x9f]'),
)
_BLOCK = 2**20  # that is searched at a time for the first two bytes of these [byte]
_NAME = re.compile(rb'[/~A-Za-z_][A-Za-z0-9_/~{}.-]*')
_TYPE = re.compile(rb'[A-Za-z][A-Za-z0-9_]*(/|::)[A-Za-z0-9_/:.-]+')
_INTEGERS = {1: 1, 2: 2, 3: 3, 4: 4, 5: 6, 6: 8, 8: 0, 9: 0}  # kind -> size [byte]
_SIZES = {0: 0, 7: 8, **_INTEGERS}
_BLOB, _TEXT = 12, 13  # kinds of empty ones; 2 more for each byte
_LONGEST_NAME = 1000  # of a topic or type [byte]
# Work that only made-up files ask for: places at which a row may begin, and rows, pages and links
# that are looked at to learn of a row whether it is listed, or how large a page is.
_FREE_STEPS, _BYTES_PER_STEP = 500_000, 32
_STEPS_TO_LEARN = 2_000_000
_PROBES = 50  # rows from which the size of a page is learnt

# How much speaks for a row: its bytes alone, the page that lists it, an intact page.
_FOUND, _LISTED, _SURE = 0, 1, 2


class _Row(NamedTuple):
    begin: int
    columns: int  # where their head begins
    number: int
    kinds: list[int]
    values: int  # where they begin
    size: int  # of the columns with their head [byte]


class _Page(NamedTuple):
    begin: int
    rows: frozenset[int]  # where those that it lists begin
    intact: bool


@dataclass
class Rows:
    """Messages that were found, in the order of their numbers."""

    # ``number``, ``topic``, ``time``, ``begin``, ``size``: numbers of the rows and of their topics,
    # log times [ns], where the data begin and their sizes [byte]
    number: Any
    topic: Any
    time: Any
    begin: Any
    size: Any
    # Where data begin -> bytes on the page of the row, begins of the pages on which they go on
    further: dict[int, tuple[int, tuple[int, ...]]]
    topics: dict[int, tuple[str, str]]  # number of a topic -> name and type
    usable: int
    # Whether deleted rows may be among them, as the list of free pages is damaged
    free_unknown: bool
    cut: bool  # whether the file is shorter than it states
    # Whether there was too much at which a row might begin, or be listed, to look at it all
    given_up: bool

    def data(self, content: Buffer, place: int) -> bytes:
        """Return the data of the message at a place in these arrays."""
        begin, size = int(self.begin[place]), int(self.size[place])
        here, pages = self.further.get(begin, (size, ()))
        found = bytes(content[begin : begin + here])
        for page in pages:
            found += content[page + 4 : page + 4 + min(size - len(found), self.usable - 4)]
        return found


def find_rows(content: Buffer, largest: int) -> Rows:
    """Find all messages of at most ``largest`` bytes, and the topics."""
    return _Search(content, largest).rows()


class _Search:
    def __init__(self, content: Buffer, largest: int) -> None:
        self._content = content
        self._largest = largest
        self._steps = _STEPS_TO_LEARN  # left
        self._phases = [0]  # begins of pages, modulo their size; first the one that fitted last
        self._looked_at: dict[int, _Page | None] = {}
        self._intact: set[int] = set()  # begins of intact pages with rows
        headed = content[: len(MAGIC)] == MAGIC
        stated = int.from_bytes(content[16:18], 'big')
        size = 65536 if stated == 1 else stated
        known = headed and size in _PAGE_SIZES
        self._size = size if known else self._learnt_size()
        reserved = content[20] if known else 0
        self._usable = self._size - (reserved if reserved <= 32 else 0)
        length = int.from_bytes(content[28:32], 'big') * self._size if headed else 0
        self._cut = len(content) < length
        # Where bytes are missing the pages behind stand elsewhere than their numbers say.
        self._shifts = sorted({0, len(content) - length}) if length else [0]
        self._free, self._free_unknown = self._free_pages(headed)

    def rows(self) -> Rows:
        """Return what is found."""
        most = _FREE_STEPS + len(self._content) // _BYTES_PER_STEP
        self._steps = most
        tried = 0
        found = array('q')  # columns: the first five of `Rows`, begin and end of the row, trust
        further = {}
        for at in islice(_heads(self._content, *_MESSAGE), most):
            tried += 1
            message = self._message(at)
            if message is not None:
                columns, pages = message
                found.extend(columns)
                if pages:
                    further[columns[3]] = pages
        given_up = tried == most or self._steps <= 0
        self._steps = _FREE_STEPS  # for the topics, which are few
        table = np.asarray(found, dtype=np.int64).reshape(-1, 8)
        table = self._kept(table, further)
        number, topic, time, begin, size = table[:, :5].T
        return Rows(
            number,
            topic,
            time,
            begin,
            size,
            further,
            self._topics(),
            self._usable,
            self._free_unknown,
            self._cut,
            given_up,
        )

    # --- Rows. ---

    def _message(
        self, at: int
    ) -> tuple[tuple[int, ...], tuple[int, tuple[int, ...]] | None] | None:
        """Return the columns of a message whose head may stand here, and where its data go on."""
        row = self._row(at)
        if row is None or len(row.kinds) != 4:
            return None
        _, topic_kind, time_kind, blob = row.kinds
        if blob < _BLOB or blob % 2 or (blob - _BLOB) // 2 > self._largest:
            return None
        time_begin = row.values + _INTEGERS[topic_kind]
        begin = time_begin + _INTEGERS[time_kind]
        topic, time = self._integer(row.values, topic_kind), self._integer(time_begin, time_kind)
        trust = self._trust(row.begin)
        if topic < 0 or time < 0 or trust is None:
            return None
        local = self._local(row.size)
        end = row.columns + local
        size = (blob - _BLOB) // 2
        pages: tuple[int, ...] | None = ()
        if local < row.size:
            pages = self._chain(end, row.size - local)
            end += 4
        if pages is None or end > len(self._content):
            return None
        further = (row.columns + local - begin, pages) if pages else None
        return (row.number, topic, time, begin, size, row.begin, end, trust), further

    def _row(self, at: int) -> _Row | None:
        """Return the row whose head stands at a place, None if the bytes do not agree."""
        content = self._content
        if at >= len(content):
            return None
        values = at + content[at]
        kinds, place, size = [], at + 1, content[at]
        while place < values <= len(content):
            kind, place = self._varint(place)
            size += (kind - _BLOB) // 2 if kind >= _BLOB else _SIZES.get(kind, 0)
            kinds.append(kind)
        if place != values:
            return None
        first = at - 1  # byte of the number
        while first > max(at - 8, 0) and content[first - 1] > 127:
            first -= 1
        stated = _encoded(size)
        begin = first - len(stated)
        if begin < 0 or content[begin:first] != stated or content[at - 1] > 127:
            return None
        return _Row(begin, at, self._varint(first)[0], kinds, values, size)

    def _columns(self, begin: int) -> int:
        """Return where the columns of a row begin, behind its size and number."""
        return self._varint(self._varint(begin)[1])[1]

    def _topics(self) -> dict[int, tuple[str, str]]:
        found: dict[int, tuple[int, tuple[str, str]]] = {}
        for at in islice(_heads(self._content, *_TOPIC), _FREE_STEPS):
            row = self._row(at)
            if row is None or len(row.kinds) < 3:
                continue
            sizes = [(kind - _TEXT) // 2 for kind in row.kinds[1:3] if kind % 2]
            if len(sizes) < 2 or max(sizes) > _LONGEST_NAME:
                continue
            middle = row.values + sizes[0]
            name, kind = self._content[row.values : middle], self._content[middle:][: sizes[1]]
            if _NAME.fullmatch(name) and _TYPE.fullmatch(kind):
                trust = self._trust(row.begin)
                if trust is not None and trust > found.get(row.number, (-1,))[0]:
                    found[row.number] = trust, (name.decode(), kind.decode())
        return {number: topic for number, (_, topic) in sorted(found.items())}

    def _kept(self, table: Any, further: dict[int, tuple[int, tuple[int, ...]]]) -> Any:
        """Return one row of each number, in their order, without those that reach into others."""
        begin, row, end, trust = table[:, 3], table[:, 5], table[:, 6], table[:, 7]
        keep = np.ones(len(table), dtype=bool)
        # The bytes of a row that lost some go on with those of the next one.
        keep[:-1] &= row[1:] >= end[:-1]
        pages = np.sort(np.asarray(list(self._intact), dtype=np.int64))
        if len(pages):
            next_page = np.append(pages, np.iinfo(np.int64).max)[
                np.searchsorted(pages, row, 'right')
            ]
            keep &= (next_page >= end) | (trust == _SURE)
        numbers = dict(zip(begin.tolist(), table[:, 0].tolist(), strict=True))
        used = {(page, numbers[at]) for at, (_, rest) in further.items() for page in rest}
        if used:  # what stands on a page of data is none; a page belongs to one row
            first, times = np.unique([page for page, _ in used], return_counts=True)
            before = first[np.searchsorted(first, row, 'right') - 1]
            keep &= (row < before) | (row >= before + self._usable) | (trust > _FOUND)
            shared = set(first[times > 1].tolist())
            for place in np.flatnonzero(np.isin(begin, list(further))).tolist() if shared else ():
                keep[place] &= shared.isdisjoint(further[int(begin[place])][1])
        table = table[keep]
        # The same row may stand in several places; a number may be damaged itself.
        table = table[np.lexsort((-table[:, 7], table[:, 0]))]
        table = table[np.sort(np.unique(table[:, [0, 1, 2, 4]], axis=0, return_index=True)[1])]
        number, trust = table[:, 0], table[:, 7]
        first = np.searchsorted(number, number)
        return table[(trust > _FOUND) | (trust[first] < _SURE)]

    def _chain(self, pointer: int, size: int) -> tuple[int, ...] | None:
        """Return the begins of the pages on which so many bytes go on, None if they are lost."""
        count = -(-size // (self._usable - 4))
        last = size - (count - 1) * (self._usable - 4)
        for shift in self._shifts:
            pages: list[int] = []
            at = pointer
            while True:
                self._steps -= 1
                number = self._uint(at, 4) if self._steps > 0 else 0
                at = (number - 1) * self._size + shift
                if len(pages) == count or number < 2 or at in pages[-1:] or at < 0:
                    break
                pages.append(at)
                if at + 4 + (last if len(pages) == count else self._usable) > len(self._content):
                    break
            if len(pages) == count and number == 0:
                if count > 1:  # surely so, and then for the rows that follow as well
                    self._shifts.remove(shift)
                    self._shifts.insert(0, shift)
                return tuple(pages)
        return None

    # --- Pages. ---

    def _trust(self, begin: int) -> int | None:
        """Return how much speaks for a row that begins at a place, None for a deleted one."""
        for phase in self._phases if self._steps > 0 else ():
            page = self._page(begin - (begin - phase) % self._size)
            if page is not None and begin in page.rows:
                break
            if page is not None and page.intact:
                return _FOUND if self._inside_of_another(begin, page) else None
        else:
            page = self._page_that_lists(begin) if self._steps > 0 else None
            if page is None:
                return _FOUND
            phase = page.begin % self._size
        if self._phases[0] != phase:
            self._phases = [phase, *(p for p in self._phases if p != phase)][:8]
        if page.begin // self._size + 1 in self._free and not page.begin % self._size:
            return None
        return _SURE if page.intact else _LISTED

    def _inside_of_another(self, begin: int, page: _Page) -> bool:
        """Whether a row stands in the bytes of a listed one, which then lost some of its own."""
        self._steps -= len(page.rows) // 8
        before = max((place for place in page.rows if place < begin), default=None)
        row = None if before is None else self._row(self._columns(before))
        return row is not None and row.columns + self._local(row.size) > begin

    def _page_that_lists(self, begin: int) -> _Page | None:
        """Look before a row for a page that lists it, wherever pages may begin."""
        least = max(begin - self._size, 0)
        at = begin
        while self._steps > 0 and (at := self._content.rfind(bytes([_LEAF]), least, at)) >= 0:
            page = self._page(at)
            if page is not None and page.intact and begin in page.rows:
                return page
        return None

    def _page(self, begin: int) -> _Page | None:
        if begin not in self._looked_at:
            if len(self._looked_at) > 64:
                self._looked_at.clear()
            self._looked_at[begin] = page = self._read_page(begin)
            if page is not None and page.intact and page.rows:
                self._intact.add(begin)
        return self._looked_at[begin]

    def _read_page(self, begin: int) -> _Page | None:
        """Read the head of a page; None if there cannot be one at a place."""
        content, end = self._content, begin + self._usable
        at = begin + (_HEADER if begin == 0 else 0)
        if begin < 0 or at + 12 > len(content):
            return None
        self._steps -= 1
        kind = content[at]
        head = _PAGE_HEAD.get(kind, 0)
        count = self._uint(at + 3, 2)
        first = at + head
        behind = first + 2 * count
        if not head or not count or behind > min(end, len(content)):
            return None
        start = self._uint(at + 5, 2) or 65536
        if content[at + 7] > _FRAGMENTS or not behind <= begin + start <= end:
            return None
        self._steps -= count
        places = [begin + p for p in struct.unpack_from(f'>{count}H', content, first)]
        intact = all(behind <= place < end for place in places) and self._fits(kind, places, end)
        return _Page(begin, frozenset(places if kind == _LEAF else ()), intact)

    def _fits(self, kind: int, places: list[int], end: int) -> bool:
        """Whether a page of some kind can list these rows."""
        content = self._content
        if max(places) + 4 > len(content):
            return False
        if kind == _LEAF:
            rows = [self._row(self._columns(place)) for place in places]
            return all(
                row is not None and row.begin == place and place + self._local(row.size) <= end
                for row, place in zip(rows, places, strict=True)
            )
        if kind == _INDEX_LEAF:
            return all(content[place + 1] == _INDEX_HEAD for place in places)
        most = len(content) // self._size + 1
        return all(0 < self._uint(place, 4) <= most for place in places)

    def _learnt_size(self) -> int:
        """Return the size of pages of a file whose header is lost."""
        self._size, self._usable = _PAGE_SIZES[-1], _PAGE_SIZES[-1]
        pages = set()
        for at in islice(_heads(self._content, *_MESSAGE), _PROBES):
            row = self._row(at)
            page = self._page_that_lists(row.begin) if row is not None else None
            if page is not None:
                pages.add(page.begin)
        self._looked_at.clear()
        self._intact.clear()
        found = sorted(pages)
        size = math.gcd(*(b - a for a, b in pairwise(found)))
        return size if size in _PAGE_SIZES else _USUAL_PAGE

    def _free_pages(self, headed: bool) -> tuple[frozenset[int], bool]:
        """Return the numbers of the pages that are listed as free, and whether some are missing."""
        if not headed:
            return frozenset(), True
        trunk, count = self._uint(32, 4), self._uint(36, 4)
        found: set[int] = set()
        while trunk and trunk not in found and len(found) < count:
            at = (trunk - 1) * self._size
            if at + self._size > len(self._content):
                break
            found.add(trunk)
            trunk, leaves = self._uint(at, 4), self._uint(at + 4, 4)
            leaves = min(leaves, (self._size - 8) // 4)
            found.update(struct.unpack_from(f'>{leaves}I', self._content, at + 8))
        return frozenset(found), len(found) != count

    # --- Numbers. ---

    def _local(self, size: int) -> int:
        """Return how many bytes of so large a row stand on its own page."""
        most, least = self._usable - 35, (self._usable - 12) * 32 // 255 - 23
        if size <= most:
            return size
        kept = least + (size - least) % (self._usable - 4)
        return kept if kept <= most else least

    def _varint(self, at: int) -> tuple[int, int]:
        """Return the number at a place and where it ends; of at most 8 bytes."""
        value = 0
        for byte in self._content[at : at + 8]:
            value = value << 7 | byte & 127
            at += 1
            if byte < 128:
                break
        return value, at

    def _integer(self, at: int, kind: int) -> int:
        if _INTEGERS[kind] == 0:
            return kind - 8
        return int.from_bytes(self._content[at : at + _INTEGERS[kind]], 'big', signed=True)

    def _uint(self, at: int, size: int) -> int:
        return int.from_bytes(self._content[at : at + size], 'big')


def _heads(content: Buffer, lengths: range, kinds: re.Pattern[bytes]) -> Iterator[int]:
    """Yield where the head of a row can stand: a length, nothing for the number, kinds."""
    for begin in range(0, len(content), _BLOCK):
        block = np.frombuffer(content[begin : begin + _BLOCK + 1], dtype=np.uint8)
        long = block[:-1] - np.uint8(lengths.start) < len(lengths)
        for at in (np.flatnonzero(long & (block[1:] == 0)) + begin).tolist():
            if kinds.match(content, at + 2):
                yield at


def _encoded(value: int) -> bytes:
    """Return a number as a row states it."""
    out = [value & 127]
    while value := value >> 7:
        out.append(value & 127 | 128)
    return bytes(reversed(out))
