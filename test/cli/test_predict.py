# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""wheel-terra predict: tables and pictures of the model, and what it refuses."""

import csv
import io

import numpy as np
import pytest

from wheel_terra_estimator.cli.main import main
from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.terramechanics.model import WheelSoilModel
from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints
from wheel_terra_estimator.terramechanics.wheel import Wheel

BASE = ('predict', '--config', 'hit_wh3_lug10', '--config', 'hit_lss1')


def table(text: str) -> dict[str, np.ndarray]:
    rows = list(csv.DictReader(io.StringIO(text)))
    return {k: np.array([float(r[k] or 'nan') for r in rows]) for k in rows[0]}


def test_the_table_is_the_model(printed):
    got = table(printed([*BASE, '--slip', '-0.4:0.9:14', '--load', '40,80', '--slope', '0,0.1']))
    assert got['slip'].size == 14 * 4
    configuration = reader.load(['hit_wh3_lug10', 'hit_lss1'])
    model = WheelSoilModel(configuration.soil, configuration.effects)
    points = OperatingPoints(
        got['slip'], got['normal_load'], Wheel(0.1574, 0.165, 0.010, 30),
        slope=got['slope'], slip_radius=configuration.slip_radius,
    )  # fmt: skip
    answer = model.steady_state(points)
    for name in ('sinkage', 'drawbar_pull', 'torque'):
        assert got[name] == pytest.approx(getattr(answer, name), rel=1e-7, abs=1e-9)


def test_closed_form(printed):
    exact = table(printed([*BASE, '--slip', '0.2,0.6']))
    close = table(printed([*BASE, '--slip', '0.2,0.6', '--method', 'closed_form']))
    assert close['drawbar_pull'] == pytest.approx(exact['drawbar_pull'], abs=0.03 * 80)
    assert (close['drawbar_pull'] != exact['drawbar_pull']).all()


def test_the_load_that_nobody_states_is_the_mean_of_the_wheels(printed):
    rover = reader.load(['frostyboy']).rover
    got = table(printed(['predict', '--config', 'frostyboy', '--slip', '0.1']))
    assert got['normal_load'] == pytest.approx(rover.mass * rover.gravity / 4)


def test_points_of_a_table(tmp_path, printed, refused):
    path = tmp_path / 'rows.csv'
    path.write_text(
        'slip,normal_load,sinkage,drawbar_pull,lug_height,leaving_angle\n'
        '0.2,80,0.01,20,0.01,\n0.2,80,0.01,20,0.0,\n0.2,80,0.01,20,0.01,-0.4\n'
    )
    got = table(printed([*BASE, '--points', str(path)]))
    assert got['lug_height'].tolist() == [0.01, 0.0, 0.01]
    assert len(set(got['drawbar_pull'].tolist())) == 3
    path.write_text('slip,Fz\n0.2,80\n')
    said = refused([*BASE, '--points', str(path)], "no column 'normal_load'")
    assert 'name it in the file: normal_load' in said and '--' not in said  # no option of predict
    path.write_text('slip,normal_load\n')
    refused([*BASE, '--points', str(path)], 'no rows below the column names')
    path.write_text('slip,normal_load\n0.2,80\n0.3,heavy\n')
    refused([*BASE, '--points', str(path)], "line 3, column normal_load: 'heavy' is not a number")


