# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""``wheel-terra simulate``."""

from __future__ import annotations

import argparse
import shlex
from pathlib import Path

from wheel_terra_estimator.cli.outputs import add_output
from wheel_terra_estimator.configuration import reader as configuration_reader
from wheel_terra_estimator.errors import UserError

EXAMPLES = (
    'wheel-terra simulate -o drive',
    'wheel-terra simulate --scenario steep_climb --seed 3 -o climb',
)
SHORTEST = 0.1  # drive [s]
LONGEST = 86400.0  # [s]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    from wheel_terra_estimator.configuration import shipped
    from wheel_terra_estimator.simulation.scenario import DEFAULT

    parser.add_argument(
        '--scenario',
        type=shipped.FileName,
        default=DEFAULT,
        metavar='F',
        help='scenario file, or the bare name of a shipped one (wheel-terra config list scenarios; '
        f'default: {DEFAULT})',
    )
    parser.add_argument(
        '--rover',
        type=shipped.FileName,
        metavar='F',
        help="rover file, or the bare name of a shipped one, in place of the scenario's rover",
    )
    parser.add_argument('--seed', type=int, default=0, help='seed of all random quantities')
    parser.add_argument(
        '--duration', type=float, metavar='S', help="length of the drive in place of the scenario's"
    )
    add_output(parser, 'rosbag2 folder (MCAP)', required=True)
    configuration_reader.add_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from wheel_terra_estimator.simulation import scenario as scenarios

    if arguments.seed < 0:
        raise UserError(f'--seed {arguments.seed}: must not be negative')
    scenario = scenarios.load(
        arguments.scenario,
        files=arguments.config,
        parameters=arguments.parameters,
        rover=arguments.rover,
    )
    duration = scenario.duration if arguments.duration is None else arguments.duration
    if not SHORTEST <= duration <= LONGEST:
        raise UserError(f'--duration {duration:g}: must be {SHORTEST:g} to {LONGEST:g} s')

    import numpy as np
    from tqdm import tqdm

    from wheel_terra_estimator.bags.simulated_drive import write_simulated_drive
    from wheel_terra_estimator.output_folder import check_folder
    from wheel_terra_estimator.simulation.drive import Drive

    check_folder(arguments.output, arguments.overwrite)
    quiet = True if duration < 60.0 else None  # None: where there is no terminal
    with tqdm(total=round(duration), unit='s', disable=quiet, leave=False) as bar:
        drive = Drive(scenario, arguments.seed).run(duration, bar.update)
    bag = write_simulated_drive(drive, arguments.output, arguments.overwrite)

    truth = drive.truth
    distance = float(np.hypot(*np.diff(truth.position[:, :2], axis=0).T).sum())
    title = Path(scenario.name).stem
    print(f'{title}, seed {arguments.seed}: {duration:g} s, {distance:.2f} m driven')
    for name, share in truth.time_in_class().items():
        print(f'  {name:8s} {100.0 * share:5.1f} % of the wheel time')
    stuck = truth.first_stuck()
    print('  not entrapped' if stuck is None else f'  entrapped after {stuck:.1f} s')
    print(f'bag: {arguments.output} ({sum(bag.counts.values())} messages)')
    command = ['wheel-terra', 'replay', str(arguments.output)]
    for name in scenario.files:
        command += ['--config', name]
    for parameter in scenario.parameters:
        command += ['-p', parameter]
    print(f'estimates: {shlex.join(command)}')
    return 0
