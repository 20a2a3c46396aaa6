# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Scenario files: which rover drives where, with which sensors and faults, and what is random.

A scenario is a ROS parameter file like every configuration file. The declared keys below are all
there are. What starts with ``variation.`` is drawn anew for each seed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.configuration import reader, ros_yaml, shipped
from wheel_terra_estimator.configuration.configuration import Configuration, Section
from wheel_terra_estimator.configuration.parameters import (
    Parameter,
    flag,
    integer,
    nearest,
    number,
    text,
)
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.simulation.commands import DriveProfile
from wheel_terra_estimator.simulation.terrain import SOIL_QUANTITIES, Patch

FloatArray = NDArray[np.float64]
DEFAULT = 'climb_soft_patch'

WHEEL_FAULTS = ('overspeed', 'locked', 'coasting', 'weak', 'lifted')
SENSOR_FAULTS = (
    'no_wheel_odometry',
    'no_torque',
    'no_imu',
    'no_orientation',
    'no_sinkage',
    'no_reference',
    'sinkage_stuck',
    'torque_spikes',
    'reference_wild',
    'imu_bias',
    'nan_values',
    'zero_stamps',
    'repeated_stamps',
)

_FACTORS = {
    'stiffness': 'bearing modulus',
    'cohesion': 'cohesion',
    'friction': 'tangent of the friction angle',
    'shear_modulus': 'shear modulus',
    'slip_sinkage': 'growth of the sinkage exponent with slip',
}

TRUE_EFFECTS = {
    'slip_sinkage_exponent.enabled': 'true',
    'slip_sinkage_exponent.n1': '0.35',
    'stress_peak_shift.enabled': 'true',
    'stress_peak_shift.c2': '0.15',
    'lug_shear_radius.enabled': 'true',
    'lug_digging.enabled': 'true',
    'soil_mound.enabled': 'true',
    'multipass.enabled': 'true',
    'bulldozing.enabled': 'true',
    'bulldozing.kb': '0.3',
}
"""Effects that are at work in the simulated soil where a scenario does not say otherwise."""

DECLARED: tuple[Parameter, ...] = (
    text('description', '', 'what happens in the drive'),
    text('configuration', ['generic_six_wheel'], 'rover and soil files', size=0),
    text('parameters', [], 'NAME:=VALUE on top of these files, known to the estimator', size=0),
    text(
        'truth',
        [f'effects.{name}:={value}' for name, value in TRUE_EFFECTS.items()],
        'NAME:=VALUE that hold in the simulation, whatever the estimator is told',
        size=0,
    ),
    number('duration', 120.0, 's', 'length of the drive', above=0.0, at_most=1e6),
    # What the rover is told
    number('drive.time', [0.0], 's', 'knots of the command, linear between', size=0),
    number('drive.forward', [0.05], 'm/s', 'commanded speed at the knots', size=0),
    number('drive.turn_rate', [0.0], 'rad/s', 'commanded yaw rate at the knots', size=0),
    number('drive.acceleration', 0.1, 'm/s^2', 'greatest change of rim speed', above=0.0),
    number(
        'drive.torque_ratio',
        0.0,
        '-',
        'torque limit over mean load times radius; 0 = wheels.torque_limit',
        at_least=0.0,
    ),
    # Ground
    number('slope.position', [0.0], 'm', 'knots of the slope along the path', size=0),
    number(
        'slope.angle_deg',
        [0.0],
        'deg',
        'slope there, uphill positive',
        size=0,
        at_least=-60.0,
        at_most=60.0,
    ),
    number('slope.side_deg', 0.0, 'deg', 'slope across, left high', at_least=-45.0, at_most=45.0),
    number('slope.undulation_deg', 0.0, 'deg', 'unevenness, standard deviation', at_least=0.0),
    number('slope.undulation_length', 0.6, 'm', 'its correlation length', above=0.0),
    number('patches.start', [], 'm', 'patches of other soil begin here', size=0),
    number('patches.end', [], 'm', 'and end here', size=0),
    number('patches.right', [], 'm', 'right borders (default: none)', size=0),
    number('patches.left', [], 'm', 'left borders (default: none)', size=0),
    *(
        number(f'patches.{name}', [], '-', f'factor on the {meaning}', size=0, above=0.0)
        for name, meaning in _FACTORS.items()
    ),
    number('patches.border', 0.3, 'm', 'width of the transition', above=0.0),
    number('patchiness', 0.0, '-', 'relative unevenness of the stiffness', at_least=0.0),
    number('patchiness_length', 0.6, 'm', 'its correlation length', above=0.0),
    number(
        'dig_efficiency',
        0.05,
        '-',
        'share of the soil between passing lugs that a spinning wheel throws out',
        at_least=0.0,
        at_most=1.0,
    ),
    # Drawn for each seed: relative standard deviations
    *(
        number(f'variation.{name}', 0.0, '-', f'of the {meaning}', at_least=0.0, at_most=2.0)
        for name, meaning in _FACTORS.items()
    ),
    number('variation.patch', 0.0, '-', 'of the stiffness of each patch', at_least=0.0),
    number('variation.slope_deg', 0.0, 'deg', 'of the slope, all knots alike', at_least=0.0),
    number('variation.speed', 0.0, '-', 'of the commanded speeds', at_least=0.0),
    number('variation.mass', 0.0, '-', 'of the mass', at_least=0.0),
    number('variation.radius', 0.0, '-', 'of the wheel radius, all wheels alike', at_least=0.0),
    # Sensors; noise and rates are those of the configuration (sensors.*)
    flag('sensors.torque', True, 'drives report torque'),
    flag('sensors.imu', True, 'there is an IMU'),
    flag('sensors.orientation', True, 'the IMU reports its orientation'),
    flag('sensors.sinkage', True, 'sinkage is measured'),
    flag('sensors.leaving_angle', False, 'the leaving angle is measured'),
    flag('sensors.reference', True, 'there is a reference velocity'),
    number('sensors.noise', 1.0, '-', 'factor on all noise and zero errors', at_least=0.0),
    number(
        'sensors.reference_rate',
        0.0,
        'Hz',
        '0 = sensors.reference_rate of the rover',
        at_least=0.0,
    ),
    number('sensors.reference_delay', -1.0, 's', 'negative = that of the rover file', at_most=10.0),
    integer('sensors.encoder_counts', 20000, '1/rev', 'per turn of a wheel; 0 = exact', at_least=0),
    number('sensors.sinkage_outliers', 0.01, '-', 'share of wild readings', at_least=0.0),
    number('sensors.sinkage_dropouts', 0.02, '-', 'share of missing readings', at_least=0.0),
    number('sensors.reference_dropouts', 0.02, '-', 'share of missing messages', at_least=0.0),
    number('sensors.reference_outliers', 0.0, '-', 'share of wild messages', at_least=0.0),
    number('sensors.jitter', 0.005, 's', 'mean of the random delay of messages', at_least=0.0),
    # Faults
    text('faults.kind', [], 'faults', size=0, choices=WHEEL_FAULTS + SENSOR_FAULTS),
    text('faults.wheel', [], 'wheel concerned; "" = all, or none in particular', size=0),
    number('faults.start', [], 's', 'from', size=0),
    number('faults.end', [], 's', 'to', size=0),
    number('faults.random_rate', 0.0, '1/h', 'rate of random sensor faults', at_least=0.0),
)


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
    """A checked scenario.

    Attributes
    ----------
    name : str
        Where it came from.
    files, parameters : tuple of str
        Configuration files and NAME:=VALUE that an estimator of this drive is to be given.
    configuration : Configuration
        What these say: rover, nominal soil, sensors.
    truth : Configuration
        What holds in the simulation before the variations of a seed.
    drive, slope, variation, sensors : Section
        Declared keys of these sections as attributes.
    profile : DriveProfile
        The command.
    patches : tuple of Patch
        Patches of other soil.
    faults : tuple of Fault
        Planned faults.
    """

    name: str
    description: str
    files: tuple[str, ...]
    parameters: tuple[str, ...]
    configuration: Configuration
    truth: Configuration
    duration: float
    profile: DriveProfile
    patches: tuple[Patch, ...]
    faults: tuple[Fault, ...]
    drive: Section
    slope: Section
    variation: Section
    sensors: Section
    border: float
    patchiness: float
    patchiness_length: float
    dig_efficiency: float
    random_fault_rate: float


