# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Titles of columns: read as what they say, asked for where that is open, never lost."""

import json
import math
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from test_table import HEADER, lines, rows, write

from wheel_terra_estimator.api import diagnose
from wheel_terra_estimator.cli.main import main
from wheel_terra_estimator.discrepancy.tables import header
from wheel_terra_estimator.discrepancy.tables.header import Choice, meaning_of
from wheel_terra_estimator.discrepancy.tables.parsing import read_table, table_of
from wheel_terra_estimator.discrepancy.tables.steady_table import COLUMNS, QUANTITIES
from wheel_terra_estimator.errors import UserError

BASE = {name: rows()[name] for name in ('slip', 'normal_load')}
READ = {
    'Slip [%]': ('slip', 0.01),
    'slip_percent': ('slip', 0.01),
    'Slip ratio (-)': ('slip', 1.0),
    's [-]': ('slip', 1.0),
    'Vertical_Load_N': ('normal_load', 1.0),
    'vertical load [kN]': ('normal_load', 1000.0),
    'NormalLoad': ('normal_load', 1.0),
    'Sinkage (mm)': ('sinkage', 1e-3),
    'sinkage_mm': ('sinkage', 1e-3),
    'sinkage / mm': ('sinkage', 1e-3),
    'sinkage in cm': ('sinkage', 1e-2),
    'Sinkage, mm': ('sinkage', 1e-3),
    'sinkage_std_mm': ('sinkage_std', 1e-3),
    'DP [N]': ('drawbar_pull', 1.0),
    'DBP [kN]': ('drawbar_pull', 1000.0),
    'pull [kgf]': ('drawbar_pull', 9.80665),
    'load (gf)': ('normal_load', 0.00980665),
    'torque / kgf·cm': ('torque', 0.0980665),
    'pull': ('drawbar_pull', 1.0),
    'pull_sd [N]': ('drawbar_pull_std', 1.0),
    'sigma_pull': ('drawbar_pull_std', 1.0),
    'T [N m]': ('torque', 1.0),
    'T (N·mm)': ('torque', 1e-3),
    'T (N\u22c5mm)': ('torque', 1e-3),
    'Torque (N-m)': ('torque', 1.0),
    'Torque [N-mm]': ('torque', 1e-3),
    'Drive torque [ft lbf]': ('torque', 1.3558179),
    'Slope [°]': ('slope', math.pi / 180),
    'r [mm]': ('wheel_radius', 1e-3),
    'rpm': ('angular_velocity', math.pi / 30),
    'omega [rad/s]': ('angular_velocity', 1.0),
    'angular_velocity_rad_s': ('angular_velocity', 1.0),
    'pass no.': ('pass_number', 1.0),
    'meas_torque_nm': ('torque', 1.0),
    'Mean sinkage [mm]': ('sinkage', 1e-3),
}
ASKED = (
    'DP', 'DBP', 'Fx [N]', 'Fx', 'depth', 'depth [mm]', 'z [mm]', 'z', 'T', 'M', 'Fz', 'W [N]', 's',
    'i', 'force [N]', 'traction', 'radius [m]', 'alpha [deg]', 'current [A]', 'H', 'column 7',
    'DP [-]',
)  # fmt: skip
HARMLESS = ('time [s]', 't [s]', 'T [°C]', 'run', 'Unnamed: 0', '', 'temperature', 'id')


@pytest.mark.parametrize(('title', 'name', 'factor'), [(k, *v) for k, v in READ.items()])
def test_read(title, name, factor):
    """Values in the stated unit come back in SI, with a note where the title says it otherwise."""
    wanted = 0.1 + 0.01 * np.arange(8)
    if name == 'pass_number':
        wanted = np.arange(8) % 3 + 1.0
    if name == 'slip':
        wanted = rows()['slip']
    if name == 'normal_load':
        wanted = 60.0 + np.arange(8)
    data = {
        'sinkage': rows()['sinkage'],
        'torque': rows()['torque'],
        'pull': rows()['drawbar_pull'],
    }
    data = {k: v for k, v in data.items() if meaning_of(k).name != name}
    data |= {k: v for k, v in BASE.items() if k != name}
    table = table_of(data | {title: wanted / factor}, 'data')
    quantity = name.removesuffix('_std')
    if name in QUANTITIES:
        found = table.measured[:, QUANTITIES.index(name)]
    elif quantity in QUANTITIES and name != quantity:
        found = table.stated_std[:, QUANTITIES.index(quantity)]
    else:
        found = table.columns[name]
    assert found == pytest.approx(wanted, rel=1e-6)
    assert any(f'{title!r} as {name}' in note for note in table.notes)


