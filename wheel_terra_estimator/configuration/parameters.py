# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The declared parameters: one table from which checks, descriptors and documentation come.

A parameter is an entry of ``parameters.yaml``, or of the catalogue of effects; a removed key moves
to ``retired``, with its replacement. ``tools/document_parameters.py`` documents them.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import Any, Literal, TypeAlias

import yaml

from wheel_terra_estimator.configuration.ros_yaml import Value

Kind: TypeAlias = Literal['number', 'integer', 'flag', 'text']


@dataclass(frozen=True)
class Parameter:
    """One declared parameter."""

    key: str  # canonical dotted key
    kind: Kind  # ``number`` (an integer will do), ``integer``, ``flag`` or ``text``
    # Value where no file states one; a scalar default of a per-wheel key counts for each wheel
    default: Value
    unit: str  # unit of the value in files
    meaning: str  # one sentence for the documentation and the node's descriptor
    # Per-wheel list, list of that length (0: any length), or a scalar
    size: int | Literal['wheels'] | None = None
    # ``lower``, ``upper``: allowed range of each number
    lower: float = -inf
    upper: float = inf
    open_lower: bool = False  # whether the lower bound itself is excluded
    choices: tuple[str, ...] = ()  # allowed texts, if not any
    aliases: tuple[str, ...] = ()  # other spellings that are accepted
    required: bool = False  # whether a complete configuration must state it
    one_for_all: bool = False  # whether a per-wheel list of one entry counts for all wheels

    @property
    def allowed(self) -> str:
        """What a value must be, in words, for messages and documentation."""
        noun = {'number': 'number', 'integer': 'integer', 'flag': 'true/false', 'text': 'text'}
        words = noun[self.kind]
        if self.choices:
            words = 'one of ' + ', '.join(self.choices)
        if self.size is not None:
            plural = words if self.kind in ('flag', 'text') else f'{words}s'
            words = f'list of {plural}'
            if self.size == 'wheels':
                words += ', one per wheel' + (', or one for all' if self.one_for_all else '')
            elif self.size:
                words = f'list of {self.size} {plural}'
        limits = []
        if self.lower > -inf:
            limits.append(f'{"above" if self.open_lower else "at least"} {self.lower:g}')
        if self.upper < inf:
            limits.append(f'at most {self.upper:g}')
        if limits:
            words += f' ({" and ".join(limits)})'
        return words


def plain_table(path: Path) -> dict[str, Any]:
    """Return the entries of a YAML file of the package by name, in its order."""
    loader = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)
    table: dict[str, Any] = yaml.load(path.read_text(encoding='utf-8'), loader)
    return table


def read_table(path: Path) -> tuple[tuple[Parameter, ...], dict[str, str]]:
    """Read a table of declarations.

    ``path``: YAML file; format as described in `parameters.yaml`. Returns the parameters in the
    order of the file, and retired keys -> what became of them.
    """
    table = plain_table(path)
    retired = table.pop('retired', {})
    found = []
    for name, entry in table.items():
        inside = {name: entry} if 'type' in entry else {f'{name}.{k}': e for k, e in entry.items()}
        found += [parameter(key, **fields) for key, fields in inside.items()]
    return tuple(found), retired


def parameter(
    key: str,
    type: Kind,
    default: Value,
    meaning: str,
    *,
    unit: str | None = None,
    above: float | None = None,
    at_least: float = -inf,
    at_most: float = inf,
    choices: Iterable[str] = (),
    aliases: Iterable[str] = (),
    **others: Any,
) -> Parameter:
    """Declare a parameter in the words of the table; ``others`` are fields of ``Parameter``."""
    measured = type in ('number', 'integer')
    return Parameter(
        key,
        type,
        default,
        ('-' if measured else '') if unit is None else unit,
        meaning,
        lower=at_least if above is None else above,
        upper=at_most,
        open_lower=above is not None,
        choices=tuple(choices),
        aliases=tuple(aliases),
        **others,
    )


DECLARED, RETIRED = read_table(Path(__file__).with_name('parameters.yaml'))
"""The parameters, without the effects; keys of earlier versions -> what became of them."""


def declared() -> dict[str, Parameter]:
    """Return all parameters by canonical key, those of the effects catalogue included."""
    from wheel_terra_estimator.terramechanics.effects import catalogue

    table = {item.key: item for item in DECLARED}
    for name, effect in catalogue().items():
        prefix = f'effects.{name}'
        table[f'{prefix}.enabled'] = parameter(f'{prefix}.enabled', 'flag', False, effect.claim)
        if len(effect.forms) > 1:
            names = tuple(variant.form for variant in effect.forms)
            laws = '; '.join(f'{variant.form}: {variant.symbol}' for variant in effect.forms)
            key = f'{prefix}.form'
            table[key] = parameter(key, 'text', names[0], laws, choices=names)
        if effect.sparse:
            table.update(_lists(prefix))
            continue
        for item in effect.all_parameters:
            key = f'{prefix}.{item.name}'
            table[key] = parameter(
                key,
                'number',
                float(item.default),
                item.meaning,
                unit=item.unit,
                at_least=float(item.lower),
                at_most=float(item.upper),
            )
            table[f'{key}_std'] = parameter(
                f'{key}_std',
                'number',
                0.0,
                f'standard deviation of {item.name} as fitted; 0 = not stated',
                unit=item.unit,
                at_least=0.0,
            )
    return table


def _lists(prefix: str) -> dict[str, Parameter]:
    """Return the flat lists that state a sparse law."""
    from wheel_terra_estimator.terramechanics.effects import learned_closure as law

    items = (
        parameter(f'{prefix}.targets', 'text', ['torque'], 'what each term changes', size=0,
                  choices=law.TARGETS),
        parameter(f'{prefix}.features', 'text', ['one'], 'with what it changes', size=0,
                  choices=law.FEATURES),
        parameter(f'{prefix}.coefficients', 'number', [0.0], 'by how much', size=0),
        parameter(f'{prefix}.coefficients_std', 'number', [0.0],
                  'standard deviations of the coefficients as fitted; 0 = not stated', size=0,
                  at_least=0.0),
    )  # fmt: skip
    return {item.key: item for item in items}


def by_spelling(table: Mapping[str, Parameter]) -> dict[str, Parameter]:
    """Return the parameters by every spelling that is accepted, aliases included."""
    return {**table, **{alias: item for item in table.values() for alias in item.aliases}}


def nearest(key: str, known: Iterable[str]) -> str:
    """Return the known key that looks most like ``key``.

    A key that begins with ``key`` is preferred, then a right name in a wrong section.
    """
    known = list(known)
    last = key.rsplit('.', 1)[-1]
    candidates = (
        *sorted((other for other in known if other.startswith((f'{key}_', f'{key}/'))), key=len),
        *difflib.get_close_matches(key, known, n=1, cutoff=0.8),
        *(other for other in known if other.rsplit('.', 1)[-1] == last),
        *difflib.get_close_matches(key, known, n=1, cutoff=0.0),
    )
    return candidates[0]
