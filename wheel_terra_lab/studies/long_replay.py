# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Memory of a replay over hours: a drive made up while it is read, nothing of it on disk.

    python -m wheel_terra_lab.studies.long_replay --hours 10 --report drive.html

The rover drives, turns, digs in and comes out again; joint states, IMU and sinkage are messages as
they lie in a recording, unpacked and heard as in ``wheel-terra replay``. The memory of the process
is printed for every half hour of the drive, then with the report. Exit status 1 if it was ever
above the limit, or grew after the first hour.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Collection, Iterator
from pathlib import Path

import numpy as np

from wheel_terra_estimator.bags.message_factory import MessageFactory
from wheel_terra_estimator.bags.replay import replay
from wheel_terra_estimator.bags.salvage.raw_messages import RawMessage, Topic
from wheel_terra_estimator.bags.storage import Bag
from wheel_terra_estimator.configuration import reader as configuration_reader
from wheel_terra_estimator.messages.convert import INPUT_TYPES
from wheel_terra_estimator.reporting.drive_style import Border
from wheel_terra_estimator.reporting.drive_summary import as_text, summarise
from wheel_terra_estimator.reporting.replay_report import write_replay_report

LIMIT = 250.0
"""Memory of the whole program [MB]."""
GROWTH = 5.0
"""Memory that may come after the first hour, before the report is written [MB]."""
START = 1_700_000_000_000_000_000
"""Stamp of the first message [ns]."""
LAP = 60.0
"""Time after which the drive repeats itself [s]."""
HALF_HOUR = 1800.0  # [s]
TOPICS = ('joint_states', 'imu/data', 'sinkage')
ROVER = {
    'wheels.names': ['left', 'right'],
    'wheels.radius': [0.2, 0.2],
    'wheels.width': [0.15, 0.15],
    'wheels.y': [0.4, -0.4],
    'rover.mass': 40.0,
}


class LongDrive(Bag):
    """A recording that is made up while it is read.

    Parameters
    ----------
    hours : float
        How long it is [h].
    rate : float
        Joint states and IMU messages per second; one sinkage for ten of them [Hz].
    """

    def __init__(self, hours: float, rate: float) -> None:
        super().__init__(Path('long_drive'), [], [])
        self._steps = int(hours * 3600.0 * rate)
        self._rate = rate
        counts = (self._steps, self._steps, self._steps // 10)
        self.topics = {
            f'/{name}': Topic(f'/{name}', INPUT_TYPES[name], count)
            for name, count in zip(TOPICS, counts, strict=True)
        }
        self.memory: list[tuple[float, float]] = []  # (time of the drive [s], memory [MB])

    def messages(self, topics: Collection[str]) -> Iterator[RawMessage]:
        """Yield the messages; measure the memory every half hour of the drive."""
        lap = _lap(self._rate)
        due = HALF_HOUR
        for step in range(self._steps):
            seconds = step / self._rate
            if seconds >= due:
                self.measure(seconds)
                due += HALF_HOUR
            stamp = START + round(seconds * 1e9)
            whole, rest = divmod(stamp, 10**9)
            header = whole.to_bytes(4, 'little') + rest.to_bytes(4, 'little')
            for topic, data in lap[step % len(lap)]:
                if topic in topics:
                    # Behind four bytes that name the encoding stands the stamp of the header.
                    yield RawMessage(stamp, topic, data[:4] + header + data[12:])

    def measure(self, seconds: float) -> None:
        """Take the memory of the process at a time of the drive [s] and print it."""
        self.memory.append((seconds, resident_memory()))
        used = time.process_time()
        print(f'{seconds / 3600:5.1f} h {self.memory[-1][1]:7.1f} MB {used:8.0f} s', flush=True)


def main() -> int:
    """Run the drive and judge the memory."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('--hours', type=float, default=10.0, metavar='H')
    parser.add_argument(
        '--rate', type=float, default=20.0, metavar='HZ', help='joint states and IMU messages'
    )
    parser.add_argument('-o', dest='output', type=Path, metavar='DIR', help='write the estimates')
    parser.add_argument('--report', type=Path, metavar='F.html')
    arguments = parser.parse_args()
    drive = LongDrive(arguments.hours, arguments.rate)
    configuration = configuration_reader.from_parameters(ROVER)
    print('drive    memory   processor time', flush=True)
    result = replay(drive, configuration, {}, arguments.output)
    drive.measure(arguments.hours * 3600.0)
    summary = summarise(
        'long drive', result.history, result.topics, result.heard, result.rejected, result.notes,
        Border.of(configuration),
    )  # fmt: skip
    if arguments.report:
        write_replay_report(arguments.report, summary, result.history, None, configuration)
        print(f'with the report {resident_memory():.1f} MB')
    print(as_text(summary))
    most = resident_memory(peak=True)
    settled = [memory for seconds, memory in drive.memory if seconds >= 3600.0]
    grown = max(settled) - settled[0] if settled else 0.0
    print(f'at most {most:.1f} MB; after the first hour {grown:.1f} MB more')
    return 1 if most > LIMIT or grown > GROWTH else 0


def resident_memory(peak: bool = False) -> float:
    """Return the resident memory of this process, now or at most [MB]."""
    name = 'VmHWM:' if peak else 'VmRSS:'
    for line in Path('/proc/self/status').read_text(encoding='ascii').splitlines():
        if line.startswith(name):
            return int(line.split()[1]) / 1024.0
    raise RuntimeError(f'no {name} in /proc/self/status')


def _lap(rate: float) -> list[list[tuple[str, bytes]]]:
    """Return the messages of each step of a lap; they are the same in every lap."""
    factory = MessageFactory()
    dice = np.random.default_rng(0)

    def packed(message: object) -> bytes:
        kind = message.__msgtype__  # type: ignore[attr-defined]
        return bytes(factory.store.serialize_cdr(message, kind))

    names = ROVER['wheels.names']
    steps = []
    for step in range(int(LAP * rate)):
        t = step / rate
        header = factory.header(START)
        speed = 2.0 * max(0.0, np.sin(np.pi * t / LAP)) * np.ones(2)  # [rad/s]
        dug_in = 0.01 + 0.06 * np.exp(-(((t - 0.6 * LAP) / 5.0) ** 2))  # [m]
        joints = factory.joint_state(
            header,
            names,
            velocity=speed + dice.normal(0.0, 0.02, 2),
            effort=3.0 + 60.0 * dug_in + dice.normal(0.0, 0.2, 2),
        )
        force = np.array([0.0, 0.0, 9.81]) + dice.normal(0.0, 0.05, 3)
        turn = np.array([0.0, 0.0, 0.1 * np.sin(2.0 * np.pi * t / LAP)])
        imu = factory.imu(header, force, turn, (0.0, 0.0, 0.0, 1.0))
        step_messages = [('/joint_states', packed(joints)), ('/imu/data', packed(imu))]
        if step % 10 == 0:
            sinkage = factory.joint_state(
                header, names, position=dug_in + dice.normal(0.0, 0.002, 2)
            )
            step_messages.append(('/sinkage', packed(sinkage)))
        steps.append(step_messages)
    return steps


if __name__ == '__main__':
    sys.exit(main())