@pytest.mark.parametrize('title', ASKED)
def test_asked(title):
    """It is named, the option is ready to copy, and either answer is accepted."""
    numbers = 3.0 + rows()['slip'] ** 2
    data = BASE | {'sinkage': rows()['sinkage'], title: numbers}
    with pytest.raises(UserError, match=re.escape(f'{title!r}')) as caught:
        table_of(data, 'data')
    assert '--columns' in str(caught.value) and '--ignore-columns' in str(caught.value)
    for ignored in (title, f'a,{title}, b', 'all'):
        table = table_of(data, 'data', Choice.of((), ignored))
        assert table.quantities == ('sinkage',)
    chosen = Choice.of({'torque': {'column': title, 'unit': 'N m', 'sign': -1}})
    table = table_of(data | {title: -numbers}, 'data', chosen)
    assert table.measured[:, 2] == pytest.approx(numbers)


@pytest.mark.parametrize('title', ['DP/W [-]', 'pull coefficient', 'T/(W r)', 'drawbar_pull [-]'])
def test_a_share_of_the_load_is_to_be_written_as_a_force(title):
    data = BASE | {'sinkage': rows()['sinkage'], title: rows()['slip']}
    with pytest.raises(UserError, match='times normal_load'):
        table_of(data, 'data')


@pytest.mark.parametrize('title', HARMLESS)
def test_when_and_which_is_no_measurement(title):
    table = table_of(BASE | {'torque': rows()['torque'], title: np.arange(8.0)}, 'data')
    assert table.quantities == ('torque',)


UNITS = ('', *(unit for units in header.UNITS.values() for unit in units), 'furlong', 'A', 'kg')
TITLES = st.one_of(
    st.sampled_from([*COLUMNS, *header._SURE, *header._SHORT, *header._OPEN]),
    st.text(
        'aTZé0·² []()/_,%°-\n\u22c5', max_size=12
    ),  # all of Unicode costs a second to draw from
)


@given(
    TITLES,
    st.sampled_from(UNITS),
    st.sampled_from(['{} [{}]', '{} ({})', '{}_{}', '{} / {}', '{} in {}', '{}, {}', '{}']),
    st.sampled_from([str, str.upper, str.title]),
)
def test_no_column_of_numbers_is_lost_without_a_word(word, unit, form, case):
    title = case(word).replace('{', '').strip()
    title = form.format(title, unit).strip() if unit else title
    numbers = 0.3 + 0.1 * rows()['slip'] ** 2
    data = BASE | {'torque': rows()['torque'], title: numbers}
    try:
        table = table_of(data, 'data')
    except UserError as error:
        assert repr(title)[1:-1] in str(error) or title.strip() in COLUMNS or 'column' in str(error)
        assert '\n' not in str(error)
        return
    plain = title.lower()
    assert (
        title in BASE
        or any(repr(title) in note or f'columns not used: {title}' in note for note in table.notes)
        or plain in COLUMNS
        or not title
    )
    if any('columns not used' in note for note in table.notes):
        assert header._harmless(title)


def test_a_frame_is_read_as_the_file_is(tmp_path, unproposed):
    pandas = pytest.importorskip('pandas')
    table = rows()
    titles = ('Slip [%]', 'Vertical load (kN)', 'Sinkage [mm]', 'DP [N]', 'T [N m]')
    factors = (100.0, 1e-3, 1e3, 1.0, 1.0)
    body = [
        ';'.join(
            f'{factor * table[key][i]:.6g}'.replace('.', ',')
            for key, factor in zip(HEADER.split(','), factors, strict=True)
        )
        for i in range(8)
    ]
    body[2] = body[2].rsplit(';', 1)[0] + ';'  # a gap
    path = write(tmp_path, ';'.join(titles) + '\n' + '\n'.join(body) + '\n')
    file = read_table(path)
    texts = table_of(pandas.read_csv(path, sep=';'), 'data')
    numbers = table_of(pandas.read_csv(path, sep=';', decimal=','), 'data')
    for frame in (texts, numbers):
        np.testing.assert_allclose(frame.measured, file.measured, rtol=1e-12)
        np.testing.assert_allclose(frame.columns['slip'], file.columns['slip'], rtol=1e-12)
        assert frame.notes == file.notes[1:]
    found = diagnose(pandas.read_csv(path, sep=';'), ['hit_wh3', 'hit_fit'], effects=['cohesion'])
    np.testing.assert_allclose(found.table.measured, file.measured, rtol=1e-12)


