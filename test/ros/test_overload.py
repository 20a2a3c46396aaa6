# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What a node does that is short of processor time; the clock is the test's."""

import time

import pytest
from rclpy.serialization import serialize_message
from test_estimator_node import ROVER, wheel_message

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.ros import lifecycle_node
from wheel_terra_estimator.ros.lifecycle_node import OVERLOADED, EstimatorNode

NAMES = reader.load(['pathfinder']).wheels.names


@pytest.fixture
def estimator(listener, parameters, tmp_path):
    """A node that nobody turns, and its soil file."""
    soil = tmp_path / 's.yaml'
    arguments = [*ROVER, parameters, '-p', f'soil_file:={soil}']
    node = EstimatorNode(context=listener[0].context, cli_args=arguments)
    yield node, soil
    node.destroy_node()


def arrived(seconds, came):
    """Wheel odometry of a stamp [s] that came to the process at a time [ns]."""
    info = {'received_timestamp': int(came), 'source_timestamp': 0}
    return 'joint_states', serialize_message(wheel_message(NAMES, 100.0 + seconds)), info


def test_the_soil_is_saved_though_messages_keep_the_timers_waiting(estimator, monkeypatch):
    """An executor that is short of processor time may leave the timers out for minutes."""
    node, soil = estimator
    monkeypatch.setattr(lifecycle_node, 'SAVE_PERIOD', 2.0)
    for i in range(60):
        node._seconds = lambda now=node._started + 0.05 * i: now
        node._arrive(*arrived(0.05 * i, time.time_ns() - 1e9))
        assert not (soil.exists() and i < 40), f'{0.05 * i} s'
    assert soil.exists()


@pytest.mark.parametrize(
    ('speed', 'first', 'left_out'),
    [(2.0, 40, 0), (0.4, 40, 29 + 29), (0.4, 2, 29)],
    ids=['stood', 'overloaded', 'stood after two slow ones'],
)
def test_who_cannot_keep_up_takes_what_came_last(estimator, speed, first, left_out):
    """Three batches of 2 s: all of the first, of the others the last half second, or all."""
    node, _ = estimator
    usual, clock = node._process, [node._started]
    node._seconds = lambda: clock[0]

    def hear(*message):
        clock[0] += 0.05 / speed
        usual(*message)

    node._process = hear
    for batch in range(3):
        node._catch_up(
            *[
                arrived(t, t * 1e9)
                for i in range(40 if batch else first)
                for t in [2.0 * batch + 0.05 * i + 1.0]
            ]
        )
    assert node._pipeline.rejected['joint_states', OVERLOADED] == left_out
