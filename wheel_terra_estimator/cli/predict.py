# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""``wheel-terra predict``."""

from __future__ import annotations

import argparse
import csv
import re
import sys
from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.cli.outputs import add_output
from wheel_terra_estimator.configuration import reader as configuration_reader
from wheel_terra_estimator.configuration.configuration import Configuration, Readings
from wheel_terra_estimator.discrepancy.numbers import SHOWN, axis_label
from wheel_terra_estimator.discrepancy.tables.steady_table import (
    INPUT_COLUMNS,
    WHEEL,
    operating_points,
)
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.frames import unit_of
from wheel_terra_estimator.output_folder import check_file, new_file
from wheel_terra_estimator.terramechanics.contact_law import (
    BEKKER_WONG_JANOSI,
    ContactLaw,
    contact_law,
)
from wheel_terra_estimator.terramechanics.effects.base import OUTPUTS
from wheel_terra_estimator.terramechanics.model import METHODS, OVERLOADED, WheelSoilModel
from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints

EXAMPLES = (
    'wheel-terra predict --config hit_wh3 --config hit_fit --slip 0:0.6:13 --load 80',
    'wheel-terra predict --config hit_wh3 --config dlr_mss -o curves.png',
    'wheel-terra predict --config hit_wh3 --config hit_fit -p rover.contact_law:=wong_reece',
)
DEFAULT_SLIP = '0:0.9:19'
MOST_POINTS = 100_000

# Columns of the result, in the layout of the tables of steady measurements.
INPUTS = (*INPUT_COLUMNS, 'leaving_angle')
SIDEWAYS = 'lateral_force'  # beside them where a wheel slides sideways
CURVES = {
    'normal_load': '{:g} N',
    'slope': 'slope {:g} rad',
    'slip_angle': 'slip angle {:.3g} rad',
    'slip': 'slip {:g}',
}
"""How a picture names its curves, by what they are not drawn over."""
PICTURES = ('.png', '.svg', '.pdf')


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    # Lets `--slip -0.5:0.9:15` through: argparse takes only plain negative numbers for values.
    parser._negative_number_matcher = re.compile(r'^-\.?\d')
    parser.add_argument(
        '--slip',
        metavar='A:B:N',
        help=f'N slip ratios from A to B, or a list A,B,C (default {DEFAULT_SLIP})',
    )
    parser.add_argument(
        '--load',
        metavar='W[,W]',
        help='loads on the wheel [N] (default: the weight of the rover over the number of wheels)',
    )
    parser.add_argument(
        '--slope',
        metavar='A[,A]',
        help='slopes, positive uphill [rad], as a list or A:B:N (default 0)',
    )
    parser.add_argument(
        '--slip-angle',
        metavar='A[,A]',
        help='slip angles, positive where the wheel slides left [rad], as a list or A:B:N (default '
        '0); adds the lateral force',
    )
    parser.add_argument('--wheel', metavar='NAME', help='which of wheels.names (default the first)')
    parser.add_argument(
        '--angular-velocity', type=float, metavar='W', help='wheel rate [rad/s], for speed effects'
    )
    parser.add_argument(
        '--points',
        type=Path,
        metavar='F.csv',
        help='operating points from a table of steady rows instead of --slip and --load',
    )
    parser.add_argument(
        '--method', choices=METHODS, default='quadrature', help='how the contact is integrated'
    )
    parser.add_argument(
        '--noise',
        metavar='Z,F,T[,L]',
        help='make virtual measurements: add normal noise of these standard deviations to sinkage '
        '[m], drawbar pull [N], torque [N m] and lateral force [N], and state them in columns',
    )
    parser.add_argument(
        '--seed', type=int, default=1, metavar='N', help='draws the noise (default 1)'
    )
    add_output(parser, 'write a picture (.png, .svg, .pdf) or a table (.csv) instead', 'FILE')
    configuration_reader.add_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    output: Path | None = arguments.output
    if output is not None:
        _check_output(output, arguments.overwrite)
    # The mass is needed for the default load only.
    brings_load = bool(arguments.load or arguments.points)
    configuration = configuration_reader.from_arguments(arguments, complete=not brings_load)
    if not configuration.soil_stated:
        note = 'no soil was stated (--config): these are curves of the default sand'
        print(f'wheel-terra predict: {note}', file=sys.stderr)
    points = _points(arguments, configuration)
    columns = {n: getattr(points.wheel if n in WHEEL else points, WHEEL.get(n, n)) for n in INPUTS}
    try:
        model = _model(arguments, configuration, float(columns['wheel_width'][0]))
        state = model.steady_state(points)
    except ValueError as error:
        raise UserError(str(error)) from None
    overloaded = (state.flags & OVERLOADED) != 0
    if overloaded.all():
        raise UserError(
            f'this soil cannot carry {columns["normal_load"][0]:g} N on this wheel at any sinkage '
            'up to the radius; choose a smaller --load, a larger wheel or another soil'
        )
    if overloaded.any():
        print(
            f'wheel-terra predict: {int(overloaded.sum())} of {overloaded.size} points left empty: '
            'the soil cannot carry the load there',
            file=sys.stderr,
        )
    result: dict[str, FloatArray] = {
        name: values
        for name, values in columns.items()
        if name in INPUTS[:3] or (arguments.points and np.isfinite(values).any())
    }
    sideways = bool(columns['slip_angle'].any())
    result.pop('slip_angle', None)
    if sideways:
        result['slip_angle'] = columns['slip_angle']
    # As the sensors of the wheel would read them, like the tables of measurements.
    outputs = Readings.of(configuration, _wheel_index(arguments, configuration)).of_state(state)
    outputs |= {SIDEWAYS: state.lateral_force} if sideways else {}
    result |= {name: np.where(overloaded, np.nan, values) for name, values in outputs.items()}
    if arguments.noise is not None:
        result = _measured(result, arguments.noise, arguments.seed)
    _write(result, arguments, configuration)
    return 0


