# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What the node costs, beside a node with the same topics that does nothing: medians of pairs.

::

    python -m wheel_terra_lab.studies.node_load --odometry 100 --imu 100 --pairs 5 --seconds 20
    python -m wheel_terra_lab.studies.node_load --late imu/data --delay 0.5 --jitter 0.2

The second kind compares the node with late messages with itself with punctual ones.
"""

from __future__ import annotations

import argparse
import heapq
import random
import signal
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

import rclpy
from rclpy.executors import SingleThreadedExecutor

from wheel_terra_estimator.configuration import reader
from wheel_terra_lab.studies.live_rover import Process, Rover, quantile

OUTPUTS = ('slip', 'sinkage', 'slip_stddev', 'sinkage_stddev', 'mobility', 'soil')


class LateLink:
    """Sends the messages of one topic late.

    Parameters
    ----------
    topic : str
        Which; empty text: none.
    delay, jitter : float
        How late [s], and by what share of it more or less at random.
    """

    def __init__(self, topic: str, delay: float, jitter: float) -> None:
        self._topic, self._delay, self._jitter = topic, delay, jitter
        self._held: list[tuple[float, int, Callable[[Any], None], Any]] = []
        self._count = 0

    def send(self, topic: str, message: Any, publish: Callable[[Any], None]) -> None:
        """Send a message at once or hold it back."""
        if topic != self._topic:
            publish(message)
            return
        delay = self._delay * (1.0 + self._jitter * random.uniform(-1.0, 1.0))
        self._count += 1
        heapq.heappush(self._held, (time.monotonic() + delay, self._count, publish, message))

    def release(self) -> float:
        """Send what is due; return when the next message is."""
        while self._held and self._held[0][0] <= time.monotonic():
            _, _, publish, message = heapq.heappop(self._held)
            publish(message)
        return self._held[0][0] if self._held else float('inf')


def floor_node(executor: str) -> None:
    """Hear the inputs, publish sets of the same size at 20 Hz, estimate nothing."""
    import filterpy.kalman
    import numpy  # noqa: F401
    from nav_msgs.msg import Odometry
    from rclpy.experimental import EventsExecutor
    from sensor_msgs.msg import Imu, JointState

    assert filterpy.kalman
    rclpy.init(args=[])
    node = rclpy.create_node('wheel_terra_estimator')
    publishers = [node.create_publisher(JointState, f'~/{topic}', 10) for topic in OUTPUTS]
    message = JointState(name=[f'wheel_{i}' for i in range(6)])
    message.position = message.velocity = message.effort = [0.0] * 6
    last = [0]

    def hear(heard: Any) -> None:
        stamp = heard.header.stamp
        slot = (stamp.sec * 1_000_000_000 + stamp.nanosec) // 50_000_000
        if slot != last[0]:
            last[0] = slot
            message.header = heard.header
            for publisher in publishers:
                publisher.publish(message)

    node.create_subscription(JointState, 'joint_states', hear, 250)
    for kind, topic in ((Imu, 'imu/data'), (JointState, 'sinkage'), (Odometry, 'reference_odom')):
        node.create_subscription(kind, topic, lambda heard: None, 250)
    chosen = EventsExecutor() if executor == 'events' else SingleThreadedExecutor()
    chosen.add_node(node)
    while rclpy.ok():
        chosen.spin_once(timeout_sec=0.1)


def run(
    arguments: argparse.Namespace, command: list[str], names: tuple[str, ...], late: str = ''
) -> dict[str, float]:
    """Run one node for a while, one topic late; return what it cost."""
    rclpy.init(args=[])
    rates = {'joint_states': arguments.odometry, 'imu/data': arguments.imu}
    link = LateLink(late, arguments.delay, arguments.jitter)
    rover = Rover(names, rates | {'sinkage': 20.0, 'reference_odom': 1.0}, link.send)
    executor = SingleThreadedExecutor()
    executor.add_node(rover)
    begin = time.monotonic()
    process = Process(command)

    def serve(seconds: float) -> None:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            due = min(rover.publish_due(), link.release())
            executor.spin_once(timeout_sec=max(min(due, end) - time.monotonic(), 0.0))

    while not rover.sets and time.monotonic() - begin < 30.0:
        serve(0.05)
    first, cpu_first = time.monotonic() - begin, process.seconds()
    serve(6.0)
    rover.latencies.clear()
    before, wall, sent = process.seconds(), time.monotonic(), rover.count['joint_states']
    sets = rover.sets
    serve(arguments.seconds)
    result = {
        'cpu': 100.0 * (process.seconds() - before) / (time.monotonic() - wall),
        'cpu_first': cpu_first,
        'sets': (rover.sets - sets) / (time.monotonic() - wall),
        'p50': 1e3 * quantile(rover.latencies, 0.5),
        'p99': 1e3 * quantile(rover.latencies, 0.99),
        'rss': process.resident(),
        'first': first,
        'rate': (rover.count['joint_states'] - sent) / (time.monotonic() - wall),
    }
    if 'joint_states_lost' in rover.values:
        result['lost'] = float(rover.values['joint_states_lost'])
        result['lost_share'] = 100.0 * result['lost'] / max(rover.count['joint_states'], 1)
    process.end(signal.SIGKILL)
    rover.destroy_node()
    rclpy.shutdown()
    return result


def _median(values: list[float | None]) -> str:
    known = [value for value in values if value is not None]
    return f'{median(known):9.3f}' if known else f'{"-":>9}'


def main() -> int:
    """Run the pairs and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--odometry', type=float, default=100.0)
    parser.add_argument('--imu', type=float, default=100.0)
    parser.add_argument('--executor', default='events', choices=('events', 'single_threaded'))
    parser.add_argument('--pairs', type=int, default=5)
    parser.add_argument('--seconds', type=float, default=20.0)
    parser.add_argument('--late', default='', help='topic whose messages come late')
    parser.add_argument('--delay', type=float, default=0.5, help='how late [s]')
    parser.add_argument('--jitter', type=float, default=0.0, help='share of it, more or less')
    parser.add_argument('--floor', action='store_true', help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.floor:
        floor_node(arguments.executor)
        return 0
    configuration = reader.load(['generic_six_wheel'])
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'rover.yaml'
        configuration.write(path)
        module = ['-m', 'wheel_terra_estimator.ros.estimator_node', '--ros-args']
        node = [*module, '--params-file', str(path), '-p', f'executor:={arguments.executor}']
        floor = [__file__, '--floor', '--executor', arguments.executor]
        names = configuration.wheels.names
        pairs = [
            (
                run(arguments, node if arguments.late else floor, names),
                run(arguments, node, names, arguments.late),
            )
            for _ in range(arguments.pairs)
        ]
    first, second = ('punctual', 'late') if arguments.late else ('floor', 'node')
    print(f'            {first:9} {second:9} ratio   (cpu: % of a core; p50, p99: ms; rss: MB)')
    keys = ('cpu', 'p50', 'p99', 'rss', 'first', 'cpu_first', 'sets', 'rate', 'lost', 'lost_share')
    for key in keys:
        floor_values, node_values = ([pair[i].get(key) for pair in pairs] for i in (0, 1))
        words = [_median(floor_values), _median(node_values)]
        if None not in floor_values and all(floor_values):
            words.append(_median([b / a for a, b in zip(floor_values, node_values, strict=True)]))
        print(f'{key:11}', *words)
    return 0


if __name__ == '__main__':
    sys.exit(main())
