# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Titles of columns: quantity and unit of each, and the questions they leave open."""

from __future__ import annotations

import difflib
import re
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from wheel_terra_estimator.configuration.column_map import (
    UNITS,
    Column,
    Entry,
    entry_of,
    factor,
    is_unit,
    read_map,
)
from wheel_terra_estimator.configuration.parameters import nearest, plain_table
from wheel_terra_estimator.discrepancy.tables.steady_table import (
    COLUMNS,
    ORDER_COLUMNS,
    STD_COLUMNS,
)
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.frames import unit_of

_TITLES = plain_table(Path(__file__).with_name('titles.yaml'))
_STD_ENDS = ('std', 'sd', 'stddev', 'stdev', 'sigma')
_HARMLESS = frozenset(
    {'time', 'timestamp', 'stamp', 'duration', 'index', 'id', 'no', 'nr', 'number', 'run', 'test'}
    | {'testno', 'testnumber', 'sample', 'point', 'row', 'series', 'seed', 'repeat', 'replicate'}
    | {'temperature', 'humidity', 'entranceangle', 'peakstressangle'}
)
"""Numbers that no diagnosis needs: when, which, and what the model itself gives beside."""
_HARMLESS_UNITS = frozenset({'s', 'ms', 'min', 'h', 'k', '\u00b0c', 'degc', 'celsius', '%rh'})
_BRACKETS = re.compile(r'(.*?)\s*[\[(]([^\])]*)[\])]')
_BETWEEN = re.compile(r'\s+in\s+|\s*[/,]\s*|[_\s]+')  # a name and its unit without brackets
_MEASURED = re.compile(r'^(meas|measured|mean|avg|average)[_\s]+', re.IGNORECASE)
_COEFFICIENT = re.compile(r'coeff|/\s*\(?\s*(w|fz|load)\b', re.IGNORECASE)  # DP/W, T/(W r)
_TIMES_LOAD = (
    'a share of the load? write times normal_load, drawbar_pull [N], a torque times the radius, '
    'torque [N m]'
)
ALL = 'all'


@dataclass(frozen=True)
class Choice:
    """Choices of the user for the columns."""

    # Name of a column of ours -> the table's
    entries: Mapping[str, Entry] = field(default_factory=dict)
    ignored: tuple[str, ...] = ()  # titles that are left out; ``all``: whatever is not understood
    source: str = '--columns'  # what an error names

    @classmethod
    def of(cls, columns: Any, ignored: Sequence[str] = ()) -> Choice:
        """Return the choice in options, or in arguments of Python.

        ``columns``: ``FILE`` (YAML), ``{NAME: COLUMN}``, or ``NAME=COLUMN`` and files in any
        number. ``ignored``: titles, also several with commas between.
        """
        entries: dict[str, Entry] = {}
        if isinstance(columns, Mapping):
            entries = _entries(columns, 'columns')
        else:
            for text in [columns] if isinstance(columns, str | Path) else columns:
                name, equals, title = str(text).partition('=')
                if equals:
                    entries |= _entries({name.strip(): title.strip()}, '--columns')
                else:
                    entries |= _entries(read_map(Path(text)), str(text))
        texts = [ignored] if isinstance(ignored, str) else ignored
        parts = (part.strip() for text in texts for part in text.split(','))
        return cls(entries, (*texts, *parts))


def _entries(columns: Mapping[Any, Any], source: str) -> dict[str, Entry]:
    for name in columns:
        if name not in COLUMNS:
            raise UserError(
                f"{source}: no column '{name}' is read; nearest: '{nearest(str(name), COLUMNS)}'"
            )
    return {str(name): entry_of(value, f'{source}: {name}') for name, value in columns.items()}


@dataclass(frozen=True)
class Title:
    """Meaning of a title: the column, its unit as spelt, and whether that is ambiguous."""

    name: str
    unit: str = ''
    asked: bool = False


def _key(text: str) -> str:
    return re.sub(r'[\W_]+', '', text.lower())


def _keys(names: Mapping[str, Sequence[str]]) -> dict[str, str]:
    """Return key -> column, standard deviations with it."""
    keys = {_key(word): name for name, words in names.items() for word in (*words, name)}
    for word, name in list(keys.items()):
        if f'{name}_std' in STD_COLUMNS:
            for end in _STD_ENDS:
                keys[f'{word}{end}'] = keys[f'{end}{word}'] = f'{name}_std'
    return keys


