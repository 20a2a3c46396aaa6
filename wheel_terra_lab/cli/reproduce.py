# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""``wheel-terra reproduce``: three papers, statement by statement, beside ours."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from wheel_terra_estimator.cli.outputs import Output
from wheel_terra_estimator.errors import UserError
from wheel_terra_lab.cli.soilbin import add_study_arguments

if TYPE_CHECKING:
    from wheel_terra_lab.soilbin.metrics import Row

EXAMPLES = (
    'wheel-terra reproduce all -o papers',
    'wheel-terra reproduce ding --figure 5 -o figure_5',
    'wheel-terra reproduce nakashima --figure 8 --run --seeds 1 -o grains',
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
        help='compute the discrete elements of nakashima anew, hours of all cores (of one --figure '
        'minutes); without it the kept results of the shipped runs are shown, and called so',
    )
    parser.add_argument(
        '--points',
        type=int,
        default=20_000,
        metavar='N',
        help='drawn contacts on which quadrature and closed form are judged (default 20000)',
    )
    parser.add_argument('-o', dest='output', action=Output, required=True, metavar='DIR')
    parser.add_argument('--overwrite', action='store_true', help='replace an output folder')
    parser.add_argument(
        '--part',
        action='append',
        choices=('table7', 'table6', 'loads', 'moon', 'high_lugs', 'paper_speed'),
        help='run only this part (may be given several times); paper_speed, half an hour per case '
        'and core, runs only where it is asked for',
    )
    add_study_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Write the page and the pictures; 0 whatever the verdicts."""
    from wheel_terra_estimator.output_folder import check_folder, new_folder

    papers = PAPERS if arguments.paper == 'all' else (arguments.paper,)
    if arguments.points < LEAST_POINTS:
        raise UserError(f'--points {arguments.points}: give {LEAST_POINTS} or more')
    if not arguments.compute:
        check_folder(arguments.output, arguments.overwrite)
        with new_folder(arguments.output, arguments.overwrite) as folder:
            _write(papers, arguments, folder)
        return 0
    if 'nakashima' not in papers:
        raise UserError('--run computes discrete elements, which only nakashima has; leave it')
    from wheel_terra_lab.soilbin import reproduced_figures, reproduction, study

    jobs = reproduction.jobs(arguments)
    if arguments.figure:
        jobs = reproduced_figures.jobs_of(arguments.figure, jobs)
    study.run_in_folder(
        arguments,
        jobs,
        reproduction.TABLE,
        (PAGE, *PICTURES.values()),
        lambda rows, folder: _write(papers, arguments, folder, rows),
    )
    return 0


def _write(
    papers: Sequence[str],
    arguments: argparse.Namespace,
    folder: Path,
    rows: Sequence[Row] | None = None,
) -> None:
    """Write the page of papers and their pictures; `rows` are runs of this command, if any."""
    from wheel_terra_lab.reproduction import ding, guo, nakashima
    from wheel_terra_lab.reproduction.statement import HEAD, belongs_to, page

    figure = arguments.figure
    runs = nakashima.kept() if rows is None else nakashima.Runs(rows, folder)
    titles = {'ding': ding.TITLE, 'nakashima': f'{nakashima.TITLE} ({runs.source})'}
    titles['guo'] = guo.TITLE
    lines, found = [*HEAD], False
    for paper in papers:
        if paper == 'ding':
            statements = ding.statements(0 if figure else arguments.points)
        else:
            statements = guo.statements() if paper == 'guo' else nakashima.statements(runs)
        if figure:
            statements = [s for s in statements if belongs_to(s, figure)]
        if not statements:
            continue
        found = True
        lines += page(titles[paper], statements)
        if paper in PICTURES:
            lines += [f'![figures]({PICTURES[paper]})', '']
    if not found:
        raise UserError(f'--figure {figure}: no statement of {", ".join(papers)} has that figure')
    if 'ding' in papers:
        ding.draw(folder / PICTURES['ding'])
    if 'nakashima' in papers:
        nakashima.draw(runs, folder / PICTURES['nakashima'])
    text = '\n'.join(lines).rstrip() + '\n'
    (folder / PAGE).write_text(text, encoding='utf-8')
    print(text, end='')
