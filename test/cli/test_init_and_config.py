# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""``wheel-terra init``, ``config`` and ``calibrate``: files that every command accepts."""

from pathlib import Path

import numpy as np
import pytest
from recordings import changed

from wheel_terra_estimator.cli.main import main
from wheel_terra_estimator.configuration import reader

PATHFINDER = Path(__file__).resolve().parents[2] / 'data' / 'demo' / 'pathfinder'
WHEEL = (
    '<link name="{0}"><inertial><mass value="2"/></inertial><collision><geometry>'
    '<cylinder radius="0.2" length="0.1"/></geometry></collision></link>'
    '<joint name="{0}_wheel_joint" type="continuous"><parent link="chassis"/><child link="{0}"/>'
    '<origin xyz="0.1 {1} 0" rpy="{2} 0 0"/><axis xyz="0 0 1"/></joint>'
)
URDF = (
    '<robot name="cart"><link name="base_link"/><link name="chassis"><inertial>'
    '<origin xyz="0 0 0.1"/><mass value="40"/></inertial></link>'
    '<joint name="fixed" type="fixed"><parent link="base_link"/><child link="chassis"/>'
    '<origin xyz="0 0 0.2"/></joint>'
    + WHEEL.format('right', -0.3, 1.5707963)
    + WHEEL.format('left', 0.3, -1.5707963)
    + '</robot>'
)


def test_from_a_urdf(tmp_path):
    (tmp_path / 'cart.urdf').write_text(URDF)
    output = tmp_path / 'rover.yaml'
    command = ['init', '--urdf', str(tmp_path / 'cart.urdf'), '-o', str(output)]
    assert main(command) == 0
    rover = reader.load([output])
    assert rover.wheels.names == ('left_wheel_joint', 'right_wheel_joint')
    assert np.allclose(rover.wheels.y, [0.3, -0.3])
    assert np.allclose(rover.wheels.z, 0.2)
    assert np.allclose(rover.wheels.radius, 0.2)
    # The axis z of a joint rolled by -90 degrees points left, of one rolled by 90 degrees right.
    assert rover.wheels.direction.tolist() == [1, -1]
    assert rover.rover.mass == pytest.approx(44.0)
    assert rover.rover.centre_of_gravity[2] == pytest.approx((40 * 0.3 + 4 * 0.2) / 44, abs=1e-4)
    assert main(command) == 2  # nothing is overwritten


def test_what_steers_is_found_in_a_urdf(tmp_path, capsys):
    # Between chassis and right wheel a knuckle: rolled over, so that its axis points down.
    knuckle = (
        '<link name="knuckle"/><joint name="steer_right" type="revolute"><parent link="chassis"/>'
        '<child link="knuckle"/><origin rpy="3.1415926 0 0"/><axis xyz="0 0 {0}"/></joint>'
    )
    parts = [
        '<link name="base_link"/><link name="chassis"/>',
        '<joint name="rocker" type="revolute"><parent link="base_link"/><child link="chassis"/>'
        '<axis xyz="0 1 0"/></joint>',
        WHEEL.format('right', 0.3, -1.5707963).replace(
            'parent link="chassis"', 'parent link="knuckle"'
        ),
        WHEEL.format('left', 0.3, -1.5707963),
    ]
    output = tmp_path / 'rover.yaml'
    for axis, told in ((-1, False), (1, True)):
        text = '<robot name="cart">' + knuckle.format(axis) + ''.join(parts) + '</robot>'
        (tmp_path / 'cart.urdf').write_text(text)
        command = ['init', '--urdf', str(tmp_path / 'cart.urdf'), '-o', str(output), '--overwrite']
        assert main(command) == 0
        rover = reader.load([output])
        assert dict(zip(rover.wheels.names, rover.wheels.steering_joints, strict=True)) == {
            'left_wheel_joint': '',
            'right_wheel_joint': 'steer_right',
        }
        # An axis that points down counts to the right.
        assert ('wheels.steering_joints' in capsys.readouterr().out) == told


@pytest.mark.parametrize(
    ('text', 'word'),
    [
        ('<!DOCTYPE r [<!ENTITY a "aa">]><robot/>', 'DTD'),
        ('<robot', 'not valid XML'),
        ('<robot name="r"><link name="base_link"/></robot>', '--wheels'),
        ('<sdf/>', '<robot>'),
    ],
)
def test_what_is_no_urdf(tmp_path, capsys, text, word):
    (tmp_path / 'r.urdf').write_text(text)
    assert main(['init', '--urdf', str(tmp_path / 'r.urdf'), '-o', str(tmp_path / 'o')]) == 2
    assert word in capsys.readouterr().err
    assert not (tmp_path / 'o').exists()