def _model(arguments: argparse.Namespace, configuration: Configuration, width: float) -> ContactLaw:
    soil, effects, rover = configuration.soil, configuration.effects, configuration.rover
    law = rover.contact_law
    if law == BEKKER_WONG_JANOSI:
        return WheelSoilModel(soil, effects, arguments.method)
    if arguments.method != METHODS[0]:
        raise UserError(f'the law {law} says how the contact is integrated; leave --method')
    if 'wheels.width' in configuration.stated:
        width = float(configuration.wheels.width[_wheel_index(arguments, configuration)])
    return contact_law(law, soil, effects, width, float(rover.gravity))


def _write(
    result: Mapping[str, FloatArray], arguments: argparse.Namespace, configuration: Configuration
) -> None:
    """Write the table or the picture where the arguments want it."""
    output: Path | None = arguments.output
    if output is None:
        _write_csv(result, sys.stdout)
        return
    with new_file(output, arguments.overwrite) as fresh:
        if output.suffix.lower() == '.csv':
            with fresh.open('w', encoding='utf-8', newline='') as stream:
                _write_csv(result, stream)
        else:
            unnamed = 'soil as configured' if configuration.soil_stated else 'default sand'
            name = str(configuration.flat().get('soil.name') or unnamed)
            effects = ', '.join(configuration.effects) or 'none'
            law = configuration.rover.contact_law
            method = arguments.method if law == BEKKER_WONG_JANOSI else law
            _draw(result, fresh, f'{name}; effects: {effects}; {method}')


def _measured(columns: dict[str, FloatArray], text: str, seed: int) -> dict[str, FloatArray]:
    """Return the columns with noise, and the standard deviation of each reading."""
    deviations = _numbers('--noise', text)
    names = [name for name in (*OUTPUTS, SIDEWAYS) if name in columns][: deviations.size]
    sound = ((deviations >= 0.0) & (deviations < np.inf)).all()
    if len(names) not in (3, 4) or len(names) != deviations.size or not sound:
        raise UserError(
            f'--noise {text}: give three standard deviations, none below 0: sinkage [m], drawbar '
            'pull [N], torque [N m]; with slip angles also lateral force [N]'
        )
    if seed < 0:
        raise UserError(f'--seed {seed}: must be 0 or more')
    random = np.random.default_rng(seed)
    result = dict(columns)
    for name, deviation in zip(names, deviations.tolist(), strict=True):
        values = columns[name]
        result[name] = values + random.normal(0.0, deviation, values.shape)
        if deviation > 0.0:
            result[f'{name}_std'] = np.where(np.isnan(values), np.nan, deviation)
    return result


def _check_output(output: Path, overwrite: bool) -> None:
    if output.suffix.lower() not in (*PICTURES, '.csv'):
        raise UserError(
            f'{output}: what is wanted cannot be told from the name; end it in '
            f'{", ".join(PICTURES)} or .csv'
        )
    if not output.parent.is_dir():
        raise UserError(f'{output}: there is no folder {output.parent}; make it first')
    check_file(output, overwrite)


