# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A disk that takes no more leaves nothing half, and one line."""

import errno
import os
import resource
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from rosbags.rosbag2.storage_mcap import McapWriter

from wheel_terra_estimator.bags.bag_file import BagFile
from wheel_terra_estimator.cli.main import main
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.output_folder import MARKER

TOPIC = '/diagnostics'
KIND = 'std_msgs/msg/String'
MEGABYTE = 2**20


def fill(path: Path, count: int) -> None:
    with BagFile(path, {TOPIC: KIND, '/other': KIND}) as bag:
        for number in range(count):
            bag.write(TOPIC, number.to_bytes(8, 'little') * 1000, 1000 + number)


@contextmanager
def largest_file(size: int) -> Iterator[None]:
    """A limit on the size of files stands for a full disk: both fail in the middle of a write."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.parametrize('fails_at', [0.4, 2.5, 3.02])
def test_a_bag_on_a_disk_that_fills_up_is_not_there(tmp_path, fails_at):
    with (
        largest_file(int(fails_at * MEGABYTE)),
        pytest.raises(UserError, match='cannot be written') as caught,
    ):
        fill(tmp_path / 'out', 1000)
    assert '\n' not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_a_disk_that_is_full_at_the_end_only(tmp_path, monkeypatch):
    """The last chunk does not fit when the bag is closed."""

    def full(*_: Any) -> None:
        raise OSError(errno.ENOSPC, 'No space left on device')

    monkeypatch.setattr(McapWriter, 'close', full)
    with pytest.raises(UserError, match='No space left on device'):
        fill(tmp_path / 'out', 500)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize('command', ['replay', 'simulate', 'diagnose', 'evaluate', 'predict'])
def test_places_that_cannot_be_written_are_one_line_before_anything_is_computed(
    make_bag, tmp_path, refused, command, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    table = tmp_path / 't.csv'
    table.write_text('slip,normal_load,sinkage\n0.1,100,0.01\n')
    arguments = {
        'replay': ['replay', str(make_bag()), '--config', 'frostyboy', '-o'],
        'simulate': ['simulate', '--duration', '3600', '-o'],
        'diagnose': ['diagnose', str(table), '-o'],
        'evaluate': ['evaluate', '--overwrite', '-o'],
        'predict': ['predict', '--overwrite', '-o'],
    }[command]
    for place in ('/proc/out.csv', '/proc/new/out.csv', '/dev/full'):
        refused([*arguments, place], place)


OPENED: list[str] = []
"""Of what is below `WATCHED`: the files that were opened to be written, in turn."""
WATCHED: list[Path] = []
FAILING: list[int] = []
"""Which of them cannot be opened."""


def _watch(event: str, arguments: tuple[Any, ...]) -> None:
    if event != 'open' or not WATCHED or not isinstance(arguments[0], str):
        return
    path, _, flags = arguments
    if flags & (os.O_WRONLY | os.O_RDWR) and Path(path).is_relative_to(WATCHED[0]):
        OPENED.append(path)
        if len(OPENED) in FAILING:
            raise OSError(errno.ENOSPC, 'No space left on device', path)


@contextmanager
def disk(place: Path, full_at: int = 0) -> Iterator[None]:
    """Note what is opened to be written below a place; the disk is full for one of them."""
    if not OPENED:
        sys.addaudithook(_watch)  # for good: it does nothing where nothing is watched
    OPENED[:], WATCHED[:], FAILING[:] = [], [place], [full_at]
    try:
        yield
    finally:
        WATCHED.clear()


def everything(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob('*')
        if path.is_file()
    }


@pytest.mark.parametrize('command', ['replay', 'diagnose', 'predict'])
def test_a_disk_that_fills_up_at_any_file_leaves_the_earlier_output(
    make_bag, drive, rover, tmp_path, capsys, undrawn, command
):
    """Whichever file is the first without room: the output of the run before stands, whole."""
    read, out = tmp_path / 'read', tmp_path / 'out'
    read.mkdir()
    rover.write(read / 'rover.yaml')
    table, few = read / 't.csv', ['--slip', '0.05:0.6:8', '--load', '35,70']
    model = ['--config', 'hit_wh1_lug10', '--config', 'hit_lss1']  # its own rows agree
    assert main(['predict', *model, *few, '-o', str(table)]) == 0
    bag = str(make_bag(drive[: len(drive) // 4]))
    config = ['--config', str(read / 'rover.yaml')]
    line = {
        'replay': ['replay', bag, *config, '-o'],
        'diagnose': ['diagnose', str(table), *model, '--only', 'cohesion', '-o'],
        'predict': ['predict', '--config', 'pathfinder', '-o'],
    }[command]
    line += [str(out / 'o.csv' if command == 'predict' else out), '--overwrite']
    out.mkdir()
    for _ in range(2):
        with disk(tmp_path):
            assert main(line) == 0, capsys.readouterr().err
    count = len(OPENED)
    assert count > 1
    for full_at in sorted({1, count // 2, count}):
        before = everything(out)
        with disk(tmp_path, full_at):
            status = main(line)
        told = ''.join(capsys.readouterr())
        if status:
            kept = everything(out)
            for name in before.keys() - {MARKER}:
                assert kept[name] == before[name]
            assert 'No space left' in told
        else:
            assert everything(out).keys() == before.keys()
