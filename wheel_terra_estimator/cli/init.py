# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""``wheel-terra init``."""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from wheel_terra_estimator.cli.outputs import add_output, add_remaps
from wheel_terra_estimator.configuration.rover_template import (
    CENTRE_HEIGHT,
    DEFAULT_WIDTH_SHARE,
    RoverSketch,
    rover_file,
)
from wheel_terra_estimator.errors import UserError

EXAMPLES = (
    'wheel-terra init --urdf rover.urdf -o my_rover.yaml',
    'wheel-terra init --bag my_drive --radius 0.165 --track 0.57 --wheelbase 0.51 --mass 50 '
    '-o my_rover.yaml',
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    add_output(parser, 'rover file to be written', 'F', required=True)
    source = parser.add_mutually_exclusive_group()
    source.add_argument('--urdf', type=Path, metavar='F', help='robot description (URDF)')
    source.add_argument(
        '--bag',
        type=Path,
        metavar='BAG',
        help='recording: its /robot_description, else the names of its wheels',
    )
    parser.add_argument(
        '--wheels', metavar='NAMES', help='wheel joints, comma between, front to rear, left first'
    )
    for name, unit, meaning in _MEASURES:
        parser.add_argument(f'--{name}', type=_positive, metavar=unit, help=meaning)
    add_remaps(parser)
    parser.add_argument('--name', default='', metavar='TEXT', help='name of the rover, for reports')


_MEASURES = (
    ('radius', 'M', 'radius of the wheels, lugs not counted [m]'),
    ('width', 'M', 'width of the wheels [m]'),
    ('track', 'M', 'distance of left and right wheels [m]'),
    ('wheelbase', 'M', 'distance of the first and last axle [m]'),
    ('mass', 'KG', 'mass on these wheels [kg]'),
)
DESCRIPTION = '/robot_description'
_FEW_WHEELS = 4  # number up to which the suspension hardly matters
TEXT_AT = 8
"""Bytes of a std_msgs/String before its text: encapsulation and length."""
_NEEDED = ('radius', 'track', 'wheelbase', 'mass')


def _positive(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0.0 < value < 1e6:
        raise argparse.ArgumentTypeError(f'{text!r} must be a number above 0')
    return value


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from wheel_terra_estimator.configuration import reader
    from wheel_terra_estimator.output_folder import check_file, new_file

    check_file(arguments.output, arguments.overwrite)
    sketch = _sketch(arguments)
    if len(sketch.wheels) > _FEW_WHEELS and not sketch.suspension:
        sketch = replace(sketch, guessed=sketch.guessed | {'rover.suspension'})
    with new_file(arguments.output, arguments.overwrite) as path:
        path.write_text(rover_file(sketch), encoding='utf-8')
        try:
            reader.load([path])
        except UserError as error:
            raise UserError(str(error).replace(str(path), str(arguments.output))) from None
    count = len(sketch.wheels)
    wheels = '1 wheel' if count == 1 else f'{count} wheels'
    print(f'rover file: {arguments.output} ({wheels}, {sketch.mass:g} kg)')
    if others := ', '.join(sketch.left_out):
        print(f'  not named like wheels: {others}; if they are: --wheels')
    for key in sorted(sketch.guessed):
        print(f'  {key} is a guess: check it')
    print(f'next: wheel-terra check RECORDING --config {shlex.quote(str(arguments.output))}')
    return 0


def _sketch(arguments: argparse.Namespace) -> RoverSketch:
    wheels = [name.strip() for name in (arguments.wheels or '').split(',') if name.strip()]
    if len(wheels) == 1 and wheels[0].isdigit():
        raise UserError(f'--wheels {wheels[0]}: give the names of the wheel joints, comma between')
    sketch = _described(arguments, wheels)
    if sketch is not None:
        if arguments.mass:
            guessed = sketch.guessed - {'rover.mass'}
            sketch = replace(sketch, mass=arguments.mass, guessed=guessed)
        x, y = _spread_to(sketch.x, arguments.wheelbase), _spread_to(sketch.y, arguments.track)
        sketch = replace(sketch, x=x, y=y)
        return replace(sketch, name=arguments.name or sketch.name)
    topic = _odometry_alone(arguments) if arguments.bag and wheels else ''
    if arguments.bag and not topic:
        wheels = _wheels_of(arguments.bag, arguments.remap, wheels)
    elif not wheels:
        raise UserError('give --urdf, --bag or --wheels')
    if topic:
        print(f'note: no joint states, so wheel_odometry: odom, with --remap odom:={topic}')
    return replace(_from_measures(arguments, wheels), wheel_odometry='odom' if topic else '')


def _spread_to(places: Sequence[float], distance: float | None) -> Sequence[float]:
    """Return places whose outermost have the measured distance, if there is one [m]."""
    low, high = min(places), max(places)
    if distance is None or low == high:
        return places
    scale, middle = distance / (high - low), 0.5 * (low + high)
    return [round(middle + scale * (place - middle), 4) for place in places]


def _described(arguments: argparse.Namespace, wheels: list[str]) -> RoverSketch | None:
    """Return the rover of a URDF or of /robot_description; None where there is none."""
    from wheel_terra_estimator.bags.storage import open_bag
    from wheel_terra_estimator.configuration.urdf import read_urdf

    path, text = arguments.urdf, None
    if arguments.bag and not (arguments.track or arguments.wheelbase):
        with open_bag(arguments.bag) as bag:
            if DESCRIPTION in bag.topics:
                messages = bag.messages([DESCRIPTION])
                data = next((bytes(data) for _, _, data in messages if len(data) > TEXT_AT), b'')
                text = data[TEXT_AT:].rstrip(b'\0')  # std_msgs/String in CDR
                path = Path(f'{arguments.bag}:{DESCRIPTION}')
    return read_urdf(path, wheels, text, arguments.radius, arguments.width) if path else None


def _odometry_alone(arguments: argparse.Namespace) -> str:
    """Return the topic of the odometry of a recording without joint states; '' for none."""
    from wheel_terra_estimator.bags.reader import parse_remaps
    from wheel_terra_estimator.bags.storage import open_bag
    from wheel_terra_estimator.bags.topic_choice import choose_topics

    with open_bag(arguments.bag) as bag:
        chosen = choose_topics(bag, parse_remaps(arguments.remap))
    return '' if 'joint_states' in chosen else chosen.get('odom', '')


def _wheels_of(path: Path, remaps: list[str], given: list[str]) -> list[str]:
    """Return the given wheels, if a recording has them, or the joints that are named like some."""
    from wheel_terra_estimator.bags.reader import parse_remaps
    from wheel_terra_estimator.bags.series_reader import read_series
    from wheel_terra_estimator.bags.storage import open_bag
    from wheel_terra_estimator.checks.rover_facts import wheel_names

    with open_bag(path) as bag:
        recording = read_series(bag, parse_remaps(remaps), path.name)
        if recording.joints is None:
            raise UserError(
                f'{path}: no joint states in it; name their topic (--remap joint_states:=/TOPIC), '
                'or where there is odometry only the wheels (--wheels)'
            )
    print(*(f'note: {note}\n' for note in recording.notes), sep='', end='')
    joints = recording.joints
    if unknown := ', '.join(name for name in given if name not in joints.names):
        there = ', '.join(joints.names)
        raise UserError(f'--wheels {unknown}: not on {joints.topic} of {path}, which has {there}')
    if given:
        return given
    names = list(wheel_names(joints.names))
    rates = zip(joints.names, joints.rate.T, strict=True)
    others = [n for n, rate in rates if n not in names and (abs(rate) > 0.0).any()]
    if others:
        print(f'not named like wheels: {", ".join(others)}; if they are: --wheels')
    return names


def _from_measures(arguments: argparse.Namespace, wheels: list[str]) -> RoverSketch:
    from wheel_terra_estimator.checks.rover_facts import side_of

    measures = {name: getattr(arguments, name) for name, _, _ in _MEASURES}
    for name, most in (('wheelbase', 2), ('track', 1)):
        if measures[name] is None and len(wheels) <= most:
            measures[name] = 0.0  # one axle, one wheel
    missing = [name for name in _NEEDED if measures[name] is None]
    if missing:
        words = {name: f'--{name} {unit} ({meaning})' for name, unit, meaning in _MEASURES}
        raise UserError(f'missing: {", ".join(words[name] for name in missing)}')
    sides = [side_of(name) for name in wheels]
    order_known = 0 not in sides or arguments.wheels is not None  # whose order is asked for
    if 0 in sides:  # left before right, as the file has it
        sides = [1 if i % 2 == 0 else -1 for i in range(len(wheels))]
    if len(wheels) == 1:
        sides = [0]
    rows = [sum(side == sides[i] for side in sides[:i]) for i in range(len(wheels))]
    last = max(rows, default=0)
    base, half = measures['wheelbase'], 0.5 * measures['track']
    x = [base * (0.5 - row / last) if last else 0.0 for row in rows]
    count = len(wheels)
    guessed = {'rover.centre_of_gravity'} | (set() if measures['width'] else {'wheels.width'})
    guessed |= {'wheels.x'} if last > 1 else set()
    guessed |= {'wheels.y'} if sum(sides) or not order_known else set()
    return RoverSketch(
        name=arguments.name or 'my rover',
        wheels=wheels,
        radius=[measures['radius']] * count,
        width=[measures['width'] or DEFAULT_WIDTH_SHARE * measures['radius']] * count,
        x=[round(value, 4) for value in x],
        y=[round(half * side, 4) for side in sides],
        z=[measures['radius']] * count,
        mass=measures['mass'],
        centre_of_gravity=(0.0, 0.0, round(CENTRE_HEIGHT * measures['radius'], 4)),
        guessed=frozenset(guessed),
        source='wheel names from the recording, the rest as given' if arguments.bag else 'as given',
    )
