# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Files and overrides become a checked configuration, or one line that says what is wrong."""

import copy
import math
import pickle
import warnings
from array import array
from pathlib import Path

import document_parameters as documentation
import numpy as np
import pytest
from test_ros_yaml import read_by_ros

from wheel_terra_estimator.configuration import parameters, reader, shipped
from wheel_terra_estimator.configuration.parameters import DECLARED, RETIRED, by_spelling, declared
from wheel_terra_estimator.errors import ConfigurationWarning, UserError
from wheel_terra_estimator.terramechanics import effects
from wheel_terra_estimator.terramechanics.contact_law import LAWS
from wheel_terra_estimator.terramechanics.effects import catalogue

ROVER = {
    'wheels.names': ['left', 'right'],
    'wheels.radius': [0.1, 0.12],
    'wheels.width': [0.1, 0.1],
    'wheels.y': [0.3, -0.3],
    'rover.mass': 10,
}


def complaint(call, *arguments, **options):
    with pytest.raises(UserError) as caught:
        call(*arguments, **options)
    message = str(caught.value)
    assert '\n' not in message
    return message


def made(changes):
    return reader.from_parameters({**ROVER, **changes})


def parameter_file(tmp_path, name, body):
    file = tmp_path / name
    lines = [f'    {line}' for line in body.splitlines()]
    file.write_text('\n'.join(['/**:', '  ros__parameters:', *lines]) + '\n')
    return file


# -- The table ------------------------------------------------------------------------------------


def test_spellings_are_unique():
    table = declared()
    assert len(by_spelling(table)) == len(table) + sum(len(p.aliases) for p in table.values())
    stated = Path(parameters.__file__).with_name('parameters.yaml').read_text()
    assert len({p.key for p in DECLARED}) == stated.count('{type: '), 'a key stands twice'
    assert not set(RETIRED) & set(by_spelling(table))


def test_a_retired_key_is_left_out_and_said(tmp_path):
    with_it = parameter_file(tmp_path, 'old.yaml', 'rover.name: mine\nfilter.demand_walk: 0.02')
    with pytest.warns(ConfigurationWarning) as said:
        read = reader.load([with_it], complete=False)
    assert [str(warning.message) for warning in said] == [
        f'{with_it}: filter.demand_walk no longer exists and is left out: '
        'filter.ratio_walk holds on every ground; delete this line'
    ]
    assert read.rover.name == 'mine'
    assert 'filter.demand_walk' not in read.flat()


def test_contact_laws_are_those_of_the_physics():
    key = 'rover.contact_law'
    assert tuple(next(p for p in DECLARED if p.key == key).choices) == LAWS
    law, effect = f'{key}:=resistive_force', 'effects.stress_peak_shift.enabled:=true'
    with pytest.warns(ConfigurationWarning, match=f'{key}: .* left out: stress_peak_shift'):
        reader.load([], [law, effect], complete=False)
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        reader.load([], [law], complete=False)
        reader.load([], [f'{key}:=wong_reece', effect], complete=False)


def test_defaults_keep_their_own_rules():
    wheels = 3
    for parameter in (p for p in DECLARED if not p.required):
        default = [parameter.default] * wheels if parameter.size == 'wheels' else parameter.default
        stated = {parameter.key: (default, 'default')}
        assert reader.checked_value(parameter, stated, wheels) == default, parameter.key
        assert parameter.meaning and not parameter.meaning.endswith('.'), parameter.key


def test_degrees_stand_only_behind_deg():
    for key, parameter in declared().items():
        assert (parameter.unit == 'deg') == key.endswith('_deg'), key


# -- Values ---------------------------------------------------------------------------------------


def test_units_inside_are_si_and_radians():
    c = made({'soil.friction_angle_deg': 30, 'sensors.imu_mounting_roll_deg': 180.0})
    assert c.soil.friction_angle == pytest.approx(math.pi / 6)
    assert c.sensors.imu_mounting_roll == pytest.approx(math.pi)
    assert c.rover.mass == 10.0 and isinstance(c.rover.mass, float)
    np.testing.assert_array_equal(c.wheels.radius, [0.1, 0.12])
    assert c.wheels.count == 2 and c.wheels.names == ('left', 'right')


