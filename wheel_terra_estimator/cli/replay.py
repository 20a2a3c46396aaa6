# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""``wheel-terra replay``."""

from __future__ import annotations

import argparse
from pathlib import Path

from wheel_terra_estimator.configuration import reader as configuration_reader

SUMMARY = 'run the estimator over a rosbag2, without ROS'
EXAMPLES = (
    'wheel-terra replay my_bag --config my_rover.yaml -o estimates --report report.html',
    'wheel-terra replay drive.mcap --config pathfinder --remap reference_odom:=/truth/odometry',
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    parser.add_argument(
        'bag', type=Path, metavar='BAG', help='rosbag2 folder, or a single .mcap or .db3 file'
    )
    parser.add_argument(
        '-o',
        dest='output',
        type=Path,
        metavar='DIR',
        help='rosbag2 folder (MCAP) for the estimates, under the names that the node has',
    )
    parser.add_argument('--report', type=Path, metavar='F.html', help='report with pictures')
    configuration_reader.add_arguments(parser)
    parser.add_argument(
        '--remap',
        action='append',
        default=[],
        metavar='FROM:=TO',
        help="the estimator's topic, then the bag's (reference_odom:=/truth/odometry); may be "
        'given several times',
    )
    parser.add_argument(
        '--arrival',
        type=Path,
        metavar='F',
        help='hear the messages in the order that a live node logged (its parameter '
        'record_arrival), not in the order of the bag',
    )
    parser.add_argument(
        '--overwrite', action='store_true', help='replace an earlier output of the same name'
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from wheel_terra_estimator.bags.reader import parse_remaps
    from wheel_terra_estimator.bags.replay import replay
    from wheel_terra_estimator.bags.storage import open_bag
    from wheel_terra_estimator.bags.truth import read_truth
    from wheel_terra_estimator.output_folder import check_file, check_folder
    from wheel_terra_estimator.reporting.drive_summary import as_text, summarise
    from wheel_terra_estimator.reporting.replay_report import write_replay_report

    configuration = configuration_reader.from_arguments(arguments)
    remaps = parse_remaps(arguments.remap)
    inputs = [arguments.bag, *([arguments.arrival] if arguments.arrival else [])]
    if arguments.report:
        check_file(arguments.report, arguments.overwrite, inputs)
    if arguments.output:
        check_folder(arguments.output, arguments.overwrite, inputs)
    with open_bag(arguments.bag) as bag:
        result = replay(
            bag,
            configuration,
            remaps,
            arguments.output,
            overwrite=arguments.overwrite,
            arrival=arguments.arrival,
        )
        truth = read_truth(bag, remaps, configuration) if arguments.report else None
    title = arguments.bag.resolve().name
    summary = summarise(
        title, result.history, result.topics, result.heard, result.rejected, result.notes
    )
    print(as_text(summary))
    if arguments.output:
        print(f'estimates: {arguments.output}')
    if arguments.report:
        write_replay_report(
            arguments.report,
            summary,
            result.history,
            truth,
            configuration,
            overwrite=arguments.overwrite,
        )
        print(f'report: {arguments.report}')
    return 130 if result.interrupted else 0
