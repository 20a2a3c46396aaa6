# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Whole commands over recordings with any stamps and any numbers: an answer, never a traceback."""

import itertools
import warnings

import numpy as np
import pytest
from recordings import changed

from wheel_terra_estimator.bags.simulated_drive import write_simulated_drive
from wheel_terra_estimator.cli.main import main
from wheel_terra_estimator.simulation import scenario
from wheel_terra_estimator.simulation.drive import simulate

CONFIG = ['--config', 'generic_six_wheel', '--config', 'test_sand']
SPANS = (10**10, 10**13, 4 * 10**17)  # [ns]
WILD = (np.nan, np.inf, -np.inf, 1e300, -1e300, 1e9, 5e-324)


@pytest.fixture(scope='module')
def drive(tmp_path_factory):
    path = tmp_path_factory.mktemp('drive') / 'drive'
    write_simulated_drive(simulate(scenario.load('turns'), seed=5, duration=4.0), path)
    return path


def run(command, bag, capsys, *more):
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        status = main([command, str(bag), *CONFIG, *more])
    out, err = capsys.readouterr()
    assert status in (0, 1), err
    assert not err and 'nan' not in out.split() and 'internal error' not in out
    return out


@pytest.mark.parametrize(
    'seed', [s if s % 4 == 0 else pytest.param(s, marks=pytest.mark.slow) for s in range(9)]
)
def test_random_stamps(drive, tmp_path, capsys, seed):
    random = np.random.default_rng(seed)

    def change(topic, message):
        if hasattr(message, 'header') and random.random() < (1.0, 0.5, 0.02)[seed // 3]:
            stamp = int(1.7e18) + int(random.integers(0, SPANS[seed % 3]))
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
        return message

    bag = changed(drive, tmp_path / 'bag', change)
    run('check', bag, capsys)
    run('replay', bag, capsys)


def test_a_recording_without_stamps_is_no_success(drive, tmp_path, capsys):
    def change(topic, message):
        if hasattr(message, 'header'):
            message.header.stamp.sec = message.header.stamp.nanosec = 0
        return message

    assert main(['replay', str(changed(drive, tmp_path / 'bag', change)), *CONFIG]) == 2
    said = capsys.readouterr()
    assert 'x stamp is zero or negative' in said.out and 'bag: no estimate; ' in said.err


def test_wild_numbers_in_the_truth(drive, tmp_path, capsys):
    numbers = itertools.cycle(WILD)

    def change(topic, message):
        if topic == '/ground_truth/twist':
            message.twist.twist.linear.x = next(numbers)
        elif topic.startswith('/ground_truth/s') and hasattr(message, 'position'):
            message.position = np.array([next(numbers) for _ in message.position])
        return message

    assert 'against the truth' in run('replay', changed(drive, tmp_path / 'bag', change), capsys)


def test_without_an_imu_the_first_finding_says_so(drive, tmp_path, capsys):
    bag = changed(drive, tmp_path / 'bag', lambda topic, m: None if 'imu' in topic else m)
    assert main(['check', str(bag), *CONFIG]) == 1
    assert 'no IMU in the recording' in capsys.readouterr().out.splitlines()[1]
    assert main(['replay', str(bag), *CONFIG]) == 0
    assert 'no IMU in the recording' in capsys.readouterr().out.splitlines()[0]
