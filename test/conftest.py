# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Small recordings made on the spot, and the way to the measured ones."""

from __future__ import annotations

import gc
import io
import logging
import os
import signal
import threading
import traceback
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import hypothesis
import pytest
import yaml
from message_factory import MessageFactory, serialised
from retries import pytest_sessionfinish, pytest_terminal_summary  # noqa: F401
from rosbags.rosbag2 import writer as bag_writer

from wheel_terra_estimator.bags.bag_file import BagFile
from wheel_terra_estimator.bags.storage import jazzy_types
from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.messages.unpack import IMU

# The quick tests draw the same few in each run; `.ci/slow` draws a hundred anew
# (--hypothesis-profile random).
hypothesis.settings.register_profile('random', deadline=None, print_blob=True)
hypothesis.settings.register_profile(
    'same', deadline=None, derandomize=True, database=None, max_examples=30
)
hypothesis.settings.load_profile('same')


def pytest_xdist_auto_num_workers() -> int:
    """Two more than cores: tests of nodes wait most of their time."""
    return (os.cpu_count() or 1) + 2


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Sort the files by name: those of nodes, which wait, lie among those that compute."""
    items.sort(key=lambda item: (item.path.name, item.path))


def pytest_collection_finish() -> None:
    """Search for garbage seldom, and not among the modules: a tenth of the time of all tests."""
    gc.freeze()
    gc.set_threshold(50_000)


NAMES = ('left', 'right')
RATE = 2.0  # [rad/s]
START = 1_700_000_000_000_000_000  # [ns]
STEP = 100_000_000  # [ns]


def pytest_configure() -> None:
    """Let Ctrl-C reach what the tests start: shells start jobs in the background without it."""
    ignored = signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    if ignored and threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signal.default_int_handler)


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


@pytest.fixture
def unproposed(monkeypatch: pytest.MonkeyPatch) -> None:
    """No law is sought for what no effect explains: up to a second for each table."""
    from wheel_terra_estimator.discrepancy import decision

    monkeypatch.setattr(decision, 'propose', lambda *_, **__: None)


@pytest.fixture
def printed(capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """Run a command that ends with a status; return what it prints."""
    from wheel_terra_estimator.cli.main import main

    def run(command: Iterable[Any], status: int = 0) -> str:
        capsys.readouterr()
        assert main([str(part) for part in command]) == status
        return capsys.readouterr().out

    return run


@pytest.fixture
def refused(capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """Run a command that ends with status 2 and one line, which has words; return the line."""
    from wheel_terra_estimator.cli.main import main

    def run(command: Iterable[Any], *words: str) -> str:
        capsys.readouterr()
        try:
            status: Any = main([str(part) for part in command])
        except SystemExit as end:  # of argparse
            status = end.code
        assert status == 2
        said = capsys.readouterr().err
        assert said.count('\n') == 1, said
        assert all(word in said for word in words), said
        return said

    return run


class CompiledYaml:
    """What rosbags uses of ruamel.yaml to write metadata, with the compiled writer of PyYAML.

    The same but for a line break before hashes, and 0.05 s sooner for each bag.
    """

    default_flow_style: bool | None = None

    def __init__(self, typ: str) -> None:
        assert typ == 'safe'

    def dump(self, data: Any, stream: Any) -> None:
        dumper = getattr(yaml, 'CSafeDumper', yaml.SafeDumper)
        yaml.dump(data, stream, dumper, default_flow_style=self.default_flow_style)


LIBRARY_YAML = bag_writer.YAML


@pytest.fixture(scope='session', autouse=True)
def quick_metadata() -> Iterator[None]:
    """Bags of the tests are closed sooner; those of `library_metadata` as they always are."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(bag_writer, 'YAML', CompiledYaml)
        yield


