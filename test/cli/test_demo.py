# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The demonstration where DDS does not connect: the drives are replayed."""

import importlib.util
from pathlib import Path
from subprocess import CompletedProcess

import pytest

from wheel_terra_estimator.cli import demo, main


def test_a_node_that_is_not_found_does_not_end_the_demo(monkeypatch, tmp_path, capsys):
    ran = []

    def run(command, environment):
        if command[1] == 'diagnose':
            assert all(Path(command[i]).is_file() for i in (3, 5))
            return CompletedProcess([], 0, 'table\n')
        live = command[0].endswith('live_drive')
        ran.append((Path(command[1 if live else 2]).name, live, environment['ROS_DOMAIN_ID']))
        return CompletedProcess([], demo.NODE_NOT_FOUND if live else 0, f'{ran[-1][0]} ran\n')

    monkeypatch.setattr(importlib.util, 'find_spec', lambda name: name)
    monkeypatch.setattr(demo, '_run', run)
    monkeypatch.setattr(demo, '_outcome', lambda drive, output: 'replayed')
    monkeypatch.setattr(demo, '_named', lambda folder: 'named')
    assert main.main(['demo', '-o', str(tmp_path / 'out')]) == 0
    assert {(name, live) for name, live, _ in ran} == {
        (name, live) for name in ('entrapment', 'pathfinder') for live in (True, False)
    }
    assert len({domain for *_, domain in ran}) == 2  # the nodes do not hear each other's drive
    said = capsys.readouterr().out
    assert said.count('DDS does not reach the node') == 2
    assert said.index('entrapment ran') < said.index('pathfinder ran') < said.index('table')


def test_the_exit_status_is_that_of_the_live_drive():
    live_drive = pytest.importorskip('wheel_terra_lab.live_drive')
    assert demo.NODE_NOT_FOUND == live_drive.NOT_FOUND


def test_an_output_that_is_there_is_refused_with_options_that_the_command_has(tmp_path, capsys):
    assert main.main(['demo', '-o', str(tmp_path)]) == 2
    said = capsys.readouterr().err
    assert '--overwrite' in said and '--resume' not in said