def _points(arguments: argparse.Namespace, configuration: Configuration) -> OperatingPoints:
    """Return the points that the arguments, the table and the configuration ask for."""
    wheel = _wheel_index(arguments, configuration)
    if arguments.points is not None:
        if arguments.slip or arguments.load or arguments.slope or arguments.slip_angle:
            raise UserError(
                '--points brings slip, load, slope and slip angle; leave --slip, --load, --slope, '
                '--slip-angle'
            )
        columns = _read_points(arguments.points)
    else:
        slips = _numbers('--slip', arguments.slip or DEFAULT_SLIP)
        rover = configuration.rover
        loads = np.array([rover.mass * rover.gravity / configuration.wheels.count])
        if arguments.load:
            loads = _numbers('--load', arguments.load)
        slopes = _numbers('--slope', arguments.slope or '0')
        angles = _numbers('--slip-angle', arguments.slip_angle or '0')
        if (asked := slips.size * loads.size * slopes.size * angles.size) > MOST_POINTS:
            raise UserError(f'{asked} points asked for; at most {MOST_POINTS} are computed')
        rows = np.array(list(product(loads, slopes, angles, slips)))
        names = ('normal_load', 'slope', 'slip_angle', 'slip')
        columns = dict(zip(names, rows.T, strict=True))
    for name, default in (
        ('angular_velocity', arguments.angular_velocity),
        ('pass_number', configuration.wheels.passes[wheel]),
    ):
        if default is not None:
            given = columns.get(name, np.full(columns['slip'].size, np.nan))
            columns[name] = np.where(np.isnan(given), default, given)
    source = arguments.points or 'operating points'
    return operating_points(columns, configuration, str(source), wheel)


def _wheel_index(arguments: argparse.Namespace, configuration: Configuration) -> int:
    names = configuration.wheels.names
    if arguments.wheel is None:
        return 0
    if arguments.wheel not in names:
        raise UserError(f'--wheel {arguments.wheel}: there are {", ".join(names)}')
    return names.index(arguments.wheel)


def _numbers(option: str, text: str) -> FloatArray:
    """Read A:B:N or A,B,C."""
    try:
        if ':' in text:
            first, last, count = text.split(':')
            if not 1 <= int(count) <= MOST_POINTS:
                raise ValueError
            return np.linspace(float(first), float(last), int(count))
        return np.array([float(part) for part in text.split(',')])
    except ValueError:
        raise UserError(
            f'{option} {text}: must be A:B:N (N values from A to B, at most {MOST_POINTS}) or a '
            'list A,B,C of numbers'
        ) from None


def _read_points(path: Path) -> dict[str, FloatArray]:
    """Read the input columns of a table; others are left alone."""
    from wheel_terra_estimator.discrepancy.tables.header import ALL, Choice
    from wheel_terra_estimator.discrepancy.tables.parsing import read_columns

    lines, columns, *_ = read_columns(path, Choice(ignored=(ALL,)), INPUTS)
    if not lines.size:
        raise UserError(f'{path}: no rows below the column names; add one per operating point')
    for needed in ('slip', 'normal_load'):
        missing = lines[~np.isfinite(columns[needed])]
        if missing.size:
            raise UserError(f'{path}, line {missing[0]}: {needed} is missing; fill the cell')
    return columns


def _write_csv(columns: Mapping[str, FloatArray], stream: Any) -> None:
    writer = csv.writer(stream, lineterminator='\n')
    writer.writerow(columns)
    for row in zip(*columns.values(), strict=True):
        writer.writerow(f'{value:.9g}' if np.isfinite(value) else '' for value in row)


def _draw(columns: Mapping[str, FloatArray], path: Path, title: str) -> None:
    from matplotlib.figure import Figure

    from wheel_terra_estimator.reporting.style import LINE_COLOURS, picture_style

    names = [*OUTPUTS, *([SIDEWAYS] if SIDEWAYS in columns else [])]
    # Over the slip or, where there is but one, over what else varies.
    varied = [
        name
        for name in ('slip', 'slip_angle', *CURVES)
        if name in columns and np.ptp(columns[name])
    ]
    across = varied[0] if varied else 'slip'
    with picture_style():
        figure = Figure(figsize=(3.2 * len(names), 3.4))
        axes = figure.subplots(1, len(names))
        for index, (label, rows) in enumerate(_groups(columns, across)):
            order = np.argsort(rows[across], kind='stable')
            colour, marker = LINE_COLOURS[index % len(LINE_COLOURS)], '' if len(order) > 1 else 'o'
            for axis, name in zip(axes, names, strict=True):
                x, y = rows[across][order], SHOWN[name][0] * rows[name][order]
                axis.plot(x, y, marker=marker, color=colour, label=label)
        for axis, name in zip(axes, names, strict=True):
            axis.set_xlabel(f'{across.replace("_", " ")} [{unit_of(across)}]')
            axis.set_ylabel(axis_label(name))
        axes[0].invert_yaxis()
        axes[0].legend()
        figure.suptitle(title, fontsize=9)
        figure.savefig(path, dpi=110)


def _groups(
    columns: Mapping[str, FloatArray], across: str
) -> Sequence[tuple[str, Mapping[str, FloatArray]]]:
    """Split the rows into one curve over `across` per combination of the other inputs."""
    names = [name for name in CURVES if name in columns and name != across and columns[name].any()]
    keys = np.stack([columns[name] for name in names], axis=1)
    found = []
    for values in np.unique(keys, axis=0):
        rows = (keys == values).all(axis=1)
        label = ', '.join(CURVES[name].format(v) for name, v in zip(names, values, strict=True))
        found.append((label, {name: column[rows] for name, column in columns.items()}))
    return found
