# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""From parameter files and overrides to a checked ``Configuration``.

Every error is one line that names the file, the key, what is allowed and, for an unknown key,
the nearest known one.
"""

from __future__ import annotations

import argparse
import math
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from wheel_terra_estimator.configuration import ros_yaml, shipped
from wheel_terra_estimator.configuration.configuration import Configuration, law
from wheel_terra_estimator.configuration.parameters import (
    RETIRED,
    Parameter,
    by_spelling,
    declared,
    nearest,
)
from wheel_terra_estimator.configuration.ros_yaml import Value
from wheel_terra_estimator.errors import ConfigurationWarning, UserError
from wheel_terra_estimator.terramechanics.contact_law import RESISTIVE_FORCE
from wheel_terra_estimator.terramechanics.effects.base import Effect
from wheel_terra_estimator.terramechanics.soil import doubtful_units

# Parameters that every ROS node has; they may stand in the same file.
STANDARD_PARAMETERS = ('use_sim_time', 'start_type_description_service')
STANDARD_PREFIXES = ('qos_overrides.',)

LEAST, MOST = 1e-30, 1e30  # of numbers but 0: squares and inverses are finite
_SMALLER_UNITS = {'m': 'mm', 'kg': 'g'}  # that a number which is too large may be in

_MISTAKEN = {'rover.weight': 'rover.mass', 'wheels.diameter': 'wheels.radius'}  # keys for others

_Sourced = dict[str, tuple[Any, str]]


def load(
    files: Sequence[str | Path] = (),  # paths, or bare names of shipped files
    overrides: Sequence[str] = (),  # ``NAME:=VALUE``
    *,
    # Whether wheels and mass must be stated (not needed where a table brings them)
    complete: bool = True,
    # Whether the Python file that ``effect_file`` names may be run
    allow_effect_files: bool = False,
) -> Configuration:
    """Read parameter files and overrides; later ones win key by key.

    Raises UserError if a file or key cannot be used.
    """
    sourced: list[tuple[str, str, Any]] = []
    for name in files:
        path = shipped.find(name)
        for key, value in ros_yaml.read(path).items():
            if key == 'effect_file' and value:
                value = str(path.parent / str(value))
            sourced.append((key, str(path), value))
    return _overridden(sourced, overrides, complete, allow_effect_files)


def _overridden(
    sourced: list[tuple[str, str, Any]],
    overrides: Sequence[str],
    complete: bool,
    allow_effect_files: bool,
) -> Configuration:
    assigned = list(_assigned(overrides))
    configuration = _checked([*sourced, *assigned], complete, allow_effect_files)
    warn_of_idle([key for key, _, _ in assigned], configuration)
    return configuration


def _assigned(overrides: Iterable[str]) -> Iterator[tuple[str, str, Value]]:
    """Yield key, what messages name, and value."""
    for override in overrides:
        key, separator, text = override.partition(':=')
        if not separator or not key.strip():
            raise UserError(f"-p {override}: must be NAME:=VALUE, such as 'rover.mass:=120.0'")
        yield key.strip(), f'-p {override}', ros_yaml.parse_value(text, f'-p {override}')


def warn_of_idle(given: Sequence[str], configuration: Configuration) -> None:
    """Warn of parameters, given one by one, of effects that are off and so do not use them."""
    for key in given:
        section, _, name = key.rpartition('.')[0].partition('.')
        switch = f'{section}.{name}.enabled'
        if section == 'effects' and name not in configuration.effects and switch not in given:
            _warn(f'{key}: changes nothing while the effect is off; add {switch}:=true')


def files_behind(name: str | Path) -> list[Path]:
    """Return a parameter file and the Python file that its ``effect_file`` names.

    Nothing for the bare name of a shipped file.
    """
    path = Path(name).expanduser()
    if not path.is_file():
        return []
    effects = ros_yaml.read(path).get('effect_file')
    return [path, *([path.parent / str(effects)] if effects else [])]


def from_parameters(
    parameters: Mapping[str, Any],  # key -> scalar or sequence; arrays of any kind will do
    overrides: Sequence[str] = (),  # ``NAME:=VALUE``
    *,
    source: str = 'parameters',  # what messages name in place of the file
    # As for ``load``. An effect file may be run: a program that makes a mapping is trusted.
    complete: bool = True,
) -> Configuration:
    """Check parameters that came without a file (the node's overrides, a caller's mapping)."""
    sourced = [
        (key, source, value.tolist() if hasattr(value, 'tolist') else value)
        for key, value in parameters.items()
    ]
    return _overridden(sourced, overrides, complete, True)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare ``--config`` and ``-p``, the same for every command."""
    parser.add_argument(
        '--config',
        type=shipped.FileName,
        action='append',
        default=[],
        metavar='F',
        help='parameter file, or the bare name of a shipped one (frostyboy); may be given several '
        'times, later files win key by key',
    )
    parser.add_argument(
        '-p',
        dest='parameters',
        action='append',
        default=[],
        metavar='NAME:=VALUE',
        help='one parameter, wins over files; may be given several times',
    )
    parser.add_argument(
        '--allow-effect-files',
        action='store_true',
        help='run the Python file that effect_file names in a configuration',
    )


