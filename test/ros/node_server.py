# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Nodes by fork: a server that has imported the estimator forks one process for each.

To import filterpy, and with it most of scipy, takes a node a second of processor time. The server
of multiprocessing has done so once; rclpy it leaves to what it forks, since its import starts
threads, of which a fork keeps none. What it forks is a process as any other: own pid, signals, exit
status, participant.
"""

from __future__ import annotations

import importlib
import multiprocessing
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

PACKAGE = 'wheel_terra_estimator.ros'
SERVER = multiprocessing.get_context('forkserver')
SERVER.set_forkserver_preload(
    [  # what the nodes import beside rclpy, also late
        'filterpy.kalman',
        'scipy.linalg',
        'scipy.special',
        'wheel_terra_estimator.checks.input_judge',
        'wheel_terra_estimator.configuration.soil_file',
        'wheel_terra_estimator.control.traction_limiter',
        'wheel_terra_estimator.estimation.wheel_soil_estimator',
        'wheel_terra_estimator.messages.pipeline',
        'pytest',  # which multiprocessing imports in each process, as the main module of the tests
    ]
)


class NodeProcess:
    """What the tests ask of a node, however it was started."""

    returncode: Any
    send_signal: Any
    communicate: Any

    def stop(self, *signals: int) -> tuple[int, str]:
        """Send signals, one after the other; wait for the end, return exit status and words."""
        for number in signals:
            self.send_signal(number)
        said, _ = self.communicate(timeout=60.0)
        return self.returncode, said


class InterpretedProcess(NodeProcess, subprocess.Popen):
    """As `ros2 run` starts an executable: by an interpreter that has imported nothing yet."""

    def __init__(self, module: str, *arguments: str) -> None:
        command = [sys.executable, '-m', f'{PACKAGE}.{module}', *arguments]
        super().__init__(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


class ForkedProcess(NodeProcess):
    """A node as ``python -m PACKAGE.MODULE ARGUMENTS`` would start it, forked by the server.

    Has what of `subprocess.Popen` the tests use. ``constants``: module, colon and name -> value in
    this node; how long it waits before it tells, say.
    """

    def __init__(
        self,
        module: str,
        *arguments: str,
        package: str = PACKAGE,
        constants: Mapping[str, float] | None = None,
    ) -> None:
        # A file, not a pipe: nobody has to read it while the node runs.
        self._output = tempfile.NamedTemporaryFile('r')  # noqa: SIM115 - goes with the node
        given = (f'{package}.{module}', arguments, dict(constants or {}), self._output.name)
        self._process = SERVER.Process(target=_run, args=(*given, dict(os.environ)), daemon=True)
        self._process.start()
        self.pid = self._process.pid

    def poll(self) -> int | None:
        """Return the exit status, minus the signal that killed it, or None while it runs."""
        return self._process.exitcode

    @property
    def returncode(self) -> int | None:
        return self.poll()

    def send_signal(self, number: int) -> None:
        """Send a signal, unless it has ended."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        """End it at once."""
        self.send_signal(signal.SIGKILL)

    def wait(self, timeout: float | None = None) -> int:
        """Wait for the end; return the exit status."""
        self._process.join(timeout)
        if (status := self.poll()) is None:
            raise subprocess.TimeoutExpired(f'process {self.pid}', timeout)
        return status

    def said(self) -> str:
        """Return what it has said so far."""
        return Path(self._output.name).read_text()

    def communicate(self, timeout: float) -> tuple[str, None]:
        """Wait for the end; return what it said."""
        self.wait(timeout)
        return self.said(), None


def _run(
    module: str,
    arguments: Sequence[str],
    constants: Mapping[str, float],
    output: str,
    environment: Mapping[str, str],
) -> None:
    """Give this process the surroundings that a new one would have, and become the node."""
    descriptor = os.open(output, os.O_WRONLY)
    for stream in (1, 2):
        os.dup2(descriptor, stream)
    os.environ.clear()
    os.environ.update(environment)
    sys.argv = [module, *arguments]
    for place, value in constants.items():
        owner, _, name = place.partition(':')
        assert hasattr(importlib.import_module(owner), name), place
        setattr(sys.modules[owner], name, value)
    sys.exit(importlib.import_module(module).main())
