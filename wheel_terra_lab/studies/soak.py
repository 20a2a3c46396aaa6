# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The node for minutes or hours under random faults of transport, content and processes.

::

    python -m wheel_terra_lab.studies.soak --minutes 60 --seed 1

Faults come one after the other with a pause of health between them. The table says for each kind
how often it came, how often the node said so, and how long it took until sets flowed again. The
exit status is 1 where the node ended, sent a number that is not finite, or did not come back to OK.
``--one-process`` leaves out the restarts of the node: only so is its memory that of hours.
"""

from __future__ import annotations

import argparse
import copy
import math
import random
import signal
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable, Sequence
from pathlib import Path
from statistics import median
from typing import Any

import rclpy
from rclpy.executors import SingleThreadedExecutor

from wheel_terra_estimator.configuration import reader
from wheel_terra_lab.studies.live_rover import Process, Rover, quantile, serve

RATES = {'joint_states': 50.0, 'imu/data': 100.0, 'sinkage': 10.0, 'reference_odom': 1.0}
HEALTH = 4.0  # [s] between two faults at least
RECOVERY = 17.0  # [s]: a fault is told of for 10 s
SETTLED = 600.0  # [s] after which memory must not grow
GROWTH = 2.0  # [MB]
LOST = 'messages lost in transport so far'
AHEAD = 'set the clocks, or stamp in the driver'  # as the clock of the rover here may be

FAULTS = (
    'drop',
    'duplicate',
    'reorder',
    'delay',
    'nan',
    'clock back',
    'clock ahead',
    'publishers silent',
    'node restarted',
)


class FaultyLink:
    """Between the rover and its publishers: does to messages what a fault asks for."""

    def __init__(self) -> None:
        self.fault = ''
        self._held: list[tuple[float, Callable[[Any], None], Any]] = []

    def send(self, topic: str, message: Any, publish: Callable[[Any], None]) -> None:
        """Send a message, or not, or late, or spoilt."""
        now = time.monotonic()
        if self.fault == 'publishers silent' or (self.fault == 'drop' and random.random() < 0.3):
            return
        if self.fault == 'delay' and topic == 'imu/data':
            self._held.append((now + random.uniform(0.2, 0.3), publish, message))
            return
        if self.fault == 'reorder' and random.random() < 0.2:
            self._held.append((now + 0.03, publish, message))
            return
        if self.fault == 'nan':
            self._spoil(topic, message)
        publish(message)
        if self.fault == 'duplicate':
            publish(copy.deepcopy(message))

    def release(self) -> None:
        """Send what was held back and is due."""
        now = time.monotonic()
        due = [held for held in self._held if held[0] <= now]
        self._held = [held for held in self._held if held[0] > now]
        for _, publish, message in due:
            publish(message)

    def _spoil(self, topic: str, message: Any) -> None:
        bad = random.choice((math.nan, math.inf, -math.inf, 1e300))
        if topic == 'joint_states':
            message.velocity[random.randrange(len(message.velocity))] = bad
            message.effort[0] = bad
        elif topic == 'imu/data':
            message.linear_acceleration.x = bad
        elif topic == 'sinkage':
            message.position[0] = bad
        else:
            message.twist.twist.linear.x = bad


class Soak:
    """One run: rover, node, faults, and what was seen; the node's files lie in `folder`."""

    def __init__(self, folder: Path, seconds: float, faults: Sequence[str] = FAULTS) -> None:
        configuration = reader.load(['generic_six_wheel'])
        parameters = folder / 'rover.yaml'
        configuration.write(parameters)
        module = ['-m', 'wheel_terra_estimator.ros.estimator_node', '--ros-args']
        soil = ['-p', f'soil_file:={folder / "soil.yaml"}']
        self._command = [*module, '--params-file', str(parameters), *soil]
        self._link = FaultyLink()
        self.rover = Rover(configuration.wheels.names, RATES, self._link.send)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.rover)
        self._node = Process(self._command)
        self._seconds, self._faults = seconds, tuple(faults)
        self._started = time.monotonic()  # the present process
        self.grown = 0.0  # most memory since the first ten minutes of a process [MB]
        self._settled: float | None = None
        self._began = time.monotonic()
        self.memory: list[tuple[float, float]] = []
        self.recoveries: dict[str, list[float]] = defaultdict(list)
        self.told: dict[str, int] = defaultdict(int)
        self.problems: list[str] = []

    def run(self) -> None:
        """Run, from the first set on, until the time is over."""
        self._wait(lambda: self.rover.sets > 0, 60.0)
        self._wait(self._is_well, 30.0)
        self._began = time.monotonic()
        order: list[str] = []
        while time.monotonic() - self._began < self._seconds and self._node.runs():
            if not order:
                order = random.sample(self._faults, len(self._faults))
            self._one_fault(order.pop())
            self._serve(random.uniform(0.2, 1.0) * HEALTH)
            if self._node.runs():
                self._note_memory()
        if self._node.runs():
            status = self._node.end(signal.SIGINT)
            if status:
                self.problems.append(f'the node ended with status {status}')
        if self.rover.not_finite:
            self.problems.append(f'{self.rover.not_finite} numbers are not finite')
        if self.grown > GROWTH:
            self.problems.append(f'memory grew by {self.grown:.1f} MB after ten minutes')

    def _one_fault(self, fault: str) -> None:
        levels = len(self.rover.levels)
        begin = time.monotonic()
        if fault == 'node restarted':
            status = self._node.end(random.choice((signal.SIGINT, signal.SIGTERM)))
            if status:
                self.problems.append(f'the node ended with status {status}')
            self._node = Process(self._command)
            self._started = begin = time.monotonic()
            self._settled = None
        elif fault in ('clock back', 'clock ahead'):
            self.rover.shift += round((-30.0 if fault == 'clock back' else 1.5) * 1e9)
            begin = time.monotonic()
        else:
            self._link.fault = fault
            self._serve(random.uniform(2.0, 4.0))
            self._link.fault = ''
            begin = time.monotonic()
        sets = self.rover.sets
        flows = self._wait(lambda: self.rover.sets > sets + 5, 60.0)
        if flows:
            self.recoveries[fault].append(time.monotonic() - begin)
        if not flows or not self._wait(self._is_well, RECOVERY + 30.0):
            words = self.rover.levels[-1][2] if self.rover.levels else 'nothing'
            self.problems.append(f'no recovery from: {fault}; the node says: {words}')
        self.told[fault] += any(level for _, level, _ in self.rover.levels[levels:])
        if not self._node.runs():
            self.problems.append(f'the node ended by itself at: {fault}')

    def _note_memory(self) -> None:
        now, memory = time.monotonic(), self._node.resident()
        self.memory.append((now - self._began, memory))
        if now - self._started > SETTLED:
            if self._settled is None:
                self._settled = memory
            self.grown = max(self.grown, memory - self._settled)

    def _is_well(self) -> bool:
        """Whether the node says OK, or what a machine without time loses and its clock is."""
        if not self.rover.levels:
            return False
        said = self.rover.said.split('; ')
        return self.rover.levels[-1][1] == 0 or all(words.endswith((LOST, AHEAD)) for words in said)

    def _wait(self, condition: Callable[[], bool], seconds: float) -> bool:
        return serve(self.rover, self._executor, seconds, condition, self._link.release)

    def _serve(self, seconds: float) -> None:
        serve(self.rover, self._executor, seconds, before=self._link.release)

    def report(self) -> str:
        """Return the table."""
        lines = [
            f'{"fault":18} {"times":>6} {"warned":>6} {"estimates again, median; worst [s]":>36}'
        ]
        for fault in FAULTS:
            times = self.recoveries.get(fault)
            if times:
                figures = f'{median(times):.2f}; {max(times):.2f}'
                lines.append(f'{fault:18} {len(times):6} {self.told[fault]:6} {figures:>36}')
        latencies = self.rover.latencies
        half, most = 1e3 * quantile(latencies, 0.5), 1e3 * quantile(latencies, 0.99)
        lines.append(f'sets {self.rover.sets}; latency p50 {half:.1f} ms, p99 {most:.1f} ms')
        if self.memory:
            memory = [mb for _, mb in self.memory]
            lines.append(f'resident memory {min(memory):.1f} to {max(memory):.1f} MB')
            if self._settled is not None:
                lines.append(f'of the last process: + {self.grown:.2f} MB after ten minutes')
        lost = {
            key: n for key, n in self.rover.values.items() if key.endswith('_lost') and n != '0'
        }
        lines.append(f'lost in transport, of the last process: {lost or "nothing"}')
        lines += [f'PROBLEM: {problem}' for problem in self.problems]
        return '\n'.join(lines)


def main() -> int:
    """Run the soak and print the table."""
    parser = argparse.ArgumentParser(description='The node under random faults.')
    parser.add_argument('--minutes', type=float, default=2.0)
    parser.add_argument('--seed', type=int, default=0)
    parser.add_argument('--one-process', action='store_true', help='without restarts of the node')
    arguments = parser.parse_args()
    random.seed(arguments.seed)
    rclpy.init(args=[])
    with tempfile.TemporaryDirectory() as folder:
        faults = [f for f in FAULTS if not (arguments.one_process and f == 'node restarted')]
        soak = Soak(Path(folder), 60.0 * arguments.minutes, faults)
        try:
            soak.run()
        finally:
            print(soak.report())
            soak.rover.destroy_node()
            rclpy.try_shutdown()
    return 1 if soak.problems else 0


if __name__ == '__main__':
    sys.exit(main())