def load(
    source: str | Path | Mapping[str, Any] = DEFAULT,
    *,
    files: Sequence[str | Path] = (),
    parameters: Sequence[str] = (),
    rover: str | Path | None = None,
    **changes: Any,
) -> Scenario:
    """Read a scenario.

    Parameters
    ----------
    source : str, pathlib.Path or mapping
        A path, the bare name of a shipped scenario, or dotted keys with values.
    files, parameters : sequence
        Further configuration files and NAME:=VALUE, known to simulation and estimator.
    rover : str or pathlib.Path, optional
        Rover file in place of the scenario's own; its soil and ground stay.
    **changes
        Dotted keys of the scenario with ``__`` for the dot, such as ``sensors__reference=False``.

    Raises
    ------
    UserError
        For a file, key or value that cannot be used.
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
        border=checked['patches.border'],
        patchiness=checked['patchiness'],
        patchiness_length=checked['patchiness_length'],
        dig_efficiency=checked['dig_efficiency'],
        random_fault_rate=checked['faults.random_rate'],
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


def shipped_scenarios() -> dict[str, str]:
    """Return name -> description of the scenarios that come with the package."""
    return {
        key.removeprefix('scenarios/'): str(ros_yaml.read(path).get('description', ''))
        for key, path in shipped.files().items()
        if key.startswith('scenarios/')
    }


def _checked(name: str, values: Mapping[str, Any]) -> dict[str, Any]:
    table = {parameter.key: parameter for parameter in DECLARED}
    for key in values:
        if key not in table:
            close = nearest(key, table)
            hint = f"; the nearest known one is '{close}'" if close else ''
            raise UserError(f"{name}: unknown key '{key}' of a scenario{hint}")
    stated = {key: (value, name) for key, value in values.items() if value != []}
    return {key: reader.checked_value(table[key], stated, 0) for key in table}


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


def _profile(name: str, checked: Mapping[str, Any]) -> DriveProfile:
    keys = ('drive.time', 'drive.forward', 'drive.turn_rate')
    columns = [np.array(c, float) for c in _columns(name, checked, keys[0], keys).values()]
    if (np.diff(columns[0]) < 0.0).any():
        raise UserError(f'{name}: drive.time: times must not decrease')
    return DriveProfile(*columns)


def _slope(name: str, checked: Mapping[str, Any]) -> Section:
    keys = ('slope.position', 'slope.angle_deg')
    columns = _columns(name, checked, keys[0], keys)
    if (np.diff(columns[keys[0]]) < 0.0).any():
        raise UserError(f'{name}: slope.position: positions must not decrease')
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