def from_arguments(arguments: argparse.Namespace, *, complete: bool = True) -> Configuration:
    """Return the configuration that the arguments of ``add_arguments`` ask for."""
    return load(
        arguments.config,
        arguments.parameters,
        complete=complete,
        allow_effect_files=arguments.allow_effect_files,
    )


def _checked(
    sourced: Sequence[tuple[str, str, Any]], complete: bool, allow_effect_files: bool
) -> Configuration:
    _load_effect_file(sourced, allow_effect_files)
    table = declared()
    spellings = by_spelling(table)
    stated: _Sourced = {}
    seen: dict[tuple[str, str], str] = {}
    for key, source, value in sourced:
        if key in STANDARD_PARAMETERS or key.startswith(STANDARD_PREFIXES):
            continue
        if key in RETIRED:
            _warn(f'{source}: {key} no longer exists and is left out: {RETIRED[key]}')
            continue
        parameter = spellings.get(key)
        if parameter is None:
            close = nearest(key, [*spellings, *_MISTAKEN])
            close = _MISTAKEN.get(close, close)
            raise UserError(
                f"{source}: unknown parameter '{key}'; the nearest known one is '{close}' "
                f'({spellings[close].allowed})'
            )
        before = seen.setdefault((source, parameter.key), key)
        if before != key:
            raise UserError(f'{source}: {before} and {key} are the same parameter; give one')
        stated[parameter.key] = (value, source)
    sources = ', '.join(dict.fromkeys(source for _, source, _ in sourced)) or 'no configuration'
    missing = [key for key, item in table.items() if item.required and key not in stated]
    if complete and missing:
        raise UserError(
            f'{sources}: {", ".join(missing)} not stated; give a rover file '
            '(--config or --params-file), such as the shipped generic_six_wheel'
        )
    values: dict[str, Value] = {}
    names = table['wheels.names']
    wheels = len(checked_value(names, stated, 0))
    for key, parameter in table.items():
        values[key] = checked_value(parameter, stated, wheels)
    _cross_check(values, stated, sources)
    configuration = Configuration.from_values(values, stated)
    typed = () if 'provenance' in stated else stated  # fitted values need no such check
    for key, words in doubtful_units(configuration.soil, typed):
        _warn(f'{stated[key][1]}: {words}')
    if configuration.rover.contact_law == RESISTIVE_FORCE and configuration.effects:
        _warn(
            f'{stated["rover.contact_law"][1]}: rover.contact_law: {RESISTIVE_FORCE} has no '
            f'effects; left out: {", ".join(configuration.effects)}'
        )
    return configuration


def _warn(words: str) -> None:
    warnings.warn(words, ConfigurationWarning, stacklevel=4)


