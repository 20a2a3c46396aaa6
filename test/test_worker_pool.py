# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Workers end with their parent, and what an interrupted bench has done is kept."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from wheel_terra_estimator.cli.main import main
from wheel_terra_lab.evaluation import bench, tables

PROGRAM = """
import os, sys, time
from wheel_terra_estimator.cli.terminal import termination_as_interrupt
from wheel_terra_estimator.scheduler import worker_pool

def work(_):
    os.write(1, f'{os.getpid()}\\n'.encode())  # one write: two workers share the pipe
    end = time.monotonic() + 60
    while time.monotonic() < end:  # a busy worker, not a waiting one
        pass

if __name__ == '__main__':
    with termination_as_interrupt(), worker_pool(2) as pool:
        for future in [pool.submit(work, i) for i in range(2)]:
            future.result()
"""


def alive(process: int) -> bool:
    try:
        state = Path(f'/proc/{process}/stat').read_text().rpartition(')')[2].split()[0]
    except FileNotFoundError:
        return False
    return state != 'Z'


@pytest.mark.skipif(not Path('/proc/self/stat').exists(), reason='looks processes up in /proc')
@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_workers_end_with_their_parent(tmp_path, number):
    (tmp_path / 'program.py').write_text(PROGRAM)
    with subprocess.Popen(
        [sys.executable, str(tmp_path / 'program.py')],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    ) as parent:
        assert parent.stdout is not None
        workers = [int(parent.stdout.readline()) for _ in range(2)]
        assert all(map(alive, workers))
        os.kill(parent.pid, number)
        parent.wait(timeout=20.0)
        deadline = time.monotonic() + 10.0
        while any(map(alive, workers)) and time.monotonic() < deadline:
            time.sleep(0.05)
        assert not any(map(alive, workers))


def test_an_interrupted_bench_keeps_and_says_what_it_has(tmp_path, monkeypatch, capsys):
    done = []

    def score(world: str, kind: str, seed: int, *_: Any) -> list[Any]:
        if len(done) == 2:
            raise KeyboardInterrupt
        done.append(seed)
        return [SimpleNamespace(simulator=world, kind=kind, seed=seed, mode='reference', health={})]

    monkeypatch.setattr(bench, 'score_drive', score)
    monkeypatch.setattr(tables, 'report', lambda results, modes: f'{len(results.drives)} rows')
    out = tmp_path / 'r.md'
    assert main(['evaluate', '--kinds', 'cruise', '--seeds', '5', '-o', str(out)]) == 130
    assert out.read_text().startswith('2 rows\n\ninterrupted: 2 of 5 drives\n')
    assert out.read_text().endswith('The filter was started anew 0 times in 2 runs.\n')
    assert 'interrupted: 2 of 5 drives' in capsys.readouterr().out