@pytest.fixture(scope='module')
def library_metadata() -> Iterator[None]:
    """Write metadata as the library does, from here on in a file: for tests of what is written."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(bag_writer, 'YAML', LIBRARY_YAML)
        yield


@pytest.fixture(scope='session', autouse=True)
def quick_parsers() -> Iterator[None]:
    """The parsers of a command are made once: 5 ms of each run of one."""
    from wheel_terra_estimator.cli import main

    made, commands = main._parsers, main.COMMANDS
    kept = cache(made)

    def parsers(needed: Iterable[str]) -> Any:
        return kept(tuple(needed)) if main.COMMANDS is commands else made(tuple(needed))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(main, '_parsers', parsers)
        yield


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


@pytest.fixture
def config(tmp_path: Path, rover: Configuration) -> list[str]:
    """Options of a command for that cart."""
    rover.write(tmp_path / 'rover.yaml')
    return ['--config', str(tmp_path / 'rover.yaml')]


@pytest.fixture(scope='session')
def proposed_law(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of a law that no listed effect states, as a diagnosis writes it."""
    law = {
        'enabled': True,
        'targets': ['torque', 'exponent'],
        'features': ['rim_speed', 'slip'],
        'coefficients': [0.05, 0.4],
        'coefficients_std': [0.01, 0.1],
    }
    values = {f'effects.learned_closure.{key}': value for key, value in law.items()}
    path = tmp_path_factory.mktemp('law') / 'proposal.yaml'
    reader.from_parameters(values, complete=False).write(path)
    return path


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


MakeBag = Callable[..., Path]


@pytest.fixture
def make_bag(tmp_path: Path, drive: list[tuple[str, Any, int]]) -> MakeBag:
    """Write a bag, by default that of `drive`."""

    def make(
        messages: Iterable[Any] | None = None, name: str = 'drive', storage: str = 'mcap'
    ) -> Path:
        path, told = tmp_path / name, drive if messages is None else list(messages)
        topics = {topic: message.__msgtype__ for topic, message, _ in told}
        if storage == 'mcap':
            with BagFile(path, topics or {'/imu/data': IMU}) as file:
                for topic, message, log_time in told:
                    file.write(topic, serialised(message), log_time)
            return path
        plugin = bag_writer.StoragePlugin.SQLITE3
        with bag_writer.Writer(path, version=9, storage_plugin=plugin) as writer:
            connections = {
                topic: writer.add_connection(topic, kind, typestore=jazzy_types())
                for topic, kind in topics.items()
            }
            for topic, message, log_time in told:
                writer.write(connections[topic], log_time, serialised(message))
        return path

    return make


@pytest.fixture(scope='session')
def filter_failures() -> Iterator[list[str]]:
    """What made a filter start anew anywhere in this process, in words."""
    from wheel_terra_estimator.estimation.filter.ekf import GatedFilter
    from wheel_terra_estimator.estimation.output_guard import OutputGuard

    found: list[str] = []
    repaired, enforce_bounds = OutputGuard.repaired, GatedFilter._enforce_bounds

    def watched_repaired(self: OutputGuard, stamp: int, outcome: Any) -> Any:
        result = repaired(self, stamp, outcome)
        if result[1]:
            found.append(repr(outcome) if isinstance(outcome, Exception) else 'not a number')
        return result

    def watched_enforce_bounds(self: GatedFilter) -> None:
        before = self.restarts
        enforce_bounds(self)
        if self.restarts > before:
            found.append('mean or covariance not a number')

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(OutputGuard, 'repaired', watched_repaired)
        patch.setattr(GatedFilter, '_enforce_bounds', watched_enforce_bounds)
        yield found


@pytest.fixture(scope='session')
def check_failures() -> Iterator[list[str]]:
    """Errors of checks anywhere in this process: a recording is judged by the others."""
    from wheel_terra_estimator.checks import online, run

    found: list[str] = []

    def watched(logger: logging.Logger) -> Any:
        def debug(*arguments: Any, **options: Any) -> None:
            found.append(traceback.format_exc(-1))
            logger.debug(*arguments, **options)

        return SimpleNamespace(debug=debug)

    with pytest.MonkeyPatch.context() as patch:
        for module in (online, run):
            patch.setattr(module, '_LOGGER', watched(module._LOGGER))
        yield found


@pytest.fixture(autouse=True)
def nothing_fails_unseen(
    request: pytest.FixtureRequest, filter_failures: list[str], check_failures: list[str]
) -> Iterator[None]:
    """No test may start a filter anew or lose a check unsaid: handlers would hide the error."""
    watched = {'filter_fails': filter_failures, 'check_fails': check_failures}
    before = {mark: len(failures) for mark, failures in watched.items()}
    yield
    for mark, failures in watched.items():
        new = failures[before[mark] :]
        if request.node.get_closest_marker(mark) is None:
            assert not new, f'{mark}: {new[:3]}'
        else:
            assert new, f'nothing failed, so the mark {mark} is wrong'
