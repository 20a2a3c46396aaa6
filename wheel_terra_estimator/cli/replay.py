# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""``wheel-terra replay``."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from wheel_terra_estimator.cli.outputs import Output, add_output, add_remaps
from wheel_terra_estimator.configuration import reader as configuration_reader
from wheel_terra_estimator.configuration import soil_file
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.scheduler import add_jobs_argument, add_scheduler_argument

if TYPE_CHECKING:
    from wheel_terra_estimator.bags.replay import Options
    from wheel_terra_estimator.fleet.drive import Drive

SOME_FAILED = 1
INTERRUPTED = 130
EXAMPLES = (
    'wheel-terra replay my_bag --config my_rover.yaml -o estimates --report report.html',
    'wheel-terra replay drive.mcap --config pathfinder --remap reference_odom:=/truth/odometry',
    'wheel-terra replay my_bag --config my_rover.yaml --smooth --table smoothed.csv',
    'wheel-terra replay bags/* --config my_rover.yaml -o estimates --jobs 4 --report report.html',
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    parser.add_argument(
        'bags',
        type=Path,
        nargs='+',
        metavar='BAG',
        help='rosbag2 folder, or a single .mcap or .db3 file; of several, each gets a folder below '
        '-o (--report, --table, --track are names in it), and an interrupted run is resumed',
    )
    add_output(
        parser,
        'rosbag2 folder (MCAP) for the estimates, under the names of the node; of several '
        'recordings a folder of such folders, with summary.csv and summary.html',
    )
    parser.add_argument(
        '--table',
        action=Output,
        metavar='F.csv|F.parquet',
        help='table of the estimates, one row per set and wheel, units in the header',
    )
    parser.add_argument(
        '--track',
        action=Output,
        metavar='F.csv',
        help='map of the drive: position, slip, class, sinkage, pull margin and learned soil, '
        'units in the header',
    )
    parser.add_argument(
        '--save-soil',
        action=Output,
        metavar='F.yaml',
        help='parameter file with the learned soil and sensor biases of one recording, a further '
        '--config for the next drive',
    )
    parser.add_argument(
        '--smooth',
        action='store_true',
        help='estimates of the fixed-interval smoother; warnings stay as they were given live',
    )
    parser.add_argument('--json', action='store_true', help='print the summary as JSON')
    parser.add_argument('--report', action=Output, metavar='F.html', help='report with pictures')
    add_jobs_argument(parser, words='recordings at a time')
    add_scheduler_argument(parser, what='recordings')
    configuration_reader.add_arguments(parser)
    add_remaps(parser)
    parser.add_argument(
        '--arrival',
        type=Path,
        metavar='F',
        help='replay messages in the order logged by a live node (its parameter '
        'record_arrival), not in that of the bag',
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    return _run_one(arguments) if len(arguments.bags) == 1 else _run_several(arguments)


def _run_one(arguments: argparse.Namespace) -> int:
    from wheel_terra_estimator.bags.reader import parse_remaps
    from wheel_terra_estimator.checks.finding import CheckReport
    from wheel_terra_estimator.fleet.drive import findings_as_lines, replay_drive
    from wheel_terra_estimator.reporting import truth_scores
    from wheel_terra_estimator.reporting.drive_summary import as_dict

    def print_findings(checked: CheckReport) -> None:
        for line in () if arguments.json else findings_as_lines(checked):
            print(line)

    (bag,) = arguments.bags
    configuration = configuration_reader.from_arguments(arguments)
    remaps = parse_remaps(arguments.remap)
    _check_outputs(arguments)
    drive = replay_drive(
        bag, configuration, remaps, arguments.output, _options(arguments), print_findings
    )
    if arguments.json:
        content = as_dict(drive.summary)
        content['findings'] = drive.checked.as_dict()['findings']
        content['truth'] = truth_scores.as_dict(drive.errors) if drive.errors else None
        print(json.dumps(content, indent=2))
    else:
        print(drive.as_text)
    written = _write_outputs(drive, arguments)
    if not arguments.json:
        for what, path in written.items():
            print(f'{what}: {path}')
    if drive.result.interrupted:
        return INTERRUPTED
    if not drive.summary.sets:
        raise UserError(f'{bag}: no estimate; what was received and rejected is listed above')
    return 0


def _options(arguments: argparse.Namespace) -> Options:
    from wheel_terra_estimator.bags.replay import Options

    return Options(
        overwrite=arguments.overwrite,
        arrival=arguments.arrival,
        every_set=bool(arguments.table),
        smooth=arguments.smooth,
    )


_ENDINGS = {
    'report': (('.html', '.htm'), 'a report is an HTML page; give it a name that ends in .html'),
    'table': (('.csv', '.parquet'), 'a table ends in .csv or .parquet'),
    'track': (('.csv',), 'a track ends in .csv'),
}
"""Option that names a file -> allowed endings, and the message on another."""


def _files(arguments: argparse.Namespace) -> dict[str, Path]:
    """Return the files to be written by option; refuse names that promise another format."""
    from wheel_terra_estimator.reporting.estimates_table import PARQUET, pandas_for

    paths: dict[str, Path] = {o: p for o in _ENDINGS if (p := getattr(arguments, o))}
    for option, path in paths.items():
        endings, words = _ENDINGS[option]
        if path.suffix.lower() not in endings:
            raise UserError(f'{path}: {words}')
        if path.suffix.lower() == PARQUET:
            pandas_for(path)
    return paths


def _check_outputs(arguments: argparse.Namespace) -> None:
    """Refuse outputs that cannot be written, before hours of work."""
    from wheel_terra_estimator.output_folder import check_file, check_folder

    for path in _files(arguments).values():
        check_file(path, arguments.overwrite)
    if arguments.save_soil:
        check_file(arguments.save_soil, arguments.overwrite, foreign=soil_file.why_foreign)
    if arguments.output:
        check_folder(arguments.output, arguments.overwrite)


def _write_outputs(drive: Drive, arguments: argparse.Namespace) -> dict[str, Path]:
    """Write the requested files beside the bag of estimates; return their descriptions."""
    drive.write(_files(arguments), arguments.overwrite)
    if arguments.save_soil:
        if not drive.result.learned:
            raise UserError(
                f'{arguments.bags[0]}: no estimates, so nothing for {arguments.save_soil}'
            )
        soil_file.write_values(arguments.save_soil, drive.result.learned, arguments.overwrite)
    outputs = {
        'table': arguments.table,
        'track': arguments.track,
        'soil': arguments.save_soil,
        'estimates': arguments.output,
        'report': arguments.report,
    }
    return {what: path for what, path in outputs.items() if path}


def _run_several(arguments: argparse.Namespace) -> int:
    from wheel_terra_estimator.bags.reader import parse_remaps
    from wheel_terra_estimator.fleet.several_bags import SUMMARY_PAGE, Settings, replay_bags

    if not arguments.output:
        raise UserError('several recordings need a folder for their outputs: add -o DIR')
    for option, given in (('--arrival', arguments.arrival), ('--save-soil', arguments.save_soil)):
        if given:
            raise UserError(f'{option}: belongs to one recording; replay that one by itself')
    settings = Settings(
        configuration_reader.from_arguments(arguments),
        parse_remaps(arguments.remap),
        arguments.output,
        {option: _plain_name(option, path) for option, path in _files(arguments).items()},
        _options(arguments),
    )
    try:
        rows = replay_bags(
            arguments.bags,
            settings,
            overwrite=arguments.overwrite,
            jobs=arguments.jobs,
            scheduler=arguments.scheduler or '',
        )
    except KeyboardInterrupt:
        raise KeyboardInterrupt('; the same command without --overwrite resumes') from None
    failed = [row for row in rows if row.error]
    if arguments.json:
        print(
            json.dumps({'drives': [asdict(row) for row in rows], 'failed': len(failed)}, indent=2)
        )
    else:
        for row in rows:
            if not row.error:
                print(row.as_line)
        print(f'summary: {arguments.output / SUMMARY_PAGE}')
        if failed:
            print(f'{len(failed)} of {len(rows)} recordings failed:')
        for row in failed:
            print(f'  {row.as_line}')
    return SOME_FAILED if failed else 0


def _plain_name(option: str, path: Path) -> str:
    """Return the name of a file that stands in the folder of each recording."""
    if path != Path(path.name):
        raise UserError(
            f'--{option} {path}: with several recordings it goes to the folder of each; '
            f'give a plain name such as {path.name}'
        )
    return path.name