def test_slip_radius_is_the_tip_unless_the_rim_is_asked_for():
    lugs = {**ROVER, 'wheels.lug_height': [0.01, 0.02]}
    np.testing.assert_allclose(reader.from_parameters(lugs).wheels.slip_radius, [0.11, 0.14])
    rim = reader.from_parameters({**lugs, 'slip_radius': 'rim'})
    np.testing.assert_allclose(rim.wheels.slip_radius, [0.1, 0.12])
    np.testing.assert_allclose(rim.wheels.wheel.tip_radius, [0.11, 0.14])


@pytest.mark.parametrize(
    ('alias', 'key', 'value'),
    [
        ('wheels.slip_radius', 'slip_radius', 'rim'),
        ('sensors.wheel_odometry', 'wheel_odometry', 'odom'),
        ('sensors.reference_odom_max_rate', 'reference_odom_max_rate', 1.0),
        ('filter.max_lag', 'max_lag', 0.2),
        ('filter.history', 'history', 1.0),
        ('filter.rest_speed', 'rest_speed', 0.01),
    ],
)
def test_both_spellings_of_the_bare_names(alias, key, value):
    c = made({alias: value})
    assert getattr(c, key) == value and c.flat()[key] == value
    assert 'same parameter' in complaint(made, {alias: value, key: value})


def test_the_soil_has_a_deviation_even_where_none_is_stated():
    c = made({'soil.cohesion': 500.0, 'soil.cohesion_std': 77.0, 'soil.relative_std': 0.2})
    assert c.soil_std['cohesion'] == 77.0
    assert c.soil_std['shear_modulus'] == pytest.approx(0.2 * c.soil.shear_modulus)
    c = made({'soil.friction_angle_std_deg': 2.0})
    assert c.soil_std['friction_angle'] == pytest.approx(math.radians(2.0))


def test_effects_that_are_on():
    c = made(
        {
            'effects.hard_layer.enabled': True,
            'effects.hard_layer.stiffness': 2,
            'effects.hard_layer.stiffness_std': 0.1,
            'effects.bulldozing.kb': 1.0,
        }
    )
    assert list(c.effects) == list(c.effects_std) == ['hard_layer']
    assert c.effects_std['hard_layer']['stiffness'] == 0.1
    assert c.effects['hard_layer'] == catalogue()['hard_layer'].defaults() | {'stiffness': 2.0}


def test_arrays_of_any_kind_and_parameters_of_every_node():
    c = made(
        {
            'wheels.radius': array('d', [0.2, 0.3]),
            'wheels.width': np.array([1, 2]),
            'wheels.names': ('a', 'b'),
            'use_sim_time': True,
            'qos_overrides./joint_states.subscription.reliability': 'reliable',
        }
    )
    np.testing.assert_array_equal(c.wheels.radius, [0.2, 0.3])
    np.testing.assert_array_equal(c.wheels.width, [1.0, 2.0])


def test_a_configuration_is_read_only_and_can_be_copied():
    c = reader.from_parameters(ROVER)
    with pytest.raises(AttributeError):
        c.rover.mass = 3.0
    with pytest.raises(ValueError):
        c.wheels.radius[0] = 3.0
    with pytest.raises(ValueError):
        c.wheels.slip_radius[0] = 3.0
    with pytest.raises(AttributeError):
        _ = c.filter.no_such_thing
    for other in (pickle.loads(pickle.dumps(c)), copy.deepcopy(c)):
        assert other.flat() == c.flat()
        assert other.rover.mass == 10.0


