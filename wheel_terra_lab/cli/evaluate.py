# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""``wheel-terra evaluate``."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from wheel_terra_estimator.cli.outputs import Output
from wheel_terra_estimator.configuration import reader as configuration_reader
from wheel_terra_estimator.configuration.ros_yaml import Value
from wheel_terra_estimator.configuration.shipped import FileName
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.scheduler import add_jobs_argument

FILTER_FAILED = 1
"""Exit status where the filter failed on a drive; none of them should make it."""
INTERRUPTED = 130
EXAMPLES = (
    'wheel-terra evaluate --kinds climb turns --seeds 4',
    'wheel-terra evaluate --rover my_rover.yaml --kinds climb scenarios/slow_entrapment --seeds 2',
    'wheel-terra evaluate --kinds climb --seeds 4 -p filter.stuck_threshold:=0.6',
    'wheel-terra evaluate --limiter --seeds 10 -o limiter.md',
    'wheel-terra evaluate --simulator A B --kinds firm --modes reference --seeds 50 -o firm.md',
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    from wheel_terra_lab.evaluation.runner import MODES
    from wheel_terra_lab.evaluation.simulators import SIMULATORS

    kinds = '; '.join(
        f'{name}: {", ".join((*simulator.kinds, *simulator.more_kinds))}'
        + (', or scenarios/NAME, a shipped scenario' if simulator.takes_scenarios else '')
        for name, simulator in SIMULATORS.items()
    )
    parser.add_argument(
        '--simulator',
        nargs='+',
        choices=list(SIMULATORS),
        default=['A'],
        help="simulators of the drives: A (default), the package's own; the others were written "
        'apart from it, by other hands',
    )
    parser.add_argument(
        '--kinds',
        nargs='+',
        metavar='KIND',
        help=f'kinds of simulated drives (default: all but firm of simulator A). {kinds}',
    )
    parser.add_argument(
        '--rover',
        type=FileName,
        metavar='F',
        help="rover file, or the bare name of a shipped one, in place of the kinds' own rover "
        '(simulator A)',
    )
    configuration_reader.add_arguments(parser)
    parser.add_argument(
        '--seeds', type=int, default=20, metavar='N', help='drives of each kind (default 20)'
    )
    seeds = parser.add_mutually_exclusive_group()
    seeds.add_argument(
        '--tuning', action='store_true', help='tuning seeds; the default are the test seeds'
    )
    seeds.add_argument(
        '--first-seed',
        type=int,
        metavar='N',
        help='the first of the seeds, for drives that nothing was chosen on',
    )
    parser.add_argument(
        '--modes',
        nargs='+',
        metavar='MODE',
        default=['reference', 'no_reference'],
        help=f'what the estimator gets: {", ".join(MODES)}',
    )
    add_jobs_argument(parser, words='drives at a time')
    parser.add_argument(
        '--measured',
        type=Path,
        metavar='DIR',
        help='folder of the measured data: score the real drives in place of simulated ones',
    )
    parser.add_argument(
        '--limiter',
        action='store_true',
        help='drive the same soft patch with and without the traction limiter (and a picture '
        'beside the output)',
    )
    parser.add_argument(
        '-o',
        dest='output',
        action=Output,
        metavar='F.md',
        help='write the tables',
    )
    parser.add_argument('--overwrite', action='store_true', help='replace an earlier output')


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from wheel_terra_estimator.output_folder import check_file, new_file

    given = (
        ('--rover', arguments.rover),
        ('--config', arguments.config),
        ('-p', arguments.parameters),
    )
    for option, value in given:
        if value and (arguments.measured or arguments.limiter):
            raise UserError(f'{option} goes with simulated kinds, not with --measured or --limiter')
    if arguments.output:
        check_file(arguments.output, arguments.overwrite)
    if arguments.measured:
        from wheel_terra_lab.evaluation import real_drives

        told = _Told(*real_drives.report(arguments.measured))
    elif arguments.limiter:
        told = _limiter(arguments)
    else:
        told = _simulated(arguments)
    restarts = sum(health.get('filter_restarts', 0) for health in told.healths)
    runs = len(told.healths)
    text = f'{told.text}\n\nThe filter was started anew {restarts} times in {runs} runs.'
    print(text)
    if arguments.output:
        with new_file(arguments.output, arguments.overwrite) as fresh:
            fresh.write_text(text + '\n', encoding='utf-8')
    return told.status or (FILTER_FAILED if restarts else 0)


class _Told(NamedTuple):
    """What one kind of evaluation found."""

    text: str
    healths: Sequence[Mapping[str, Any]]
    status: int = 0


def _seeds(arguments: argparse.Namespace) -> range:
    from wheel_terra_lab.evaluation import kinds

    first = arguments.first_seed
    if first is None:
        first = (kinds.TUNING_SEEDS if arguments.tuning else kinds.TEST_SEEDS).start
    elif first < 0:
        raise UserError(f'--first-seed {first}: must be 0 or more')
    return range(first, first + arguments.seeds)


def _limiter(arguments: argparse.Namespace) -> _Told:
    from wheel_terra_estimator.output_folder import check_file, new_file
    from wheel_terra_lab.evaluation import closed_loop

    picture = arguments.output and arguments.output.with_suffix('.png')
    if picture:
        check_file(picture, arguments.overwrite)
    drives = closed_loop.compare(_seeds(arguments))
    if picture:
        with new_file(picture, arguments.overwrite) as fresh:
            closed_loop.draw(drives[0], fresh)
    return _Told(
        closed_loop.report(drives),
        [run.health for pair in drives for run in (pair.free, pair.limited)],
    )


def _simulated(arguments: argparse.Namespace) -> _Told:
    from wheel_terra_lab.evaluation import bench, runner, tables

    chosen = _chosen(arguments.simulator, arguments.kinds)
    if arguments.rover:
        _check_rover(arguments.rover, arguments.simulator)
    _check_names(arguments.modes, runner.MODES, 'mode')
    overrides = _overrides(arguments)
    from tqdm import tqdm

    with tqdm(total=len(chosen) * arguments.seeds, unit='drive') as bar:
        results = bench.run(
            chosen,
            _seeds(arguments),
            arguments.modes,
            arguments.jobs,
            lambda _: bar.update(),
            arguments.rover,
            overrides,
        )
    parts = [tables.report(results, arguments.modes)]
    if arguments.rover:
        parts.append(f'Rover in place of that of the kinds: {arguments.rover}.')
    if overrides:
        parts.append(f'The estimator was told, and the drives were not: {", ".join(overrides)}.')
    if results.interrupted:
        parts.append(results.interrupted)
    return _Told(
        '\n\n'.join(parts),
        [score.health for score in results.drives],
        status=INTERRUPTED if results.interrupted else 0,
    )


def _overrides(arguments: argparse.Namespace) -> dict[str, Value]:
    """Return what --config and -p tell the estimator; the drives do not follow it."""
    configuration = configuration_reader.from_arguments(arguments, complete=False)
    if 'wheels.names' in configuration.stated:
        raise UserError(
            '--config: a rover file; give it as --rover, so that the drives have it too'
        )
    values = configuration.flat()
    return {key: values[key] for key in sorted(configuration.stated)}


def _chosen(names: Sequence[str], kinds: list[str] | None) -> list[tuple[str, str]]:
    """Return the pairs of simulator and kind to be run."""
    from wheel_terra_lab.evaluation.simulators import SIMULATORS

    simulators = [SIMULATORS[name] for name in names]
    if kinds is None:
        return [(s.name, kind) for s in simulators for kind in s.kinds]
    known = {kind: None for s in simulators for kind in (*s.kinds, *s.more_kinds)}
    strange = [kind for kind in kinds if not any(s.has(kind) for s in simulators)]
    _check_names(strange, tuple(known), 'kind')
    return [(s.name, kind) for s in simulators for kind in kinds if s.has(kind)]


def _check_rover(rover: str, simulators: Sequence[str]) -> None:
    """Refuse what is no rover file before the first drive."""
    from wheel_terra_estimator.configuration import reader, ros_yaml, shipped

    if list(simulators) != ['A']:
        raise UserError('--rover needs --simulator A: the rovers of the others are not files')
    if 'wheels.names' not in ros_yaml.read(shipped.find(rover)):
        raise UserError(f'--rover {rover}: wheels.names is missing: not a rover file')
    reader.load([rover])


def _check_names(given: Sequence[str], known: Sequence[str], what: str) -> None:
    unknown = [name for name in given if name not in known]
    if unknown:
        raise UserError(f'no {what} {unknown[0]!r}; there are {", ".join(known)}')
