# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""``wheel-terra convert``."""

from __future__ import annotations

import argparse
import shlex
from pathlib import Path

from wheel_terra_estimator.cli.outputs import add_output
from wheel_terra_estimator.errors import UserError

EXAMPLES = (
    'wheel-terra convert --example',
    'wheel-terra convert log.csv --columns columns.yaml -o drive',
)
USUAL_PERIODS = 5e-4, 2.0
"""Of wheel rates [s]: 2 kHz to one in two seconds, four times `filter.silence`."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    parser.add_argument('table', nargs='?', type=Path, metavar='LOG.csv', help='one row per time')
    parser.add_argument(
        '--columns', type=Path, metavar='MAP.yaml', help='meaning of the columns (see --example)'
    )
    add_output(parser, 'rosbag2 folder (MCAP)')
    parser.add_argument('--example', action='store_true', help='print an example column map')


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from wheel_terra_estimator.bags.table_to_bag import EXAMPLE, convert

    if arguments.example:
        print(EXAMPLE, end='')
        return 0
    for value, name in (
        (arguments.table, 'LOG.csv'),
        (arguments.columns, '--columns MAP.yaml'),
        (arguments.output, '-o DIR'),
    ):
        if value is None:
            raise UserError(f'{name} is missing; a map of columns: wheel-terra convert --example')
    written = convert(arguments.table, arguments.columns, arguments.output, arguments.overwrite)
    counts = ', '.join(f'{topic} {count}' for topic, count in written.counts.items())
    print(f'bag: {arguments.output} ({counts})')
    if written.short:
        count = len(written.short)
        rows = f'{count} rows end' if count > 1 else 'a row ends'
        print(
            f'note: {rows} before the last column of the map (first: line {written.short[0]}); '
            'what is missing there is skipped'
        )
    for topic, count in written.held.items():
        print(f'note: {topic} repeats each reading over about {count} rows; it is written once')
    if written.period and not USUAL_PERIODS[0] <= written.period <= USUAL_PERIODS[1]:
        print(f'note: wheel rates {written.period:.2g} s apart: is the unit of the time right?')
    print(f'next: wheel-terra check {shlex.quote(str(arguments.output))} --config ROVER')
    return 0
