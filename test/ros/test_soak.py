# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The nodes under two minutes of random faults."""

import subprocess
import sys

import pytest


@pytest.mark.slow
@pytest.mark.parametrize('program', ['soak', 'soak_limiter'])
def test_no_fault_ends_a_node_and_all_are_recovered_from(program):
    module = f'wheel_terra_lab.studies.{program}'
    command = [sys.executable, '-m', module, '--minutes', '2', '--seed', '3']
    done = subprocess.run(command, capture_output=True, text=True, timeout=400, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert 'Traceback' not in done.stderr
    assert 'PROBLEM' not in done.stdout
