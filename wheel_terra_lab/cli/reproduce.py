# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""``wheel-terra reproduce``: three papers, statement by statement, beside ours."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from wheel_terra_estimator.cli.outputs import Output
from wheel_terra_estimator.errors import UserError

if TYPE_CHECKING:
    from wheel_terra_lab.reproduction.statement import Statement

EXAMPLES = (
    'wheel-terra reproduce all -o papers',
    'wheel-terra reproduce ding --figure 5 -o figure_5',
)
PAPERS = ('ding', 'nakashima', 'guo')
PAGE = 'reproduction.md'
PICTURES = {'ding': 'ding.svg', 'nakashima': 'nakashima.svg'}
LEAST_POINTS = 100


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    parser.add_argument('paper', choices=(*PAPERS, 'all'), help='which paper')
    parser.add_argument('--figure', metavar='N', help='only the statements of one figure')
    parser.add_argument(
        '--run',
        dest='compute',
        action='store_true',
        help='compute the discrete elements of nakashima anew, hours of all cores, in the folder '
        'DIR_soilbin (gone on with where it exists); without it the kept results of the shipped '
        'runs are shown, and called so',
    )
    parser.add_argument(
        '--points',
        type=int,
        default=20_000,
        metavar='N',
        help='drawn contacts on which quadrature and closed form are judged (default 20000)',
    )
    parser.add_argument('-o', dest='output', action=Output, type=Path, required=True, metavar='DIR')
    parser.add_argument('--overwrite', action='store_true', help='replace an output folder')


def run(arguments: argparse.Namespace) -> int:
    """Write the page and the pictures; 0 whatever the verdicts."""
    from wheel_terra_estimator.output_folder import check_folder, new_folder
    from wheel_terra_lab.reproduction.statement import belongs_to, page

    papers = PAPERS if arguments.paper == 'all' else (arguments.paper,)
    if arguments.points < LEAST_POINTS:
        raise UserError(f'--points {arguments.points}: give {LEAST_POINTS} or more')
    if arguments.compute and 'nakashima' not in papers:
        raise UserError('--run computes discrete elements, which only nakashima has; leave it')
    check_folder(arguments.output, arguments.overwrite)
    rows = _computed(arguments.output) if arguments.compute else None
    lines, found = ['# Three papers, statement by statement', ''], 0
    with new_folder(arguments.output, arguments.overwrite) as folder:
        for paper in papers:
            title, statements, note = _statements(paper, arguments, folder, rows)
            if arguments.figure:
                statements = [s for s in statements if belongs_to(s, arguments.figure)]
            found += len(statements)
            if statements:
                lines += [*page(title, statements), *note]
        if not found:
            raise UserError(
                f'--figure {arguments.figure}: no statement of {", ".join(papers)} has that figure'
            )
        text = '\n'.join(lines).rstrip() + '\n'
        (folder / PAGE).write_text(text, encoding='utf-8')
    print(text, end='')
    return 0


def _statements(
    paper: str, arguments: argparse.Namespace, folder: Path, rows: list[dict[str, str]] | None
) -> tuple[str, list[Statement], list[str]]:
    """Return title, statements and notes of a paper; draw its figures."""
    from wheel_terra_lab.reproduction import ding, guo, nakashima

    if paper == 'guo':
        return guo.TITLE, guo.statements(), []
    note = [f'![figures]({PICTURES[paper]})', '']
    if paper == 'ding':
        ding.draw(folder / PICTURES[paper])
        return ding.TITLE, ding.statements(0 if arguments.figure else arguments.points), note
    source = nakashima.KEPT if rows is None else 'computed now'
    runs = nakashima.kept() if rows is None else rows
    nakashima.draw(runs, folder / PICTURES[paper])
    return f'{nakashima.TITLE} ({source})', nakashima.statements(runs), note


def _computed(output: Path) -> list[dict[str, str]]:
    """Run the discrete elements beside the output folder and return their rows."""
    import csv

    from wheel_terra_estimator.cli.main import main
    from wheel_terra_lab.soilbin.reproduction import TABLE

    runs = output.with_name(f'{output.name}_soilbin')
    status = main(['soilbin', 'reproduce', '-o', str(runs), *(['--resume'] * runs.exists())])
    if status:
        raise UserError(
            f'{runs}: the soil bin ended with status {status}; the same command goes on'
        )
    with (runs / TABLE).open(newline='', encoding='utf-8') as stream:
        return list(csv.DictReader(stream))
