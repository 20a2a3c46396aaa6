# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The declared parameters: one table from which checks, descriptors and documentation come.

A parameter is an entry of ``parameters.yaml``, or of the catalogue of effects; a removed key moves
to ``retired``, with its replacement. ``tools/document_parameters.py`` documents them.
"""

from __future__ import annotations

import difflib
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import Any, Literal, TypeAlias

import yaml

from wheel_terra_estimator.configuration.ros_yaml import Value

Kind: TypeAlias = Literal['number', 'integer', 'flag', 'text']


@dataclass(frozen=True)
class Parameter:
    """One declared parameter: canonical dotted key, and an entry as `parameters.yaml` has it."""

    key: str
    type: Kind
    default: Value
    meaning: str
    unit: str = ''
    size: int | Literal['wheels'] | None = None
    above: float | None = None
    at_least: float = -inf
    at_most: float = inf
    choices: Collection[str] = ()
    aliases: Sequence[str] = ()
    required: bool = False
    one_for_all: bool = False

    @property
    def lower(self) -> float:
        """Lower bound of each number, itself excluded where it is stated as ``above``."""
        return self.at_least if self.above is None else self.above

    @property
    def allowed(self) -> str:
        """What a value must be, in words, for messages and documentation."""
        noun = {'number': 'number', 'integer': 'integer', 'flag': 'true/false', 'text': 'text'}
        words = noun[self.type]
        if self.choices:
            words = 'one of ' + ', '.join(self.choices)
        if self.size is not None:
            plural = words if self.type in ('flag', 'text') else f'{words}s'
            words = f'list of {plural}'
            if self.size == 'wheels':
                words += ', one per wheel' + (', or one for all' if self.one_for_all else '')
            elif self.size:
                words = f'list of {self.size} {plural}'
        limits = []
        if self.lower > -inf:
            limits.append(f'{"at least" if self.above is None else "above"} {self.lower:g}')
        if self.at_most < inf:
            limits.append(f'at most {self.at_most:g}')
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
        for key, fields in inside.items():
            unit = '-' if fields['type'] in ('number', 'integer') else ''
            found.append(Parameter(key, **{'unit': unit, **fields}))
    return tuple(found), retired


DECLARED, RETIRED = read_table(Path(__file__).with_name('parameters.yaml'))
"""The parameters, without the effects; keys of earlier versions -> what became of them."""


def declared() -> dict[str, Parameter]:
    """Return all parameters by canonical key, those of the effects catalogue included."""
    from wheel_terra_estimator.terramechanics.effects import catalogue

    table = {item.key: item for item in DECLARED}
    for name, effect in catalogue().items():
        prefix = f'effects.{name}'
        table[f'{prefix}.enabled'] = Parameter(f'{prefix}.enabled', 'flag', False, effect.claim)
        if len(effect.forms) > 1:
            names = tuple(variant.form for variant in effect.forms)
            laws = '; '.join(f'{variant.form}: {variant.symbol}' for variant in effect.forms)
            key = f'{prefix}.form'
            table[key] = Parameter(key, 'text', names[0], laws, choices=names)
        if effect.sparse:
            table.update(_lists(prefix))
            continue
        for item in effect.all_parameters:
            key = f'{prefix}.{item.name}'
            table[key] = Parameter(
                key,
                'number',
                float(item.default),
                item.meaning,
                unit=item.unit,
                at_least=float(item.lower),
                at_most=float(item.upper),
            )
            table[f'{key}_std'] = Parameter(
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
        Parameter(f'{prefix}.targets', 'text', ['torque'], 'what each term changes', size=0,
                  choices=law.TARGETS),
        Parameter(f'{prefix}.features', 'text', ['one'], 'with what it changes', size=0,
                  choices=law.FEATURES),
        Parameter(f'{prefix}.coefficients', 'number', [0.0], 'by how much', '-', size=0),
        Parameter(f'{prefix}.coefficients_std', 'number', [0.0],
                  'standard deviations of the coefficients as fitted; 0 = not stated', '-',
                  size=0, at_least=0.0),
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