def test_a_map_of_columns(tmp_path, refused, unproposed):
    text = HEADER.replace('sinkage', 'z [mm]').replace('torque', 'M').replace('drawbar_pull', 'Fx')
    table = rows()
    body = [
        f'{table["slip"][i]:.9g},{table["normal_load"][i]:.9g},{-1e3 * table["sinkage"][i]:.9g},'
        f'{-table["drawbar_pull"][i]:.9g},{1e3 * table["torque"][i]:.9g}'
        for i in range(8)
    ]
    path = write(tmp_path, text + '\n' + '\n'.join(body) + '\n')
    file = tmp_path / 'map.yaml'
    file.write_text('sinkage: -z [mm]\ndrawbar_pull: {column: Fx, sign: -1}\n')
    plain = check(table)
    for columns in (
        [str(file), 'torque=M [N mm]'],
        ['sinkage=-z [mm]', 'drawbar_pull=-Fx', 'torque=M[N mm]'],
        {'sinkage': '-z [mm]', 'drawbar_pull': '-Fx', 'torque': {'column': 'M', 'unit': 'N mm'}},
    ):
        found = read_table(path, Choice.of(columns))
        np.testing.assert_allclose(found.measured, plain.measured, rtol=1e-7)
    command = ['diagnose', str(path), '--config', 'hit_wh3', '--config', 'hit_fit', '--no-pictures']
    output = ['-o', str(tmp_path / 'out')]
    refused(
        [*command, *output], "'z [mm]' (sinkage [m], the depth of the rim", "'Fx' (drawbar_pull"
    )
    options = ['--columns', str(file), '--columns', 'torque=M [N mm]']
    assert main([*command, *output, *options, '--only', 'cohesion']) == 0
    report = json.loads((tmp_path / 'out' / 'report.json').read_text())
    assert {candidate['name'] for candidate in report['candidates']} == {'cohesion', 'nothing'}


def check(table):
    return table_of(table, 'data')


@pytest.mark.parametrize(
    ('columns', 'words'),
    [
        (['sinkge=z'], "no column 'sinkge' is read; nearest: 'sinkage'"),
        (['sinkage=zz'], "no column 'zz' for sinkage; nearest: 'z'"),
        (['sinkage=z [furlong]'], 'the unit of .z. is not known'),
        ([{'sinkage': {'column': 'z', 'sign': 2}}], 'sign must be 1 or -1'),
        ([{'sinkage': ['z']}], 'give column, unit'),
        (['no_such_file.yaml'], 'no_such_file.yaml'),
    ],
)
def test_a_map_that_cannot_be_used(columns, words):
    with pytest.raises(UserError, match=words):
        choice = Choice.of(columns if isinstance(columns[0], str) else columns[0])
        table_of(BASE | {'z': rows()['sinkage']}, 'data', choice)


def test_the_user_names_a_column_that_another_one_has_the_name_of():
    data = rows() | {'corrected pull': rows()['drawbar_pull'] + 1.0}
    with pytest.raises(UserError, match="'drawbar_pull'"):
        table_of(data, 'data', Choice.of({'drawbar_pull': 'corrected pull'}))
    chosen = Choice.of({'drawbar_pull': 'corrected pull'}, ['drawbar_pull'])
    assert table_of(data, 'data', chosen).measured[:, 1] == pytest.approx(
        rows()['drawbar_pull'] + 1.0
    )


def test_a_large_table_is_read(tmp_path):
    body = '\n'.join(lines())
    text = HEADER + ',note\n' + ''.join(f'{line},{"x" * 5000}\n' for line in body.split()) * 460
    path = write(tmp_path, text)
    assert path.stat().st_size > 17 * 2**20
    assert len(read_table(path)) == 8
