# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""``wheel-terra diagnose``: table or drive in, verdict, corrected model and report out."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from wheel_terra_estimator.cli.outputs import add_output, add_remaps, file_or_entry
from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.output_folder import check_folder, new_folder

if TYPE_CHECKING:
    from wheel_terra_estimator.configuration.configuration import Configuration
    from wheel_terra_estimator.discrepancy.result import Diagnosis
    from wheel_terra_estimator.discrepancy.tables.steady_table import SteadyTable

EXAMPLES = (
    'wheel-terra diagnose rows.csv --config hit_wh3 --config hit_fit -o diagnosis',
    'wheel-terra diagnose my_bag --config my_rover.yaml --remap reference_odom:=/vo -o diagnosis',
    'wheel-terra diagnose smooth.csv lugged.csv --config rig.yaml -o diagnosis',
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    parser.add_argument(
        'data',
        type=Path,
        nargs='+',
        metavar='DATA',
        help='CSV table of steady rows, or a rosbag2; several count as one',
    )
    add_output(parser, 'folder to be written', required=True)
    parser.add_argument(
        '--reference',
        type=Path,
        metavar='A.csv',
        help='table in which the effect in question is absent: structural error common to both '
        'cancels',
    )
    parser.add_argument(
        '--columns',
        type=file_or_entry,
        action='append',
        default=[],
        metavar='FILE|NAME=COLUMN',
        help='which column is what, where its title does not say: sinkage=-z (a minus turns the '
        'sign round), "torque=M [N mm]", or a YAML file of lines NAME: COLUMN',
    )
    parser.add_argument(
        '--ignore-columns',
        action='append',
        default=[],
        metavar='COLUMN',
        help='column of numbers to leave out (several with commas between; all: what is not '
        'understood); else a column that is not used is an error',
    )
    parser.add_argument(
        '--effects',
        type=Path,
        action='append',
        default=[],
        metavar='FILE.py',
        help='Python file with effects of your own, which compete like the others',
    )
    parser.add_argument(
        '--only',
        action='append',
        default=[],
        metavar='NAME',
        help='effect that may be named; may be given several times (default: all)',
    )
    parser.add_argument(
        '--allowed-error',
        type=float,
        default=0.02,
        metavar='SHARE',
        help="model error that is allowed, share of each quantity's range (default 0.02): a "
        'quantity off by more than twice its sum with the noise does not agree',
    )
    parser.add_argument(
        '--soil-known-to',
        type=float,
        metavar='SHARE',
        help='share of its value to which every soil number is known (default: as configured, else '
        'by the class of its source)',
    )
    add_remaps(parser, 'for a bag: ')
    parser.add_argument(
        '--smooth',
        action='store_true',
        help='for a bag: slip from a fixed-interval smoother without torque and sinkage (1.7 times '
        'the time of a replay)',
    )
    parser.add_argument(
        '--no-pictures', action='store_true', help='write report.json and model.yaml only'
    )
    parser.add_argument('--json', action='store_true', help='print report.json and nothing else')
    reader.add_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from wheel_terra_estimator.bags.storage import is_bag
    from wheel_terra_estimator.discrepancy.report.model_file import write_files

    output: Path = arguments.output
    check_folder(output, arguments.overwrite)
    for option, least, most in (('allowed_error', 0.0, 0.5), ('soil_known_to', 1e-6, 2.0)):
        share = getattr(arguments, option)
        if share is not None and not least <= share <= most:
            name = option.replace('_', '-')
            raise UserError(f'--{name} {share:g}: must be a share between {least:g} and {most:g}')
    given = [*arguments.data, *([arguments.reference] if arguments.reference else [])]
    if not any(map(is_bag, given)):
        if arguments.remap:
            raise UserError(
                f'--remap {arguments.remap[0]}: renames topics of a bag, but {given[0]} is a '
                'table; leave it out'
            )
        if arguments.smooth:
            raise UserError(f'--smooth: goes with a bag, but {given[0]} is a table; leave it out')
    diagnosis = _diagnosed(arguments)
    with new_folder(output, arguments.overwrite) as folder:
        write_files(diagnosis, folder, pictures=not arguments.no_pictures)
    if arguments.json:
        print((output / 'report.json').read_text(encoding='utf-8').rstrip())
    else:
        _print_result(diagnosis, output)
    return 0


def _diagnosed(arguments: argparse.Namespace) -> Diagnosis:
    """Return the diagnosis of all data as one table."""
    from wheel_terra_estimator.discrepancy.tables.averaging import together
    from wheel_terra_estimator.discrepancy.workflow import Options, diagnose

    own = _load_effects(arguments.effects)
    configuration = reader.from_arguments(arguments, complete=False)
    table = together([_read(data, arguments, configuration) for data in arguments.data])
    reference = None
    if arguments.reference:
        reference = _read(arguments.reference, arguments, configuration)
    options = Options(
        tuple(arguments.only) or None, arguments.allowed_error, arguments.soil_known_to
    )
    diagnosis = diagnose(table, configuration, reference, options)
    # The model file names the file of a named effect, so that it is accepted as it is.
    files = {own[effect.name] for effect in diagnosis.effects if effect.name in own}
    if len(files) == 1:  # two: the user has to put them into one
        named = diagnosis.configuration.replace({'effect_file': str(files.pop())})
        diagnosis = replace(diagnosis, configuration=named)
    if not configuration.soil_stated:
        note = 'no soil was stated (--config): the default sand was taken as the starting model'
        diagnosis = replace(diagnosis, notes=(*diagnosis.notes, note))
    return diagnosis


def _print_result(diagnosis: Diagnosis, output: Path) -> None:
    """Print the verdict, the gaps, the next measurement and the files written."""
    from wheel_terra_estimator.discrepancy.numbers import SHOWN, number
    from wheel_terra_estimator.discrepancy.report.words import soil_line, worth
    from wheel_terra_estimator.discrepancy.result import OPEN

    print(diagnosis.sentence)
    print(f'  {soil_line(diagnosis)}')
    for quantity, gap in diagnosis.gap.items():
        scale, unit = SHOWN[quantity]
        print(
            f'  {quantity} [{unit}]: error on unseen rows {number(scale * gap.before)} '
            f'as configured, {number(scale * gap.refit)} soil refitted, '
            f'{number(scale * gap.after)} in the end, noise {number(scale * gap.noise)}'
        )
    if diagnosis.proposal:
        print(f'  proposed law (proposal.yaml): {diagnosis.proposal.words}')
    if diagnosis.next_measurement:
        print(f'  next measurement: {worth(diagnosis.next_measurement[0])}')
    elif diagnosis.verdict in OPEN:
        print('  next measurement: none of the usual ones would decide')
    for note in diagnosis.notes:
        print(f'  note: {note}')
    print(f'  written: {output}')


def _load_effects(files: list[Path]) -> dict[str, Path]:
    """Register the user's own effects; return the file of each."""
    from wheel_terra_estimator.terramechanics.effects import load_file

    found: dict[str, Path] = {}
    for file in files:
        try:
            found.update({effect.name: file.resolve() for effect in load_file(file)})
        except ValueError as error:
            raise UserError(f'--effects {error}') from None
    return found


def _read(path: Path, arguments: argparse.Namespace, configuration: Configuration) -> SteadyTable:
    """Read a table, or extract the steady windows of a drive."""
    from wheel_terra_estimator.bags.storage import is_bag

    if is_bag(path):
        from wheel_terra_estimator.bags.reader import parse_remaps
        from wheel_terra_estimator.discrepancy.drives.windows import rows_from_bag

        remaps = parse_remaps(arguments.remap)
        return rows_from_bag(path, configuration, remaps, smooth=arguments.smooth).table()
    from wheel_terra_estimator.discrepancy.tables.header import Choice
    from wheel_terra_estimator.discrepancy.tables.parsing import read_table

    return read_table(path, Choice.of(arguments.columns, arguments.ignore_columns))
