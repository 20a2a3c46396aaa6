# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""``wheel-terra convert``: units, signs and gaps of a table, read back from the bag."""

import math

import numpy as np
import pytest
import yaml

from wheel_terra_estimator.bags.reader import MeasurementReader
from wheel_terra_estimator.bags.series_reader import read_series
from wheel_terra_estimator.bags.storage import open_bag
from wheel_terra_estimator.cli.main import main
from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.estimation.measurements import WheelOdometry

HEADER = 'time,rpm_fl,rpm_fr,torque_fl,torque_fr,ax,ay,az,gx,gy,gz,sinkage_fl,gps_speed'
ROWS = [
    '100.0,60,-60,1.5,-1.5,0,0,1,0,0,90,12,0.5',
    '100.1,30,,1.0,,0,0,1,0,0,0,,',
]


@pytest.fixture
def files(tmp_path, capsys):
    assert main(['convert', '--example']) == 0
    (tmp_path / 'map.yaml').write_text(capsys.readouterr().out)
    (tmp_path / 'log.csv').write_text('\n'.join([HEADER, *ROWS]))
    return tmp_path


def command(folder):
    table, columns, out = (str(folder / n) for n in ('log.csv', 'map.yaml', 'bag'))
    return ['convert', table, '--columns', columns, '-o', out]


def test_the_example_converts_units_and_signs(files):
    assert main(command(files)) == 0
    with open_bag(files / 'bag') as bag:
        told = read_series(bag, {}, 'bag')
    assert told.joints.names == ('front_left', 'front_right')
    assert np.allclose(told.joints.rate[0], 2.0 * math.pi)  # 60 rpm, the right one turned round
    assert told.joints.rate[1, 0] == pytest.approx(math.pi) and np.isnan(told.joints.rate[1, 1])
    assert np.allclose(told.joints.torque[0], 1.5)
    assert told.imu.force[0, 2] == pytest.approx(9.80665)
    assert told.imu.rate[0, 2] == pytest.approx(math.pi / 2.0)
    assert told.sinkage.sinkage.tolist() == [[0.012]]
    assert told.reference.velocity[:, 0].tolist() == [0.5]
    assert np.diff(told.joints.stamp).tolist() == [100_000_000]
    assert main(command(files)) == 2  # nothing is overwritten


def test_decimal_commas_between_commas_are_refused(files, capsys):
    rows = [line.replace('.', ',') for line in ROWS]
    (files / 'log.csv').write_text('\n'.join([HEADER, *rows]))
    assert main(command(files)) == 2
    assert 'line 2: 17 cells but 13 columns; use commas between' in capsys.readouterr().err
    (files / 'log.csv').write_text('\n'.join([HEADER, *(f'{row},,' for row in ROWS)]))
    assert main(command(files)) == 0  # empty cells beyond the last column are none


@pytest.mark.parametrize('entry', ['time', 'joint_states'])
def test_a_map_without_what_is_needed_says_so(files, capsys, entry):
    columns = yaml.safe_load((files / 'map.yaml').read_text())
    del columns[entry]
    (files / 'map.yaml').write_text(yaml.safe_dump(columns))
    assert main(command(files)) == 2
    assert 'time and joint_states are needed' in capsys.readouterr().err


def test_steering_angles_reach_the_measurements(files):
    columns = (files / 'map.yaml').read_text()
    assert '\n# front_left_steering:' in columns
    shown = columns.replace('\n# front_left_steering', '\n  front_left_steering').replace(
        '\n#   position', '\n    position'
    )
    (files / 'map.yaml').write_text(shown)
    rows = [HEADER + ',angle_fl', ROWS[0] + ',-30', ROWS[1] + ',']
    (files / 'log.csv').write_text('\n'.join(rows))
    assert main(command(files)) == 0
    rover = reader.from_parameters(
        {
            'wheels.names': ['front_left', 'front_right'],
            'wheels.y': [0.2, -0.2],
            'wheels.steering_joints': ['front_left_steering', ''],
        },
        complete=False,
    )
    with open_bag(files / 'bag') as bag:
        measured = [m for _, m in MeasurementReader(bag, {}, rover).measurements()]
    odometry = [m for m in measured if isinstance(m, WheelOdometry)]
    assert odometry[0].steering[0] == pytest.approx(math.radians(-30.0))
    assert math.isnan(odometry[0].steering[1])
    assert np.allclose(odometry[0].rate, 2.0 * math.pi)
    assert odometry[1].steering is None or np.isnan(odometry[1].steering).all()


@pytest.mark.parametrize('delimiter', [';', '\t'])
def test_decimal_commas_between_semicolons_or_tabs(files, delimiter):
    lines = [HEADER, *ROWS]
    text = '\n'.join(line.replace(',', delimiter).replace('.', ',') for line in lines)
    (files / 'log.csv').write_text(text)
    assert main(command(files)) == 0
    with open_bag(files / 'bag') as bag:
        told = read_series(bag, {}, 'bag')
    assert told.reference.velocity[:, 0].tolist() == [0.5]
    assert np.allclose(told.joints.torque[0], 1.5)
    assert np.diff(told.joints.stamp).tolist() == [100_000_000]