# -- Complaints -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('changes', 'words'),
    [
        (
            {'wheels.raduis': [0.1, 0.1]},
            "unknown parameter 'wheels.raduis'; the nearest known one is 'wheels.radius'",
        ),
        ({'rover.radius': 0.1}, "'wheels.radius'"),
        ({'soil.friction_angle': 0.5}, "'soil.friction_angle_deg'"),
        ({'effects.lug_diging.enabled': True}, "'effects.lug_digging.enabled'"),
        ({'maxlag': 1.0}, "'max_lag'"),
        ({'max_lag': -0.5}, '-0.5 is neither -1 (learned) nor a time to wait'),
        ({'rover.wieght': 20.0}, "'rover.mass'"),
        ({'qwertz': 1}, 'the nearest known one is'),
        ({'wheels.radius': [0.1]}, 'has 1 entries instead of 2 (as many as wheels.names)'),
        ({'wheels.radius': [0.1] * 3}, 'has 3 entries instead of 2'),
        ({'wheels.radius': 0.1}, '0.1 is not a list, write [0.1, 0.1]; allowed: list of'),
        ({'rover.centre_of_gravity': [0.0, 1.0]}, 'has 2 entries instead of 3'),
        ({'rover.mass': [1.0]}, 'is a list; allowed: number'),
        ({'rover.mass': '12'}, "'12' is not a number"),
        ({'rover.mass': '12,5'}, "'12,5' is not a number; the decimal mark is a point"),
        ({'rover.mass': True}, 'True is not a number'),
        ({'rover.mass': 0}, '0.0 is out of range; allowed: number (above 0 and'),
        ({'rover.mass': math.nan}, 'nan is not finite'),
        ({'rover.mass': math.inf}, 'inf is not finite'),
        ({'rover.mass': 1e300}, '1e+300 is not a plausible value'),
        ({'reference_odom_max_rate': 1e-300}, '1e-300 is not a plausible value'),
        ({'wheels.radius': [0.1, -0.1]}, '-0.1 is out of range; allowed'),
        ({'wheels.z': [-300.0, 300.0]}, '-300.0 is out of range (in mm, not m?); allowed'),
        ({'rover.mass': 45500}, '45500.0 is out of range (in g, not kg?)'),
        ({'wheels.lug_count': [1.5, 2]}, '1.5 is not an integer'),
        ({'wheels.direction': [1, 0]}, 'each entry must be 1 or -1'),
        ({'wheels.names': ['a', 'a']}, 'names must be distinct'),
        ({'wheels.names': [1, 2]}, '1 is not a text'),
        ({'soil.leaving_angle_ratio': 0.1}, 'at most 0'),
        (
            {'slip_radius': 'tip'},
            "'tip' is unknown, nearest is 'lug_tip'; allowed: one of lug_tip, rim",
        ),
        ({'rover.suspension': 'rocker-bogie'}, "nearest is 'rocker_bogie'"),
        ({'rover.suspension': 'rocker_bogie'}, 'three wheels on each side'),
        ({'wheels.y': [0.0, 0.0]}, 'rigid needs wheels.x and wheels.y'),
        ({'rover.load_shares': [0.5, 0.4]}, 'add up to 0.9 instead of 1'),
        ({'effects.lug_digging.enabled': 1}, '1 is not true or false'),
        ({'effects.lug_digging.kd': 99.0}, 'at least 0 and at most 4'),
        ({'filter.class_thresholds': [0.6, 0.3, 0.9]}, 'must increase'),
        ({'wheels.lug_thickness': [0.5, 0.5], 'wheels.lug_count': [30, 30]}, 'do not fit'),
        ({'effect_file': '/nowhere/effects.py'}, 'there is no file'),
    ],
)  # fmt: skip
def test_complaints(changes, words):
    message = complaint(reader.from_parameters, {**ROVER, **changes}, source='rover.yaml')
    assert words in message
    assert message.startswith('rover.yaml: ')
    key = 'rover.suspension' if 'wheels.y' in changes else next(iter(changes))
    assert key in message


def test_what_is_missing_is_named():
    message = complaint(reader.from_parameters, {'rover.mass': 1.0})
    assert 'wheels.names, wheels.radius, wheels.width' in message
    assert 'rover.mass' not in message
    assert reader.from_parameters({}, complete=False).wheels.count == 1


def test_the_complaint_names_the_file_that_has_the_key(tmp_path):
    good = parameter_file(tmp_path, 'good.yaml', 'rover.mass: 3.0')
    bad = parameter_file(tmp_path, 'bad.yaml', 'soil: {cohesoin: 3.0}')
    message = complaint(reader.load, ['frostyboy', good, bad])
    assert message.startswith(f'{bad}: ') and "'soil.cohesion'" in message


# -- Files and arguments --------------------------------------------------------------------------


