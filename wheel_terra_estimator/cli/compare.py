# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""``wheel-terra compare``."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from wheel_terra_estimator.cli import bag_arguments
from wheel_terra_estimator.cli.outputs import Output
from wheel_terra_estimator.configuration import reader as configuration_reader

EXAMPLES = (
    'wheel-terra compare estimates_a estimates_b',
    'wheel-terra compare estimates_a estimates_b --truth my_drive --report compare.html',
    'wheel-terra compare --laws rows.csv --config my_rover.yaml --config hit_fit',
    'wheel-terra compare --laws my_drive --config my_rover.yaml --config hit_fit',
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    parser.add_argument(
        'first', type=Path, nargs='?', metavar='A', help='bag of estimates (replay -o)'
    )
    parser.add_argument(
        'second', type=Path, nargs='?', metavar='B', help='bag of estimates of the same drive'
    )
    parser.add_argument(
        '--laws',
        type=Path,
        metavar='F.csv|BAG',
        help='instead of two bags: which law of the contact (predict --law) a table of steady '
        'measurements speaks for, by evidence, or a recording, by the likelihood of its readings',
    )
    parser.add_argument('--truth', type=Path, metavar='BAG', help='recording with ground truth')
    parser.add_argument('--json', action='store_true', help='print the differences as JSON')
    parser.add_argument('--report', action=Output, metavar='F.html', help='page with both overlaid')
    bag_arguments.add_arguments(parser, 'for --laws with a recording: ')
    parser.add_argument('--overwrite', action='store_true', help='replace an earlier report')
    configuration_reader.add_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from wheel_terra_estimator.errors import UserError

    if arguments.laws:
        if arguments.first or arguments.truth or arguments.report:
            raise UserError(
                '--laws takes one table or recording; leave the bags, --truth and --report'
            )
        _rank_laws(arguments)
        return 0
    if arguments.second is None:
        raise UserError('give two bags of estimates, or --laws with a table or a recording')
    if arguments.config or arguments.remap:
        raise UserError('--config and --remap belong to --laws; bags of estimates bring their own')
    from wheel_terra_estimator.bags.history import read_estimates
    from wheel_terra_estimator.bags.storage import open_bag
    from wheel_terra_estimator.bags.truth import read_simulated_truth
    from wheel_terra_estimator.bags.writer import read_origin
    from wheel_terra_estimator.output_folder import check_file
    from wheel_terra_estimator.reporting.comparison import (
        as_dict,
        as_text,
        compare,
        write_comparison,
    )
    from wheel_terra_estimator.reporting.html import check_page

    inputs = [arguments.first, arguments.second]
    if arguments.report:
        check_page(arguments.report)
        check_file(arguments.report, arguments.overwrite)
    limits = bag_arguments.limits_of(arguments)
    histories = []
    notes: list[str] = []
    for path in inputs:
        with open_bag(path, limits) as bag:
            histories.append(read_estimates(bag))
            notes += bag.notes
    truth = None
    if arguments.truth:
        with open_bag(arguments.truth, limits) as bag:
            truth = read_simulated_truth(bag, histories[0].names)
            notes += bag.notes
        if truth is None:
            raise UserError(
                f'{arguments.truth}: no truth in it: neither /ground_truth/twist nor '
                '/truth/odometry'
            )
    origins = read_origin(inputs[0]), read_origin(inputs[1])
    names = [str(path) for path in inputs]
    comparison = compare(histories[0], histories[1], names, truth, origins)
    if arguments.json:
        print(json.dumps({**as_dict(comparison), 'notes': notes}, indent=2))
    else:
        print('\n'.join([as_text(comparison), *(f'note: {note}' for note in notes)]))
    if arguments.report:
        write_comparison(arguments.report, comparison, histories, truth, arguments.overwrite)
        if not arguments.json:
            print(f'report: {arguments.report}')
    return 0


def _rank_laws(arguments: argparse.Namespace) -> None:
    from dataclasses import asdict

    from wheel_terra_estimator.bags.storage import is_bag

    laws, text = (_of_drive if is_bag(arguments.laws) else _of_table)(arguments)
    print(json.dumps([asdict(law) for law in laws], indent=2) if arguments.json else text)


def _of_table(arguments: argparse.Namespace) -> tuple[list[Any], str]:
    """Return the laws in their order, and as text."""
    from wheel_terra_estimator.discrepancy.law_ranking import as_text, rank_laws
    from wheel_terra_estimator.discrepancy.tables.parsing import read_table

    configuration = configuration_reader.from_arguments(arguments, complete=False)
    laws = rank_laws(read_table(arguments.laws), configuration)
    return laws, as_text(laws)


def _of_drive(arguments: argparse.Namespace) -> tuple[list[Any], str]:
    """Return the laws in their order, and as text with the notes of the recording."""
    from wheel_terra_estimator.bags.drive_laws import as_text, rank_laws
    from wheel_terra_estimator.bags.reader import parse_remaps
    from wheel_terra_estimator.bags.storage import open_bag

    configuration = configuration_reader.from_arguments(arguments)
    with open_bag(arguments.laws, bag_arguments.limits_of(arguments)) as bag:
        laws = rank_laws(bag, configuration, parse_remaps(arguments.remap))
        return laws, '\n'.join([as_text(laws), *(f'note: {note}' for note in bag.notes)])