def _load_effect_file(sourced: Sequence[tuple[str, str, Any]], allowed: bool) -> None:
    """Register a user's own effects before their keys are checked."""
    for key, source, value in reversed(sourced):
        if key == 'effect_file' and value:
            if not Path(str(value)).is_file():
                raise UserError(f'{source}: effect_file: there is no file {value}')
            if not allowed:
                raise UserError(
                    f'{source}: effect_file: {value} is Python code; look at it, then add '
                    '--allow-effect-files to have it run'
                )
            from wheel_terra_estimator.terramechanics import effects

            try:
                effects.load_file(str(value))
            except ValueError as error:
                raise UserError(f'{source}: effect_file: {error}') from None
            return


def checked_value(parameter: Parameter, stated: _Sourced, wheels: int) -> Any:
    """Return the checked value of one parameter, its default where it is not stated."""
    if parameter.key not in stated:
        if parameter.size == 'wheels':
            return [parameter.default] * wheels
        return parameter.default
    value, source = stated[parameter.key]

    def refuse(problem: str) -> UserError:
        return UserError(f'{source}: {parameter.key}: {problem}; allowed: {parameter.allowed}')

    if hasattr(value, '__iter__') and not isinstance(value, str):
        if parameter.size is None:
            raise refuse('is a list')
        items = [_scalar(parameter, item, refuse) for item in value]
        wanted = wheels if parameter.size == 'wheels' else parameter.size
        if parameter.one_for_all and len(items) == 1:
            items = items * wheels
        if not items or (wanted and len(items) != wanted):
            of = ' (as many as wheels.names)' if parameter.size == 'wheels' else ''
            raise refuse(f'has {len(items)} entries instead of {wanted or "at least 1"}{of}')
        return items
    if parameter.size is not None:
        count = parameter.size if isinstance(parameter.size, int) else wheels
        items = [value] * (1 if parameter.one_for_all else count)
        raise refuse(f'{value!r} is not a list, write [{", ".join(map(str, items))}]')
    return _scalar(parameter, value, refuse)


def _scalar(parameter: Parameter, value: Any, refuse: Callable[[str], UserError]) -> Any:
    kind = parameter.type
    if hasattr(value, 'item'):
        value = value.item()
    if kind == 'flag':
        if not isinstance(value, bool):
            raise refuse(f'{value!r} is not true or false')
        return value
    if kind == 'text':
        if not isinstance(value, str):
            raise refuse(f'{value!r} is not a text')
        if parameter.choices and value not in parameter.choices:
            raise refuse(f"{value!r} is unknown, nearest is '{nearest(value, parameter.choices)}'")
        return value
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        comma = '; the decimal mark is a point' if ',' in str(value) else ''
        raise refuse(f'{value!r} is not a number{comma}')
    if not math.isfinite(value):
        raise refuse(f'{value!r} is not finite')
    if kind == 'integer':
        if value != int(value):
            raise refuse(f'{value!r} is not an integer')
        value = int(value)
    else:
        value = float(value)
    if value and not LEAST <= abs(value) <= MOST:
        raise refuse(f'{value!r} is not a plausible value ({LEAST} to {MOST})')
    too_low = value < parameter.lower or value == parameter.above
    if too_low or value > parameter.at_most:
        unit = parameter.unit
        small = _SMALLER_UNITS.get(unit) if abs(value) > parameter.at_most else None
        asked = f' (in {small}, not {unit}?)' if small else ''
        raise refuse(f'{value!r} is out of range{asked}')
    return value


