# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Tables that cannot be used end in one line with file, row and cure; good ones are read."""

from types import SimpleNamespace

import numpy as np
import pytest

from wheel_terra_estimator.discrepancy.tables.averaging import averaged
from wheel_terra_estimator.discrepancy.tables.checks import check_table, check_wheel_of_model
from wheel_terra_estimator.discrepancy.tables.header import Choice
from wheel_terra_estimator.discrepancy.tables.parsing import read_table
from wheel_terra_estimator.errors import UserError

HEADER = 'slip,normal_load,sinkage,drawbar_pull,torque'


def rows(**changes):
    slip = np.linspace(0.05, 0.8, 8)
    table = {
        'slip': slip,
        'normal_load': np.full(8, 80.0),
        'sinkage': 0.01 + 0.01 * slip,
        'drawbar_pull': 30.0 * slip,
        'torque': 2.0 + 4.0 * slip,
    }
    table.update(changes)
    return {key: value for key, value in table.items() if value is not None}


def write(tmp_path, text):
    path = tmp_path / 'bin.csv'
    path.write_text(text, encoding='utf-8')
    return path


def lines(count=8):
    table = rows()
    return [','.join(f'{table[key][i]:.6g}' for key in HEADER.split(',')) for i in range(count)]


def test_reads_numbers_gaps_and_extra_columns(tmp_path):
    body = lines()
    body[2] = '0.3,80,,9.1,nan'
    text = 'note,' + HEADER + '\n' + '\n'.join(f'a,{line}' for line in body) + '\n\n'
    table = read_table(write(tmp_path, '\ufeff' + text))
    assert len(table) == 8
    assert np.isnan(table.measured[2, [0, 2]]).all()
    assert table.measured[2, 1] == 9.1
    assert table.lines[2] == 4
    assert table.quantities == ('sinkage', 'drawbar_pull', 'torque')
    assert table.varying() == ('slip',)
    assert any('note' in note for note in table.notes)
    assert any('normal_load' in note for note in table.notes), 'constant columns are said'


@pytest.mark.parametrize(
    ('header', 'parts'),
    [
        ('slip,normal_load,sinkage,drawbar_pul,torque', ('drawbar_pul', 'drawbar_pull?')),
        ('slip,normal_load,a,b,c', ('none of sinkage',)),
        ('slip,normal_load,one,two,three', ('none of sinkage', 'add it, or', 'NAME=TITLE')),
        ('0.1,80,0.01,3,4', ('no header',)),
        ('slip,slip,sinkage,drawbar_pull,torque', ('twice',)),
        ('slip,Fz,sinkage,drawbar_pull,torque', ("no column 'normal_load'", "'Fz' (normal_load")),
        (
            'slip,normal_load,z,DP,T',
            ("'z' (sinkage [m], the depth", "'DP' (drawbar", "'T' (torque"),
        ),
        (HEADER.replace(',', ';'), ('line 2', "separated by ';', the cells are not")),
        (HEADER.replace(',', '|'), ('line 1', "separated by '|'", 'commas')),
        ('Rig test 12\n' + HEADER, ('line 1', 'stand in line 2', 'delete')),
        (HEADER + '\n-,Newton,low,a,b', ('line 2', 'no numbers', 'delete')),
        ('PK\x03\x04', ('not text', 'CSV')),
    ],
)
def test_columns_misspelt_or_missing(tmp_path, header, parts):
    with pytest.raises(UserError) as caught:
        read_table(write(tmp_path, header + '\n' + '\n'.join(lines())))
    message = str(caught.value)
    assert 'bin.csv' in message
    assert '\n' not in message
    assert all(part in message for part in parts), message


