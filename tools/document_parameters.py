# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Write docs/parameters.md from the declared table.

python tools/document_parameters.py
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from pathlib import Path

from wheel_terra_estimator.configuration.parameters import Parameter, declared
from wheel_terra_estimator.configuration.ros_yaml import format_value

PAGE = Path(__file__).resolve().parents[1] / 'docs' / 'parameters.md'
_INTRODUCTION = """# Parameters

Written by `python tools/document_parameters.py` from the declared table; do not edit.

Keys of [configuration files](configuration.md); in brackets default, unit and what is allowed. A
list per wheel has one entry for each of `wheels.names`, in that order. An integer will do for a
number, though not inside a list (`[0.0, 0.5]`, not `[0, 0.5]`: ROS refuses mixed lists).
Every `_std` is one standard deviation, in the unit of what it belongs to.
"""

_SECTIONS = {
    '': 'General',
    'wheels': 'Wheels',
    'rover': 'Rover',
    'soil': 'Soil',
    'sensors': 'Sensors',
    'filter': 'Filter',
}
_SIGNS = {
    'list of numbers, one': 'one',
    'list of integers, one': 'integer, one',
    'list of text, one': 'one',
    'list of text': 'texts',
    'list of ': '',
    'number (': '',
    ' (': ', ',
    ')': '',
    'at least ': '≥ ',
    ' and at most ': ', ≤ ',
    'at most ': '≤ ',
    'above ': '> ',
    ' and below ': ', < ',
}
_EFFECTS = """## Effects

`effects.NAME.enabled: true` switches an effect on, `effects.NAME.form` chooses one of its forms,
`effects.NAME.PARAMETER` sets a parameter, `effects.NAME.PARAMETER_std` is the standard deviation
that a fit found (0 = not stated). Names, forms, units and ranges: [effects](effects.md).
"""


def page() -> str:
    """Return the page as Markdown."""
    lines = [_INTRODUCTION]
    table = list(declared().values())
    for section, title in _SECTIONS.items():
        lines += [f'## {title}', '']
        of_section = [p for p in table if p.key.rpartition('.')[0] == section]
        lines += [_row([*alike]) for _, alike in itertools.groupby(of_section, key=_row_key)]
        lines.append('')
    return '\n'.join(lines) + f'\n{_EFFECTS}'


def _row_key(parameter: Parameter) -> tuple[object, ...]:
    """Return the content that parameters of one row have in common."""
    return parameter.meaning, parameter.allowed, str(parameter.default), parameter.required


def _row(alike: Sequence[Parameter]) -> str:
    parameter = alike[0]
    default = '*required*' if parameter.required else f'`{format_value(parameter.default)}`'
    units = {p.unit for p in alike}
    unit = parameter.unit if len(units) == 1 and parameter.unit not in ('', '-') else ''
    allowed = _in_short(parameter.allowed)
    quantity = f'{default}, {unit}' if parameter.required and unit else f'{default} {unit}'.strip()
    facts = quantity if allowed in ('number', 'text', 'true/false') else f'{quantity}, {allowed}'
    meaning = parameter.meaning.replace('<', '&lt;')
    if parameter.aliases:
        meaning += ' (also ' + ', '.join(f'`{alias}`' for alias in parameter.aliases) + ')'
    keys = ', '.join(f'`{p.key}`' for p in alike)
    return f'- {keys} ({facts}): {meaning}'


def _in_short(allowed: str) -> str:
    """Return what is allowed, with signs in place of words."""
    for words, sign in _SIGNS.items():
        allowed = allowed.replace(words, sign)
    return allowed


if __name__ == '__main__':
    PAGE.write_text(page(), encoding='utf-8')
