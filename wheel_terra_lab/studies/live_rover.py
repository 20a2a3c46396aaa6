# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A rover that publishes its sensors live, and a listener to the estimates; for load and soak."""

from __future__ import annotations

import atexit
import math
import os
import random
import subprocess
import sys
import time
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
from rclpy.executors import Executor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import Imu, JointState

NODE = '/wheel_terra_estimator'
TICKS = os.sysconf('SC_CLK_TCK')
NOISES = 997
"""Draws of noise that are used in turn."""


class Process:
    """A node in a process of its own, with what it costs."""

    def __init__(self, arguments: Sequence[str]) -> None:
        self._popen = subprocess.Popen([sys.executable, *arguments])
        atexit.register(self._popen.kill)  # if it still runs then: this program was interrupted

    def seconds(self) -> float:
        """Return the processor time so far [s]."""
        fields = Path(f'/proc/{self._popen.pid}/stat').read_text().rpartition(')')[2].split()
        return (int(fields[11]) + int(fields[12])) / TICKS

    def resident(self) -> float:
        """Return the resident memory [MB]."""
        lines = Path(f'/proc/{self._popen.pid}/status').read_text().splitlines()
        return int(next(x for x in lines if x.startswith('VmRSS')).split()[1]) / 1024.0

    def runs(self) -> bool:
        """Whether it has not ended."""
        return self._popen.poll() is None

    def signal(self, number: int) -> None:
        """Send a signal."""
        self._popen.send_signal(number)

    def end(self, number: int) -> int:
        """Send a signal and return the exit status."""
        self.signal(number)
        return self._popen.wait(60.0)


class Rover(Node):
    """Publishes joint states, IMU, sinkage and a reference; hears slip and diagnostics."""

    def __init__(
        self,
        names: Sequence[str],
        rates: dict[str, float],  # topic -> messages per second
        # Takes topic and message and sends it, or does something worse
        send: Callable[[str, Any, Callable[[Any], None]], None] | None = None,
        **options: Any,
    ) -> None:
        super().__init__('rover', **options)
        self.names = list(names)
        kinds = {
            'joint_states': JointState,
            'imu/data': Imu,
            'sinkage': JointState,
            'reference_odom': Odometry,
        }
        profile = QoSProfile(depth=100)
        self._senders = {t: self.create_publisher(kinds[t], t, profile) for t in rates}
        self._periods = {topic: 1.0 / rate for topic, rate in rates.items()}
        begin = time.monotonic()
        self._due = dict.fromkeys(rates, begin)
        self._send = send or (lambda topic, message, publish: publish(message))
        self.sent: deque[tuple[int, float]] = deque(maxlen=5000)
        self.count = dict.fromkeys(rates, 0)
        self.latencies: list[float] = []
        self.sets = 0
        self.not_finite = 0
        self.heard_at = 0.0
        self.levels: list[tuple[float, int, str]] = []
        self.values: dict[str, str] = {}
        self.said = ''
        self.diagnostics = 0  # messages
        self.shift = 0  # of all stamps [ns]
        count = 2 * len(self.names)
        self._noise = [[random.gauss(0.0, 1.0) for _ in range(count)] for _ in range(NOISES)]
        self.create_subscription(JointState, f'{NODE}/slip', self._on_slip, 100)
        for topic in ('sinkage', 'slip_stddev', 'sinkage_stddev', 'mobility', 'soil'):
            self.create_subscription(JointState, f'{NODE}/{topic}', self._on_other, 100)
        self.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, 100)

    def publish_due(self) -> float:
        """Send what is due; return when the next message is."""
        now = time.monotonic()
        for topic, due in self._due.items():
            if now >= due:
                # A machine that was held up sends no burst.
                self._due[topic] = max(due + self._periods[topic], now - 0.05)
                stamp = time.time_ns() + self.shift
                self.count[topic] += 1
                self._send(topic, self._message(topic, stamp), self._senders[topic].publish)
                if topic == 'joint_states':
                    self.sent.append((stamp, time.monotonic()))
        return min(self._due.values())

    def _message(self, topic: str, stamp: int) -> Any:
        seconds = stamp * 1e-9
        rate = 0.5 + 0.2 * math.sin(0.3 * seconds)
        n = len(self.names)
        message: Any
        if topic == 'joint_states':
            message = JointState(name=self.names)
            # Drawn once and for all: at 1000 Hz the rover itself must not be what costs most.
            noise = self._noise[self.count[topic] % len(self._noise)]
            message.velocity = [rate + 0.01 * part for part in noise[:n]]
            message.effort = [3.0 + 0.2 * part for part in noise[n:]]
        elif topic == 'imu/data':
            message = Imu()
            message.orientation.w = 1.0
            message.linear_acceleration.x = random.gauss(0.0, 0.05)
            message.linear_acceleration.z = 9.80665 + random.gauss(0.0, 0.05)
        elif topic == 'sinkage':
            message = JointState(name=self.names)
            message.position = [0.02 + random.gauss(0.0, 0.001) for _ in range(n)]
        else:
            message = Odometry()
            message.twist.twist.linear.x = 0.12 * rate
            message.twist.covariance[0] = 1e-4
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 1_000_000_000)
        return message

    def _on_slip(self, message: JointState) -> None:
        now = time.monotonic()
        self.heard_at = now
        self.sets += 1
        self._on_other(message)
        stamp = message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec
        for sent, at in reversed(self.sent):
            if sent == stamp:
                self.latencies.append(now - at)
                break

    def _on_other(self, message: JointState) -> None:
        for values in (message.position, message.velocity, message.effort):
            self.not_finite += sum(not math.isfinite(value) for value in values)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name.endswith(': estimator'):
                level = status.level[0]
                self.values = {value.key: value.value for value in status.values}
                self.said = status.message
                self.diagnostics += 1
                if not self.levels or self.levels[-1][1] != level:
                    self.levels.append((time.monotonic(), level, status.message))


def serve(
    rover: Any,
    executor: Executor,
    seconds: float,
    until: Callable[[], bool] = lambda: False,
    before: Callable[[], None] = lambda: None,
) -> bool:
    """Let a rover publish and hear for so long, or till a condition holds; say whether it does."""
    end = time.monotonic() + seconds
    while not (holds := until()) and time.monotonic() < end:
        before()
        due = rover.publish_due()
        wait = max(min(due, end, time.monotonic() + 0.01) - time.monotonic(), 0.0)
        executor.spin_once(timeout_sec=wait)
    return holds


def quantile(values: Sequence[float], share: float) -> float:
    """Return a quantile; nan of nothing."""
    ordered = sorted(values)
    return ordered[min(int(share * len(ordered)), len(ordered) - 1)] if ordered else math.nan
