# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The demonstration where DDS does not connect, and where it is interrupted."""

import importlib.util
import signal
import subprocess
import sys
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from wheel_terra_estimator.cli import demo, main


def test_a_node_that_is_not_found_does_not_end_the_demo(monkeypatch, tmp_path, capsys):
    ran = []

    @contextmanager
    def running(command, environment):
        if command[1] == 'diagnose':
            assert all(Path(command[i]).is_file() for i in (3, 5))
            yield lambda: (0, 'table\n')
            return
        live = command[0].endswith('live_drive')
        name = Path(command[1 if live else 2]).name
        ran.append((name, live, environment.get('ROS_DOMAIN_ID')))
        yield lambda: (demo.NODE_NOT_FOUND if live else 0, f'{name} ran\n')

    monkeypatch.setattr(importlib.util, 'find_spec', lambda name: name)
    monkeypatch.setattr(demo, '_running', running)
    monkeypatch.setattr(demo, '_outcome', lambda drive, output: 'replayed')
    monkeypatch.setattr(demo, '_named', lambda folder: 'named')
    assert main.main(['demo', '-o', str(tmp_path / 'out')]) == 0
    assert {(name, live) for name, live, _ in ran} == {
        (name, live) for name in ('entrapment', 'pathfinder') for live in (True, False)
    }
    domains = {domain for _, live, domain in ran if live}
    assert len(domains) == 2  # the nodes do not hear each other's drive
    said = capsys.readouterr().out
    assert said.count('DDS does not reach the node') == 2
    assert said.index('entrapment ran') < said.index('pathfinder ran') < said.index('table')


@pytest.mark.skipif(not Path('/proc/self/cmdline').exists(), reason='no list of processes')
def test_an_interrupt_of_the_demo_alone_ends_what_it_started(tmp_path):
    command = [sys.executable, '-m', 'wheel_terra_estimator.cli.main', 'demo', '--no-node']
    command += ['-o', str(tmp_path / 'out')]
    with subprocess.Popen(command, stdout=subprocess.PIPE, start_new_session=True) as process:
        while b'===' not in process.stdout.readline():
            pass
        process.send_signal(signal.SIGINT)
        assert process.wait(15.0) == 130  # the whole demo takes 30 s
    for words in Path('/proc').glob('[0-9]*/cmdline'):
        with suppress(OSError):  # others end meanwhile
            assert bytes(tmp_path) not in words.read_bytes()


def test_the_exit_status_is_that_of_the_live_drive():
    live_drive = pytest.importorskip('wheel_terra_lab.live_drive')
    assert demo.NODE_NOT_FOUND == live_drive.NOT_FOUND


def test_an_output_that_is_there_is_refused_with_options_that_the_command_has(tmp_path, capsys):
    assert main.main(['demo', '-o', str(tmp_path)]) == 2
    said = capsys.readouterr().err
    assert '--overwrite' in said and '--resume' not in said
