# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Hostile and mistaken input ends in one line, soon and within bounds of memory."""

import json
import os
import re
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from wheel_terra_estimator.cli.main import main
from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.errors import UserError
from wheel_terra_lab.studies.fuzzing import mcap_maker as maker

HEAD = '/**:\n  ros__parameters:\n'
LAUGHS = 'a0: &a0 [x, x]\n' + ''.join(
    f'a{i}: &a{i} [{", ".join([f"*a{i - 1}"] * 10)}]\n' for i in range(1, 12)
)


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        (LAUGHS, 'is an alias'),
        (HEAD + '    rover.mass: &m 20.0\n    rover.gravity: *m\n', 'is an alias'),
        ('[' * 100_000, 'nested deeper than'),
        ('{a: ' * 100_000, 'nested deeper than'),
        (HEAD + '    rover.mass: ' + '9' * 5000, 'rover.mass'),
        (HEAD + '    wheels.names: [' + 'a, ' * 100_000 + 'b]', 'keys and values'),
        (HEAD + '    rover.name: ' + 'x' * 2_000_000, 'at most 1 MB are read'),
    ],
)
def test_yaml_that_blows_up_is_refused(tmp_path, text, words):
    file = tmp_path / 'rover.yaml'
    file.write_text(text)
    start = time.process_time()
    with pytest.raises(UserError, match=re.escape(words)) as caught:
        reader.load(['frostyboy', file])
    assert time.process_time() - start < 5.0
    assert '\n' not in str(caught.value)


LIMITED = """
import contextlib, io, json, re, sys, time
from wheel_terra_estimator.cli.main import main
for arguments in json.loads(sys.argv[1]):
    said, before = io.StringIO(), time.process_time()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        status = main(arguments)
    with open('/proc/self/status') as state:  # ru_maxrss begins at what the parent took
        peak = int(re.search(r'VmHWM:\\s+(\\d+) kB', state.read())[1])
    print(json.dumps([status, said.getvalue(), time.process_time() - before, peak]))
"""


def limited(commands: list[list[str]]) -> list[tuple[int, str, float, int]]:
    """Run commands in one process; return status, words, processor time [s], peak memory [kB]."""
    done = subprocess.run(
        [sys.executable, '-c', LIMITED, json.dumps(commands)],
        capture_output=True,
        text=True,
        check=True,
        timeout=240.0,
    )
    return [tuple(json.loads(line)) for line in done.stdout.splitlines()]


def bombs(size: int) -> Iterator[tuple[str, bytes]]:
    """Yield name and content of what unpacks to so many bytes, one chunk to a quarter of them."""
    try:
        from compression import zstd
    except ImportError:
        from backports import zstd
    zeros, frame = bytes(2**24), zstd.ZstdCompressor()
    count = size // len(zeros)
    one_frame = b''.join([*(frame.compress(zeros) for _ in range(count)), frame.flush()])
    for name, packed, stated in (
        ('frames.mcap', count * zstd.compress(zeros), size),
        ('frame.mcap', one_frame, size),
        ('liar.mcap', one_frame, 1000),
        ('zeros.mcap', one_frame, size // 4),
    ):
        head = struct.pack('<QQQI', 1, 2, stated, 0) + maker._text('zstd')
        content = head + struct.pack('<Q', len(packed)) + packed
        yield name, maker.MAGIC + maker._record(6, content)
    yield 'file.mcap.zstd', one_frame
    yield 'file.db3.zstd', one_frame


@pytest.mark.parametrize('size', [3 * 2**26, pytest.param(2**30, marks=pytest.mark.slow)])
def test_bombs_in_recordings(tmp_path, size):
    """A chunk that unpacks to a gigabyte, one that says less than it holds, a file of zeros."""
    paths = []
    for name, content in bombs(size):
        paths.append(tmp_path / name)
        paths[-1].write_bytes(content)
    commands = [['replay', str(path), '--config', 'frostyboy'] for path in paths]
    found = limited(commands)
    assert len(found) == len(paths) == 6
    for path, (status, said, used, peak) in zip(paths, found, strict=True):
        assert status == 2, said
        assert said.count('\n') == 1, said
        assert str(path) in said
        assert used < 10.0  # with the imports, on a machine that does other things
        mapped = size if 'db3' in path.name else 0  # pages of the file: the machine takes them back
        assert peak < 2**18 + mapped / 2**10


@pytest.fixture
def places(tmp_path):
    pipe, loop, folder = tmp_path / 'pipe', tmp_path / 'loop', tmp_path / 'x.mcap'
    os.mkfifo(pipe)
    loop.symlink_to(loop)
    folder.mkdir()
    bag_pipe, bag_zero = tmp_path / 'pipe.mcap', tmp_path / 'zero.mcap'
    os.mkfifo(bag_pipe)
    bag_zero.symlink_to('/dev/zero')
    inside = tmp_path / 'bag'
    inside.mkdir()
    os.mkfifo(inside / 'a.mcap')
    return {
        'pipe': pipe,
        'loop': loop,
        'folder': folder,
        'zero': Path('/dev/zero'),
        'bag_pipe': bag_pipe,
        'bag_zero': bag_zero,
        'inside': inside,
    }


@pytest.mark.timeout(120)
def test_what_is_no_regular_file_is_refused_and_never_waited_for(places, tmp_path, refused):
    out = ['-o', str(tmp_path / 'out')]
    for place in places.values():
        for command in (
            ['replay', str(place), '--config', 'frostyboy'],
            ['diagnose', str(place), '--config', 'frostyboy', *out],
            ['predict', '--config', str(place)],
            ['predict', '--config', 'frostyboy', '--points', str(place)],
            ['simulate', '--scenario', str(place), *out],
        ):
            said = refused(command)
            assert 'no such file' not in said or place.is_symlink()
    assert not (tmp_path / 'out').exists()


@pytest.mark.parametrize(
    'arguments',
    [
        ['--slip', '0:1:1000000000'],
        ['--slip', '0:1:' + '9' * 5000],
        ['--slip', '0:1:1000', '--load', '1:100:1000'],
        ['-p', 'rover.mass:=' + '9' * 5000],
        ['-p', 'rover.mass:=' + '[' * 5000],
    ],
)
def test_numbers_out_of_all_bounds(arguments, capsys):
    start = time.process_time()
    assert main(['predict', '--config', 'frostyboy', *arguments]) == 2
    assert time.process_time() - start < 5.0
    said = capsys.readouterr().err
    assert said.count('\n') == 1
    assert len(said) < 3000


def test_control_characters_in_names_do_not_reach_the_terminal(tmp_path, make_bag, rover, capsys):
    evil = '\x1b]0;owned\x07\x1b[31mred\u202e\r\x9b2J'
    evil_folder = make_bag().rename(tmp_path / f'drive{evil}')
    table = tmp_path / 't.csv'
    table.write_text(f'slip,normal_load,{evil}\n0.1,10{evil},0.1\n')
    rover.write(tmp_path / 'rover.yaml')
    replay = ['replay', str(evil_folder), '--config', str(tmp_path / 'rover.yaml')]
    assert main(replay) == 0
    main([*replay, '--remap', f'odom:=/{evil}'])
    main(['diagnose', str(table), '-o', str(tmp_path / 'out'), '--config', 'frostyboy'])
    main(['predict', '--config', f'no{evil}'])
    main(['predict', '--config', 'frostyboy', '-p', f'{evil}:=1'])
    captured = capsys.readouterr()
    harmful = re.compile('[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e]')
    assert 'owned' in captured.out
    assert not harmful.search(captured.out)
    assert captured.err.count('owned') >= 3
    assert not harmful.search(captured.err)
