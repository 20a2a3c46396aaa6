# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""``make demo``: two shipped drives through the real node, with reports and key numbers.

The entrapment of a simulated six-wheel rover, whose ground truth is known, and a piece of a real
drive of the Pathfinder rover. The node hears them over DDS; where there is no rclpy the same drives
go through ``wheel-terra replay``, which gives the same numbers.
"""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np

from wheel_terra_estimator.bags.history import EstimateHistory, read_estimates
from wheel_terra_estimator.bags.storage import open_bag
from wheel_terra_estimator.bags.truth import Truth, read_truth
from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.reporting.drive_pictures import overview
from wheel_terra_estimator.reporting.style import picture_style
from wheel_terra_estimator.simulation.truth import entrapped

ROOT = Path(__file__).resolve().parents[1]
OUTPUT = ROOT / 'demo_output'


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


def main() -> int:
    """Run the demonstration."""
    live = importlib.util.find_spec('rclpy') is not None
    if live:
        print('The drives go over DDS to estimator_node, as fast as it takes them.')
    else:
        print(
            'There is no rclpy here (no wheels for this platform, no sourced Jazzy): the same '
            'drives go through `wheel-terra replay` instead of the node.'
        )
    OUTPUT.mkdir(exist_ok=True)
    reports = []
    for drive in DRIVES:
        print(f'\n=== {drive.name}: {drive.title}\n', flush=True)
        status = subprocess.run(_command(drive, live), env=_environment(), check=False).returncode
        if status:
            return status
        _key_numbers(drive)
        reports.append(OUTPUT / f'{drive.name}.html')
    print('\nReports with pictures, to be opened in a browser:')
    for report in reports:
        print(f'  {report}')
    return 0


def _command(drive: DemoDrive, live: bool) -> list[str]:
    program = ['wheel_terra_estimator.ros.live_drive']
    if not live:
        program = ['wheel_terra_estimator.cli.main', 'replay']
    command = [sys.executable, '-m', *program, str(_recording(drive))]
    command += ['-o', str(OUTPUT / drive.name), '--report', str(OUTPUT / f'{drive.name}.html')]
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


def _recording(drive: DemoDrive) -> Path:
    return ROOT / 'data' / 'demo' / drive.name


def _key_numbers(drive: DemoDrive) -> None:
    """Print how the estimates compare with the truth in the recording."""
    configuration = reader.load(drive.configuration)
    with open_bag(_recording(drive)) as bag:
        truth = read_truth(bag, {}, configuration)
    with open_bag(OUTPUT / drive.name) as bag:
        history = read_estimates(bag)
    with picture_style():
        overview(history, truth).savefig(OUTPUT / f'{drive.name}.png', dpi=110)
    if truth is None or truth.slip is None:
        return
    moving = _seconds(truth, truth.slip.stamp) > 10.0
    print('\nAgainst the truth in the recording, after the first 10 s:')
    for name, unit, scale, known in (
        ('slip', '', 1.0, truth.slip),
        ('sinkage', ' mm', 1e3, truth.sinkage),
        ('drawbar_pull', ' N', 1.0, truth.drawbar_pull),
    ):
        if known is None:
            continue
        estimate = _at(history, name, known.stamp)
        error = (estimate - known.value)[moving[: len(known.stamp)]]
        rms = float(np.sqrt(np.nanmean(error**2)))
        print(f'  {name.replace("_", " "):13s} rms error {scale * rms:.3g}{unit}')
    stuck = entrapped(truth.slip.stamp, truth.slip.value)
    warnings = [_seconds(truth, np.array([w.start]))[0] for w in history.warnings]
    if stuck.any():
        at = float(_seconds(truth, truth.slip.stamp[stuck][:1])[0])
        before = [w for w in warnings if w <= at]
        words = f'warned {at - before[-1]:.1f} s before' if before else 'no warning before'
        print(f'  entrapped at {at:.1f} s (median slip above 0.9 for 1 s): {words}')
    elif not warnings:
        print('  never entrapped, never warned')


def _seconds(truth: Truth, stamp: np.ndarray) -> np.ndarray:
    return (stamp - truth.velocity.stamp[0]) * 1e-9


def _at(history: EstimateHistory, name: str, stamp: np.ndarray) -> np.ndarray:
    """Return the newest estimates at stamps."""
    rows = np.clip(np.searchsorted(history.stamp, stamp, side='right') - 1, 0, None)
    return history.values[name][rows]


if __name__ == '__main__':
    sys.exit(main())
