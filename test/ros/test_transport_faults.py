# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What only the transport knows: names taken twice, a clock that is missing, messages lost."""

from types import SimpleNamespace

import pytest
import ros_types as ros
from test_estimator_node import NODE, ROVER

from wheel_terra_estimator.configuration import reader

BURST = 200  # messages sent while the node is held up
TURNS = 20  # of the node in this process between two looks at a condition
HELD_UP = 0.25
"""Time for which a node is held up [s]: a quarter of a second at 1000 Hz fills its queue."""


@pytest.fixture
def heard(listener):
    """Return the listener's node, its waiting, and the statuses of the estimator as they come."""
    node, until = listener
    statuses = []

    def take(message):
        statuses.extend(s for s in message.status if s.name.endswith(': estimator'))

    node.create_subscription(ros.DiagnosticArray, '/diagnostics', take, 100)
    return node, until, statuses


def joint_states(node, stamp, *, apart=1_000_000):
    """Return a function that publishes wheel rates with stamps by so much ``apart`` [ns]."""
    names = list(reader.load(['pathfinder']).wheels.names)
    publisher = node.create_publisher(ros.JointState, 'joint_states', 1000)
    message = ros.JointState(name=names, velocity=[1.0] * len(names), effort=[2.0] * len(names))

    def send():
        stamp[0] += apart
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp[0], 1_000_000_000)
        publisher.publish(message)

    return publisher, send


def test_what_is_wrong_around_a_node_is_told_until_it_ends(start, heard, parameters, soon):
    """Another node of its name, no clock, no place for what it learns; estimates go on."""
    from rclpy.node import Node

    node, until, statuses = heard
    sets = []
    node.create_subscription(ros.JointState, f'{NODE}/slip', sets.append, 10)
    publisher, send = joint_states(node, [100_000_000_000], apart=50_000_000)
    nowhere = '/proc/s.yaml'
    given = ('-p', 'use_sim_time:=true', '-p', f'soil_file:={nowhere}')
    start('estimator_node', *ROVER, parameters, *given, **soon)
    until(lambda: publisher.get_subscription_count() and node.count_publishers(f'{NODE}/slip'))
    until(lambda: (send(), len(sets) > 3 and statuses)[1])
    assert not any('another node' in s.message for s in statuses)
    second = Node(NODE.strip('/'), context=node.context)
    faults = [
        f'another node is also called {NODE}: both publish estimates',
        'nothing arrives on /clock',
        f'soil_file: {nowhere}: ',
    ]

    def told(status):
        return status.level[0] == 1 and all(words in status.message for words in faults)

    until(lambda: (send(), any(map(told, statuses)))[1])
    second.destroy_node()
    clock = node.create_publisher(ros.Clock, '/clock', 10)
    tick = ros.Clock()
    tick.clock.sec = 100

    def gone():
        tick.clock.sec += 1
        clock.publish(tick)
        return not any(words in statuses[-1].message for words in faults[:2])

    until(gone)


@pytest.mark.parametrize(('topic', 'kept'), [('joint_states', BURST), ('reference_odom', 10)])
def test_fast_topics_are_queued_for_a_quarter_of_a_second_at_1000_hz(listener, topic, kept):
    """One node sends to itself, so that nothing but the queue decides what is kept."""
    from wheel_terra_estimator.ros.qos import FAST_DEPTH, input_profile

    assert FAST_DEPTH >= 1000.0 * HELD_UP >= BURST
    assert {input_profile(t).depth for t in ('joint_states', 'odom', 'imu/data')} == {FAST_DEPTH}
    node, until = listener
    received = []
    publisher = node.create_publisher(ros.Int64, 'queued', 1000)
    profile = input_profile(topic)
    node.create_subscription(ros.Int64, 'queued', lambda m: received.append(m.data), profile)
    until(lambda: (publisher.publish(ros.Int64(data=-1)), received)[1])
    for number in range(BURST):  # nobody takes them meanwhile
        publisher.publish(ros.Int64(data=number))
    until(lambda: received[-1] == BURST - 1)
    assert received[-kept:] == list(range(BURST - kept, BURST))
    assert max(received[:-kept]) == -1


@pytest.fixture
def node_here(heard, parameters):
    """Return the estimator in this process, and a waiting that turns it, too."""
    from rclpy.executors import SingleThreadedExecutor

    from wheel_terra_estimator.ros.lifecycle_node import EstimatorNode

    node, until, _ = heard
    estimator = EstimatorNode(context=node.context, cli_args=[*ROVER, parameters])
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(estimator)

    def turned(condition):
        for _ in range(TURNS):
            executor.spin_once(timeout_sec=0.0)
        return condition()

    def until_turned(condition):
        until(lambda: turned(condition))

    yield estimator, until_turned
    executor.shutdown()
    estimator.destroy_node()


class Counted:
    """Publishers of wheel rates that take turns, and what the node has of them."""

    def __init__(self, node, estimator, publishers):
        stamp = [100_000_000_000]
        self._senders = [joint_states(node, stamp)[1] for _ in range(publishers)]
        self._estimator = estimator
        self.sent = 0

    def send(self, count=1):
        for _ in range(count):
            self._senders[self.sent % len(self._senders)]()
            self.sent += 1
        return True

    def figure(self, name):
        """A value of the node's diagnostics, as it is now."""
        told = {**self._estimator._pipeline.counters(), **self._estimator._transport_values()}
        return int(told.get(f'joint_states_{name}', 0))

    def missing(self):
        """Messages that were sent, and neither received nor counted as lost."""
        return self.sent - self.figure('received') - self.figure('lost')


@pytest.mark.parametrize('publishers', [1, 2])
def test_loss_is_told_and_counted(heard, node_here, publishers):
    """The node is in this process and turned by the test: nothing but its queue loses messages."""
    from wheel_terra_estimator.ros.qos import FAST_DEPTH

    node, _, statuses = heard
    estimator, until = node_here
    wheels = Counted(node, estimator, publishers)
    until(lambda: estimator.count_publishers('joint_states') == publishers)
    estimator._watch_names()  # as it does every second
    inputs = {s.topic_name: s for s in estimator.subscriptions}
    until(lambda: inputs['/joint_states'].get_publisher_count() == publishers)
    while not wheels.figure('received'):
        wheels.send()
        until(lambda: True)
    unheard = wheels.missing()  # before the two had found each other, at most
    for _ in range(20):
        wheels.send()
        until(lambda: True)
    until(lambda: wheels.missing() <= unheard)
    assert wheels.figure('lost') == 0, 'publishers that take turns lose nothing'
    if publishers == 1:
        wheels.send(2 * FAST_DEPTH)  # and nobody takes them meanwhile
        until(lambda: wheels.missing() <= unheard)
        assert wheels.figure('lost') >= FAST_DEPTH
    else:  # their counts cannot be told apart: what the middleware counts
        estimator._on_message_lost('joint_states', SimpleNamespace(total_count_change=7))
        until(lambda: wheels.figure('lost') >= 7)
    words = 'messages lost in transport'
    until(lambda: wheels.send() and any(words in s.message and s.level[0] for s in statuses))
