# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Parameter files are read as ROS reads them."""

import math
import textwrap

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from wheel_terra_estimator.configuration import ros_yaml
from wheel_terra_estimator.errors import UserError

# What rcl_yaml_param_parser of Jazzy gives (taken from rclpy 7.1.6; the test below asks it again).
AS_ROS_READS = {
    '1.8e6': 1.8e6,
    '1e5': 1e5,
    '010': 8,
    '08': 8.0,
    '0x10': 16,
    '0x1p3': 8.0,
    '0x1p99999': '0x1p99999',
    '-0x1.8P99999': '-0x1.8P99999',
    '0x1p-99999': '0x1p-99999',
    '1e99999': '1e99999',
    '-1e-999': '-1e-999',
    '0x0.0p99999': 0.0,
    '00e99999': 0.0,
    '1_000': '1_000',
    'yes': True,
    'Off': False,
    'n': False,
    '.5': 0.5,
    '1.': 1.0,
    '+1': 1,
    '-3': -3,
    '+.5e-3': 0.0005,
    'inf': math.inf,
    '-.inf': -math.inf,
    '"1"': '1',
    "'1.0'": '1.0',
    '"yes"': 'yes',
    '1:30': '1:30',
    '2020-01-01': '2020-01-01',
    '9223372036854775808': 9.223372036854775808e18,
    '=': '=',
    '[1.0, 2e0]': [1.0, 2.0],
    '[1, 2]': [1, 2],
    '[a, b]': ['a', 'b'],
}


@pytest.mark.parametrize(('text', 'value'), AS_ROS_READS.items())
def test_values(text, value):
    read = ros_yaml.parse_value(text, 'test')
    assert read == value
    assert type(read) is type(value)


SIGN = st.sampled_from(('', '+', '-'))
EXPONENT = st.tuples(st.sampled_from('eEpP'), SIGN, st.text('0123456789', min_size=1, max_size=9))
NUMBER = st.tuples(
    SIGN,
    st.sampled_from(('', '0x', '0X')),
    st.text('0123456789abcdefABCDEF_.', max_size=30),
    st.just('') | EXPONENT.map(''.join),
).map(''.join)


@given(NUMBER)
def test_whatever_looks_like_a_number_has_a_value(text):
    ros_yaml.plain_scalar(text)


def test_not_a_number():
    assert math.isnan(ros_yaml.parse_value('.nan', 'test'))


def read_by_ros(file):
    """Return the parameters of a file as rclpy gives them to a node."""
    rclpy = pytest.importorskip('rclpy')
    context = rclpy.Context()
    rclpy.init(args=['--ros-args', '--params-file', str(file)], context=context)
    try:
        node = rclpy.create_node(
            'wheel_terra_estimator',
            context=context,
            automatically_declare_parameters_from_overrides=True,
        )
        found = {name: p.value for name, p in node._parameters.items()}
        node.destroy_node()
    finally:
        rclpy.shutdown(context=context)
    return found


@pytest.mark.ros
def test_values_against_ros_itself(tmp_path):
    lines = [f'    k{i}: {text}' for i, text in enumerate(AS_ROS_READS)]
    file = write(tmp_path, '\n'.join(['/**:', '  ros__parameters:', *lines]) + '\n')
    found = read_by_ros(file)
    for i, (text, value) in enumerate(AS_ROS_READS.items()):
        read = list(found[f'k{i}']) if isinstance(value, list) else found[f'k{i}']
        assert read == value and type(read) is type(value), text


def test_the_global_loader_is_left_alone():
    assert yaml.safe_load('a: 1.8e6') == {'a': '1.8e6'}
    assert yaml.safe_load('a: yes') == {'a': True}


def write(tmp_path, text):
    file = tmp_path / 'some.yaml'
    file.write_text(text)
    return file


