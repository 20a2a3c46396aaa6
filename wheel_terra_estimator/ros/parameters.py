# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The declared table of parameters as ROS parameters, checked by the one reader."""

from __future__ import annotations

import re
import sys
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node

from wheel_terra_estimator.configuration import reader, ros_yaml
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.configuration.parameters import Parameter, declared
from wheel_terra_estimator.errors import ConfigurationWarning, UserError

TUNING = ('output_rate', 'max_lag', 'history', 'reference_odom_max_rate')
"""May be changed while the node runs, as all of ``filter.*``."""


def is_tuning(key: str) -> bool:
    """Whether a parameter may be changed while the node runs."""
    return key in TUNING or key.startswith('filter.')


def overrides(node: Node) -> dict[str, Any]:
    """Return what the user gave a node.

    The node must have been made with ``automatically_declare_parameters_from_overrides``: only so
    are undeclared parameters found, such as misspelt ones.
    """
    return {
        name: node.get_parameter(name).value
        for name in node.get_parameters_by_prefix('')
        if name not in reader.STANDARD_PARAMETERS and not name.startswith(reader.STANDARD_PREFIXES)
    }


def files(arguments: Sequence[str] | None) -> list[Path]:
    """Return the parameter files of the command line, and of arguments given to a node."""
    words = [*sys.argv, *(arguments or ())]
    return [Path(words[i + 1]) for i, word in enumerate(words[:-1]) if word == '--params-file']


def unread(files: Iterable[Path], node: Node) -> str:
    """Return which of the parameter files has no section for this node; empty where all have."""
    name = node.get_fully_qualified_name()
    for path in files:
        sections = ros_yaml.sections(path)
        if not any(_applies(section, name) for section in sections):
            there = ', '.join(f"'{section}:'" for section in sections) or 'none'
            return (
                f'{path}: sections there: {there}; none applies to node {name}, '
                "so nothing of it counts; use '/**:'"
            )
    return ''


def _applies(section: str, name: str) -> bool:
    """Whether ROS gives a section of a parameter file to a node: '*' is one name, '**' any."""
    pattern = re.escape(f'/{section.lstrip("/")}')
    pattern = pattern.replace(r'/\*\*', r'(/\w+)*').replace(r'/\*', r'/\w+')
    return re.fullmatch(pattern, name) is not None


def configuration(given: Mapping[str, Any], warn: Callable[[str], Any]) -> Configuration:
    """Return the checked configuration; pass its warnings to ``warn``.

    Raises UserError if a parameter is unknown or its value cannot be used.
    """
    with warnings.catch_warnings(record=True) as doubtful:
        warnings.simplefilter('always', ConfigurationWarning)
        checked = reader.from_parameters(given, source='parameters')
    for warning in doubtful:
        warn(str(warning.message))
    return checked


def why_refused(given: Mapping[str, Any], changes: Mapping[str, Any]) -> str:
    """Return why one of the changes cannot be used, whatever the others are; empty where all can.

    Conditions on several parameters are checked when the node is configured.
    """
    table = declared()
    wheels = len({**given, **changes}.get('wheels.names') or ())
    for key, value in changes.items():
        value = value.tolist() if hasattr(value, 'tolist') else value
        if key in table and (wheels or table[key].size != 'wheels'):
            try:
                reader.checked_value(table[key], {key: (value, 'parameters')}, wheels)
            except UserError as error:
                return str(error)
    return ''


def declare(node: Node, configuration: Configuration) -> None:
    """Declare all parameters again, with their values, units and ranges."""
    for name in overrides(node):
        node.undeclare_parameter(name)
    values = configuration.flat()
    for key, parameter in declared().items():
        node.declare_parameter(key, values[key], descriptor(parameter), ignore_override=True)


def descriptor(parameter: Parameter) -> ParameterDescriptor:
    """Return the descriptor of a parameter: meaning, unit, range, when it may change."""
    unit = f' [{parameter.unit}]' if parameter.unit else ''
    tuning = is_tuning(parameter.key)
    when = '' if tuning else '; read-only while the node is configured'
    found = ParameterDescriptor(
        description=f'{parameter.meaning}{unit}',
        additional_constraints=f'{parameter.allowed}{when}',
        # An integer will do where a number is wanted; the validator knows.
        dynamic_typing=parameter.type == 'number',
    )
    finite = parameter.lower > float('-inf') and parameter.at_most < float('inf')
    if finite and parameter.type == 'number' and not tuning:
        found.floating_point_range = [
            FloatingPointRange(
                from_value=float(parameter.lower), to_value=float(parameter.at_most), step=0.0
            )
        ]
    elif finite and parameter.type == 'integer':
        found.integer_range = [
            IntegerRange(from_value=int(parameter.lower), to_value=int(parameter.at_most), step=1)
        ]
    return found
