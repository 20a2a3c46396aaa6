# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The nodes under two minutes of random faults."""

import os
import signal
import subprocess
import sys
from contextlib import suppress

import pytest


@pytest.mark.slow
@pytest.mark.timeout(500)
@pytest.mark.parametrize('program', ['soak', 'soak_limiter'])
def test_no_fault_ends_a_node_and_all_are_recovered_from(program):
    module = f'wheel_terra_lab.studies.{program}'
    command = [sys.executable, '-m', module, '--minutes', '2', '--seed', '3']
    pipe = subprocess.PIPE
    soak = subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True, start_new_session=True)
    try:
        said, errors = soak.communicate(timeout=400)
    finally:
        with suppress(ProcessLookupError):
            os.killpg(soak.pid, signal.SIGKILL)  # its nodes, too, which it may have left
    assert soak.returncode == 0, said + errors
    assert 'Traceback' not in errors
    assert 'PROBLEM' not in said
