# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Makes what ``wheel-terra demo`` shows: two recordings and the table of a blind trial.

    python tools/make_demo_bags.py ../shared/measured/bags/wvu_pathfinder_test17_mcap

writes ``data/demo/entrapment`` and ``data/demo/pathfinder`` (compressed MCAP), and the table in
``data/demo/trial``, whose hash it prints for ``wheel_terra_estimator/cli/demo.py``.
"""

from __future__ import annotations

import argparse
import shutil
from pathlib import Path
from tempfile import TemporaryDirectory

from rosbags.rosbag2 import CompressionFormat, CompressionMode, Reader, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from wheel_terra_estimator.bags.simulated_drive import write_simulated_drive
from wheel_terra_estimator.simulation.drive import simulate
from wheel_terra_estimator.simulation.scenario import load
from wheel_terra_lab.trials import trial

DATA = Path(__file__).resolve().parents[1] / 'data' / 'demo'
SCENARIO, SEED, DURATION = 'climb_soft_patch', 36, 112.0
"""A drive with one warning, in time; docs/worth.md says how often others have a false one."""
PIECE = (6.0, 36.0)
"""Part of the Pathfinder drive [s after its start]: standing, starting and driving."""

TRIAL_SEED = 55


def repack(source: Path, target: Path, part: tuple[float, float] | None = None) -> None:
    """Copy a bag, or a part of it [s], with compressed chunks."""
    shutil.rmtree(target, ignore_errors=True)
    store = get_typestore(Stores.ROS2_JAZZY)
    with Reader(source) as reader:
        writer = Writer(target, version=9, storage_plugin=StoragePlugin.MCAP)
        writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
        with writer:
            connections = {
                c.id: writer.add_connection(
                    c.topic,
                    c.msgtype,
                    typestore=store,
                    offered_qos_profiles=c.ext.offered_qos_profiles,
                )
                for c in reader.connections
            }
            start = reader.start_time
            for connection, stamp, data in reader.messages():
                if part is None or part[0] <= (stamp - start) * 1e-9 <= part[1]:
                    writer.write(connections[connection.id], stamp, data)


def main() -> None:
    """Run the program."""
    parser = argparse.ArgumentParser(description='Make the recordings of the demo.')
    parser.add_argument('pathfinder', type=Path, help='rosbag2 of the Pathfinder drive test17')
    arguments = parser.parse_args()
    DATA.mkdir(parents=True, exist_ok=True)
    # An IMU rate of 20 Hz keeps the file small.
    scenario = load(SCENARIO, parameters=['sensors.imu_rate:=20.0'])
    with TemporaryDirectory() as folder:
        plain = Path(folder) / 'entrapment'
        write_simulated_drive(simulate(scenario, SEED, DURATION), plain)
        repack(plain, DATA / 'entrapment')
    repack(arguments.pathfinder, DATA / 'pathfinder', PIECE)
    (DATA / 'trial').mkdir(exist_ok=True)
    print(trial.hide(trial.draw(TRIAL_SEED, None), DATA / 'trial'))


if __name__ == '__main__':
    main()
