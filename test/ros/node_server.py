# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Nodes by fork: a process that has imported the estimator forks one process for each.

To import filterpy, and with it most of scipy, takes a node a second of processor time. The server
has done so once; rclpy it leaves to what it forks, since its import starts threads, of which a fork
keeps none. What it forks is a process as any other: own pid, signals, exit status, participant.

Run as a program it is the server; `NodeServer` is what the tests talk to.
"""

from __future__ import annotations

import importlib
import json
import os
import random
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO, Any

PACKAGE = 'wheel_terra_estimator.ros'
PRELOADED = (  # what the nodes import beside rclpy, also late
    'filterpy.kalman',
    'scipy.linalg',
    'scipy.special',
    'wheel_terra_estimator.checks.input_judge',
    'wheel_terra_estimator.configuration.soil_file',
    'wheel_terra_estimator.estimation.traction_limiter',
    'wheel_terra_estimator.estimation.wheel_soil_estimator',
    'wheel_terra_estimator.messages.pipeline',
)
LONGEST_REQUEST = 65_536  # bytes
LOOK_UP = 0.02  # [s] between two looks whether a process has ended
NOT_ENDED = None


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

    def __init__(self, module: str, arguments: Sequence[str]) -> None:
        command = [sys.executable, '-m', f'{PACKAGE}.{module}', *arguments]
        super().__init__(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


class ForkedProcess(NodeProcess):
    """A process that the server forked; what of `subprocess.Popen` the tests use."""

    def __init__(self, server: NodeServer, pid: int, output: IO[str]) -> None:
        self._server = server
        self._output = output
        self.pid = pid
        self.returncode: int | None = NOT_ENDED

    def poll(self) -> int | None:
        """Return the exit status, minus the signal that killed it, or None while it runs."""
        if self.returncode is NOT_ENDED:
            self.returncode = self._server.ask({'poll': self.pid})
        return self.returncode

    def send_signal(self, number: int) -> None:
        """Send a signal, unless it has ended."""
        if self.poll() is NOT_ENDED:
            os.kill(self.pid, number)

    def kill(self) -> None:
        """End it at once."""
        self.send_signal(signal.SIGKILL)

    def wait(self, timeout: float) -> int:
        """Wait for the end; return the exit status."""
        end = time.monotonic() + timeout
        while (status := self.poll()) is NOT_ENDED:
            if time.monotonic() > end:
                raise subprocess.TimeoutExpired(f'process {self.pid}', timeout)
            time.sleep(LOOK_UP)
        return status

    def said(self) -> str:
        """Return what it has said so far; where it goes on writing stays the same."""
        return os.pread(self._output.fileno(), LONGEST_REQUEST, 0).decode()

    def communicate(self, timeout: float) -> tuple[str, None]:
        """Wait for the end; return what it said."""
        self.wait(timeout)
        with self._output:
            self._output.seek(0)
            return self._output.read(), None


class NodeServer:
    """The server as the tests see it; it ends with `close`, or with the process of the tests."""

    def __init__(self) -> None:
        self._socket, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._process = subprocess.Popen(
            [sys.executable, __file__, str(theirs.fileno())],
            pass_fds=[theirs.fileno()],
            env={**os.environ, 'OMP_NUM_THREADS': '1', 'OPENBLAS_NUM_THREADS': '1'},
        )
        theirs.close()

    def start(
        self,
        module: str,
        arguments: Sequence[str],
        package: str = PACKAGE,
        constants: Mapping[str, float] | None = None,
    ) -> ForkedProcess:
        """Start a node as ``python -m PACKAGE.MODULE ARGUMENTS`` would.

        ``constants``: module, colon and name -> value in this node; how long it waits before it
        tells, say.
        """
        # A file, not a pipe: nobody has to read it while the node runs.
        output = tempfile.TemporaryFile('w+')  # noqa: SIM115 - closed when it was read
        request = {
            'start': f'{package}.{module}',
            'arguments': list(arguments),
            'constants': dict(constants or {}),
            'environment': dict(os.environ),
            'folder': str(Path.cwd()),
        }
        return ForkedProcess(self, self.ask(request, output.fileno()), output)

    def ask(self, request: dict[str, Any], *descriptors: int) -> Any:
        """Send a request and return the answer."""
        text = json.dumps(request).encode()
        assert len(text) < LONGEST_REQUEST
        socket.send_fds(self._socket, [text], descriptors)
        answer = self._socket.recv(LONGEST_REQUEST)
        assert answer, 'the node server has ended'
        return json.loads(answer)

    def close(self) -> None:
        """End the server."""
        self._socket.close()
        self._process.wait(60.0)


def _serve(connection: socket.socket) -> int:
    """Answer requests until the tests end; in a forked process, run the node instead."""
    for name in PRELOADED:
        importlib.import_module(name)
    assert len(list(Path('/proc/self/task').iterdir())) == 1, 'a fork keeps one thread only'
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the tests
    while True:
        text, descriptors, _, _ = socket.recv_fds(connection, LONGEST_REQUEST, 1)
        if not text:
            return 0
        request = json.loads(text)
        if 'poll' in request:
            ended, status = os.waitpid(request['poll'], os.WNOHANG)
            answer = os.waitstatus_to_exitcode(status) if ended else NOT_ENDED
        else:
            answer = os.fork()
            if not answer:
                connection.close()
                _become(request, *descriptors)
                return int(importlib.import_module(request['start']).main())
        for descriptor in descriptors:
            os.close(descriptor)
        connection.send(json.dumps(answer).encode())


def _become(request: dict[str, Any], output: int) -> None:
    """Give this process the surroundings that a new one would have."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    with Path(os.devnull).open() as nothing:
        os.dup2(nothing.fileno(), 0)
    for stream in (1, 2):
        os.dup2(output, stream)
    os.close(output)
    os.environ.clear()
    os.environ.update(request['environment'])
    os.chdir(request['folder'])
    sys.argv = [request['start'], *request['arguments']]
    for place, value in request['constants'].items():
        module, _, name = place.partition(':')
        owner = importlib.import_module(module)
        assert hasattr(owner, name), place
        setattr(owner, name, value)
    random.seed()


if __name__ == '__main__':
    sys.path[0] = str(Path.cwd())  # as with python -m
    sys.exit(_serve(socket.socket(fileno=int(sys.argv[1]))))
