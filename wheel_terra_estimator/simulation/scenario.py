# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Scenario files: rover, course, sensors, faults and random variations.

A scenario is a ROS parameter file like every configuration file. The keys in
``scenario_keys.yaml`` are all there are. What starts with ``variation.`` is drawn anew for each
seed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wheel_terra_estimator.configuration import reader, ros_yaml, shipped
from wheel_terra_estimator.configuration.configuration import Configuration, Section
from wheel_terra_estimator.configuration.parameters import nearest, read_table
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.simulation.drives import DriveProfile
from wheel_terra_estimator.simulation.terrain import SOIL_QUANTITIES, Patch

DEFAULT = 'climb_soft_patch'

DECLARED = {
    item.key: item for item in read_table(Path(__file__).with_name('scenario_keys.yaml'))[0]
}
"""What a scenario may state, by key."""

WHEEL_FAULTS = {
    'overspeed': ('rate_factor', 4.0),
    'locked': ('rate_factor', 0.0),
    'coasting': ('torque_factor', 0.0),
    'weak': ('torque_factor', 0.25),
    'lifted': ('load_factor', 0.02),
}
"""Faults of wheels -> field of ``plant.WheelFaults`` and its value."""
SENSOR_FAULTS = tuple(k for k in DECLARED['faults.kind'].choices if k not in WHEEL_FAULTS)


@dataclass(frozen=True)
class Fault:
    """A fault that lasts from ``start`` to ``end`` [s]; ``wheel`` is its index, None = all."""

    kind: str
    wheel: int | None
    start: float
    end: float

    def active(self, time: float) -> bool:
        """Return whether the fault is there at a time [s]."""
        return self.start <= time < self.end


@dataclass(frozen=True, eq=False)
class Scenario:
    """A checked scenario."""

    name: str  # where it came from
    description: str
    # ``files``, ``parameters``: configuration files and NAME:=VALUE that an estimator of this drive
    # is to be given
    files: tuple[str, ...]
    parameters: tuple[str, ...]
    configuration: Configuration  # their content: rover, nominal soil, sensors
    truth: Configuration  # what holds in the simulation before the variations of a seed
    duration: float
    profile: DriveProfile
    patches: tuple[Patch, ...]
    faults: tuple[Fault, ...]
    # ``drive``, ``slope``, ``variation``, ``sensors``: declared keys of these sections as
    # attributes
    drive: Section
    slope: Section
    variation: Section
    sensors: Section
    values: Mapping[str, Any]  # of all declared keys


def load(
    # A path, the bare name of a shipped scenario, or dotted keys with values
    source: str | Path | Mapping[str, Any] = DEFAULT,
    *,
    # ``files``, ``parameters``: further configuration files and NAME:=VALUE, known to simulation
    # and estimator
    files: Sequence[str | Path] = (),
    parameters: Sequence[str] = (),
    # Rover file in place of the scenario's own; its soil and ground stay
    rover: str | Path | None = None,
    # Dotted keys of the scenario with ``__`` for the dot, such as ``sensors__reference=False``
    **changes: Any,
) -> Scenario:
    """Read a scenario.

    Raises UserError for a file, key or value that cannot be used.
    """
    if isinstance(source, Mapping):
        name, values = 'scenario', dict(source)
    else:
        path = shipped.find(source, 'scenarios')
        name, values = str(path), dict(ros_yaml.read(path))
    values |= {key.replace('__', '.'): value for key, value in changes.items()}
    checked = _checked(name, values)
    base = [*_with_rover(checked['configuration'], rover), *files]
    known = [*checked['parameters'], *parameters]
    configuration = reader.load(base, known)
    return Scenario(
        name=name,
        description=checked['description'],
        files=tuple(str(file) for file in base),
        parameters=tuple(known),
        configuration=configuration,
        truth=reader.load(base, [*known, *checked['truth']]),
        duration=checked['duration'],
        profile=_profile(name, checked),
        patches=_patches(name, checked),
        faults=_faults(name, _on_rover(checked, rover, configuration), configuration.wheels.names),
        drive=Section(checked, 'drive.'),
        slope=_slope(name, checked),
        variation=Section(checked, 'variation.'),
        sensors=Section(checked, 'sensors.'),
        values=checked,
    )


