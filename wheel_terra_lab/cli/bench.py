# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""``wheel-terra bench``."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from wheel_terra_estimator.cli.outputs import Output
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
    parser.add_argument('--report', action=Output, metavar='F.html', help='page with the figures')
    parser.add_argument('--overwrite', action='store_true', help='replace an earlier report')


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from wheel_terra_estimator.output_folder import check_file
    from wheel_terra_estimator.reporting.html import check_page
    from wheel_terra_lab.benchmarks.run import QUICK, Size, figures

    if arguments.report:
        check_page(arguments.report)
        check_file(arguments.report, arguments.overwrite)
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
    if arguments.report:
        _write_page(arguments.report, told, arguments.overwrite)
    return 0


def _write_page(path: Path, figures: list[dict[str, Any]], overwrite: bool) -> None:
    from wheel_terra_estimator.reporting.tables_page import Table, write_tables

    compared = any('change' in entry for entry in figures)
    rows = [
        (
            entry['name'],
            f'{entry["times_as_fast"]:.3g} ({entry["least"]:.3g} to {entry["greatest"]:.3g})',
            entry['beside'],
            _milliseconds(entry['seconds']),
            _milliseconds(entry['seconds_beside']),
            *([f'{entry["change"]:.2f}' if 'change' in entry else '-'] if compared else []),
        )
        for entry in figures
    ]
    head: tuple[str, ...] = ('what', 'times as fast', 'compared with', 'time', 'time of that')
    if compared:
        head = (*head, 'ratio, over the earlier')
    words = 'Ratios to another program or way on this machine; seconds alone say little.'
    write_tables(path, 'Speed', words, 'good', [Table('Figures', head, rows)], overwrite)


def _milliseconds(seconds: float) -> str:
    return f'{1e3 * seconds:.3g}\u00a0ms'


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
