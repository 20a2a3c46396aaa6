# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""``wheel-terra demo``: two shipped drives through the real node, and a blind trial.

The entrapment of a simulated six-wheel rover, whose ground truth is known, and a piece of a real
drive of the Pathfinder rover. The node receives them over DDS; where rclpy or the laboratory is
missing the same drives go through ``wheel-terra replay``, which gives the same numbers. The trial
is a table made by ``wheel-terra trial``, in which an effect is hidden: it is diagnosed blind, then
compared with the withheld truth.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib.util
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import NamedTuple, TypeAlias

from wheel_terra_estimator.cli.outputs import add_output
from wheel_terra_estimator.configuration.shipped import demo_recording
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.output_folder import check_folder, working_folder

SEAL_SHA256 = '78c7f9baa4662e0969d5b5dff2c94fbd5cbd89ae14923cf0fcc754b1af82c5c7'
"""Of the shipped ``sealed.json``, which states the effect hidden in the table beside it."""
NODE_NOT_FOUND = 4
"""Exit status of the laboratory's ``live_drive`` where DDS does not connect it with the node."""
DOMAINS = 101
"""ROS domains that every system has."""
ONE_THREAD = {'OMP_NUM_THREADS': '1', 'OPENBLAS_NUM_THREADS': '1'}
Part: TypeAlias = Callable[[], tuple[int, str]]  # waits for the end; status, output
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
    add_output(
        parser,
        'folder for estimates, reports and pictures (default demo_output)',
        default=Path('demo_output'),
    )
    parser.add_argument(
        '--no-node', action='store_true', help='replay the drives even if rclpy is installed'
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    output: Path = arguments.output
    check_folder(output, arguments.overwrite)  # a demo does not continue an earlier one
    entries = [f'{drive.name}{end}' for drive in DRIVES for end in ('/', '.html')]
    try:
        with working_folder(output, arguments.overwrite, False, [*entries, 'trial/']):
            if status := _show(arguments, output):
                raise subprocess.CalledProcessError(status, 'demo')  # it is not whole
    except subprocess.CalledProcessError as ended:
        return ended.returncode
    return 0


def _show(arguments: argparse.Namespace, output: Path) -> int:
    """Run drives and trial into the folder; return the first status that is not 0."""
    absent = [name for name in ('rclpy', 'wheel_terra_lab') if not importlib.util.find_spec(name)]
    live = not arguments.no_node and not absent
    if live:
        print('The drives are sent over DDS to estimator_node, as fast as it processes them.')
    else:
        why = '' if arguments.no_node else f'Without {" and ".join(absent)} (docs/install.md) '
        print(f'{why}the drives go through `wheel-terra replay`; the numbers are the same.')
    with ExitStack() as stack:  # where it ends early, so do the parts

        def begin(command: Sequence[str], environment: Mapping[str, str]) -> Part:
            return stack.enter_context(_running(command, environment))

        drives = [begin(_command(d, output, live), _environment(i)) for i, d in enumerate(DRIVES)]
        trial = begin(_trial_command(output / 'trial'), ONE_THREAD)
        for drive, part in zip(DRIVES, drives, strict=True):
            status = _ended(f'{drive.name}: {drive.title}', part)
            if live and status == NODE_NOT_FOUND:
                print('DDS does not reach the node on this machine: `wheel-terra replay` instead.')
                replay = begin(_command(drive, output, False), ONE_THREAD)
                status = _ended(f'{drive.name}, replayed', replay)
            if status:
                return status
        title = 'trial: which effect is missing in the model of a wheel?'
        if status := _ended(f'{title} (SHA-256 of the answer: {SEAL_SHA256[:16]}...)', trial):
            return status
    shown = [f'{drive.name}: {_outcome(drive, output)}' for drive in DRIVES]
    shown.append(f'trial: {_named(output / "trial")}')
    print('\nReports with pictures, to be opened in a browser:')
    for report in (*(f'{drive.name}.html' for drive in DRIVES), 'trial/diagnosis/report.html'):
        print(f'  {(output / report).resolve()}')
    print('\nResults:')
    for line in shown:
        print(f'  {line}')
    return 0


def _ended(title: str, part: Part) -> int:
    """Print the title, then the output of a part; return its status."""
    print(f'\n=== {title}\n', flush=True)
    status, said = part()
    print(said, end='', flush=True)
    return status


@contextmanager
def _running(command: Sequence[str], environment: Mapping[str, str]) -> Iterator[Part]:
    """Run a command of the package beside this one; yield what waits for its end."""
    with tempfile.TemporaryFile('w+', encoding='utf-8') as said:
        process = subprocess.Popen(
            [sys.executable, '-m', *command],
            env={**os.environ, **environment},
            stdout=said,
            stderr=subprocess.STDOUT,
            start_new_session=True,  # Ctrl-C stops it once, by way of the end of this block
        )

        def wait() -> tuple[int, str]:
            status = process.wait()
            said.seek(0)
            return status, said.read()

        try:
            yield wait
        finally:
            process.terminate()
            process.wait()


def _trial_command(folder: Path) -> list[str]:
    """Return what diagnoses the shipped table blind."""
    shipped = demo_recording('trial')
    command = ['wheel_terra_estimator.cli.main', 'diagnose', '--overwrite']
    command += [str(shipped / 'blind.csv'), '--config', str(shipped / 'rig.yaml')]
    return [*command, '-o', str(folder / 'diagnosis')]


def _named(folder: Path) -> str:
    """Reveal the truth; return whether what was named is what was hidden."""
    path = demo_recording('trial') / 'sealed.json'
    sealed = path.read_bytes()
    if hashlib.sha256(sealed).hexdigest() != SEAL_SHA256:
        raise UserError(f'{path}: its checksum is wrong; reinstall the package')
    report = json.loads((folder / 'diagnosis' / 'report.json').read_text(encoding='utf-8'))
    hidden = ' + '.join(json.loads(sealed)['hidden'])
    found = ' + '.join(effect['name'] for effect in report['effects']) or report['verdict']
    judged = 'right' if found == hidden else 'wrong'
    return f'hidden effect {hidden}, identified {found}: {judged}'


def _command(drive: DemoDrive, output: Path, live: bool) -> list[str]:
    command = ['wheel_terra_lab.live_drive']
    if not live:
        command = ['wheel_terra_estimator.cli.main', 'replay']
    command += [str(demo_recording(drive.name))]
    command += ['-o', str(output / drive.name), '--report', str(output / f'{drive.name}.html')]
    for name in drive.configuration:
        command += ['--config', name]
    for remap in drive.remaps:
        command += ['--remap', remap]
    return [*command, '--overwrite']


def _environment(number: int) -> dict[str, str]:
    """Restrict a drive to this machine, and separate it from other robots and drives on it."""
    domain = int(os.environ.get('ROS_DOMAIN_ID') or os.getpid()) + number
    reach = os.environ.get('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    return {
        **ONE_THREAD,
        'ROS_AUTOMATIC_DISCOVERY_RANGE': reach,
        'ROS_DOMAIN_ID': str(domain % DOMAINS),
    }


def _outcome(drive: DemoDrive, output: Path) -> str:
    """Return whether the warning came before the true entrapment."""
    from wheel_terra_estimator.bags.history import read_estimates
    from wheel_terra_estimator.bags.storage import open_bag
    from wheel_terra_estimator.bags.truth import read_truth
    from wheel_terra_estimator.configuration import reader
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
        words = 'not warned before' if lead is None else f'warned {lead:.1f} s before'
        return f'entrapped at {errors.entrapped:.1f} s (median slip above 0.9 for 1 s), {words}'
    warnings = len(history.warnings)
    return f'never entrapped, {f"{warnings} false warnings" if warnings else "never warned"}'
