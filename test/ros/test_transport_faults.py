# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What only the transport knows: names taken twice, a clock that is missing, messages lost."""

import os
import signal
import time

import pytest

from wheel_terra_estimator.configuration import reader

NODE = '/wheel_terra_estimator'
ROVER = ('generic_six_wheel',)
BURST = 200  # messages sent while the node is held up
STATUS_PERIOD = 1.0  # of the diagnostics [s]
HELD_UP = 0.25
"""Time for which a node is held up [s]: a quarter of a second at 1000 Hz fills its queue."""


@pytest.fixture
def rover(tmp_path):
    path = tmp_path / 'rover.yaml'
    reader.load(ROVER).write(path)
    return ['--ros-args', '--params-file', str(path)]


@pytest.fixture
def heard(listener):
    """Return the listener's node, its waiting, and the statuses of the estimator as they come."""
    from diagnostic_msgs.msg import DiagnosticArray

    node, until = listener
    statuses = []

    def take(message):
        statuses.extend(s for s in message.status if s.name.endswith(': estimator'))

    node.create_subscription(DiagnosticArray, '/diagnostics', take, 100)
    return node, until, statuses


def values(status):
    return {value.key: value.value for value in status.values}


def joint_states(node, stamp, *, topic='joint_states'):
    """Return a function that publishes wheel rates with stamps a millisecond apart."""
    from sensor_msgs.msg import JointState

    names = list(reader.load(ROVER).wheels.names)
    publisher = node.create_publisher(JointState, topic, 1000)
    message = JointState(name=names, velocity=[1.0] * len(names), effort=[2.0] * len(names))

    def send():
        stamp[0] += 1_000_000
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp[0], 1_000_000_000)
        publisher.publish(message)

    return publisher, send


def test_two_nodes_of_one_name_are_told(start, heard, rover):
    _, until, statuses = heard
    start('estimator_node', *rover)
    until(lambda: statuses)
    assert not any('another node' in s.message for s in statuses)
    second = start('estimator_node', *rover)
    words = f'another node is called {NODE}: both publish estimates'
    until(lambda: any(words in s.message for s in statuses))
    second.stop(signal.SIGINT)
    until(lambda: 'another node' not in statuses[-1].message)


def test_sim_time_without_a_clock_is_told_until_it_comes(start, heard, rover):
    from rosgraph_msgs.msg import Clock

    node, until, statuses = heard
    start('estimator_node', *rover, '-p', 'use_sim_time:=true')
    until(lambda: statuses and 'nothing comes on /clock' in statuses[-1].message)
    clock = node.create_publisher(Clock, '/clock', 10)
    tick = Clock()
    tick.clock.sec = 100

    def gone():
        tick.clock.sec += 1
        clock.publish(tick)
        return '/clock' not in statuses[-1].message

    until(gone)


def test_estimates_go_on_without_a_clock(start, heard, rover):
    from sensor_msgs.msg import JointState

    node, until, statuses = heard
    sets = []
    node.create_subscription(JointState, f'{NODE}/slip', sets.append, 10)
    publisher, send = joint_states(node, [100_000_000_000])
    start('estimator_node', *rover, '-p', 'use_sim_time:=true')
    until(publisher.get_subscription_count)
    until(lambda: node.count_publishers(f'{NODE}/slip'))

    def some():
        send()
        return len(sets) > 3

    until(some)
    until(lambda: (send(), any(s.level[0] == 1 and '/clock' in s.message for s in statuses))[1])


def hold_up(process, seconds, publish):
    """Stop a process, publish, and let it go on after a time [s]."""
    os.kill(process._process.pid, signal.SIGSTOP)
    publish()
    time.sleep(seconds)
    os.kill(process._process.pid, signal.SIGCONT)


@pytest.mark.parametrize(('topic', 'kept'), [('joint_states', BURST), ('reference_odom', 10)])
def test_fast_topics_are_queued_for_a_quarter_of_a_second_at_1000_hz(listener, topic, kept):
    """One node sends to itself, so that nothing but the queue decides what is kept."""
    from std_msgs.msg import Int64

    from wheel_terra_estimator.ros.qos import FAST_DEPTH, input_profile

    assert FAST_DEPTH >= 1000.0 * HELD_UP >= BURST
    assert {input_profile(t).depth for t in ('joint_states', 'odom', 'imu/data')} == {FAST_DEPTH}
    node, until = listener
    received = []
    publisher = node.create_publisher(Int64, 'queued', 1000)
    profile = input_profile(topic)
    node.create_subscription(Int64, 'queued', lambda m: received.append(m.data), profile)
    until(lambda: (publisher.publish(Int64(data=-1)), received)[1])
    for number in range(BURST):  # nobody takes them meanwhile
        publisher.publish(Int64(data=number))
    until(lambda: received[-1] == BURST - 1)
    assert received[-kept:] == list(range(BURST - kept, BURST))
    assert max(received[:-kept]) == -1


@pytest.mark.parametrize('publishers', [1, 2])
def test_loss_is_told_and_counted(start, heard, rover, publishers):
    node, until, statuses = heard
    stamp = [100_000_000_000]
    senders = [joint_states(node, stamp) for _ in range(publishers)]
    process = start('estimator_node', *rover)
    until(lambda: all(publisher.get_subscription_count() for publisher, _ in senders))
    sent = 0

    def send(count=1):
        nonlocal sent
        for _ in range(count):
            senders[sent % publishers][1]()
            sent += 1

    def figure(name):
        return int(values(statuses[-1]).get(f'joint_states_{name}', 0)) if statuses else 0

    # Publishers take turns: that alone is no loss. Every second the node looks how many there are.
    begin = time.monotonic()
    until(lambda: (send(), figure('received') > 10 and time.monotonic() - begin > 2.0)[1])
    settled = time.monotonic() + 2.0 * STATUS_PERIOD
    until(lambda: time.monotonic() > settled)
    unheard = sent - figure('received')  # before the two had found each other
    assert unheard < 10
    assert figure('lost') == 0
    hold_up(process, HELD_UP, lambda: send(1500))
    until(lambda: (send(), 'messages lost on the way' in statuses[-1].message)[1])
    assert statuses[-1].level[0] == 1
    if publishers == 1:
        until(lambda: unheard + figure('received') + figure('lost') == sent)
    else:
        until(lambda: figure('lost') > 100)  # as the middleware counts
