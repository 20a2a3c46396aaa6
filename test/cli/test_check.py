# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""``wheel-terra check``: exit status and JSON, on the Pathfinder recording."""

import json
import shlex
from pathlib import Path

import numpy as np
import pytest
from message_factory import serialised

from wheel_terra_estimator.bags.bag_file import BagFile
from wheel_terra_estimator.bags.series_reader import read_series
from wheel_terra_estimator.bags.storage import open_bag
from wheel_terra_estimator.checks.run import check_recording
from wheel_terra_estimator.cli.main import main

PATHFINDER = Path(__file__).resolve().parents[2] / 'data' / 'demo' / 'pathfinder'
FIELDS = {'kind', 'topic', 'wheel', 'parameter', 'value', 'std', 'confidence', 'words', 'cure'}


def test_the_radius_of_pathfinder(printed):
    told = json.loads(printed(['check', str(PATHFINDER), '--config', 'pathfinder', '--json'], 1))
    assert set(told) == {'findings', 'not_checked', 'figures'}
    assert all(set(finding) == FIELDS for finding in told['findings'])
    radius = next(f for f in told['findings'] if f['kind'] == 'radius')
    assert radius['parameter'] == 'wheels.radius'
    assert radius['value'] == pytest.approx(0.117, abs=0.001)
    assert all({'kind', 'reason'} == set(entry) for entry in told['not_checked'])


def test_without_a_rover_file_it_proposes_one(capsys):
    main(['check', str(PATHFINDER)])
    said = capsys.readouterr().out
    assert 'wheels.names: [front_left_wheel_joint, front_right_wheel_joint, rear_left' in said


def test_a_remap_to_nothing_names_the_topic_that_is_not_there(make_bag, drive, refused):
    bag = make_bag(row for row in drive if row[0] != '/reference_odom')
    refused(
        ['check', str(bag), '--remap', 'joint_states:=/wheels'],
        'no wheel rates on /wheels',
        '/joint_states (sensor_msgs',
    )


def test_all_topics_of_a_long_recording_end_at_one_time():
    with open_bag(PATHFINDER) as bag:
        told = read_series(bag, {'reference_odom': '/truth/odometry'}, 'bag', most=500)
    ends = [channel.log_time[-1] * 1e-9 for channel in (told.joints, told.imu, told.reference)]
    assert np.ptp(ends) < 0.1 and told.notes[-1].endswith(
        'only its first 0.167 minutes were checked'
    )
    assert min(told.heard.values()) * 1e-9 > max(ends) + 19.0, 'of the whole recording'


def test_an_imu_that_says_it_has_no_accelerometer(tmp_path, factory):
    with BagFile(tmp_path / 'bag', {'/imu/data': 'sensor_msgs/msg/Imu'}) as bag:
        for stamp in range(10**9, 4 * 10**9, 10**8):
            message = factory.imu(factory.header(stamp), [0.0] * 3, [0.1, 0.2, 0.3], None)
            message.linear_acceleration_covariance[0] = -1.0
            bag.write('/imu/data', serialised(message), stamp)
    with open_bag(tmp_path / 'bag') as bag:
        told = read_series(bag, {}, 'bag')
    assert np.isnan(told.imu.force).all() and np.allclose(told.imu.rate, [0.1, 0.2, 0.3])
    assert 'placeholder' not in {f.kind for f in check_recording(told, None).findings}


@pytest.mark.parametrize('topic', ['/nothing', '/imu/data'])
@pytest.mark.parametrize('command', ['check', 'calibrate'])
def test_a_remap_of_an_input_that_can_be_absent_must_fit(tmp_path, refused, command, topic):
    words = [command, str(PATHFINDER), '--config', 'pathfinder']
    words += ['--remap', f'reference_odom:={topic}']
    if command == 'calibrate':
        words += ['-o', str(tmp_path / 'rover.yaml')]
    refused(
        words,
        f'{topic}: no such topic of nav_msgs/msg/Odometry',
        '/truth/odometry (nav_msgs/msg/Odometry)',
    )


def test_the_next_command_of_a_calibration_can_be_pasted(tmp_path, printed):
    remap, rover = 'reference_odom:=/truth/odometry', str(tmp_path / 'my rover.yaml')
    words = ['calibrate', str(PATHFINDER), '--config', 'pathfinder', '--remap', remap, '-o', rover]
    following = shlex.split(printed(words).rpartition('next: ')[2])
    assert following[2:7] == [str(PATHFINDER), '--config', rover, '--remap', remap]
