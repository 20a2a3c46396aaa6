# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The node under random faults: a few in the suite, two minutes of them by ``-m slow``."""

import subprocess
import sys
from pathlib import Path

import pytest

SOAK = Path(__file__).resolve().parents[2] / 'tools' / 'soak.py'


@pytest.mark.parametrize(
    'minutes', [pytest.param(0.1, id='short'), pytest.param(2.0, id='long', marks=pytest.mark.slow)]
)
def test_no_fault_ends_the_node_and_all_are_recovered_from(minutes):
    command = [sys.executable, str(SOAK), '--minutes', str(minutes), '--seed', '3']
    done = subprocess.run(command, capture_output=True, text=True, timeout=280, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert 'Traceback' not in done.stderr
    assert 'PROBLEM' not in done.stdout
