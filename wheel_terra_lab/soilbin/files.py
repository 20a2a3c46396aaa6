# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Case files: ROS parameter files with the keys ``soilbin.<group>.<name>``."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from wheel_terra_estimator.errors import UserError
from wheel_terra_lab.soilbin.case import Case

ROOT = 'soilbin.'
CONFIG = Path(__file__).with_name('config')
"""Shipped cases, wheels and grains."""
GROUPS = ('wheel', 'grains', 'bed', 'operation', 'numerics')
IN_DEGREES = {'operation.slope': 'operation.slope_deg'}


def keys() -> dict[str, tuple[str, str]]:
    """Return the known keys with the group and the field that each one sets."""
    known = {'soilbin.name': ('', 'name')}
    for group in GROUPS:
        for field in dataclasses.fields(getattr(Case(), group)):
            name = f'{group}.{field.name}'
            known[ROOT + IN_DEGREES.get(name, name)] = (group, field.name)
    return known


def load(names: Sequence[str], overrides: Sequence[str] = ()) -> Case:
    """Return the case of several files, later ones win key by key, then NAME:=VALUE.

    Names are paths, or bare names of files in `CONFIG` (``wheel_2``, ``quick``); in an override the
    leading ``soilbin.`` may be left out. Raises UserError for an unknown file or key, or a wrong
    type.
    """
    from wheel_terra_estimator.configuration import ros_yaml, shipped

    case = Case()
    for name in names:
        path = shipped.find(name, folder=CONFIG)
        case = apply(case, ros_yaml.read(path), str(path))
        if path.parent.name not in ('wheels', 'grains'):
            case = dataclasses.replace(case, name=path.stem)
    for text in overrides:
        name, sign, value = text.partition(':=')
        if not sign:
            raise UserError(f'-p {text}: write NAME:=VALUE')
        key = name if name.startswith(ROOT) else ROOT + name
        case = apply(case, {key: ros_yaml.parse_value(value, f'-p {name}')}, f'-p {name}')
    return case


def apply(case: Case, values: Mapping[str, Any], where: str) -> Case:
    """Return the case with the keys changed; unknown keys and wrong types are errors."""
    from wheel_terra_estimator.configuration.parameters import nearest

    known = keys()
    for key, value in values.items():
        if key not in known:
            raise UserError(
                f'{where}: unknown key {key}; the nearest known one is {nearest(key, known)}'
            )
        group, field = known[key]
        owner = getattr(case, group) if group else case
        new: Any = _convert(value, getattr(owner, field), f'{where}: {key}')
        if key.endswith('_deg'):
            new = math.radians(new)
        case = case.replace(**{f'{group}__{field}' if group else field: new})
    return case


def _convert(value: Any, wanted: Any, where: str) -> Any:
    """Return the value in the type of the field that it is for."""
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if isinstance(wanted, tuple):
        if isinstance(value, list) and all(isinstance(item, (int, float)) for item in value):
            return tuple(float(item) for item in value)
        kind = 'a list of numbers'
    elif isinstance(wanted, str):
        if isinstance(value, str):
            return value
        kind = 'a word'
    elif isinstance(wanted, int):
        if number and value == int(value):
            return int(value)
        kind = 'a whole number'
    else:
        if number:
            return float(value)
        kind = 'a number'
    raise UserError(f'{where} = {value!r} must be {kind}')