_OWN = {_key(name): name for name in COLUMNS}
_SURE = {**_keys(_TITLES['words']), **_OWN}
_SHORT = {key: name for key, name in _keys(_TITLES['symbols']).items() if key not in _SURE}
_OPEN = {_key(word): name for name, words in _TITLES['asked'].items() for word in words}


def meaning_of(title: str) -> Title | None:
    """Return which column a title names; None for none."""
    for base, unit in _readings(title):
        key = _key(_MEASURED.sub('', base))
        if key in _SURE:
            return Title(_SURE[key], unit)
        if key in _SHORT:
            name = _SHORT[key]
            if key.endswith('rpm') and not unit:
                return Title(name, 'rpm')
            if not unit or factor(unit_of(name), unit) is None:
                return None if unit.lower() in _HARMLESS_UNITS else Title(name, unit, asked=True)
            return Title(name, unit)
        if key in _OPEN:
            return Title(_OPEN[key], unit, asked=True)
    return None


def with_unit(title: str, unit: str) -> str:
    """Return a title with a unit known from elsewhere, unless it has one itself."""
    meaning = meaning_of(title)
    si = unit_of(meaning.name) if meaning else '-'
    return title if unit in ('', si) or (meaning and meaning.unit) else f'{title} [{unit}]'


def _readings(title: str) -> Iterator[tuple[str, str]]:
    """Yield what may be name and unit in a title."""
    brackets = _BRACKETS.fullmatch(title)
    if brackets:
        yield brackets[1], brackets[2].strip()
        return
    yield title, ''
    for between in _BETWEEN.finditer(title):
        unit = title[between.end() :]
        if between.start() and is_unit(unit):
            yield title[: between.start()], unit


class Header:
    """Meaning and faults of the titles of a table.

    ``source`` is what an error names, ``wanted`` are columns of ours. Then ``columns`` are those
    that are read, ``unused`` places and titles of the others (but for those that the user leaves
    out), ``notes`` columns that are read otherwise than stated.
    """

    def __init__(
        self, source: str, titles: Sequence[str], choice: Choice, wanted: Sequence[str] = COLUMNS
    ) -> None:
        self.source, self.titles = source, titles
        self.columns: list[Column] = []
        self.unused: list[tuple[int, str]] = []
        self.notes: list[str] = []
        self._faults: list[str] = []
        self._leave_all = ALL in choice.ignored
        taken = set(self._chosen(choice))
        for place, title in enumerate(titles):
            if place in taken or title in choice.ignored:
                continue
            meaning = meaning_of(title)
            if meaning is None or meaning.asked:
                self.unused.append((place, title))
            elif meaning.name in wanted:
                self._take(place, title, meaning.name, meaning.unit)
        mended = [
            f'{titles[c.place]!r} as {c.name}'
            + (f' (times {c.factor:.4g})' if c.factor != 1 else '')
            for c in self.columns
            if titles[c.place] != c.name
        ]
        if mended:
            self.notes.append(f'read {", ".join(mended)}')
        self.notes += [
            f'{name} is not used: there is no column {name.removesuffix("_std")}'
            for name in self.names
            if name in STD_COLUMNS and name.removesuffix('_std') not in self.names
        ]

    @property
    def names(self) -> list[str]:
        """Columns that are read."""
        return [column.name for column in self.columns]

    @property
    def units(self) -> dict[str, float]:
        """Column -> factor to SI of the unit in its title."""
        return {column.name: abs(column.factor) for column in self.columns}

    def _chosen(self, choice: Choice) -> Iterator[int]:
        """Take the columns that the user names; yield their places."""
        for name, entry in choice.entries.items():
            found = _find(self.titles, entry)
            if found is None:
                said = [meaning_of(title) for title in self.titles]
                if name not in [m.name for m in said if m and not m.asked]:  # needs no map
                    close = nearest(entry.column, self.titles) if self.titles else ''
                    self._faults.append(
                        f"no column {entry.column!r} for {name}; nearest: '{close}'"
                    )
                continue
            place, unit, sign = found
            self._take(place, self.titles[place], name, unit, sign)
            yield place

    def _take(self, place: int, title: str, name: str, unit: str, sign: int = 1) -> None:
        times = factor(unit_of(name), unit) if unit else 1.0
        if name in ORDER_COLUMNS:
            times = 1.0
        if times is None:
            known = ', '.join(UNITS[unit_of(name)])
            share = f' ({_TIMES_LOAD})' if unit == '-' else ''
            self._faults.append(f'the unit of {title!r} is not known; give one of {known}{share}')
        elif name in self.names:
            other = next(self.titles[c.place] for c in self.columns if c.name == name)
            twice = f'column {title!r} stands there twice; delete one'
            both = f'{other!r} and {title!r} are both {name}; leave one out: --ignore-columns'
            self._faults.append(twice if other == title else both)
        else:
            self.columns.append(Column(place, name, sign * times))

    def check(self, required: Sequence[str], one_of: Sequence[str] = ()) -> None:
        """Raise with all faults of the titles in one line."""
        faults = [*self._faults]
        missing = [f'no column {name!r}' for name in required if name not in self.names]
        if one_of and not set(one_of) & set(self.names):
            missing.append(f'none of {", ".join(one_of)}')
        meant = [title for _, title in self.unused if _hint(title, self._free())[0]]
        if missing:
            faults.append(f'{" and ".join(missing)} among {", ".join(self.titles)}')
            if not meant:
                or_say = ', or say which title stands for it: --columns NAME=TITLE'
                faults.append('add it' + ('' if self._leave_all else or_say))
        if faults:
            faults += [self._question(meant)] if meant else []
            raise UserError(f'{self.source}: {"; ".join(faults)}')

    def check_unused(self, hold_numbers: Sequence[int]) -> None:
        """Raise for columns of numbers that are not used; note the others.

        ``hold_numbers``: places of unused columns with numbers that are not those of the rows.
        """
        asked = [
            title for place, title in self.unused if place in hold_numbers and not _harmless(title)
        ]
        if asked and not self._leave_all:
            raise UserError(f'{self.source}: {self._question(asked)}')
        named = [title for _, title in self.unused if title]
        if named:
            self.notes.append(f'columns not used: {", ".join(named)}')

    def _free(self) -> list[str]:
        return [name for name in COLUMNS if name not in self.names]

    def _question(self, titles: Sequence[str]) -> str:
        hints = [_hint(title, self._free()) for title in titles]
        listed = ', '.join(
            repr(title) + (f' ({hint})' if hint else '')
            for title, (_, hint) in zip(titles, hints, strict=True)
        )
        answers: dict[str, str] = {}
        for title, (name, _) in zip(titles, hints, strict=True):
            answers.setdefault(name or 'NAME', title)
        if self._leave_all:
            return f'not used: {listed}; name it in the file: {", ".join(answers)}'
        options = (f'--columns {shlex.quote(f"{name}={title}")}' for name, title in answers.items())
        left_out = shlex.quote(titles[0]) if len(titles) == 1 else ALL
        return (
            f'not used: {listed}; say what they are, {" ".join(options)} (a minus before the '
            f'title turns the sign), or leave them out, --ignore-columns {left_out} '
            '(in Python: columns, ignore_columns)'
        )