@pytest.mark.parametrize('encoding', ['utf-8', 'utf-16-le', 'utf-16-be'])
def test_an_export_of_a_laboratory_is_read(tmp_path, encoding):
    """Comments above the titles, a row of units below; of comments alone the last is titles."""
    plain, body = read_table(write(tmp_path, '\n'.join([HEADER, *lines()]))), '\n'.join(lines())
    for above, line, factor in (
        (f'# wheel of 8" width, bed 3\n\n{HEADER}\n-,N,[mm],N,Nm', 5, 1e-3),
        (f'# from numpy, savetxt\n# {HEADER}', 3, 1.0),
        (f'# {HEADER}\n-,N,mm,N,Nm', 3, 1e-3),
        (f'# {HEADER}\n# -,N,mm,N,Nm', 3, 1e-3),
    ):
        path = tmp_path / 'export.csv'
        path.write_bytes(f'\ufeff{above}\n{body}\n'.encode(encoding))
        found = read_table(path)
        np.testing.assert_allclose(found.measured, plain.measured * [factor, 1, 1, 1])
        assert found.lines[0] == line
    with pytest.raises(UserError, match="line 2: 'm' below 'sinkage_mm'; correct one"):
        titles = HEADER.replace('sinkage', 'sinkage_mm')
        read_table(write(tmp_path, '\n'.join([titles, '-,N,m,N,Nm', *lines()])))
    path.write_bytes(b'\xff\xfe\x00\xd8a\x00')
    with pytest.raises(UserError, match=r'not a UTF-16 text; .*: iconv -c -f utf-16'):
        read_table(path)


def test_a_row_of_units_has_nothing_else(tmp_path):
    """Symbols that spell a unit, or a remark of one letter, are none."""
    text = '\n'.join([HEADER, 's,Fz,z,Fx,T', '-,N,m,N,Nm', *lines()])
    with pytest.raises(UserError, match='line 2: no numbers below the column names; delete'):
        read_table(write(tmp_path, text))
    text = '\n'.join([f'{HEADER},note', ',,,,,g', *(f'{line},a' for line in lines())])
    with pytest.raises(UserError, match='line 2, column slip: the number is missing'):
        read_table(write(tmp_path, text))


def test_capitals_units_and_semicolons_are_read_with_a_note(tmp_path):
    plain = read_table(write(tmp_path, HEADER + '\n' + '\n'.join(lines())))
    table = rows()
    header = 'Slip [%];Normal_Load (N);sinkage [mm];Drawbar Pull;torque [N m]'
    body = [
        ';'.join(
            f'{factor * table[key][i]:.6g}'.replace('.', ',')
            for key, factor in zip(HEADER.split(','), (100, 1, 1000, 1, 1), strict=True)
        )
        for i in range(8)
    ]
    found = read_table(write(tmp_path, header + '\n' + '\n'.join(body)))
    np.testing.assert_allclose(found.measured, plain.measured, rtol=1e-5)
    np.testing.assert_allclose(found.columns['slip'], plain.columns['slip'], rtol=1e-5)
    assert any("';'" in note for note in found.notes)
    stated = read_table(write(tmp_path, 'sep=;\n' + header + '\n' + '\n'.join(body)))
    np.testing.assert_array_equal(stated.measured, found.measured)
    assert stated.lines[0] == found.lines[0] + 1
    assert any("'sinkage [mm]' as sinkage (times 0.001)" in note for note in found.notes)


def test_a_table_laid_on_its_side_is_refused_at_once(tmp_path):
    path = tmp_path / 't.csv'
    path.write_text(','.join(f'c{i}' for i in range(200_000)) + '\n1\n')
    with pytest.raises(UserError, match='200000 columns; a table of wheel tests') as caught:
        read_table(path)
    assert len(str(caught.value)) < 300


def test_column_names_alone_are_no_table(tmp_path):
    with pytest.raises(UserError, match=r'bin.csv, line 2: no rows below'):
        read_table(write(tmp_path, HEADER + '\n'))


