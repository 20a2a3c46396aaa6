# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""``wheel-terra diagnose``: what is asked of a recording is checked as ``replay`` checks it."""

import json
from pathlib import Path

import pytest

from wheel_terra_estimator.cli.main import main


def test_packed_recording_is_a_recording(tmp_path, refused):
    packed = tmp_path / 'drive.mcap.zstd'
    packed.write_bytes(b'no recording')
    arguments = ['diagnose', str(packed), '-o', str(tmp_path / 'out'), '--config', 'pathfinder']
    refused(arguments, 'cannot be unpacked')


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


@pytest.mark.parametrize('soil', ['grenville_loam_24', 'snow_us'])
def test_a_soil_that_nobody_stated_may_be_any(tmp_path, capsys, soil):
    rig, rows = ['--config', 'generic_six_wheel'], str(tmp_path / 'rows.csv')
    noise = ['--slip', '0:0.6:12', '--load', '30', '--noise', '0.0005,0.8,0.05']
    assert main(['predict', *rig, '--config', soil, *noise, '-o', rows]) == 0
    capsys.readouterr()
    out = ['-o', str(tmp_path / 'out'), '--no-pictures', '--json']
    assert main(['diagnose', rows, *rig, *out]) == 0
    assert json.loads(capsys.readouterr().out)['verdict'] == 'agrees'


def test_json_is_the_report_and_nothing_else(tmp_path, capsys, printed):
    config = ['--config', 'hit_wh3', '--config', 'dlr_mss']
    rows = str(tmp_path / 'rows.csv')
    assert main(['predict', *config, '--slip', '0.1:0.5:5', '--load', '60,90', '-o', rows]) == 0
    capsys.readouterr()
    out = tmp_path / 'out'
    arguments = ['diagnose', rows, *config, '-o', str(out), '--no-pictures', '--json']
    said = printed([*arguments, '--only', 'lug_digging'])
    assert json.loads(said) == json.loads((out / 'report.json').read_text())


def test_tables_with_soils_of_their_own_are_diagnosed_side_by_side(tmp_path, capsys, printed):
    """The same friction of the drive in two soils: each table gets its soil."""
    rig = ['--config', 'hit_wh3_lug10']
    for name, soil in (('sand', 'hit_lss1'), ('simulant', 'fjs1_ishigami')):
        friction = 'effects.drivetrain_friction'
        hidden = ['-p', f'{friction}.enabled:=true', '-p', f'{friction}.torque:=0.8']
        rows = ['predict', *rig, '--config', soil, *hidden, '--slip', '0.05:0.7:8']
        rows += ['--load', '40,80', '--noise', '0.0003,0.6,0.06', '--seed', str(len(name))]
        assert main([*rows, '-o', str(tmp_path / f'{name}.csv')]) == 0
    tables = [str(tmp_path / f'{name}.csv') for name in ('sand', 'simulant')]
    capsys.readouterr()
    arguments = ['diagnose', *tables, *rig, '--config', 'hit_lss1', '--no-pictures']
    arguments += ['--soil', 'own', '--jobs', '1', '--only', 'drivetrain_friction']
    arguments += ['-o', str(tmp_path / 'out')]
    said = printed(arguments)
    assert 'over all 2 tables, each with its own soil' in said
    assert 'for it 2 of 2 tables' in said.splitlines()[-1]
    stiffness = {}
    for name in ('sand', 'simulant'):
        report = json.loads((tmp_path / 'out' / name / 'report.json').read_text())
        stiffness[name] = next(s for s in report['soil'] if s['name'] == 'stiffness')['after']
        assert (tmp_path / 'out' / name / 'model.yaml').exists()
    assert abs(stiffness['sand'] / stiffness['simulant'] - 1.0) > 0.05
    summary = (tmp_path / 'out' / 'summary.csv').read_text().splitlines()
    assert len(summary) == 3 and summary[0].startswith('table,verdict,effects,confidence,')
