# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""``wheel-terra check``."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING

from wheel_terra_estimator.cli.outputs import add_remaps
from wheel_terra_estimator.configuration import reader as configuration_reader

if TYPE_CHECKING:
    from wheel_terra_estimator.checks.finding import CheckReport
    from wheel_terra_estimator.checks.series import Recording

EXAMPLES = (
    'wheel-terra check my_drive',
    'wheel-terra check my_drive --config my_rover.yaml --json',
)

NOTES = 'recording.notes'  # figure: damaged, or not read


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    parser.add_argument(
        'bag', type=Path, metavar='BAG', help='rosbag2 folder, or a single .mcap or .db3 file'
    )
    configuration_reader.add_arguments(parser)
    add_remaps(parser)
    parser.add_argument('--json', action='store_true', help='print findings and figures as JSON')


def run(arguments: argparse.Namespace) -> int:
    """Run the command: 0 nothing wrong, 1 something to mend."""
    from wheel_terra_estimator.bags.reader import check_remaps, in_one_line, parse_remaps
    from wheel_terra_estimator.bags.series_reader import read_series
    from wheel_terra_estimator.bags.storage import open_bag
    from wheel_terra_estimator.checks.run import check_recording
    from wheel_terra_estimator.errors import UserError

    given = bool(arguments.config or arguments.parameters)
    configuration = configuration_reader.from_arguments(arguments) if given else None
    remaps = parse_remaps(arguments.remap)
    with open_bag(arguments.bag) as bag:
        recording = read_series(bag, remaps, arguments.bag.resolve().name)
        if recording.joints is None and recording.wheel_odometry is None:
            there = in_one_line((name, kind) for name, kind, _ in recording.topics)
            topic = remaps.get('joint_states', '/joint_states')
            raise UserError(
                f'{arguments.bag}: no wheel rates on {topic}, and no odometry; there are: {there}; '
                'name the wheel rates with --remap joint_states:=/TOPIC, or record them'
            )
        check_remaps(bag, remaps)
    report = check_recording(recording, configuration, tuple(remaps))
    if recording.notes:
        report.figures[NOTES] = list(recording.notes)
    if arguments.json:
        print(json.dumps(report.as_dict(), indent=2))
    else:
        print(as_text(recording, report, configuration is None))
    return 1 if report.findings else 0


def as_text(recording: Recording, report: CheckReport, without_rover: bool) -> str:
    """Return what the command prints."""
    from wheel_terra_estimator.checks.finding import shown
    from wheel_terra_estimator.checks.names import proposal

    count = len(report.findings)
    lines = [f'{recording.name}: {count or "no"} finding{"" if count == 1 else "s"}']
    lines += [f'  note: {note}' for note in recording.notes]
    lines += [f'  {line}' for line in shown(report.findings)]
    if without_rover:
        lines += ['', '  topics']
        lines += [f'    {name}  {kind}  {count}' for name, kind, count in recording.topics]
        proposed = proposal(recording)
        lines.append('  proposal for a rover file and the commands (see wheel-terra init)')
        lines += [f'    {remap}' for remap in proposed['remaps']]
        if proposed['wheels.names']:
            lines.append(f'    wheels.names: [{", ".join(proposed["wheels.names"])}]')
    if report.not_checked:
        lines += ['', '  not checked']
        lines += [f'    {entry.kind}: {entry.reason}' for entry in report.not_checked]
    figures = {key: value for key, value in report.figures.items() if key != NOTES}
    lines += ['', '  figures'] if figures else []
    width = max((len(key) for key in figures), default=0)
    lines += [f'    {key:{width}}  {value}' for key, value in figures.items()]
    return '\n'.join(lines)