def test_later_files_win_key_by_key_and_overrides_last(tmp_path):
    one = parameter_file(tmp_path, 'one.yaml', 'rover: {mass: 50.0, gravity: 3.71}')
    two = parameter_file(tmp_path, 'two.yaml', 'rover.mass: 60')
    c = reader.load(['frostyboy', one, str(two)])
    assert (c.rover.mass, c.rover.gravity) == (60.0, 3.71)
    c = reader.load(['frostyboy', two, one], ['rover.mass:=7', 'soil.frictional_modulus:=1.8e6'])
    assert (c.rover.mass, c.soil.frictional_modulus) == (7.0, 1.8e6)
    assert 'rover.mass' in c.stated and 'rover.load_shares' not in c.stated
    number, switch = 'effects.lug_digging.kd', 'effects.lug_digging.enabled'
    with pytest.warns(ConfigurationWarning, match=f'{number}: changes nothing .* {switch}:=true'):
        reader.load(['frostyboy'], [f'{number}:=2.0'])
    three = parameter_file(tmp_path, 'three.yaml', f'{number}: 2.0')
    reader.load(['frostyboy', three], [f'{switch}:=false', f'{number}:=1.0'])


@pytest.mark.parametrize('override', ['rover.mass', 'rover.mass=3', ':=3', 'rover.mass:='])
def test_overrides_that_are_none(override):
    assert complaint(reader.load, ['frostyboy'], [override]).startswith(f'-p {override}')


def test_names_of_shipped_files(tmp_path, monkeypatch):
    assert shipped.find('frostyboy').name == 'frostyboy.yaml'
    assert shipped.find('rovers/frostyboy') == shipped.find('frostyboy.yaml')
    message = complaint(shipped.find, 'frostiboy')
    assert "did you mean 'frostyboy'?" in message
    assert 'rovers/frostyboy, ' in message and len(message) < 200  # the nearest three, not ninety
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'frostyboy').mkdir()  # a folder does not hide the shipped file
    assert shipped.find('frostyboy').is_file()
    own = parameter_file(tmp_path, 'own.yaml', 'rover.mass: 1.0')
    assert shipped.find('own.yaml').resolve() == own.resolve()


def test_ambiguous_names_list_what_is_there(tmp_path, monkeypatch):
    for folder in ('rovers', 'soils'):
        (tmp_path / folder).mkdir()
        parameter_file(tmp_path / folder, 'snow.yaml', 'rover.mass: 1.0')
    monkeypatch.setattr(shipped, 'configuration_folder', lambda: tmp_path)
    assert complaint(shipped.find, 'snow') == "'snow' is ambiguous: rovers/snow or soils/snow"
    assert shipped.find('soils/snow').parent.name == 'soils'
    assert shipped.find('snow', 'rovers').parent.name == 'rovers'


def test_shipped_files_of_an_installation(tmp_path, monkeypatch):
    """As pip and colcon lay them out: share/ somewhere above the package, or in a ROS prefix."""
    package = tmp_path / 'install/lib/python3/site-packages/wheel_terra_estimator/configuration'
    package.mkdir(parents=True)
    monkeypatch.setattr(shipped, '__file__', str(package / 'shipped.py'))
    monkeypatch.delenv('AMENT_PREFIX_PATH', raising=False)
    assert 'not found' in complaint(shipped.configuration_folder)
    overlay = tmp_path / 'overlay/share/wheel_terra_estimator/config'
    overlay.mkdir(parents=True)
    monkeypatch.setenv('AMENT_PREFIX_PATH', f'/nowhere:{tmp_path / "overlay"}')
    assert shipped.configuration_folder() == overlay
    beside = tmp_path / 'install/share/wheel_terra_estimator/config'
    beside.mkdir(parents=True)
    assert shipped.configuration_folder() == beside


@pytest.mark.shared
def test_rovers_of_the_shipped_files_against_the_sources():
    """Numbers of the slope paper's table 1, read again."""
    table = shipped.configuration_folder().parents[1] / (
        'shared/reference/seed_nakashima2010_table1_wheels.csv'
    )
    if not table.is_file():
        pytest.skip('the reference material is not beside the project')
    for line in table.read_text().split()[1:]:
        _, number, tip, rim, width, height, thickness, count, _ = line.split(',')
        wheels = reader.load([f'nakashima_wheel_{number}']).wheels
        for value, millimetres in (
            (wheels.radius[0], float(rim) / 2),
            (wheels.wheel.tip_radius[0], float(tip) / 2),
            (wheels.slip_radius[0], float(tip) / 2),
            (wheels.width[0], float(width)),
            (wheels.lug_height[0], float(height)),
            (wheels.lug_thickness[0], float(thickness)),
        ):
            assert value == pytest.approx(millimetres / 1000)
        assert wheels.lug_count[0] == int(count)


