# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""``wheel-terra demo``: two shipped drives through the real node, and a blind trial.

The entrapment of a simulated six-wheel rover, whose ground truth is known, and a piece of a real
drive of the Pathfinder rover. The node hears them over DDS; where there is no rclpy the same drives
go through ``wheel-terra replay``, which gives the same numbers. The trial is a table made
by ``wheel-terra trial``, in which an effect is hidden: it is diagnosed blind, then the seal opened.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

from wheel_terra_estimator.cli.outputs import Output
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.output_folder import working_folder

SEAL_SHA256 = '78c7f9baa4662e0969d5b5dff2c94fbd5cbd89ae14923cf0fcc754b1af82c5c7'
"""Of the shipped ``sealed.json``, which says what was hidden in the table beside it."""
NODE_NOT_FOUND = 4
"""Exit status of ``ros.live_drive`` where DDS does not connect it with the node."""
EXAMPLES = ('wheel-terra demo', 'wheel-terra demo --no-node -o /tmp/demo --overwrite')


class DemoDrive(NamedTuple):
    """A recording and how to run it."""

    name: str
    title: str
    configuration: tuple[str, ...]
    remaps: tuple[str, ...] = ()


DRIVES = (
    DemoDrive(
        'entrapment',
        'a simulated six-wheel rover climbs into soft sand and digs itself in',
        ('generic_six_wheel', 'test_sand'),
    ),
    DemoDrive(
        'pathfinder',
        'a real four-wheel rover on firm ground (WVU Pathfinder, MIT licence)',
        ('pathfinder',),
        ('reference_odom:=/truth/odometry',),
    ),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    parser.add_argument(
        '-o',
        dest='output',
        action=Output,
        type=Path,
        default=Path('demo_output'),
        metavar='DIR',
        help='folder for estimates, reports and pictures (default demo_output)',
    )
    parser.add_argument(
        '--no-node', action='store_true', help='replay the drives even where rclpy is at hand'
    )
    parser.add_argument(
        '--overwrite', action='store_true', help='replace the output of an earlier demo'
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    output: Path = arguments.output
    entries = [f'{drive.name}{end}' for drive in DRIVES for end in ('/', '.html')]
    with working_folder(output, arguments.overwrite, False, [*entries, 'trial/']):
        return _show(arguments, output)


def _show(arguments: argparse.Namespace, output: Path) -> int:
    """Run drives and trial into the folder; return the first status that is not 0."""
    live = not arguments.no_node and importlib.util.find_spec('rclpy') is not None
    if live:
        print('The drives go over DDS to estimator_node, as fast as it takes them.')
    else:
        why = '' if arguments.no_node else 'There is no rclpy here (no sourced Jazzy): '
        print(f'{why}the drives go through `wheel-terra replay`; the numbers are the same.')
    reports, shown = [], []
    for drive in DRIVES:
        print(f'\n=== {drive.name}: {drive.title}\n', flush=True)
        status = _run_drive(drive, output, live)
        if live and status == NODE_NOT_FOUND:
            print('DDS has no way to the node on this machine: `wheel-terra replay` goes on.')
            live, status = False, _run_drive(drive, output, False)
        if status:
            return status
        shown.append(f'{drive.name}: {_outcome(drive, output)}')
        reports.append(output / f'{drive.name}.html')
    print('\n=== trial: what is missing in the model of a wheel?\n', flush=True)
    status, outcome = _trial(output / 'trial')
    if status:
        return status
    shown.append(f'trial: {outcome}')
    reports.append(output / 'trial' / 'diagnosis' / 'report.html')
    print('\nReports with pictures, to be opened in a browser:')
    for report in reports:
        print(f'  {report.resolve()}')
    print('\nWhat was shown:')
    for line in shown:
        print(f'  {line}')
    return 0


def _trial(folder: Path) -> tuple[int, str]:
    """Diagnose the shipped table blind, open its seal; return the status and what came of it."""
    from wheel_terra_estimator.configuration.shipped import demo_recording

    shipped = demo_recording('trial')
    sealed = (shipped / 'sealed.json').read_bytes()
    if hashlib.sha256(sealed).hexdigest() != SEAL_SHA256:
        raise UserError(f'{shipped / "sealed.json"}: the seal is broken; install the package anew')
    print(f'blind table, truth sealed (SHA-256 {SEAL_SHA256[:16]}...)', flush=True)
    command = [sys.executable, '-m', 'wheel_terra_estimator.cli.main', 'diagnose', '--overwrite']
    command += [str(shipped / 'blind.csv'), '--config', str(shipped / 'rig.yaml')]
    command += ['-o', str(folder / 'diagnosis')]
    status = subprocess.run(command, env=_environment(), check=False).returncode
    if status:
        return status, ''
    report = json.loads((folder / 'diagnosis' / 'report.json').read_text(encoding='utf-8'))
    hidden = ' + '.join(json.loads(sealed)['hidden'])
    said = ' + '.join(effect['name'] for effect in report['effects']) or report['verdict']
    judged = 'right' if said == hidden else 'wrong'
    return 0, f'seal opened: {hidden} was hidden; said: {said}: {judged}'


def _run_drive(drive: DemoDrive, output: Path, live: bool) -> int:
    command = _command(drive, output, live)
    return subprocess.run(command, env=_environment(), check=False).returncode


def _command(drive: DemoDrive, output: Path, live: bool) -> list[str]:
    from wheel_terra_estimator.configuration.shipped import demo_recording

    program = ['wheel_terra_estimator.ros.live_drive']
    if not live:
        program = ['wheel_terra_estimator.cli.main', 'replay']
    command = [sys.executable, '-m', *program, str(demo_recording(drive.name))]
    command += ['-o', str(output / drive.name), '--report', str(output / f'{drive.name}.html')]
    for name in drive.configuration:
        command += ['--config', name]
    for remap in drive.remaps:
        command += ['--remap', remap]
    return [*command, '--overwrite']


def _environment() -> dict[str, str]:
    """Keep the demonstration to this machine and apart from other robots on it."""
    own = {
        'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
        'ROS_DOMAIN_ID': str(os.getpid() % 100 + 1),
        'OMP_NUM_THREADS': '1',
        'OPENBLAS_NUM_THREADS': '1',
    }
    return {**own, **os.environ}


def _outcome(drive: DemoDrive, output: Path) -> str:
    """Return whether the warning came before the true entrapment."""
    from wheel_terra_estimator.bags.history import read_estimates
    from wheel_terra_estimator.bags.storage import open_bag
    from wheel_terra_estimator.bags.truth import read_truth
    from wheel_terra_estimator.configuration import reader
    from wheel_terra_estimator.configuration.shipped import demo_recording
    from wheel_terra_estimator.reporting.truth_scores import truth_errors

    configuration = reader.load(drive.configuration)
    with open_bag(demo_recording(drive.name)) as bag:
        truth = read_truth(bag, {}, configuration)
    with open_bag(output / drive.name) as bag:
        history = read_estimates(bag)
    if truth is None or truth.slip is None:
        return f'{len(history.warnings)} stuck warnings'
    errors = truth_errors(history, truth, configuration.filter.class_thresholds)
    if errors is not None and errors.entrapped is not None:
        lead = errors.lead
        words = 'no warning before' if lead is None else f'warned {lead:.1f} s before'
        return f'entrapped at {errors.entrapped:.1f} s (median slip above 0.9 for 1 s), {words}'
    warnings = len(history.warnings)
    return f'never entrapped, {f"{warnings} false warnings" if warnings else "never warned"}'