def test_picture_and_the_refusal_to_overwrite(tmp_path, refused):
    picture = tmp_path / 'curves.png'
    assert main([*BASE, '--slip', '0:0.8:5', '-o', str(picture)]) == 0
    assert picture.read_bytes().startswith(b'\x89PNG') and picture.stat().st_size > 10_000
    before = picture.read_bytes()
    refused([*BASE, '-o', str(picture)], 'exists already; choose another path or give --overwrite')
    assert picture.read_bytes() == before
    drawing = tmp_path / 'curves.svg'
    assert main([*BASE, '--slip', '0.3', '--slip-angle', '0:1.5:6', '-o', str(drawing)]) == 0
    assert drawing.read_text().count('>slip angle [rad]<') == 4  # one slip: over the angle
    sheet = tmp_path / 'curves.csv'
    assert main([*BASE, '--slip', '0:0.9:4', '-o', str(sheet)]) == 0
    assert main([*BASE, '--slip', '0:0.9:5', '-o', str(sheet), '--overwrite']) == 0
    assert len(table(sheet.read_text())['slip']) == 5


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        (['--slip', '0:1'], 'must be A:B:N'),
        (['--slip', 'high'], 'must be A:B:N'),
        (['--slip', '1.5'], 'slip is 1.5; allowed is [-1, 1]'),
        (['--load', '-3'], 'normal load is -3 N'),
        (['--load', '1e6'], 'this soil cannot carry 1e+06 N'),
        (['--wheel', 'spare'], 'there are wheel'),
        (['-o', 'curves.doc'], 'end it in .png'),
        (['-o', 'no_such_folder/curves.png'], 'there is no folder no_such_folder'),
        (['-p', 'effects.grouser_thrust.enabled:=true'], 'cannot be on together'),
        (['-p', 'soil.cohesion:=-1.0'], 'soil.cohesion'),
        (['--noise', '0.001'], '--noise'),
        (['--noise', '0.001,1'], '--noise'),
        (['--noise=0.001,-1,0.1'], '--noise'),
        (['--noise', 'nan,1,0.1'], '--noise'),
        (['--noise', 'a,b,c'], '--noise'),
    ],
)
def test_refusals(arguments, words, refused):
    refused([*BASE, *arguments], words)


def test_rows_that_the_soil_cannot_carry_stay_empty(capsys):
    assert main([*BASE, '--slip', '0.2', '--load', '80,1e6']) == 0
    captured = capsys.readouterr()
    got = table(captured.out)
    assert np.isfinite(got['sinkage']).tolist() == [True, False]
    assert '1 of 2 points left empty' in captured.err


@pytest.mark.parametrize(('more', 'told'), [([], True), (['--config', 'hit_fit'], False)])
def test_that_no_soil_was_stated_is_told(capsys, more, told):
    assert main(['predict', '--config', 'hit_wh3', '--load', '80', *more]) == 0
    assert ('no soil was stated' in capsys.readouterr().err) == told


def test_a_law_without_effects(capsys):
    smooth = ('predict', '--config', 'hit_wh3', '--config', 'hit_fit', '--slip', '-0.4:0.9:5')
    resistive = ('-p', 'rover.contact_law:=resistive_force')
    assert main([*smooth, *resistive]) == 0
    said = capsys.readouterr().err
    assert 'slip_sinkage_exponent' in said and 'left out' in said
    for more, word in (
        (['--method', 'closed_form'], 'leave --method'),
        (['--slip-angle', '0.2'], 'plane of the wheel'),
    ):
        assert main([*smooth, *resistive, *more]) == 2
        assert word in capsys.readouterr().err


def test_the_law_of_the_configuration(printed, refused):
    rows = ('predict', '--config', 'hit_wh3', '--config', 'hit_fit', '--slip', '-0.4:0.9:5')
    # On the Moon too the pressures are the same at the width of the wheel.
    moon = [*rows, '-p', 'rover.gravity:=1.62', '-p', 'effects.stress_peak_shift.enabled:=true']
    key = ['-p', 'rover.contact_law:=wong_reece']
    configured = printed([*moon, *key])
    reece, bekker = table(configured), table(printed(moon))
    # The exponent grows with slip, from the depth of the width in one, from 1 m in the other.
    assert reece['sinkage'][1] != pytest.approx(bekker['sinkage'][1], rel=1e-3)
    straight = ['-p', 'effects.slip_sinkage_exponent.enabled:=false']
    reece = table(printed([*moon, *straight, *key]))
    bekker = table(printed([*moon, *straight]))
    assert reece['sinkage'] == pytest.approx(bekker['sinkage'], rel=1e-4)
    said = "rover.contact_law: 'wong' is unknown, nearest is 'wong_reece'"
    refused([*rows, '-p', 'rover.contact_law:=wong'], said)
