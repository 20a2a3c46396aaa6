# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The node under random faults: one in the suite, two minutes of them by ``-m slow``."""

import random
import subprocess
import sys

import pytest

ONE_FAULT = 0.1  # [s]: no second one begins


@pytest.fixture
def soak(node_server, monkeypatch):
    """The program's module, with nodes from the server."""
    import rclpy

    from wheel_terra_lab.studies import soak
    from wheel_terra_lab.studies.live_rover import Process

    class Forked(Process):
        def __init__(self, arguments):
            _, module, *rest = arguments
            self._popen = node_server.start(module.rpartition('.')[2], rest)

    monkeypatch.setattr(soak, 'Process', Forked)
    rclpy.init(args=[])
    yield soak
    rclpy.try_shutdown()


def test_numbers_that_are_none_are_told_and_recovered_from(soak, tmp_path, monkeypatch):
    monkeypatch.setattr(soak, 'HEALTH', 0.0)
    random.seed(3)
    run = soak.Soak(tmp_path, ONE_FAULT, ['nan'])
    run.run()
    run.rover.destroy_node()
    assert not run.problems, run.report()
    assert len(run.recoveries['nan']) == run.told['nan'] == 1


@pytest.mark.slow
@pytest.mark.parametrize('program', ['soak', 'soak_limiter'])
def test_no_fault_ends_a_node_and_all_are_recovered_from(program):
    module = f'wheel_terra_lab.studies.{program}'
    command = [sys.executable, '-m', module, '--minutes', '2', '--seed', '3']
    done = subprocess.run(command, capture_output=True, text=True, timeout=400, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert 'Traceback' not in done.stderr
    assert 'PROBLEM' not in done.stdout
