# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Units that columns of a table may have, and the map that states quantity and unit of each."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from wheel_terra_estimator.configuration.ros_yaml import in_words, load
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.input_file import read_text

_DEGREE = math.pi / 180.0
_FOOT, _POUND, _KILOPOND = 0.3048, 4.4482216152605, 9.80665  # [m], [N], [N]
UNITS: dict[str, dict[str, float]] = {
    's': {'s': 1.0, 'ms': 1e-3, 'us': 1e-6, 'ns': 1e-9},
    'm': {'m': 1.0, 'cm': 1e-2, 'mm': 1e-3, 'in': _FOOT / 12, 'ft': _FOOT},
    'm/s': {'m/s': 1.0, 'km/h': 1 / 3.6, 'mm/s': 1e-3},
    'm/s^2': {'m/s^2': 1.0, 'g': 9.80665, 'mg': 9.80665e-3, 'm/s2': 1.0, 'm/s\u00b2': 1.0},
    'N': {'N': 1.0, 'kN': 1e3, 'lbf': _POUND, 'kgf': _KILOPOND, 'gf': 1e-3 * _KILOPOND},
    'N m': {
        'N m': 1.0,
        'N mm': 1e-3,
        'N cm': 1e-2,
        'kN m': 1e3,
        'kgf m': _KILOPOND,
        'kgf cm': 1e-2 * _KILOPOND,
        'lbf ft': _POUND * _FOOT,
        'ft lbf': _POUND * _FOOT,
    },
    'rad': {'rad': 1.0, 'deg': _DEGREE, '\u00b0': _DEGREE, 'degree': _DEGREE, 'degrees': _DEGREE},
    'rad/s': {
        'rad/s': 1.0,
        'deg/s': _DEGREE,
        'rpm': math.pi / 30,
        'rev/s': 2 * math.pi,
        'rad_s': 1.0,
        'deg_s': _DEGREE,
        '\u00b0/s': _DEGREE,
        '1/s': 1.0,
    },
    '-': {'-': 1.0, '%': 0.01, '1': 1.0, 'percent': 0.01, 'pct': 0.01},
}
"""SI unit -> spelling of a unit -> factor to the SI unit."""
_SPACES = re.compile('[\\s*\u00b7\u22c5.]+|(?<=[a-z])-')


def _plain(unit: str) -> str:
    return _SPACES.sub('', unit.lower())


_FACTORS = {si: {_plain(unit): f for unit, f in units.items()} for si, units in UNITS.items()}


def factor(si: str, unit: str) -> float | None:
    """Return the factor from a unit, however it is spelt, to the SI unit; None: not known."""
    return _FACTORS[si].get(_plain(unit))


def is_unit(text: str) -> bool:
    """Return whether a text spells a unit of any kind."""
    return any(_plain(text) in units for units in _FACTORS.values())


def are_units(cells: Iterable[str]) -> bool:
    """Return whether cells are a row of units: each one or empty, two of them beside '-'."""
    units = [unit for cell in cells if (unit := bare(cell))]
    named = [unit for unit in units if unit != '-']
    return len(named) > 1 and all(map(is_unit, units)) and '1' not in units


def bare(unit: str) -> str:
    """Return a unit without the brackets and the mark of a comment around it."""
    return unit.strip('#[]() ')


@dataclass(frozen=True)
class Entry:
    """A column of a table as a user names it."""

    column: str
    unit: str = ''  # its unit; empty: that of the title, else SI
    sign: int = 1  # -1 turns it round


@dataclass(frozen=True)
class Column:
    """A column that is read: its place in the table, its name, the factor to SI with the sign."""

    place: int
    name: str
    factor: float


def entry_of(value: Any, where: str) -> Entry:
    """Return an entry from ``TITLE`` or ``{column: TITLE, unit: mm, sign: -1}``.

    Raises UserError where it is neither.
    """
    if isinstance(value, str):
        return Entry(value)
    if not isinstance(value, Mapping):
        raise UserError(f'{where}: give column, unit and, if the sign is inverted, sign')
    unknown = ', '.join(repr(key) for key in value if key not in ('column', 'unit', 'sign'))
    if unknown or 'column' not in value:
        stray = f' (unknown: {unknown})' if unknown else ''
        raise UserError(f'{where}: give column, unit and, if the sign is inverted, sign{stray}')
    sign = value.get('sign', 1)
    if sign not in (1, -1):
        raise UserError(f'{where}: sign must be 1 or -1')
    return Entry(str(value['column']), str(value.get('unit', '')), int(sign))


def read_map(path: Path) -> Mapping[Any, Any]:
    """Return the entries of a map of columns, a YAML file.

    Raises UserError where it cannot be read, or is no map.
    """
    try:
        document = load(read_text(path), yaml.SafeLoader)
    except yaml.YAMLError as error:
        raise UserError(f'{path}: {in_words(error)}') from None
    except ValueError as error:
        raise UserError(f'{path}: not valid YAML: {str(error).splitlines()[0]}') from None
    if not isinstance(document, Mapping):
        raise UserError(f'{path}: not a map of columns: one NAME: COLUMN a line')
    return document