def _cross_check(values: Mapping[str, Any], stated: _Sourced, sources: str) -> None:
    """Check what concerns more than one key, or more than a range."""

    def refuse(key: str, problem: str) -> UserError:
        source = stated[key][1] if key in stated else sources
        return UserError(f'{source}: {key}: {problem}')

    names = values['wheels.names']
    if len(set(names)) < len(names) or not all(names):
        raise refuse('wheels.names', f'names must be distinct and not empty: {names}')
    if any(direction not in (-1, 1) for direction in values['wheels.direction']):
        raise refuse('wheels.direction', 'each entry must be 1 or -1')
    for i, name in enumerate(names):
        room = 2.0 * math.pi * (values['wheels.radius'][i] + values['wheels.lug_height'][i])
        if values['wheels.lug_count'][i] * values['wheels.lug_thickness'][i] > room:
            raise refuse('wheels.lug_thickness', f'the lugs of {name} do not fit its circumference')
    if -1.0 < values['max_lag'] < 0.0:
        raise refuse('max_lag', f'{values["max_lag"]} is neither -1 (learned) nor a time to wait')
    thresholds = values['filter.class_thresholds']
    if not thresholds[0] < thresholds[1] < thresholds[2]:
        raise refuse('filter.class_thresholds', f'must increase: {thresholds}')
    _check_suspension(values, refuse)
    _check_effects(values, stated, refuse)


def _check_suspension(values: Mapping[str, Any], refuse: Callable[[str, str], UserError]) -> None:
    suspension = values['rover.suspension']
    shares = values['rover.load_shares']
    if any(shares) and abs(sum(shares) - 1.0) > 1e-3:
        raise refuse('rover.load_shares', f'the shares add up to {sum(shares):g} instead of 1')
    x, y = values['wheels.x'], values['wheels.y']
    if suspension == 'rigid' and len(x) > 1 and len(set(zip(x, y, strict=True))) < len(x):
        raise refuse(
            'rover.suspension', 'rigid needs wheels.x and wheels.y, distinct for each wheel'
        )
    if suspension == 'rocker_bogie':
        left = sum(side > 0.0 for side in y)
        right = sum(side < 0.0 for side in y)
        if (left, right) != (3, 3):
            raise refuse(
                'rover.suspension',
                'rocker_bogie needs three wheels on each side; '
                f'wheels.y gives {left} left and {right} right',
            )
        for side in (1.0, -1.0):
            along = sorted(xi for xi, yi in zip(x, y, strict=True) if yi * side > 0.0)
            rear, front = along[:2] if values['rover.bogie_wheels'] == 'rear' else along[1:]
            if not rear < values['rover.bogie_pivot'][0] < front:
                raise refuse(
                    'rover.bogie_pivot',
                    f'its x must lie between the bogie wheels, {rear:g} and {front:g} m (wheels.x)',
                )


def _check_effects(
    values: Mapping[str, Any], stated: _Sourced, refuse: Callable[[str, str], UserError]
) -> None:
    """Refuse effects that the catalogue calls incompatible, and parameters of another form."""
    from wheel_terra_estimator.terramechanics.effects import catalogue

    effects = catalogue()
    enabled = [name for name in effects if values[f'effects.{name}.enabled']]
    for name in enabled:
        for other in effects[name].incompatible_with:
            if other in enabled:
                raise refuse(
                    f'effects.{name}.enabled', f'cannot be on together with effects.{other}'
                )
        if effects[name].sparse:
            try:
                law(values, f'effects.{name}')
            except ValueError as error:
                raise refuse(f'effects.{name}.targets', str(error)) from None
        else:
            _check_form(effects[name], values, stated, refuse)


def _check_form(
    effect: Effect,
    values: Mapping[str, Any],
    stated: _Sourced,
    refuse: Callable[[str, str], UserError],
) -> None:
    """Refuse a parameter of another form where no form is chosen, since it would have no effect.

    Beside a form that is stated it is left alone: one file may hold the parameters of a model, and
    a later one choose another form.
    """
    key = f'effects.{effect.name}.form'
    if key in stated:
        return
    form = str(values.get(key, effect.form))
    own = {p.name for p in effect.in_form(form).parameters}
    for p in effect.all_parameters:
        parameter = f'effects.{effect.name}.{p.name}'
        if p.name not in own and parameter in stated:
            forms = ' or '.join(v.form for v in effect.forms if p in v.parameters)
            raise refuse(
                parameter, f'the form {form!r} has no such parameter; state {key}: {forms}'
            )
