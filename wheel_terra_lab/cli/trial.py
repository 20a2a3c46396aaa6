# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""``wheel-terra trial``: hide an effect, diagnose blind, reveal the truth."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from wheel_terra_estimator.cli.outputs import Output
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.output_folder import check_folder, new_folder

if TYPE_CHECKING:
    from wheel_terra_estimator.discrepancy.result import Diagnosis
    from wheel_terra_lab.trials.trial import Outcome

EXAMPLES = (
    'wheel-terra trial --seed 1 -o trial',
    'wheel-terra trial --many 20 --seed 100 --effect lug_digging -o trials',
)
MOST = 10_000


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    parser.add_argument(
        '--seed', type=int, default=1, metavar='N', help='draws wheel, soil, design, noise (1)'
    )
    parser.add_argument(
        '--effect',
        metavar='NAME',
        help="what is hidden: an effect, 'none' or 'stranger', one outside the catalogue "
        '(default: drawn by the seed)',
    )
    parser.add_argument(
        '--many', type=int, metavar='N', help='N trials from the seed on, and their score'
    )
    parser.add_argument(
        '-o',
        '--output',
        action=Output,
        required=True,
        metavar='DIR',
        help='folder to be written',
    )
    parser.add_argument('--no-pictures', action='store_true', help='no report.html')
    parser.add_argument('--overwrite', action='store_true', help='replace DIR if it exists')


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    output: Path = arguments.output
    if arguments.seed < 0:
        raise UserError(f'--seed {arguments.seed}: must be 0 or more')
    if arguments.many is not None and not 1 <= arguments.many <= MOST:
        raise UserError(f'--many {arguments.many}: must be between 1 and {MOST}')
    check_folder(output, arguments.overwrite)
    with new_folder(output, arguments.overwrite) as folder:
        if arguments.many is None:
            _one(folder, arguments.seed, arguments.effect, pictures=not arguments.no_pictures)
        else:
            _many(folder, arguments.seed, arguments.effect, arguments.many)
    print(f'written: {output}')
    return 0


def _one(folder: Path, seed: int, effect: str | None, *, pictures: bool) -> None:
    from wheel_terra_lab.trials import trial

    campaign = trial.draw(seed, effect)
    digest = trial.hide(campaign, folder)
    rows = len(campaign.rows['slip'])
    print(f'blind table of {rows} rows, truth withheld (SHA-256 {digest[:16]}...)')
    diagnosis = trial.solve_blind(folder)
    print(f'diagnosis: {diagnosis.sentence}')
    outcome = trial.compare(folder, diagnosis)
    print(f'truth revealed: {outcome.words}')
    _print_gap(outcome)
    if outcome.proposal:
        print(f'  proposed law: {outcome.proposal}')
    _write(diagnosis, folder / 'diagnosis', pictures=pictures)
    trial.write_scores([outcome], folder / 'score.csv')


def _many(folder: Path, seed: int, effect: str | None, count: int) -> None:
    from wheel_terra_lab.trials import trial

    outcomes = []
    for place in range(count):
        below = folder / f'{seed + place}'
        below.mkdir()
        trial.hide(trial.draw(seed + place, effect), below)
        outcome = trial.compare(below, trial.solve_blind(below))
        outcomes.append(outcome)
        print(f'{outcome.seed}: {outcome.words}', flush=True)
    trial.write_scores(outcomes, folder / 'score.csv')
    print('score (95 % interval):')
    for kind, right, total, low, high in trial.score(outcomes):
        if total:
            print(f'  {kind}: {right} of {total} right ({100 * low:.0f} to {100 * high:.0f} %)')


def _print_gap(outcome: Outcome) -> None:
    from wheel_terra_estimator.discrepancy.numbers import SHOWN

    for quantity, (noise, before, refit, after) in outcome.gap.items():
        scale, unit = SHOWN[quantity]
        print(
            f'  {quantity} [{unit}]: gap {scale * before:.3g} as configured, '
            f'{scale * refit:.3g} refitted, {scale * after:.3g} after; noise {scale * noise:.3g}'
        )


def _write(diagnosis: Diagnosis, folder: Path, *, pictures: bool) -> None:
    from wheel_terra_estimator.discrepancy.report.model_file import write_files

    folder.mkdir()
    write_files(diagnosis, folder, pictures=pictures)
