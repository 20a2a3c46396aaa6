# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A new rover file with comments: required values, and useful optional ones."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from wheel_terra_estimator.configuration.parameters import declared
from wheel_terra_estimator.configuration.ros_yaml import Value, as_text, format_value

DEFAULT_WIDTH_SHARE = 0.6  # width over radius of a wheel whose width is not known [-]
CENTRE_HEIGHT = 1.4
"""Height of a centre of gravity that is not known, over the wheel radius [-]: low four-wheel rovers
have 1.3 to 1.4."""

A_GUESS = 'A GUESS, to be measured'
GUESSED = re.compile(rf'# ({A_GUESS}.*)\n +([\w.]+):')  # the comment, the key below it


@dataclass(frozen=True)
class RoverSketch:
    """Facts of a rover; nan-free, one entry per wheel, front to rear, left before right.

    ``guessed`` names the keys that are guesses and have to be looked at.
    """

    name: str
    wheels: Sequence[str]
    radius: Sequence[float]  # [m]
    width: Sequence[float]  # [m]
    x: Sequence[float]  # [m]
    y: Sequence[float]  # [m]
    z: Sequence[float]  # [m]
    mass: float  # [kg]
    centre_of_gravity: Sequence[float]  # [m]
    direction: Sequence[int] = ()
    wheel_odometry: str = ''  # topic that carries the rates; '': joint_states
    steering_joints: Sequence[str] = ()  # that steer each wheel, '' = not steered
    suspension: Mapping[str, Value] = field(default_factory=dict)  # its keys; none: not known
    left_out: Sequence[str] = ()  # joints that may be wheels, by their height
    guessed: frozenset[str] = field(default_factory=frozenset)
    source: str = ''


def rover_file(sketch: RoverSketch) -> str:
    """Return the text of a rover file that all commands accept."""
    count = len(sketch.wheels)
    values: dict[str, Value] = {
        'rover.name': sketch.name,
        'rover.mass': float(sketch.mass),
        'rover.centre_of_gravity': [float(v) for v in sketch.centre_of_gravity],
        **sketch.suspension,
        'wheels.names': list(sketch.wheels),
        **{
            f'wheels.{name}': [float(v) for v in getattr(sketch, name)]
            for name in ('radius', 'width', 'x', 'y', 'z')
        },
        'wheels.direction': [int(v) for v in sketch.direction] or [1] * count,
    }
    if any(sketch.steering_joints):
        values['wheels.steering_joints'] = list(sketch.steering_joints)
    if sketch.wheel_odometry:
        values['wheel_odometry'] = sketch.wheel_odometry
    values['wheels.passes'] = passes(sketch.x, sketch.y)
    table = declared()
    comment = f'{sketch.name}: made by `wheel-terra init`\n\n'
    comment += f'Source: {sketch.source}.\n' if sketch.source else ''
    comment += 'Next: wheel-terra check RECORDING --config THIS_FILE, then wheel-terra calibrate.'
    notes = {}
    for key in (*values, *_WORTH_STATING):
        unit = f' [{table[key].unit}]' if table[key].unit not in ('', '-') else ''
        mark = f'{A_GUESS}: ' if key in sketch.guessed else ''
        notes[key] = f'{mark}{table[key].meaning}{unit}'
    lines = [as_text(values, comment, notes)]
    lines += ['    # Worth stating if known (values shown are the defaults):']
    for key in _WORTH_STATING:
        if key not in values:
            default = table[key].default
            shown = [default] * count if table[key].size == 'wheels' else default
            lines.append(f'    # {key}: {format_value(shown)}  # {notes[key]}')
    return '\n'.join(lines) + '\n'


_WORTH_STATING = (
    'wheels.lug_height',
    'wheels.lug_count',
    'wheels.torque_limit',
    'rover.suspension',
    'rover.gravity',
    'sensors.wheel_rate_std',
    'sensors.torque_std',
    'sensors.specific_force_std',
    'sensors.angular_rate_std',
    'sensors.reference_std',
    'sensors.reference_wander_std',
    'sensors.imu_mounting_roll_deg',
    'sensors.imu_mounting_pitch_deg',
    'sensors.imu_mounting_yaw_deg',
)


def passes(x: Sequence[float], y: Sequence[float]) -> list[int]:
    """Return the pass number of each wheel: how many run before it in the same rut, plus one."""
    count = len(x)
    same_rut = 0.1  # [m]
    return [
        1 + sum(x[k] > x[i] + same_rut and abs(y[k] - y[i]) < same_rut for k in range(count))
        for i in range(count)
    ]
