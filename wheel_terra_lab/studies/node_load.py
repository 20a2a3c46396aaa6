# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What the node costs, beside a node with the same topics that does nothing: medians of pairs.

::

    python -m wheel_terra_lab.studies.node_load --odometry 100 --imu 100 --pairs 5 --seconds 20
"""

from __future__ import annotations

import argparse
import signal
import sys
import tempfile
import time
from pathlib import Path
from statistics import median
from typing import Any

import rclpy
from rclpy.executors import SingleThreadedExecutor

from wheel_terra_estimator.configuration import reader
from wheel_terra_lab.studies.live_rover import Process, Rover, quantile, serve

OUTPUTS = ('slip', 'sinkage', 'slip_stddev', 'sinkage_stddev', 'mobility', 'soil')


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
    arguments: argparse.Namespace, command: list[str], names: tuple[str, ...]
) -> dict[str, float]:
    """Run one node for a while; return what it cost."""
    rclpy.init(args=[])
    rates = {'joint_states': arguments.odometry, 'imu/data': arguments.imu}
    rover = Rover(names, rates | {'sinkage': 20.0, 'reference_odom': 1.0})
    executor = SingleThreadedExecutor()
    executor.add_node(rover)
    begin = time.monotonic()
    process = Process(command)

    while not rover.sets and time.monotonic() - begin < 30.0:
        serve(rover, executor, 0.05)
    first, cpu_first = time.monotonic() - begin, process.seconds()
    serve(rover, executor, 6.0)
    rover.latencies.clear()
    before, wall, sent = process.seconds(), time.monotonic(), rover.count['joint_states']
    sets = rover.sets
    serve(rover, executor, arguments.seconds)
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
    rclpy.try_shutdown()
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
            (run(arguments, floor, names), run(arguments, node, names))
            for _ in range(arguments.pairs)
        ]
    print('            floor     node      ratio   (cpu: % of a core; p50, p99: ms; rss: MB)')
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
