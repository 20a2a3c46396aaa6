# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Tables with slip angle and lateral force: read, predicted, diagnosed."""

import csv
import io

import numpy as np
import pytest

from wheel_terra_estimator.api import diagnose
from wheel_terra_estimator.cli.main import main
from wheel_terra_estimator.discrepancy.tables.checks import check_table
from wheel_terra_estimator.discrepancy.tables.parsing import read_table
from wheel_terra_estimator.errors import UserError

ROVER = ('--config', 'hit_wh3', '--config', 'hit_fit')
LOAD = ('--load', '80')
GRID = ('--slip=0:0.6:6', '--slip-angle', '-0.2,0.1,0.3,0.6')


def predicted(capsys, *more: str) -> dict[str, np.ndarray]:
    capsys.readouterr()
    assert main(['predict', *ROVER, *more]) == 0
    rows = list(csv.DictReader(io.StringIO(capsys.readouterr().out)))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


def test_predict_prints_the_lateral_force_with_slip_angles(capsys, tmp_path):
    table = predicted(capsys, *GRID, *LOAD)
    assert len(table['slip']) == 24
    assert (table['lateral_force'] * table['slip_angle'] < 0.0).all()
    straight = predicted(capsys, '--slip=0:0.6:6', *LOAD)
    assert 'lateral_force' not in straight and 'slip_angle' not in straight
    path = tmp_path / 'points.csv'
    with path.open('w', encoding='utf-8') as stream:
        stream.write('slip,normal_load,slip angle [deg]\n')
        for slip, angle in zip(table['slip'], table['slip_angle'], strict=True):
            stream.write(f'{slip},80,{np.degrees(angle)}\n')
    again = predicted(capsys, '--points', str(path))['lateral_force']
    assert again == pytest.approx(table['lateral_force'], rel=1e-6)


def test_a_table_of_lateral_force_is_read_in_its_units_and_checked(tmp_path):
    path = tmp_path / 'rows.csv'
    slips = np.linspace(0.05, 0.6, 8)
    angles = np.tile([15.0, 45.0], 4)

    def write(sign: float) -> None:
        with path.open('w', encoding='utf-8') as stream:
            stream.write('slip,normal_load,slip_angle_deg,sinkage [mm],Side force [kN],')
            stream.write('lateral_force_std [N]\n')
            for k, (slip, angle) in enumerate(zip(slips, angles, strict=True)):
                stream.write(f'{slip},80,{angle},{5 + k},{sign * (0.02 + 0.001 * k)},1\n')

    write(-1.0)
    table = read_table(path)
    assert table.columns['slip_angle'] == pytest.approx(np.radians(angles))
    assert table.measured[:, 3] == pytest.approx(-20.0 - np.arange(8))
    assert table.stated_std[:, 3] == pytest.approx(1.0)
    assert table.quantities == ('sinkage', 'lateral_force')
    write(1.0)
    with pytest.raises(UserError, match=r'lateral_force.*wrong sign.*by -1'):
        read_table(path)
    row = {'slip': slips, 'normal_load': np.full(8, 80.0), 'slip_angle': angles}
    with pytest.raises(UserError, match='looks like degrees'):
        check_table('t', {**row, 'sinkage': 0.005 + 0.001 * np.arange(8)})
    row['slip_angle'] = np.radians(angles)
    with pytest.raises(UserError, match='none of'):  # a lateral force alone is not enough
        check_table('t', {**row, 'lateral_force': -20.0 - np.arange(8)})


FEW = 'side_bulldozing', 'bulldozing', 'cohesion'


@pytest.mark.parametrize('effects', [FEW, pytest.param(None, marks=pytest.mark.slow)])
def test_what_the_flank_does_is_named_from_the_lateral_force(capsys, effects):
    flank = ('-p', 'effects.side_bulldozing.enabled:=true', '-p', 'effects.side_bulldozing.ks:=2.0')
    noise = ('--noise', '0.0003,0.5,0.1,0.3', '--seed', '4')
    rows = predicted(
        capsys, '--slip=0:0.6:4', '--slip-angle', '-0.2,0.3,0.6', '--load', '60,110', *flank, *noise
    )
    found = diagnose(rows, ('hit_wh3', 'hit_fit'), effects=effects)
    assert [effect.name for effect in found.effects] == ['side_bulldozing']
    assert found.effects[0].parameters['ks'].value == pytest.approx(2.0, abs=0.5)
    gap = found.gap['lateral_force']
    assert gap.after < 0.5 * gap.before
    assert gap.after == pytest.approx(0.3, rel=0.5)
    straight = {name: values for name, values in rows.items() if 'lateral' not in name}
    unseen = diagnose(straight, ('hit_wh3', 'hit_fit'), effects=FEW)
    assert 'lateral_force' not in unseen.gap
    assert 'side_bulldozing' not in [effect.name for effect in unseen.effects]
