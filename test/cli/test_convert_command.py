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
ROWS = ['100.0,60,-60,1.5,-1.5,0,0,1,0,0,90,12,0.5', '100.1,30,,1.0,,0,0,1,0,0,0,,']
LOG = '\n'.join([HEADER, *ROWS])


@pytest.fixture
def example(printed):
    return printed(['convert', '--example'])


@pytest.fixture
def convert(tmp_path, example):
    """Convert a table by a map, the example's unless told; return what is in the bag."""

    def run(log=LOG, columns=example, more=()):
        text = columns if isinstance(columns, str) else yaml.safe_dump(columns)
        (tmp_path / 'map.yaml').write_text(text)
        (tmp_path / 'log.csv').write_text(log)
        table, map_file, out = (str(tmp_path / name) for name in ('log.csv', 'map.yaml', 'bag'))
        if status := main(['convert', table, '--columns', map_file, '-o', out, *more]):
            return status
        with open_bag(tmp_path / 'bag') as bag:
            return read_series(bag, {}, 'bag')

    return run


@pytest.mark.parametrize('log', [LOG, *(LOG.replace(',', d).replace('.', ',') for d in ';\t')])
def test_the_example_converts_units_and_signs(convert, log):
    """Decimal commas between semicolons or tabs are read as well."""
    told = convert(log)
    assert told.joints.names == ('front_left', 'front_right')
    assert np.allclose(told.joints.rate[0], 2.0 * math.pi)  # 60 rpm, the right one turned round
    assert told.joints.rate[1, 0] == pytest.approx(math.pi) and np.isnan(told.joints.rate[1, 1])
    assert np.allclose(told.joints.torque[0], 1.5)
    assert told.imu.force[0, 2] == pytest.approx(9.80665)
    assert told.imu.rate[0, 2] == pytest.approx(math.pi / 2.0)
    assert told.sinkage.sinkage.tolist() == [[0.012]]
    assert told.reference.velocity[:, 0].tolist() == [0.5]
    assert np.diff(told.joints.stamp).tolist() == [100_000_000]
    assert convert() == 2  # nothing is overwritten


@pytest.mark.parametrize(('unit', 'told'), [('s', 'note: wheel rates 1e+02 s apart'), ('ms', '')])
def test_a_log_in_a_wrong_unit_of_time_is_noted(convert, example, capsys, unit, told):
    rows = [f'{time},60,-60,1.5,-1.5,0,0,1,0,0,90,12,0.5' for time in (100, 200, 300)]
    convert('\n'.join([HEADER, *rows]), example.replace('unit: s}', f'unit: {unit}}}'))
    said = capsys.readouterr().out
    assert told in said and ('is the unit of the time right' in said) == bool(told)


def test_steering_angles_and_orientation_of_the_example_reach_the_measurements(
    convert, example, tmp_path
):
    columns = example.replace('\n# front_left_steering:', '\n  front_left_steering:')
    columns = columns.replace('\n#   position', '\n    position')
    columns = columns.replace('\n# orientation', '\n  orientation')
    rows = [f'{HEADER},angle_fl,qx,qy,qz,qw', f'{ROWS[0]},-30,0,0,0.6,0.8', f'{ROWS[1]},,0,0,0,1']
    told = convert('\n'.join(rows), columns)
    assert np.allclose(told.imu.orientation, [[0, 0, 0.6, 0.8], [0, 0, 0, 1]])
    rover = reader.from_parameters(
        {
            'wheels.names': ['front_left', 'front_right'],
            'wheels.y': [0.2, -0.2],
            'wheels.steering_joints': ['front_left_steering', ''],
        },
        complete=False,
    )
    with open_bag(tmp_path / 'bag') as bag:
        measured = list(MeasurementReader(bag, {}, rover).measurements())
    odometry = [m for m in measured if isinstance(m, WheelOdometry)]
    assert odometry[0].steering[0] == pytest.approx(math.radians(-30.0))
    assert math.isnan(odometry[0].steering[1])
    assert np.allclose(odometry[0].rate, 2.0 * math.pi)
    assert odometry[1].steering is None or np.isnan(odometry[1].steering).all()


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
def test_a_map_that_cannot_be_used(convert, example, capsys, old, new, words):
    assert old in example
    assert convert(columns=example.replace(old, new, 1)) == 2
    assert words in capsys.readouterr().err


@pytest.mark.parametrize(
    ('log', 'words'),
    [
        (LOG.replace('.1,30', '.1,abc'), "line 3, column rpm_fl: 'abc' is not a number"),
        (LOG.replace('100.0', '1.7e12'), 'column time: 1.7e+12 s is not within 1970 to 2038; is'),
        (LOG.replace('100.0', ''), 'column time: no time; delete the row'),
        ('', 'log.csv: empty; the first line must name the columns'),
        (LOG.replace('.', ','), 'line 2: 17 cells but 13 columns; use commas between'),
    ],
)
def test_a_table_that_cannot_be_used(convert, capsys, log, words):
    assert convert(log) == 2
    assert words in capsys.readouterr().err


@pytest.mark.parametrize('entry', ['time', 'joint_states'])
def test_a_map_without_what_is_needed_says_so(convert, example, capsys, entry):
    columns = {key: value for key, value in yaml.safe_load(example).items() if key != entry}
    assert convert(columns=columns) == 2
    assert 'time and joint_states are needed' in capsys.readouterr().err


