# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Small recordings made on the spot, and the way to the measured ones."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from wheel_terra_estimator.bags.bag_file import BagFile
from wheel_terra_estimator.bags.message_factory import MessageFactory
from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.messages.convert import INPUT_TYPES

NAMES = ('left', 'right')
RATE = 2.0  # [rad/s]
START = 1_700_000_000_000_000_000  # [ns]
STEP = 100_000_000  # [ns]


@pytest.fixture(scope='session')
def shared() -> Path:
    """The measured data beside the project; tests that need it are skipped without."""
    folder = Path(__file__).resolve().parents[2] / 'shared' / 'measured'
    if not folder.is_dir():
        pytest.skip('the measured data in ../shared is not here')
    return folder


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures are made, but not drawn (half a second each): for tests of words."""
    from matplotlib.figure import Figure

    def savefig(self: Figure, file: Any, **_: Any) -> None:
        if isinstance(file, io.TextIOBase):
            file.write('picture')
        elif isinstance(file, Path):
            file.write_bytes(b'picture')
        else:
            file.write(b'picture')

    monkeypatch.setattr(Figure, 'savefig', savefig)


@pytest.fixture(scope='session')
def factory() -> MessageFactory:
    return MessageFactory()


@pytest.fixture
def rover() -> Configuration:
    """A cart with two wheels; the joint of the right one counts negative forward."""
    return reader.from_parameters(
        {
            'wheels.names': list(NAMES),
            'wheels.radius': [0.2, 0.2],
            'wheels.width': [0.15, 0.15],
            'wheels.lug_height': [0.01, 0.01],
            'wheels.y': [0.4, -0.4],
            'wheels.direction': [1, -1],
            'rover.mass': 40.0,
        }
    )


@pytest.fixture(scope='session')
def drive(factory: MessageFactory) -> list[tuple[str, Any, int]]:
    """(topic, message, log time) of a straight drive at constant rate on level ground."""
    return list(drive_messages(factory))


@pytest.fixture(scope='session')
def make_drive(factory: MessageFactory) -> Callable[[int], Iterator[tuple[str, Any, int]]]:
    """Make such a drive of any length, in steps of the wheel odometry."""
    return lambda steps: drive_messages(factory, steps)


def drive_messages(factory: MessageFactory, steps: int = 40) -> Iterator[tuple[str, Any, int]]:
    for step in range(steps):
        stamp = START + step * STEP
        header = factory.header(stamp)
        joints = factory.joint_state(
            header, ('arm', *NAMES), velocity=(9.0, RATE, -RATE), effort=(0.0, 3.0, -3.0)
        )
        yield '/joint_states', joints, stamp + 1_000_000
        imu = factory.imu(header, (0.1, 0.0, 9.8), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
        yield '/imu/data', imu, stamp + 2_000_000
        if step % 10 == 0:
            twist = factory.twist_with_covariance(0.36, 0.0, [1e-6] + [0.0] * 35)
            yield '/reference_odom', factory.odometry(header, twist), stamp + 3_000_000


DRIVE_TOPICS = {
    '/joint_states': INPUT_TYPES['joint_states'],
    '/imu/data': INPUT_TYPES['imu/data'],
    '/reference_odom': INPUT_TYPES['reference_odom'],
}

MakeBag = Callable[..., Path]


@pytest.fixture
def make_bag(tmp_path: Path, drive: list[tuple[str, Any, int]]) -> MakeBag:
    """Write a bag, by default that of `drive`."""

    def make(
        messages: Any = None,
        topics: dict[str, str] | None = None,
        name: str = 'drive',
        storage: str = 'mcap',
    ) -> Path:
        path = tmp_path / name
        with BagFile(path, topics or DRIVE_TOPICS, storage=storage) as file:
            for topic, message, log_time in drive if messages is None else messages:
                file.write(topic, message, log_time)
        return path

    return make
