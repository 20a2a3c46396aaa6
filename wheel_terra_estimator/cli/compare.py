# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""``wheel-terra compare``."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

EXAMPLES = (
    'wheel-terra compare estimates_a estimates_b',
    'wheel-terra compare estimates_a estimates_b --truth my_drive',
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    parser.add_argument('first', type=Path, metavar='A', help='bag of estimates (replay -o)')
    parser.add_argument('second', type=Path, metavar='B', help='bag of estimates of the same drive')
    parser.add_argument('--truth', type=Path, metavar='BAG', help='recording with ground truth')
    parser.add_argument('--json', action='store_true', help='print the differences as JSON')


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from wheel_terra_estimator.bags.history import read_estimates
    from wheel_terra_estimator.bags.storage import open_bag
    from wheel_terra_estimator.bags.truth import read_simulated_truth
    from wheel_terra_estimator.errors import UserError
    from wheel_terra_estimator.reporting.comparison import as_dict, as_text, compare

    inputs = [arguments.first, arguments.second]
    histories = []
    notes: list[str] = []
    for path in inputs:
        with open_bag(path) as bag:
            histories.append(read_estimates(bag))
            notes += bag.notes
    truth = None
    if arguments.truth:
        with open_bag(arguments.truth) as bag:
            truth = read_simulated_truth(bag, histories[0].names)
            notes += bag.notes
        if truth is None:
            raise UserError(
                f'{arguments.truth}: no truth in it: neither /ground_truth/twist nor '
                '/truth/odometry'
            )
    names = [str(path) for path in inputs]
    comparison = compare(histories[0], histories[1], names, truth)
    if arguments.json:
        print(json.dumps({**as_dict(comparison), 'notes': notes}, indent=2))
    else:
        print('\n'.join([as_text(comparison), *(f'note: {note}' for note in notes)]))
    return 0