@pytest.mark.parametrize(
    ('cell', 'parts'),
    [
        ('abc', ('line 5', 'torque', 'abc', 'not a number')),
        ('inf', ('line 5', 'torque', 'not finite')),
        ('"1,25"', ('line 5', 'torque', 'point as decimal')),
        ('"1,234.5"', ('line 5', 'thousands separators')),
        ('12 %', ('line 5', 'without a percent sign')),
        ('-1.8 N', ('line 5', 'into the title')),
        ('00:12.5', ('line 5', 'in s, ms')),
        ('\u22124.1', ('line 5', 'plain minus')),
        ('1,2', ('line 5', '6 cells', 'point as decimal')),
    ],
)
def test_cells_that_are_no_numbers(tmp_path, cell, parts):
    body = lines()
    body[3] = body[3].rsplit(',', 1)[0] + ',' + cell
    with pytest.raises(UserError) as caught:
        read_table(write(tmp_path, HEADER + '\n' + '\n'.join(body)))
    assert all(part in str(caught.value) for part in parts), caught.value


@pytest.mark.parametrize(
    ('changes', 'parts'),
    [
        ({'slip': np.linspace(5, 80, 8)}, ('slip', 'percent', '100')),
        ({'slip': np.linspace(0.1, 1.2, 8)}, ('slip', 'outside -1..1')),
        ({'slope': np.full(8, 15.0)}, ('slope', 'degrees')),
        ({'sinkage': np.linspace(5, 20, 8)}, ('sinkage', 'millimetres')),
        ({'sinkage': np.r_[np.full(7, 0.01), -999.0]}, ('line 9', 'missing-value code')),
        ({'wheel_radius': np.full(8, 157.0)}, ('wheel_radius', 'millimetres')),
        ({'normal_load': np.full(8, -80.0)}, ('normal_load', 'not positive')),
        ({'normal_load': np.full(8, 0.08)}, ('normal_load', 'kN')),
        ({'drawbar_pull': np.linspace(1, 900, 8)}, ('drawbar_pull', 'three times')),
        ({'normal_load': np.r_[1e308, np.full(7, 80.0)]}, ('normal_load', 'more than any wheel')),
        ({'torque_std': np.zeros(8)}, ('torque_std', 'not positive')),
        ({'torque_std': np.full(8, 1e-308)}, ('torque_std', 'next to nothing')),
        ({'pass_number': np.zeros(8)}, ('pass_number', 'outside')),
        ({'slip': np.full(8, 0.2) + 1e-3 * np.arange(8)}, ('slip only from', 'add rows with slip')),
        ({'torque': None, 'sinkage': None, 'drawbar_pull': None}, ('none of the columns',)),
        (
            {'wheel_radius': np.full(8, 0.1), 'lug_height': np.full(8, 0.2)},
            ('lug_height', 'more than the wheel radius'),
        ),
        ({'sinkage_std': np.full(8, 0.5)}, ('sinkage_std', 'ten times', 'both in m')),
        ({'torque': -2.0 - 4.0 * np.linspace(0.05, 0.8, 8)}, ('line 4', 'torque', 'wrong sign')),
        ({'slip': -np.linspace(0.05, 0.8, 8), 'drawbar_pull': np.full(8, 9.0)}, ('wrong sign',)),
        ({'angular_velocity': np.full(8, -0.3)}, ('torque', 'wrong sign', 'reverse')),
        ({'leaving_angle': np.full(8, 0.2)}, ('leaving_angle', 'behind the hub is negative')),
        ({'sinkage': -np.linspace(0.01, 0.02, 8)}, ('sinkage', 'negative', 'by -1')),
        (
            {'slip': np.full(8, 0.2), 'normal_load': np.linspace(40, 90, 8)},
            ('slip is 0.2 in every row', 'add rows at other slips'),
        ),
        ({'sinkage': np.full(8, 0.004)}, ('sinkage', 'all 8 rows', 'leave the column out')),
        ({'slip': np.r_[np.nan, np.linspace(0.1, 0.8, 7)]}, ('slip', 'the number is missing')),
    ],
)
def test_units_and_ranges(changes, parts):
    with pytest.raises(UserError) as caught:
        check_table('x.csv', rows(**changes))
    assert all(part in str(caught.value) for part in parts), caught.value