def test_a_number_of_wheels_is_no_name(tmp_path, capsys):
    assert main(['init', '--wheels', '6', '-o', str(tmp_path / 'o')]) == 2
    assert 'names of the wheel joints' in capsys.readouterr().err


def test_from_a_recording_then_checked_and_calibrated(tmp_path, capsys):
    output = tmp_path / 'rover.yaml'
    measures = ['--radius', '0.11', '--track', '0.6', '--wheelbase', '0.5', '--mass', '22']
    assert main(['init', '--bag', str(PATHFINDER), *measures, '-o', str(output)]) == 0
    rover = reader.load([output])
    assert rover.wheels.names[0] == 'front_left_wheel_joint'
    assert np.allclose(rover.wheels.x, [0.25, 0.25, -0.25, -0.25])
    assert rover.wheels.passes.tolist() == [1, 1, 2, 2]
    assert 'rover.centre_of_gravity is a guess' in capsys.readouterr().out
    assert 'A GUESS, to be measured: centre of gravity' in output.read_text()
    better = tmp_path / 'calibrated.yaml'
    command = ['calibrate', str(PATHFINDER), '--config', str(output), '-o', str(better)]
    assert main(command) == 0
    assert np.allclose(reader.load([better]).wheels.radius, 0.117, atol=0.001)


def test_a_turning_joint_that_is_left_out_is_told(tmp_path, capsys):
    def rename(topic, message):
        if topic == '/joint_states':
            message.name[message.name.index('front_left_wheel_joint')] = 'nose'
        return message

    bag = changed(PATHFINDER, tmp_path / 'bag', rename)
    measures = ['--radius', '0.11', '--track', '0.6', '--wheelbase', '0.5', '--mass', '22']
    assert main(['init', '--bag', str(bag), *measures, '-o', str(tmp_path / 'rover.yaml')]) == 0
    assert 'not taken for wheels by their names: nose; ' in capsys.readouterr().out


def test_all_measures_that_are_missing_are_named_at_once(tmp_path, capsys):
    command = ['init', '--bag', str(PATHFINDER), '--mass', '22', '-o', str(tmp_path / 'rover.yaml')]
    assert main(command) == 2
    complaint = capsys.readouterr().err
    assert all(name in complaint for name in ('--radius', '--track', '--wheelbase'))
    assert '--mass' not in complaint and not (tmp_path / 'rover.yaml').exists()


def test_a_single_wheel_needs_neither_track_nor_wheelbase(tmp_path):
    file = tmp_path / 'rig.yaml'
    measures = ['--wheels', 'wheel', '--radius', '0.1', '--mass', '15']
    assert main(['init', *measures, '-o', str(file)]) == 0
    assert reader.load([file]).wheels.y.tolist() == [0.0]


def test_an_axis_that_is_not_across_leaves_the_sign_a_guess(tmp_path, capsys):
    urdf = tmp_path / 'cart.urdf'
    urdf.write_text(URDF.replace('rpy="1.5707963 0 0"', 'rpy="0 0 0"'))
    main(['init', '--urdf', str(urdf), '-o', str(tmp_path / 'rover.yaml')])
    assert 'wheels.direction is a guess' in capsys.readouterr().out


def test_config(capsys):
    assert main(['config', 'list', 'rovers']) == 0
    listed = capsys.readouterr().out
    assert 'rovers/frostyboy' in listed and 'soils/' not in listed
    assert main(['config', 'list', 'soils']) == 0
    listed = capsys.readouterr().out
    assert 'loose (Hurrell et al. 2025)\n' in listed, 'a point inside a sentence does not end it'
    assert 'Proxies' not in listed and 'Source' not in listed
    assert main(['config', 'path', 'pathfinder']) == 0
    path = Path(capsys.readouterr().out.strip())
    assert main(['config', 'show', 'pathfinder']) == 0
    assert capsys.readouterr().out == path.read_text()
    assert main(['config', 'show', 'pathfindr']) == 2
    complaint = capsys.readouterr().err
    assert 'rovers/pathfinder' in complaint and len(complaint) < 300
