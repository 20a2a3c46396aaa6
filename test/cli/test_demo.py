# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The demonstration where DDS does not connect: the drives are replayed."""

from __future__ import annotations

import importlib.util

import pytest

from wheel_terra_estimator.cli import demo, main


def test_a_node_that_is_not_found_does_not_end_the_demo(monkeypatch, tmp_path, capsys):
    ran = []

    def run_drive(drive, output, live):
        ran.append((drive.name, live))
        return demo.NODE_NOT_FOUND if live else 0

    monkeypatch.setattr(importlib.util, 'find_spec', lambda name: name)
    monkeypatch.setattr(demo, '_run_drive', run_drive)
    monkeypatch.setattr(demo, '_outcome', lambda drive, output: 'replayed')
    monkeypatch.setattr(demo, '_trial', lambda folder: (0, 'named'))
    assert main.main(['demo', '-o', str(tmp_path / 'out')]) == 0
    assert ran == [('entrapment', True), ('entrapment', False), ('pathfinder', False)]
    assert 'DDS has no way to the node' in capsys.readouterr().out


def test_the_exit_status_is_that_of_the_live_drive():
    live_drive = pytest.importorskip('wheel_terra_estimator.ros.live_drive')
    assert demo.NODE_NOT_FOUND == live_drive.NOT_FOUND