@pytest.mark.parametrize(
    ('old', 'new', 'words'),
    [
        ('unit: rpm,', 'unit: rpn,', "unit 'rpn' is none of rad/s, deg/s, rpm, rev/s"),
        ('column: ax', 'column: axx', "no column 'axx'"),
        ('sinkage:', 'sinkages:', "nearest: 'sinkage'"),
        (', sign: -1}', ', sign: 2}', 'sign must be 1 or -1'),
        ('imu/data:', 'imu:', "unknown entry 'imu'; nearest: 'imu/data'"),
        ('{column: ax,', '{colum: ax,', "(unknown: 'colum')"),
        ('time: {', '\ttime: {', 'line 3: found character that cannot start any token'),
    ],
)
def test_a_map_that_cannot_be_used(files, capsys, old, new, words):
    text = (files / 'map.yaml').read_text()
    assert old in text
    (files / 'map.yaml').write_text(text.replace(old, new, 1))
    assert main(command(files)) == 2
    assert words in capsys.readouterr().err


def test_a_cell_that_is_no_number(files, capsys):
    (files / 'log.csv').write_text('\n'.join([HEADER, ROWS[0], ROWS[1].replace('30', 'abc')]))
    assert main(command(files)) == 2
    assert "log.csv, line 3, column rpm_fl: 'abc' is not a number" in capsys.readouterr().err


def test_milliseconds_taken_for_seconds_are_told(files, capsys):
    (files / 'log.csv').write_text('\n'.join([HEADER, ROWS[0].replace('100.0', '1.7e12')]))
    assert main(command(files)) == 2
    assert 'column time: 1.7e+12 s is no time from 0 to 2038; is' in capsys.readouterr().err


def test_an_empty_table_is_called_empty(files, capsys):
    (files / 'log.csv').write_text('')
    assert main(command(files)) == 2
    assert 'log.csv: empty; the first line must name the columns' in capsys.readouterr().err


def test_a_row_that_was_cut_short_is_told(files, capsys):
    cut = ','.join(ROWS[0].replace('100.0', '100.2').split(',')[:4])
    (files / 'log.csv').write_text('\n'.join([HEADER, *ROWS]))
    assert main(command(files)) == 0
    assert 'note' not in capsys.readouterr().out
    (files / 'log.csv').write_text('\n'.join([HEADER, *ROWS, cut]))
    assert main([*command(files), '--overwrite']) == 0
    said = capsys.readouterr().out
    assert '/joint_states 3, /imu/data 2' in said
    assert 'a row ends before the last column of the map (first: line 4)' in said


def test_a_held_reading_is_written_once(files, capsys):
    """A logger at 20 Hz repeats a speed at 2 Hz; a rounded speed at 20 Hz is no held one."""
    rng = np.random.default_rng(1)
    speeds = 0.4 + 0.05 * rng.standard_normal(40)
    speeds[20:30] = 0.0  # it stands

    def lines(values):
        rows = [
            f'{100.0 + 0.05 * k:.2f},60,-60,1,-1,0,0,1,0,0,0,12,{value}'
            for k, value in enumerate(values)
        ]
        return '\n'.join([HEADER, *rows])

    def read(text):
        (files / 'log.csv').write_text(text)
        assert main([*command(files), '--overwrite']) == 0
        with open_bag(files / 'bag') as bag:
            return read_series(bag, {}, 'bag').reference, capsys.readouterr().out

    held, said = read(lines(np.repeat(speeds.round(4), 10)))
    assert held.velocity[:, 0] == pytest.approx(speeds, abs=1e-4)
    assert np.diff(held.stamp) * 1e-9 == pytest.approx(0.5, abs=1e-6)
    assert 'note: /reference_odom repeats each reading over about 10 rows' in said
    rounded, said = read(lines((0.4 + 0.05 * rng.standard_normal(400)).round(1)))
    assert len(rounded.stamp) == 400 and '/reference_odom repeats' not in said


def test_the_orientation_of_the_example_reaches_the_recording(files):
    columns = (files / 'map.yaml').read_text()
    (files / 'map.yaml').write_text(columns.replace('\n# orientation', '\n  orientation'))
    rows = [f'{HEADER},qx,qy,qz,qw', f'{ROWS[0]},0,0,0.6,0.8', f'{ROWS[1]},0,0,0,1']
    (files / 'log.csv').write_text('\n'.join(rows))
    assert main(command(files)) == 0
    with open_bag(files / 'bag') as bag:
        told = read_series(bag, {}, 'bag').imu.orientation
    assert np.allclose(told, [[0, 0, 0.6, 0.8], [0, 0, 0, 1]])
