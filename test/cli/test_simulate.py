# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""``wheel-terra simulate``: the bag that a user gets, and one line for what cannot be done."""

import re

import numpy as np
import pytest

from wheel_terra_estimator.bags.simulated_drive import TRUTH_TOPICS, write_simulated_drive
from wheel_terra_estimator.bags.storage import jazzy_types, messages_of, open_bag
from wheel_terra_estimator.bags.truth import read_truth
from wheel_terra_estimator.cli.main import main
from wheel_terra_estimator.messages.convert import INPUT_TYPES, JOINT_STATE, stamp_of
from wheel_terra_estimator.simulation.drive import simulate
from wheel_terra_estimator.simulation.scenario import load


@pytest.fixture(scope='module')
def bag_path(tmp_path_factory):
    path = tmp_path_factory.mktemp('bags') / 'drive'
    status = main(
        ['simulate', '--scenario', 'turns', '--seed', '3', '--duration', '3', '-o', str(path)]
    )
    assert status == 0
    return path


def test_the_bag_has_inputs_and_truth(bag_path):
    with open_bag(bag_path) as bag:
        found = {name: topic.type for name, topic in bag.topics.items()}
    wanted = {f'/{name}': kind for name, kind in INPUT_TYPES.items() if name != 'leaving_angle'}
    assert found == {**wanted, **TRUTH_TOPICS}


def test_the_way_driven_counts_both_ways(tmp_path, capsys):
    scenario = tmp_path / 'there_and_back.yaml'
    scenario.write_text("""
configuration: [generic_six_wheel, test_sand]
drive: {time: [0.0, 3.0, 3.0], forward: [0.1, 0.1, -0.1]}
""")
    drive = ['--scenario', str(scenario), '--duration', '6', '-o', str(tmp_path / 'drive')]
    assert main(['simulate', *drive]) == 0
    way = float(re.search(r'6 s, ([0-9.]+) m driven', capsys.readouterr().out)[1])
    assert 0.4 < way < 0.6, 'twice 3 s of 0.1 m/s, less what starting, turning round and slip cost'


@pytest.fixture(scope='module')
def drive():
    return simulate(load('turns'), 3, 3.0)


def test_variances_of_the_imu_are_those_of_its_sensors(bag_path, drive):
    sensors = drive.configuration.sensors
    with open_bag(bag_path) as bag:
        _, _, message = next(messages_of(bag, {'/imu/data': INPUT_TYPES['imu/data']}))
    for begin, name in ((4, 'orientation'), (16, 'angular_rate'), (28, 'specific_force')):
        stated = message.numbers[0][begin : begin + 9]
        wanted = getattr(sensors, f'{name}_std') ** 2 * np.eye(3)
        np.testing.assert_allclose(np.reshape(stated, (3, 3)), wanted, err_msg=name)


def test_truth_in_the_bag_is_that_of_the_drive(bag_path, drive):
    with open_bag(bag_path) as bag:
        truth = read_truth(bag, {}, drive.configuration)
        classes = list(bag.messages(('/ground_truth/slip_class',)))
    assert truth is not None
    np.testing.assert_array_equal(truth.slip.stamp, drive.truth.stamp)
    np.testing.assert_array_equal(truth.slip.value, drive.truth.slip)
    np.testing.assert_array_equal(truth.sinkage.value, drive.truth.sinkage)
    np.testing.assert_array_equal(truth.drawbar_pull.value, drive.truth.drawbar_pull)
    assert len(classes) == len(drive.truth.stamp)


def test_true_slip_of_wheels_at_rest_is_unknown(tmp_path):
    """About a standing side a rover can be entrapped: only the wheels that turn say so."""
    pivot = {'drive.forward': [0.025], 'drive.turn_rate': [-0.05], 'duration': 2.0}
    drive = simulate(load({'configuration': ['generic_six_wheel', 'test_sand'], **pivot}))
    write_simulated_drive(drive, tmp_path / 'bag')
    with open_bag(tmp_path / 'bag') as bag:
        truth = read_truth(bag, {}, drive.configuration)
        slips = messages_of(bag, {'/ground_truth/slip': JOINT_STATE})
        held = [message.numbers[0] for _, _, message in slips]
    assert np.isfinite(held).all()  # the contract: no output is ever nan
    assert truth is not None
    assert np.isnan(truth.slip.value[-1]).tolist() == 3 * [False, True]
    np.testing.assert_array_equal(truth.slip.value, drive.truth.slip)


def test_odometry_is_the_motion_of_rolling_wheels(tmp_path):
    pivot = {'drive.forward': [0.025], 'drive.turn_rate': [-0.05], 'duration': 2.0}
    drive = simulate(load({'configuration': ['generic_six_wheel', 'test_sand'], **pivot}))
    write_simulated_drive(drive, tmp_path / 'bag')
    store, wheels = jazzy_types(), drive.configuration.wheels
    with open_bag(tmp_path / 'bag') as bag:
        sent = [
            store.deserialize_cdr(m.data, 'nav_msgs/msg/Odometry').twist.twist
            for m in bag.messages(('/odom',))
        ][-1]
    # The left side stands, the right one drives.
    rim = drive.truth.wheel_rate[-1] * wheels.slip_radius
    turn = np.mean(rim[1::2] - rim[::2]) / (wheels.y[0] - wheels.y[1])
    assert sent.angular.z == pytest.approx(turn, abs=2e-3)
    assert sent.linear.x == pytest.approx(rim.mean(), abs=1e-3)


def test_log_times_are_arrivals(bag_path):
    store = jazzy_types()
    with open_bag(bag_path) as bag:
        late = [
            m.log_time - stamp_of(store.deserialize_cdr(m.data, 'nav_msgs/msg/Odometry'))
            for m in bag.messages(('/reference_odom',))
        ]
    assert late
    assert min(late) >= 0.4e9


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        (['-o', 'x', '--scenario', 'clim_soft_patch'], 'climb_soft_patch'),
        (['-o', 'x', '--seed', '-1'], '--seed'),
        (['-o', 'x', '--duration', '0'], '--duration'),
        (['-o', 'x', '--duration', '1e-9'], '--duration'),
        (['-o', 'x', '-p', 'rover.mas:=3.0'], 'rover.mass'),
    ],
)
def test_bad_arguments(arguments, words, refused, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    refused(['simulate', *arguments], words)
    assert not list(tmp_path.iterdir())