def test_angles_of_wheels_are_no_rates(convert, capsys):
    joints = {side: {'position': {'column': side, 'unit': 'deg'}} for side in ('left', 'right')}
    columns = {'time': {'column': 'time'}, 'joint_states': joints}
    assert convert('time,left,right\n1,0,0\n2,9,9', columns) == 2
    assert 'no velocity; of angles of wheels, add columns' in capsys.readouterr().err


def test_rows_that_are_too_long_or_cut_short(convert, capsys):
    assert convert('\n'.join([HEADER, *(f'{row},,' for row in ROWS)])) != 2  # empty cells are none
    assert 'note' not in capsys.readouterr().out
    cut = ','.join(ROWS[0].replace('100.0', '100.2').split(',')[:4])
    assert convert(f'{LOG}\n{cut}', more=['--overwrite']) != 2
    said = capsys.readouterr().out
    assert '/joint_states 3, /imu/data 2' in said
    assert 'a row ends before the last column of the map (first: line 4)' in said


def test_a_held_reading_is_written_once(convert, capsys):
    """A logger at 20 Hz repeats a speed at 2 Hz; a rounded speed at 20 Hz is no held one."""
    rng = np.random.default_rng(1)
    speeds = 0.4 + 0.05 * rng.standard_normal(40)
    speeds[20:30] = 0.0  # it stands

    def read(values):
        row = '{:.2f},60,-60,1,-1,0,0,1,0,0,0,12,{}'
        rows = [row.format(100.0 + 0.05 * k, value) for k, value in enumerate(values)]
        told = convert('\n'.join([HEADER, *rows]), more=['--overwrite'])
        return told.reference, capsys.readouterr().out

    held, said = read(np.repeat(speeds.round(4), 10))
    assert held.velocity[:, 0] == pytest.approx(speeds, abs=1e-4)
    assert np.diff(held.stamp) * 1e-9 == pytest.approx(0.5, abs=1e-6)
    assert 'note: /reference_odom repeats each reading over about 10 rows' in said
    rounded, said = read((0.4 + 0.05 * rng.standard_normal(400)).round(1))
    assert len(rounded.stamp) == 400 and '/reference_odom repeats' not in said


RIM = {'column': 'v', 'unit': 'm/s', 'radius': 0.2}
METRES = {key: {'column': key[-1], 'unit': 'm'} for key in ('position.x', 'position.y')}
DEGREES = {key: {'column': key[:3], 'unit': 'deg'} for key in ('latitude', 'longitude')}


@pytest.mark.parametrize('sense', [1.0, -1.0])
@pytest.mark.parametrize('reference', [METRES, DEGREES])
def test_rim_speeds_and_positions_of_a_log(convert, reference, sense):
    speed, east = 0.5 * sense, math.radians(30.0)
    metre = 180.0 / math.pi / 6_371_000.0
    rows = ['t,v,x,y,lat,lon']
    for t in np.arange(100.0, 105.0, 0.2):
        travel, rim = speed * min(t - 100.0, 4.0), speed * (t < 104.0)  # then it stands
        x, y = travel * math.cos(east), travel * math.sin(east)
        lat, lon = 47.0 + metre * y, 8.0 + metre * x / math.cos(math.radians(47.0))
        rows.append(f'{t},{rim},{x:.9f},{y:.9f},{lat:.12f},{lon:.12f}')
    columns = {
        'time': {'column': 't'},
        'joint_states': {'left': {'velocity': RIM}},
        'reference_odom': reference,
    }
    told = convert('\n'.join(rows), columns)
    np.testing.assert_allclose(told.joints.rate[:20], speed / 0.2)
    middle = (told.reference.stamp - told.joints.stamp[0]) * 1e-9
    driven = np.clip(4.5 - middle, 0.0, 1.0)  # share of the second about it
    np.testing.assert_allclose(told.reference.velocity[:, 0], speed * driven, rtol=1e-4, atol=1e-6)
    np.testing.assert_allclose(middle, 0.5 + 0.2 * np.arange(middle.size), atol=1e-6)
    # A mean over a stop is no speed at an instant: it says so; on the way nothing is stated.
    off = np.abs(told.reference.velocity[:, 0] - speed * (middle < 4.0))
    std = np.sqrt(np.nan_to_num(told.reference.variance))
    assert (off <= 2.0 * std + 1e-4)[np.abs(middle - 4.0) > 0.01].all() and (off > 0.1).any()
    assert not std[middle < 3.4].any()


def test_positions_need_wheels_that_count_one_way(convert, tmp_path, capsys):
    columns = {
        'time': {'column': 't', 'unit': 'ms'},
        'joint_states': {side: {'velocity': {'column': side}} for side in ('left', 'right')},
        'reference_odom': METRES,
    }
    day = 1_700_000_000_000  # [ms]: stamps of a date fall on the grid of the estimates
    rows = [f'{day + 50 * i},2.51,-2.5,{0.02 * i},0' for i in range(60)]
    log = '\n'.join(['t,left,right,x,y', *rows])
    assert convert(log, columns) == 2
    assert 'sign: -1 for each that reads negative' in capsys.readouterr().err
    assert not (tmp_path / 'bag').exists()
    columns['joint_states']['right']['velocity']['sign'] = -1
    told = convert(log, columns)
    np.testing.assert_allclose(told.reference.velocity[:, 0], 0.4, rtol=1e-6)
    assert set(np.diff(told.joints.stamp)) == {50_000_000}
