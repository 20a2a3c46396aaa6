# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""``wheel-terra calibrate``."""

from __future__ import annotations

import argparse
import shlex
from pathlib import Path

from wheel_terra_estimator.cli.outputs import add_output, add_remaps
from wheel_terra_estimator.configuration import reader as configuration_reader
from wheel_terra_estimator.configuration import ros_yaml
from wheel_terra_estimator.configuration.rover_template import GUESSED

EXAMPLES = (
    'wheel-terra calibrate ten_minute_drive --config my_rover.yaml -o my_rover_calibrated.yaml',
    'wheel-terra calibrate drive --config pathfinder --remap reference_odom:=/truth/odometry '
    '-o pathfinder_calibrated.yaml',
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    parser.add_argument(
        'bag',
        type=Path,
        metavar='BAG',
        help='recording of the ten-minute drive (docs/own_rover.md)',
    )
    configuration_reader.add_arguments(parser)
    add_output(parser, 'rover file to be written', 'F', required=True)
    add_remaps(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from wheel_terra_estimator.bags.reader import check_remaps, parse_remaps
    from wheel_terra_estimator.bags.series_reader import read_series
    from wheel_terra_estimator.bags.storage import open_bag
    from wheel_terra_estimator.checks.calibration import as_file, calibrate, summary
    from wheel_terra_estimator.output_folder import check_file, new_file

    configuration = configuration_reader.from_arguments(arguments)
    check_file(arguments.output, arguments.overwrite)
    with open_bag(arguments.bag) as bag:
        name = arguments.bag.resolve().name
        remaps = parse_remaps(arguments.remap)
        check_remaps(bag, remaps)
        recording = read_series(bag, remaps, name)
        calibration = calibrate(recording, configuration, tuple(remaps))
    guessed: dict[str, str] = {}
    for path in filter(Path.is_file, map(Path, arguments.config)):
        stated = ros_yaml.read(path)  # a later file wins, as a number that is known
        guessed = {key: words for key, words in guessed.items() if key not in stated}
        guessed |= {key: words for words, key in GUESSED.findall(path.read_text('utf-8'))}
    known = {each.partition(':=')[0] for each in arguments.parameters}
    known |= {change.key for change in calibration.changes}
    guessed = {key: words for key, words in guessed.items() if key not in known}
    text = as_file(calibration, configuration, name, guessed)
    with new_file(arguments.output, arguments.overwrite) as path:
        path.write_text(text, encoding='utf-8')
    count = len(calibration.changes)
    print(f'{name}: {count} parameter{"" if count == 1 else "s"} identified')
    print('\n'.join(summary(calibration)))
    for note in recording.notes:
        print(f'note: {note}')
    for key in guessed:
        print(f'  {key} is still a guess: measure it')
    print(f'rover file: {arguments.output}')
    words = ['wheel-terra', 'replay', str(arguments.bag), '--config', str(arguments.output)]
    for remap in arguments.remap:
        words += ['--remap', remap]
    print(f'next: {shlex.join(words)} --report report.html')
    return 0
