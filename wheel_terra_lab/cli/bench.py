# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""``wheel-terra bench``."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from wheel_terra_estimator.errors import UserError

LARGEST_FILE = 2**20
"""Bytes of an earlier output."""
EXAMPLES = ('wheel-terra bench --json > before.json', 'wheel-terra bench --against before.json')


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    parser.add_argument(
        '--quick', action='store_true', help='one pair of each, small: whether it runs'
    )
    parser.add_argument('--json', action='store_true', help='print the figures as JSON')
    parser.add_argument(
        '--against',
        type=Path,
        metavar='F.json',
        help='output of an earlier --json on this machine, compared by the ratios',
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from wheel_terra_lab.benchmarks.run import QUICK, Size, figures

    earlier = _earlier(arguments.against) if arguments.against else {}
    told = []
    for figure in figures(QUICK if arguments.quick else Size()):
        entry = figure.as_dict()
        if before := earlier.get(figure.name):
            entry['change'] = figure.ratio / before
        told.append(entry)
        if not arguments.json:
            print(_line(entry), flush=True)
    if arguments.json:
        print(json.dumps({'figures': told}, indent=2))
    return 0


def _line(entry: dict[str, Any]) -> str:
    spread = f'({entry["least"]:.3g} to {entry["greatest"]:.3g})'
    line = (
        f'{entry["name"]}: {entry["seconds"]:.3g} s, {entry["times_as_fast"]:.3g} times as fast '
        f'{spread} as {entry["beside"]} ({entry["seconds_beside"]:.3g} s)'
    )
    if entry['real_time_factor']:
        line += f', {entry["real_time_factor"]:.0f} times real time'
    if 'change' in entry:
        line += f', {entry["change"]:.2f} times the earlier ratio'
    return line


def _earlier(path: Path) -> dict[str, float]:
    """Return name -> ratio of an earlier output."""
    from wheel_terra_estimator.input_file import read_text

    try:
        entries = json.loads(read_text(path, LARGEST_FILE))['figures']
        return {entry['name']: float(entry['times_as_fast']) for entry in entries}
    except (ValueError, KeyError, TypeError):
        raise UserError(f'{path}: is no output of wheel-terra bench --json') from None
