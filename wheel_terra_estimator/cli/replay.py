# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""``wheel-terra replay``."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from wheel_terra_estimator.configuration import reader as configuration_reader

SUMMARY = 'run the estimator over a rosbag2, without ROS'
QUICK_MESSAGES = 60_000
"""Messages of a topic that the checks before a replay look at."""
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
    parser.add_argument(
        '--table',
        type=Path,
        metavar='F.csv|F.parquet',
        help='table of the estimates, one row per set and wheel, units in the header',
    )
    parser.add_argument('--json', action='store_true', help='print the summary as JSON')
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
    from wheel_terra_estimator.bags.series_reader import read_series
    from wheel_terra_estimator.bags.storage import open_bag
    from wheel_terra_estimator.bags.truth import read_truth
    from wheel_terra_estimator.checks.run import check_recording
    from wheel_terra_estimator.output_folder import check_file, check_folder, new_file
    from wheel_terra_estimator.reporting import estimates_table, truth_scores
    from wheel_terra_estimator.reporting.drive_summary import as_dict, as_text, summarise
    from wheel_terra_estimator.reporting.html import check_page
    from wheel_terra_estimator.reporting.replay_report import write_replay_report

    configuration = configuration_reader.from_arguments(arguments)
    remaps = parse_remaps(arguments.remap)
    inputs = [arguments.bag, *([arguments.arrival] if arguments.arrival else [])]
    if arguments.report:
        check_page(arguments.report)
        check_file(arguments.report, arguments.overwrite, inputs)
    if arguments.table:
        estimates_table.check_table(arguments.table)
        check_file(arguments.table, arguments.overwrite, inputs)
    if arguments.output:
        check_folder(arguments.output, arguments.overwrite, inputs)
    with open_bag(arguments.bag) as bag:
        recording = read_series(bag, remaps, arguments.bag.name, QUICK_MESSAGES)
        checked = check_recording(recording, configuration, tuple(remaps))
        if not arguments.json:
            for finding in checked.findings:
                print(f'finding: {finding}')
        result = replay(
            bag,
            configuration,
            remaps,
            arguments.output,
            overwrite=arguments.overwrite,
            arrival=arguments.arrival,
            every_set=bool(arguments.table),
        )
        truth = read_truth(bag, remaps, configuration)
    # A truth that the estimator was given as its reference is none to judge it by.
    judged = truth if truth and truth.source not in result.topics.values() else None
    errors = None
    if judged:
        thresholds = configuration.filter.class_thresholds
        errors = truth_scores.truth_errors(result.history, judged, thresholds)
    title = arguments.bag.resolve().name
    summary = summarise(
        title, result.history, result.topics, result.heard, result.rejected, result.notes
    )
    if arguments.json:
        told = as_dict(summary)
        told['findings'] = checked.as_dict()['findings']
        told['truth'] = truth_scores.as_dict(errors) if errors else None
        print(json.dumps(told, indent=2))
    else:
        print('\n'.join([as_text(summary), *(truth_scores.as_lines(errors) if errors else ())]))
    if arguments.table:
        with new_file(arguments.table, arguments.overwrite) as path:
            estimates_table.write_table(result.history, path)
    if arguments.report:
        write_replay_report(
            arguments.report,
            summary,
            result.history,
            truth,
            configuration,
            overwrite=arguments.overwrite,
            findings=checked.findings,
            errors=errors,
        )
    written = {
        'table': arguments.table,
        'estimates': arguments.output,
        'report': arguments.report,
    }
    if not arguments.json:
        for what, path in written.items():
            if path:
                print(f'{what}: {path}')
    return 130 if result.interrupted else 0