def _with_rover(files: Sequence[str], rover: str | Path | None) -> list[str | Path]:
    """Return the files with another rover in place of those that state the wheels."""
    if rover is None:
        return list(files)
    return [rover, *(f for f in files if 'wheels.names' not in ros_yaml.read(shipped.find(f)))]


def _on_rover(
    checked: dict[str, Any], rover: str | Path | None, configuration: Configuration
) -> dict[str, Any]:
    """Return the keys with the wheels of the faults moved to another rover, place by place."""
    if rover is None:
        return checked
    own = reader.load(checked['configuration'], checked['parameters']).wheels.names
    there = configuration.wheels.names
    moved = [
        there[min(own.index(wheel), len(there) - 1)] if wheel in own else wheel
        for wheel in checked['faults.wheel']
    ]
    return {**checked, 'faults.wheel': moved}


def _checked(name: str, values: Mapping[str, Any]) -> dict[str, Any]:
    for key in values:
        if key not in DECLARED:
            close = nearest(key, DECLARED)
            raise UserError(
                f"{name}: unknown key '{key}' of a scenario; the nearest known one is '{close}'"
            )
    stated = {key: (value, name) for key, value in values.items() if value != []}
    return {key: reader.checked_value(item, stated, 0) for key, item in DECLARED.items()}


def _columns(
    name: str, checked: Mapping[str, Any], lead: str, keys: Sequence[str]
) -> dict[str, list[Any]]:
    """Return lists that belong together; a list of one counts for all, an absent one is left."""
    count = len(checked[lead])
    columns = {}
    for key in keys:
        values = checked[key]
        if len(values) == 1 and count > 1:
            values = values * count
        if values and len(values) != count:
            raise UserError(
                f'{name}: {key} has {len(values)} entries instead of {count} (as many as {lead})'
            )
        columns[key] = values
    return columns


def _knots(name: str, checked: Mapping[str, Any], lead: str, *others: str) -> dict[str, list[Any]]:
    """Return lists over the one that leads, which must not decrease."""
    columns = _columns(name, checked, lead, (lead, *others))
    if (np.diff(columns[lead]) < 0.0).any():
        raise UserError(f'{name}: {lead}: {lead.partition(".")[2]}s must not decrease')
    return columns


def _profile(name: str, checked: Mapping[str, Any]) -> DriveProfile:
    columns = _knots(name, checked, 'drive.time', 'drive.forward', 'drive.turn_rate')
    return DriveProfile(*(np.array(column, float) for column in columns.values()))


def _slope(name: str, checked: Mapping[str, Any]) -> Section:
    columns = _knots(name, checked, 'slope.position', 'slope.angle_deg')
    return Section({**checked, **columns}, 'slope.')


def _patches(name: str, checked: Mapping[str, Any]) -> tuple[Patch, ...]:
    keys = [key for key in checked if key.startswith('patches.') and key != 'patches.border']
    columns = _columns(name, checked, 'patches.start', keys)
    count = len(checked['patches.start'])
    if count and not columns['patches.end']:
        raise UserError(f'{name}: patches.end is missing')

    def value(key: str, index: int, default: float) -> float:
        column = columns[f'patches.{key}']
        return float(column[index]) if column else default

    return tuple(
        Patch(
            start=value('start', i, 0.0),
            end=value('end', i, 0.0),
            right=value('right', i, -1e3),
            left=value('left', i, 1e3),
            factors={q: value(q, i, 1.0) for q in SOIL_QUANTITIES},
        )
        for i in range(count)
    )


def _faults(name: str, checked: Mapping[str, Any], wheels: Sequence[str]) -> tuple[Fault, ...]:
    keys = ('faults.kind', 'faults.wheel', 'faults.start', 'faults.end')
    columns = _columns(name, checked, keys[0], keys)
    count = len(checked['faults.kind'])
    missing = [key for key in keys[2:] if count and not columns[key]]
    if missing:
        raise UserError(f'{name}: {missing[0]} is missing')
    found = []
    for i, kind in enumerate(checked['faults.kind']):
        wheel = columns['faults.wheel'][i] if columns['faults.wheel'] else ''
        if wheel and wheel not in wheels:
            raise UserError(f'{name}: faults.wheel: {wheel!r} is none of {", ".join(wheels)}')
        found.append(
            Fault(
                kind,
                wheels.index(wheel) if wheel else None,
                float(columns['faults.start'][i]),
                float(columns['faults.end'][i]),
            )
        )
    return tuple(found)
