# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Convert the CSV tables of the FrostyBoy immobilisations to recordings.

Two of the nine events come as bags; this makes the others of the same kind, for tests::

    python tools/frostyboy_csv_to_bag.py ../shared/measured/frostyboy_snow/event_1_3.csv OUT

Axes: yaw rates of the tables count clockwise positive; ``angAccel_*`` are rates, in spite of their
name. Covariances are placeholders.
"""

from __future__ import annotations

import argparse
import csv
import math
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from wheel_terra_estimator.bags.bag_file import BagFile
from wheel_terra_estimator.bags.message_factory import MessageFactory

WHEELS = {
    'fl': 'front_left_wheel_joint',
    'fr': 'front_right_wheel_joint',
    'rl': 'rear_left_wheel_joint',
    'rr': 'rear_right_wheel_joint',
}
RADIUS = 0.265  # [m]
TRACK = 1.14224  # [m] (1.142 in print)
START = 1_583_940_000_000_000_000  # [ns], the day of the drives
TOPICS = {
    '/joint_states': 'sensor_msgs/msg/JointState',
    '/imu/data': 'sensor_msgs/msg/Imu',
    '/wheel/odometry': 'nav_msgs/msg/Odometry',
    '/truth/odometry': 'nav_msgs/msg/Odometry',
}


def read_rows(path: Path) -> list[dict[str, float]]:
    """Return the rows of a table; empty cells are nan."""
    with path.open(encoding='utf-8') as file:
        return [
            {key: float(text) if text else math.nan for key, text in row.items()}
            for row in csv.DictReader(file)
        ]


def messages(
    rows: Sequence[dict[str, float]], make: MessageFactory
) -> Iterator[tuple[str, Any, int]]:
    """Yield (topic, message, log time [ns]) of a table."""
    loose = (0.01 * np.eye(6)).reshape(36)
    tight = (0.001 * np.eye(6)).reshape(36)
    for row in rows:
        stamp = START + round(row['t'] * 1e9)
        rate = np.array([row[f'w{wheel}'] for wheel in WHEELS])
        torque = np.array([row[f'T_{wheel}'] for wheel in WHEELS])
        yield (
            '/joint_states',
            make.joint_state(make.header(stamp, ''), WHEELS.values(), velocity=rate, effort=torque),
            stamp,
        )
        attitude = Rotation.from_euler('xy', [row['roll'], row['pitch']], degrees=True).as_quat()
        yield (
            '/imu/data',
            make.imu(
                make.header(stamp, 'imu_link'),
                (row['a_X'], row['a_Y'], row['a_Z']),
                (row['angAccel_X'], -row['angAccel_Y'], -row['angAccel_Z']),
                attitude,
                (1e-3, 1e-5, 1e-2),
            ),
            stamp,
        )
        rim = RADIUS * rate
        turning = (rim[1] + rim[3] - rim[0] - rim[2]) / (2.0 * TRACK)
        wheel = make.twist_with_covariance(float(rim.mean()), float(turning), loose)
        yield '/wheel/odometry', make.odometry(make.header(stamp, 'odom'), wheel), stamp
        truth = make.twist_with_covariance(row['v_X'], 0.0, tight)
        yield '/truth/odometry', make.odometry(make.header(stamp, 'enu'), truth), stamp


def convert(table: Path, folder: Path, overwrite: bool = False) -> None:
    """Write the recording of a table."""
    with BagFile(folder, TOPICS, overwrite=overwrite) as file:
        for topic, message, log_time in messages(read_rows(table), file.messages):
            file.write(topic, message, log_time)


def main() -> int:
    """Run the tool."""
    parser = argparse.ArgumentParser(description='FrostyBoy CSV table to a rosbag2 folder.')
    parser.add_argument('table', type=Path)
    parser.add_argument('folder', type=Path)
    parser.add_argument('--overwrite', action='store_true')
    arguments = parser.parse_args()
    convert(arguments.table, arguments.folder, arguments.overwrite)
    return 0


if __name__ == '__main__':
    sys.exit(main())