def test_nested_and_dotted_keys_and_sections(tmp_path):
    file = write(
        tmp_path,
        """
other_node:
  ros__parameters: {x: 1}
/rover1/wheel_terra_estimator:
  ros__parameters:
    c: 3
ns:
  wheel_terra_estimator:
    ros__parameters:
      d: 4
wheel_terra_estimator:
  ros__parameters:
    a.b: 2
/**:
  ros__parameters:
    a: {b: 1, e: {f: 5}}
    a.g: 6
""",
    )
    assert ros_yaml.read(file) == {'a.b': 2, 'a.e.f': 5, 'a.g': 6, 'c': 3, 'd': 4}


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('', 'no parameters'),
        ('- 1', 'no parameters'),
        ('a: 1\nb: ]', 'not valid YAML: line 2: '),
        ('/**: {wheels: {radius: 1}}', "no 'ros__parameters:'"),
        ('wheel_terra_estimator: {rover.mass: 1}', "no 'ros__parameters:'"),
        ('[1, 2]', 'no parameters'),
        ('rover: {mass: 1}\nrover.mass: 2', 'rover.mass is given twice'),
        ('rover: {mass: }', 'rover.mass has no value'),
        ('/**:\n  ros__parameters: 5', 'holds no keys'),
        ('other:\n  ros__parameters: {a: 1}', "sections there: 'other'"),
        ('/**:\n  ros__parameters:\n    a:', 'a has no value'),
        ('/**:\n  ros__parameters: {a: ~}', 'a has no value'),
        ('/**:\n  ros__parameters: {a: null}', 'a has no value'),
        ('/**:\n  ros__parameters: {a: []}', 'a is an empty list'),
        ('/**:\n  ros__parameters: {a: [[1], [2]]}', 'a is a nested list'),
        ('/**:\n  ros__parameters: {a: [{b: 1}]}', 'a is a nested list'),
        ('/**:\n  ros__parameters: {a: [1, ~]}', 'empty entry'),
        ('/**:\n  ros__parameters: {a: [1, x]}', 'mixes types'),
        ('/**:\n  ros__parameters: {a: [0, 0.5]}', 'write [0.0, 0.5]'),
        ('/**:\n  ros__parameters: {a: 1, a: 2}', "'a' is given twice"),
        ('/**:\n  ros__parameters: {a.b: 1, a: {b: 2}}', 'a.b is given twice'),
        ('/**:\n  ros__parameters: {a: !!python/name:os.system x}', 'not valid YAML'),
    ],
)
def test_complaints_are_one_line_that_names_the_file(tmp_path, text, words):
    file = write(tmp_path, text)
    with pytest.raises(UserError) as caught:
        ros_yaml.read(file)
    message = str(caught.value)
    assert message.startswith(str(file)) and words in message and '\n' not in message


def test_files_that_cannot_be_read(tmp_path):
    with pytest.raises(UserError, match='cannot be read: No such file'):
        ros_yaml.read(tmp_path / 'none.yaml')
    binary = tmp_path / 'binary.yaml'
    binary.write_bytes(b'\xff\xfe\x00')
    with pytest.raises(UserError, match='not a UTF-8 text'):
        ros_yaml.read(binary)


LETTERS = 'abcxyzABC 0123456789.:;,#"\'\\-+~[]{}()<>|&*!%@`?=/_$^äß\u2028\u00a0\ufeff€\U0001f980'
"""What YAML means something by, and some of the rest (all of Unicode takes hypothesis 2 s)."""

scalars = st.one_of(
    st.booleans(),
    st.integers(-(2**63), 2**63 - 1),
    st.floats(allow_nan=False),
    st.text(LETTERS, max_size=20),
)
lists = st.one_of(
    st.lists(st.booleans(), min_size=1, max_size=4),
    st.lists(st.floats(allow_nan=False), min_size=1, max_size=4),
    st.lists(st.text('abc: #"\\\'-~[]{}01.e', max_size=6), min_size=1, max_size=4),
)


@given(st.one_of(scalars, lists))
def test_what_is_written_is_read_back(value):
    read = ros_yaml.parse_value(ros_yaml.format_value(value), 'test')
    assert read == value
    assert type(read) is type(value)


def test_a_file_of_keys_alone_is_one_of_ros(tmp_path):
    plain, ros = tmp_path / 'plain.yaml', tmp_path / 'ros.yaml'
    text = 'rover:\n  mass: 1e2\nwheels.names: [a, b]\nsoil: {cohesion: 010}\n'
    plain.write_text(text)
    ros.write_text('/**:\n  ros__parameters:\n' + textwrap.indent(text, '    '))
    assert ros_yaml.read(plain) == ros_yaml.read(ros)
    assert ros_yaml.read(plain)['soil.cohesion'] == 8  # numbers as ROS reads them