def test_row_without_measurement_and_too_few_rows():
    table = rows()
    for key in ('sinkage', 'drawbar_pull', 'torque'):
        table[key] = table[key].copy()
        table[key][3] = np.nan
    with pytest.raises(UserError, match=r'line 5.*delete the row'):
        check_table('x.csv', table)
    with pytest.raises(UserError, match='4 different rows'):
        check_table('x.csv', {key: value[:4] for key, value in rows().items()})


def test_copies_count_once_but_repeats_stay():
    table = {key: np.r_[value, value[:2]] for key, value in rows().items()}
    table['torque'][-1] += 0.1
    checked = check_table('x.csv', table)
    assert len(checked) == 9
    assert any('copies' in note for note in checked.notes)


def test_readings_at_the_end_of_a_range_or_held_are_left_out_but_not_coarse_ones():
    slip = np.tile(np.linspace(0.05, 0.7, 10), 2)
    load = np.repeat([60.0, 90.0], 10)
    noise = np.random.default_rng(4).normal(0.0, 0.3, 20)
    pull = np.round(load * 0.4 * (1.0 - np.exp(-6.0 * slip)) + noise, 2)
    columns = {'slip': slip, 'normal_load': load, 'torque': 0.2 * pull}
    clipped = check_table('x.csv', {**columns, 'drawbar_pull': np.minimum(pull, 24.0)})
    left = np.isfinite(clipped.measured[:, 1])
    np.testing.assert_array_equal(left, pull < 24.0)
    assert any('drawbar_pull is exactly 24 N in' in note for note in clipped.notes)
    held = pull.copy()
    held[3:8] = pull[3]
    assert np.isnan(check_table('x.csv', {**columns, 'drawbar_pull': held}).measured[3:8, 1]).all()
    for fine in (pull, np.round(pull), np.round(pull, 1)):
        assert np.isfinite(
            check_table('x.csv', {**columns, 'drawbar_pull': fine}).measured[:, 1]
        ).all()


def test_readings_that_look_odd_are_said_and_used():
    still = check_table('x.csv', rows(sinkage=np.full(8, 0.004), sinkage_std=np.full(8, 1e-3)))
    assert any('0.004 m in all 8 rows' in note for note in still.notes)
    off = check_table('x.csv', rows(drawbar_pull=np.where(rows()['slip'] > 0.4, 0.0, 3.0)))
    assert any('drawbar_pull is exactly 0 in 4 rows' in note for note in off.notes)
    narrow = rows(slip=np.linspace(0.2, 0.25, 8), normal_load=np.linspace(40, 90, 8))
    assert any('slip only from 0.2' in note for note in check_table('x.csv', narrow).notes)
    # A skidding wheel may take torque (friction before it) as long as it does not pull.
    skid = rows(slip=-np.linspace(0.1, 0.8, 8), drawbar_pull=np.linspace(-5, -30, 8))
    assert len(check_table('x.csv', skid)) == 8


def test_wheel_of_the_table_against_that_of_the_model_file():
    table = check_table('x.csv', rows(wheel_radius=np.full(8, 0.25)))

    def of_model(stated, radius, width):
        return SimpleNamespace(wheels=SimpleNamespace(radius=radius, width=width), stated=stated)

    check_wheel_of_model(table, of_model((), (0.125,), ()))
    both = ('wheels.radius', 'wheels.width')
    check_wheel_of_model(table, of_model(both, (0.11, 0.2), (0.1,)))
    with pytest.raises(UserError, match=r'line 2, column wheel_radius: 0.25 m.*wheels.radius'):
        check_wheel_of_model(table, of_model(both, (0.125,), ()))


