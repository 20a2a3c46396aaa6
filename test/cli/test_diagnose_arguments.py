# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""``wheel-terra diagnose``: what is asked of a recording is checked as ``replay`` checks it."""

import json
from pathlib import Path

import pytest

from wheel_terra_estimator.cli.main import main


@pytest.mark.parametrize(
    ('name', 'words'),
    [('drive.mcap.zstd', 'cannot be unpacked'), ('drive.bag', 'a bag of ROS 1')],
)
def test_a_recording_is_no_table(tmp_path, refused, name, words):
    bag = tmp_path / name
    bag.write_bytes(b'no recording')
    arguments = ['diagnose', str(bag), '-o', str(tmp_path / 'out'), '--config', 'pathfinder']
    refused(arguments, words)


def _table(path: Path) -> str:
    rows = [f'{0.05 + 0.1 * i:.2f},80,{0.01 + 0.001 * i},{5 * i},{1.0 + 0.5 * i}' for i in range(8)]
    path.write_text('slip,normal_load,sinkage,drawbar_pull,torque\n' + '\n'.join(rows))
    return str(path)


def test_remaps_and_smoothing_are_for_bags(tmp_path, refused):
    command = ['diagnose', _table(tmp_path / 'rig.csv'), '-o', str(tmp_path / 'out')]
    refused([*command, '--remap', 'odom:=/vo'], 'rig.csv is a table')
    refused([*command, '--smooth'], '--smooth: goes with a bag')


def test_a_soil_that_nobody_stated_is_said(tmp_path, printed):
    rig = ['--config', 'hit_wh1']
    rows = ['--slip', '0.05:0.6:8', '--load', '35,70', '-o', str(tmp_path / 'rig.csv')]
    assert main(['predict', *rig, *rows]) == 0
    command = ['diagnose', str(tmp_path / 'rig.csv'), *rig, '-o', str(tmp_path / 'out')]
    assert 'no soil was stated' in printed([*command, '--no-pictures', '--only', 'cohesion'])


@pytest.mark.parametrize(
    'soil', ['grenville_loam_24', pytest.param('snow_us', marks=pytest.mark.slow)]
)
def test_a_soil_that_nobody_stated_may_be_any(tmp_path, printed, soil):
    """By the report as JSON, and nothing else."""
    rig, rows = ['--config', 'generic_six_wheel'], str(tmp_path / 'rows.csv')
    noise = ['--slip', '0:0.6:12', '--load', '30', '--noise', '0.0005,0.8,0.05']
    assert main(['predict', *rig, '--config', soil, *noise, '-o', rows]) == 0
    out = tmp_path / 'out'
    told = json.loads(printed(['diagnose', rows, *rig, '-o', out, '--no-pictures', '--json']))
    assert told['verdict'] == 'agrees'
    assert told == json.loads((out / 'report.json').read_text())
