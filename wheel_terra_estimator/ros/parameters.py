# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The declared table of parameters as ROS parameters, checked by the one reader."""

from __future__ import annotations

import sys
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.configuration.parameters import Parameter, declared


def take_overrides(node: Node) -> dict[str, Any]:
    """Return what the user gave a node, and clear the way to declare it properly.

    The node must have been made with ``automatically_declare_parameters_from_overrides``: only so
    are parameters seen that nobody declares, misspelt ones above all.
    """
    given = {}
    for name in node.get_parameters_by_prefix(''):
        if name in reader.STANDARD_PARAMETERS or name.startswith(reader.STANDARD_PREFIXES):
            continue
        given[name] = node.get_parameter(name).value
        node.undeclare_parameter(name)
    return given


def declare_parameters(node: Node) -> Configuration:
    """Check and declare all parameters; they are read once, so all are read-only.

    Raises
    ------
    UserError
        If a parameter is unknown or its value cannot be used.
    """
    configuration = reader.from_parameters(
        take_overrides(node),
        source='parameters',
        allow_effect_files='--allow-effect-files' in sys.argv,
    )
    values = configuration.flat()
    for key, parameter in declared().items():
        node.declare_parameter(key, values[key], _descriptor(parameter), ignore_override=True)
    return configuration


def _descriptor(parameter: Parameter) -> ParameterDescriptor:
    unit = f' [{parameter.unit}]' if parameter.unit else ''
    descriptor = ParameterDescriptor(
        description=f'{parameter.meaning}{unit}',
        additional_constraints=parameter.allowed,
        read_only=True,
    )
    finite = parameter.lower > float('-inf') and parameter.upper < float('inf')
    if finite and parameter.kind == 'number':
        descriptor.floating_point_range = [
            FloatingPointRange(
                from_value=float(parameter.lower), to_value=float(parameter.upper), step=0.0
            )
        ]
    elif finite and parameter.kind == 'integer':
        descriptor.integer_range = [
            IntegerRange(from_value=int(parameter.lower), to_value=int(parameter.upper), step=1)
        ]
    return descriptor
