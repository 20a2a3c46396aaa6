# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""``wheel-terra check``: exit status and JSON, on the Pathfinder recording."""

import json
import shlex
from pathlib import Path

import pytest

from wheel_terra_estimator.cli.main import main

PATHFINDER = Path(__file__).resolve().parents[2] / 'data' / 'demo' / 'pathfinder'
FIELDS = {'kind', 'topic', 'wheel', 'parameter', 'value', 'std', 'confidence', 'words', 'cure'}


def test_the_radius_of_pathfinder(capsys):
    assert main(['check', str(PATHFINDER), '--config', 'pathfinder', '--json']) == 1
    printed = json.loads(capsys.readouterr().out)
    assert set(printed) == {'findings', 'not_checked', 'figures'}
    assert all(set(finding) == FIELDS for finding in printed['findings'])
    radius = next(f for f in printed['findings'] if f['kind'] == 'radius')
    assert radius['parameter'] == 'wheels.radius'
    assert radius['value'] == pytest.approx(0.117, abs=0.001)
    assert all({'kind', 'reason'} == set(entry) for entry in printed['not_checked'])


def test_without_a_rover_file_it_proposes_one(capsys):
    main(['check', str(PATHFINDER)])
    said = capsys.readouterr().out
    assert 'wheels.names: [front_left_wheel_joint, front_right_wheel_joint, rear_left' in said


def test_a_remap_to_nothing_names_the_topic_that_is_not_there(make_bag, drive, capsys):
    topics = {'/imu/data': 'sensor_msgs/msg/Imu', '/joint_states': 'sensor_msgs/msg/JointState'}
    bag = make_bag(messages=[row for row in drive if row[0] in topics], topics=topics)
    assert main(['check', str(bag), '--remap', 'joint_states:=/wheels']) == 2
    said = capsys.readouterr().err
    assert 'no wheel rates on /wheels' in said and '/joint_states (sensor_msgs' in said


@pytest.mark.parametrize('topic', ['/nothing', '/imu/data'])
@pytest.mark.parametrize('command', ['check', 'calibrate'])
def test_a_remap_of_an_input_that_can_be_absent_must_fit(tmp_path, capsys, command, topic):
    words = [command, str(PATHFINDER), '--config', 'pathfinder']
    words += ['--remap', f'reference_odom:={topic}']
    if command == 'calibrate':
        words += ['-o', str(tmp_path / 'rover.yaml')]
    assert main(words) == 2
    said = capsys.readouterr().err
    assert f'{topic}: no such topic of nav_msgs/msg/Odometry' in said
    assert '/truth/odometry (nav_msgs/msg/Odometry)' in said


def test_the_next_command_of_a_calibration_can_be_pasted(tmp_path, capsys):
    remap, rover = 'reference_odom:=/truth/odometry', str(tmp_path / 'my rover.yaml')
    words = ['calibrate', str(PATHFINDER), '--config', 'pathfinder', '--remap', remap, '-o', rover]
    assert main(words) == 0
    following = shlex.split(capsys.readouterr().out.rpartition('next: ')[2])
    assert following[2:7] == [str(PATHFINDER), '--config', rover, '--remap', remap]


def test_a_recording_that_was_cut_off_is_told(tmp_path, capsys):
    whole = next(PATHFINDER.glob('*.mcap')).read_bytes()
    (tmp_path / 'cut.mcap').write_bytes(whole[: len(whole) // 2])
    main(['check', str(tmp_path / 'cut.mcap'), '--config', 'pathfinder'])
    assert '  note: cut.mcap was not closed: ' in capsys.readouterr().out