def test_many_rows_are_averaged_over_neighbouring_inputs():
    rng = np.random.default_rng(3)
    count = 3000
    slip, load = rng.uniform(0.02, 0.8, count), rng.choice([50.0, 80.0, 120.0], count)
    truth = 3.0 * slip + 0.02 * load
    torque = truth + rng.normal(0.0, 0.1, count)
    torque[::97] += 30.0
    sinkage = np.where(rng.random(count) < 0.1, np.nan, 1e-4 * load * (1 + slip))
    many = {
        'slip': slip,
        'normal_load': load,
        'sinkage': sinkage,
        'torque': torque,
        'torque_std': np.full(count, 0.1),
    }
    table = check_table('x.csv', many)
    assert 200 <= len(table) <= 240
    assert any('3000 rows were averaged' in note for note in table.notes)
    assert set(np.unique(table.columns['normal_load'])) == {50.0, 80.0, 120.0}, 'loads not mixed'
    expected = 3.0 * table.columns['slip'] + 0.02 * table.columns['normal_load']
    whitened = (table.measured[:, 2] - expected) / table.stated_std[:, 2]
    # Means scatter as their deviations say, outliers and all.
    assert 0.85 < np.std(whitened) < 1.2
    bent = table.measured[:, 0] / (1e-4 * table.columns['normal_load'])
    full = np.isfinite(table.measured[:, 0])
    assert np.allclose(bent[full], 1 + table.columns['slip'][full], atol=1e-9)
    assert len(averaged(table.select(np.arange(10)), 4)) == 4


def test_repeated_rows_are_means_without_what_is_eight_robust_deviations_off():
    """Readings of 3 Nm, one off, at three slips: 1.4826 is the deviation of their spread."""
    common = [-1.0] * 15 + [0.0] + [1.0] * 14
    readings = np.concatenate([[*common, 11.0], [*common, 13.0], [*common, 1.0]])
    slip = np.repeat([0.1, 0.2, 0.7], 31)
    many = {'slip': slip, 'normal_load': np.full(93, 80.0), 'torque': 3.0 + readings}
    many['sinkage'] = 0.01 + 1e-6 * np.arange(93)  # no row is a copy of another
    table = averaged(check_table('x.csv', many), 10)
    assert table.columns['slip'] == pytest.approx([0.1, 0.2, 0.7])
    assert table.measured[:, 2] == pytest.approx([3.0 + 10.0 / 31.0, 3.0 - 1.0 / 30.0, 3.0])


@pytest.mark.parametrize(
    ('cells', 'asked'),
    [
        ('3 4 7 9 2 bad bad bad', True),
        ('3 4 7 bad bad bad bad bad', False),
        ('3 4 7 9 bad bad bad bad', False),
        ('0 1 2 3 4 5 6 7', False),  # counts the rows
        ('1 2 3 4 5 6 7 8', False),
        ('2 3 4 5 6 7 8 9', True),
    ],
)
def test_an_unknown_column_is_asked_for_where_most_of_it_are_numbers(tmp_path, cells, asked):
    pairs = zip(lines(), cells.split(), strict=True)
    path = write(tmp_path, f'{HEADER},gauge\n' + '\n'.join(map(','.join, pairs)))
    if asked:
        with pytest.raises(UserError, match="not used: 'gauge';"):
            read_table(path)
    else:
        assert len(read_table(path)) == 8


def test_a_unit_behind_an_unknown_name_makes_it_no_column(tmp_path):
    text = HEADER.replace('sinkage', 'sinkage_mm') + ',current_n\n'
    text += '\n'.join(f'{line},{20 + 0.1 * i}' for i, line in enumerate(lines())) + '\n'
    with pytest.raises(UserError, match="not used: 'current_n';"):
        read_table(write(tmp_path, text))
    table = read_table(write(tmp_path, text), Choice(ignored=('current_n',)))
    assert table.measured[:, 0] == pytest.approx(rows()['sinkage'] * 1e-3, rel=1e-5)