# -- Writing --------------------------------------------------------------------------------------


def test_a_written_model_is_read_back(tmp_path):
    c = reader.load(['frostyboy'], ['effects.lug_digging.enabled:=true'])
    words = 'a "fit"\nof mine: 1'
    c = c.replace({'soil.cohesion': 321.5, 'effects.lug_digging.kd': 1.25, 'provenance': words})
    file = tmp_path / 'model.yaml'
    c.write(file, comment='Made by a test.\nSecond line.')
    assert file.read_text().startswith('# Made by a test.\n# Second line.\n/**:\n')
    again = reader.load([file])
    assert again.flat() == c.flat() and again.stated == c.stated
    assert again.effects['lug_digging']['kd'] == 1.25
    keys = ['soil.cohesion', 'effects.lug_digging.enabled', 'provenance']
    c.write(file, keys)
    part = reader.load([file], complete=False)
    assert part.stated == set(keys) and part.provenance == words


@pytest.mark.ros
def test_every_shipped_file_and_a_written_one_are_loaded_by_ros(tmp_path, proposed_law):
    written = tmp_path / 'model.yaml'
    reader.load(['frostyboy']).write(written, comment='x')
    names = [n for n in shipped.files() if n.startswith(('rovers/', 'soils/'))]
    for file in [written, proposed_law, *(shipped.find(name) for name in names)]:
        ours = reader.load([file], complete=False)
        theirs = reader.from_parameters(read_by_ros(file), complete=False)
        assert theirs.flat() == ours.flat(), file


def test_an_effect_of_ones_own(tmp_path):
    """Named by a path relative to the file that names it; its keys are then known."""
    (tmp_path / 'mine.py').write_text(
        'from wheel_terra_estimator.terramechanics.effects.base import Effect, EffectParameter\n'
        'def term(contact, p):\n'
        '    contact.drawbar_pull = contact.drawbar_pull + p.extra\n'
        "MINE = Effect(name='my_effect', claim='mine', symbol='F += x',\n"
        "    touches=frozenset({'drawbar_pull'}),\n"
        "    parameters=(EffectParameter('extra', 'N', 1.0, 0.0, 9.0, 1.0, 'normal', 'more'),),\n"
        "    validity='', source='', on_outputs=term)\n"
    )
    file = parameter_file(
        tmp_path, 'm.yaml', 'effect_file: mine.py\neffects.my_effect: {enabled: true, extra: 2.0}'
    )
    try:
        with pytest.raises(UserError, match='--allow-effect-files'):
            reader.load([file], complete=False)
        assert 'my_effect' not in effects.catalogue()
        c = reader.load([file], complete=False, allow_effect_files=True)
        assert c.effects == {'my_effect': {'extra': 2.0}}
        c.write(tmp_path / 'again.yaml')
        again = reader.load([tmp_path / 'again.yaml'], complete=False, allow_effect_files=True)
        assert again.effects == c.effects
    finally:
        effects._registered.pop('my_effect', None)


@pytest.mark.parametrize(
    ('end', 'pivot', 'words'),
    [
        ('rear', -0.3, ''),
        ('front', 0.3, ''),
        ('rear', 0.0, 'its x must lie between the bogie wheels, -0.6 and 0 m'),
        ('front', -0.3, 'the bogie wheels, 0 and 0.6 m'),
    ],
)
def test_the_bogie_pivot_lies_between_its_wheels(end, pivot, words):
    rover = {
        'rover.mass': 100.0,
        'rover.suspension': 'rocker_bogie',
        'rover.bogie_wheels': end,
        'rover.bogie_pivot': [pivot, 0.2],
        'wheels.names': list('abcdef'),
        'wheels.radius': [0.2] * 6,
        'wheels.width': [0.15] * 6,
        'wheels.x': [0.6, 0.6, 0.0, 0.0, -0.6, -0.6],
        'wheels.y': [0.5, -0.5] * 3,
    }
    if not words:
        reader.from_parameters(rover)
    else:
        said = complaint(reader.from_parameters, rover, source='rover.yaml')
        assert said.startswith('rover.yaml: rover.bogie_pivot: ') and words in said


# The page of parameters is what the table says.


def test_the_page_is_current():
    page = documentation.PAGE.read_text(encoding='utf-8')
    assert page == documentation.page(), 'run python tools/document_parameters.py'
