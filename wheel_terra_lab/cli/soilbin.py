# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""``wheel-terra soilbin``: the virtual soil bin and its studies."""

from __future__ import annotations

import argparse
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from wheel_terra_estimator.cli.outputs import Output
from wheel_terra_estimator.configuration.shipped import FileName
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.scheduler import add_jobs_argument, add_scheduler_argument

if TYPE_CHECKING:
    from wheel_terra_lab.soilbin.case import Case

EXAMPLES = (
    'wheel-terra soilbin run quick -o run',
    'wheel-terra soilbin rows --help',
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the sub-commands."""
    actions = parser.add_subparsers(dest='action', required=True, metavar='ACTION')

    one = actions.add_parser('run', help='run one wheel over one bed')
    one.add_argument(
        'files',
        type=FileName,
        nargs='*',
        metavar='FILE',
        help='case, wheel or grain files (path or shipped name)',
    )
    one.add_argument('-o', '--output', action=Output, required=True, metavar='DIR')
    one.add_argument('--overwrite', action='store_true', help='replace an output folder')
    one.add_argument('--resume', action='store_true', help='go on with an interrupted run')
    one.add_argument(
        '--wheel', type=FileName, metavar='N', help="one of the paper's wheels, 1 to 9, or a file"
    )
    one.add_argument('--load', type=float, metavar='N', help='vertical load W [N]')
    one.add_argument('--slope', type=float, metavar='DEG', help='slope [deg]')
    one.add_argument('--gravity', type=float, metavar='G', help='gravity [m/s^2]')
    one.add_argument('--rate', type=float, metavar='W', help='wheel rate [rad/s]')
    one.add_argument('--friction', type=float, metavar='MU', help='friction between grains [-]')
    one.add_argument('--pull', type=float, metavar='P', help='pull at the hitch [N]')
    one.add_argument('--slip', type=float, metavar='S', help='impose the travel speed [-]')
    one.add_argument('--seed', type=int, metavar='N', help='seed of grain sizes and lug phase')
    one.add_argument('--duration', type=float, metavar='S', help='travel [s] at speed factor 1')
    one.add_argument('--grain-scale', type=float, metavar='K', help='grains larger by K')
    one.add_argument('-p', dest='overrides', action='append', default=[], metavar='NAME:=VALUE')
    one.add_argument('--film', action='store_true', help='also write film.gif')
    _cache(one)

    text = 'virtual measurements for diagnose: pull sweep or slip sweep'
    study = actions.add_parser('rows', help=text, description=text)
    study.add_argument('-o', '--output', action=Output, required=True, metavar='DIR')
    study.add_argument('--overwrite', action='store_true', help='start the study in DIR anew')
    study.add_argument('--sweep', choices=('pull', 'slip'), required=True)
    add_study_arguments(study)


def _cache(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('--cache', action=Output, metavar='DIR', help='where settled beds are kept')
    parser.add_argument('--no-cache', action='store_true', help='settle every bed anew')


def add_study_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what every study of the soil bin takes."""
    parser.add_argument('--resume', action='store_true', help='go on with the study in DIR')
    parser.add_argument('--seeds', type=int, default=0, metavar='N', help='beds per case')
    parser.add_argument(
        '--grain-scale', type=float, default=0.0, metavar='K', help='grains larger by K'
    )
    _cache(parser)
    add_jobs_argument(
        parser,
        default=0,
        words='engine processes at a time (default: one per core)',
    )
    add_scheduler_argument(parser, what='cases')


def run(arguments: argparse.Namespace) -> int:
    """Run the chosen action."""
    if arguments.action == 'run':
        return _run_one(arguments)
    from wheel_terra_lab.soilbin import measurements, study

    study.run_in_folder(
        arguments,
        measurements.jobs(arguments),
        measurements.TABLE,
        measurements.PAGES,
        partial(measurements.report, arguments.sweep),
    )
    return 0


def _run_one(arguments: argparse.Namespace) -> int:
    from wheel_terra_estimator.output_folder import working_folder
    from wheel_terra_lab.soilbin import output, snapshots
    from wheel_terra_lab.soilbin.bookkeeping import STATE
    from wheel_terra_lab.soilbin.case import check
    from wheel_terra_lab.soilbin.launch import StoppedByUserError, run_case

    case = case_of(arguments)
    check(case)
    cache = None if arguments.no_cache else arguments.cache or snapshots.default_cache()
    folder: Path = arguments.output
    work = folder / '.work'
    try:
        with working_folder(folder, arguments.overwrite, arguments.resume, output.FILES):
            try:
                with _progress_bar() as report:
                    summary = run_case(case, work, cache, report)
                output.write_folder(folder, work, case, summary, arguments.film)
            except UserError:
                if not any(work.rglob(STATE)):  # nothing for --resume
                    shutil.rmtree(work, ignore_errors=True)
                raise
            shutil.rmtree(work, ignore_errors=True)
    except StoppedByUserError as stopped:
        raise UserError(f'{stopped}; go on with --resume') from stopped
    except OSError as error:
        raise UserError(f'{folder}: cannot be written: {error}; free some space') from error
    print(output.as_text(summary, case))
    if summary['stopped']:
        print(f'stopped early: {summary["stopped"]}')
    return 0


@contextmanager
def _progress_bar() -> Iterator[Callable[[str, float], None]]:
    """Show one bar per stage with the time left; yield what takes (stage, fraction)."""
    from tqdm import tqdm

    shown: dict[str, tqdm] = {}
    form = '{l_bar}{bar}| {elapsed}, {remaining} left'

    def report(stage: str, fraction: float) -> None:
        if stage not in shown:
            close()
            shown[stage] = tqdm(total=1.0, desc=f'{stage:14s}', bar_format=form, leave=True)
        current = shown[stage]
        current.n = min(1.0, fraction)
        current.refresh()

    def close() -> None:
        for current in shown.values():
            current.close()

    try:
        yield report
    finally:
        close()


def case_of(arguments: argparse.Namespace) -> Case:
    """Return the case of files and options; options win."""
    from wheel_terra_lab.soilbin import files

    names = list(arguments.files)
    if arguments.wheel:
        names.append(f'wheel_{arguments.wheel}' if arguments.wheel.isdigit() else arguments.wheel)
    if not any(name == 'published' for name in names):
        names.insert(0, 'calibrated')
    options = {
        'operation.vertical_load': arguments.load,
        'operation.slope_deg': arguments.slope,
        'operation.gravity': arguments.gravity,
        'grains.soil_friction': arguments.friction,
        'operation.hitch_pull': arguments.pull,
        'operation.imposed_slip': arguments.slip,
        'bed.seed': arguments.seed,
        'operation.duration': arguments.duration,
        'bed.grain_scale': arguments.grain_scale,
    }
    given = [f'{name}:={value!r}' for name, value in options.items() if value is not None]
    case = files.load(names, [*given, *arguments.overrides])
    if arguments.rate is not None:
        speed = arguments.rate * case.wheel.tip_radius / case.operation.speed_factor
        case = case.replace(operation__tip_speed=speed)
    return case
