# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Tables that cannot be used end in one line with file, row and cure; good ones are read."""

from __future__ import annotations

import numpy as np
import pytest

from wheel_terra_estimator.discrepancy.table import check_table, read_table
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
        ('slip,normal_load,sinkage,drawbarpull,torque', ('drawbarpull', 'drawbar_pull')),
        ('slip,load,sinkage,drawbar_pull,torque', ('normal_load',)),
        ('slip,normal_load,sinkage_mm,drawbar_pull,torque', ('sinkage_mm', "'sinkage' [m]")),
        ('Slip,normal_load,sinkage,drawbar_pull,torque', ('Slip', "'slip'")),
        ('slip,normal_load,a,b,c', ('none of sinkage',)),
        ('0.1,80,0.01,3,4', ('no header',)),
        ('slip,slip,sinkage,drawbar_pull,torque', ('twice',)),
    ],
)
def test_columns_misspelt_or_missing(tmp_path, header, parts):
    with pytest.raises(UserError) as caught:
        read_table(write(tmp_path, header + '\n' + '\n'.join(lines())))
    message = str(caught.value)
    assert 'bin.csv' in message
    assert '\n' not in message
    assert all(part in message for part in parts), message


def test_column_names_alone_are_no_table(tmp_path):
    with pytest.raises(UserError, match=r'bin.csv, line 2: no rows below'):
        read_table(write(tmp_path, HEADER + '\n'))


@pytest.mark.parametrize(
    ('cell', 'parts'),
    [
        ('abc', ('line 5', 'torque', 'abc', 'not a number')),
        ('inf', ('line 5', 'torque', 'not finite')),
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
        ({'wheel_radius': np.full(8, 157.0)}, ('wheel_radius', 'millimetres')),
        ({'normal_load': np.full(8, -80.0)}, ('normal_load', 'not positive')),
        ({'normal_load': np.full(8, 0.08)}, ('normal_load', 'kN')),
        ({'drawbar_pull': np.linspace(1, 900, 8)}, ('drawbar_pull', 'three times')),
        ({'torque_std': np.zeros(8)}, ('torque_std', 'not positive')),
        ({'pass_number': np.zeros(8)}, ('pass_number', 'outside')),
        ({'slip': np.full(8, 0.2) + 1e-3 * np.arange(8)}, ('slip only from', 'add rows with slip')),
        ({'torque': None, 'sinkage': None, 'drawbar_pull': None}, ('none of the columns',)),
        ({'slip': np.r_[np.nan, np.linspace(0.1, 0.8, 7)]}, ('slip', 'missing')),
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