def _harmless(title: str) -> bool:
    return any(
        _key(base) in _HARMLESS or unit.lower() in _HARMLESS_UNITS
        for base, unit in _readings(title)
    )


def _hint(title: str, free: Sequence[str]) -> tuple[str, str]:
    """Return which of the free columns a title may be, and the same with what it has to hold."""
    if _COEFFICIENT.search(title):
        return '', _TIMES_LOAD
    meaning = meaning_of(title)
    if meaning is not None:
        name = meaning.name
        unit = f' [{unit_of(name)}]' if unit_of(name) != '-' else ''
        has_to_be = _TITLES['has_to_be'].get(name)
        holds = f', {has_to_be}' if has_to_be else ''
        return name, f'{name}{unit}{holds}?'
    keys = {key: name for key, name in _SURE.items() if name in free}
    for base, _ in _readings(title):
        close = difflib.get_close_matches(_key(base), keys, n=1, cutoff=0.86)
        if close:
            return keys[close[0]], f'{keys[close[0]]}?'
    return '', ''


def _find(titles: Sequence[str], entry: Entry) -> tuple[int, str, int] | None:
    """Return place, unit and sign of the column that a user names."""
    text, sign = entry.column, entry.sign
    if text not in titles and text.startswith('-'):
        text, sign = text[1:].strip(), -sign
    unit = entry.unit
    if text not in titles:  # z stands for 'z [mm]'
        named = (found for found in map(_BRACKETS.fullmatch, titles) if found)
        text = next((found[0] for found in named if found[1] == text), text)
    if text not in titles:
        brackets = _BRACKETS.fullmatch(text)
        if not brackets or brackets[1] not in titles:
            return None
        text, unit = brackets[1], brackets[2].strip()
    said = next((unit for _, unit in _readings(text) if unit), '')
    return titles.index(text), unit or said, sign
