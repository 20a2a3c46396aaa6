# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Tasks side by side: a worker that dies takes no other task along."""

import argparse
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from threading import Thread
from types import SimpleNamespace
from typing import Any

import pytest

from wheel_terra_estimator import scheduler
from wheel_terra_estimator.cli.main import main
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.scheduler import add_jobs_argument, finished
from wheel_terra_lab.evaluation import bench, tables


def root(number: float) -> float:
    if number == -1.0:
        os.kill(os.getpid(), signal.SIGKILL)
    return float(number) ** 0.5 if number >= 0 else (_ for _ in ()).throw(ValueError(str(number)))


def killed_once(mark: str) -> int:
    try:
        Path(mark).touch(exist_ok=False)
    except FileExistsError:
        return os.getpid()
    os.kill(os.getpid(), signal.SIGKILL)
    return 0


def test_results_and_errors_by_index():
    found = dict(finished(root, [4.0, -4.0, 9.0], jobs=2))
    assert found[0] == 2.0 and found[2] == 3.0
    assert isinstance(found[1], ValueError)


def test_a_killed_worker_costs_its_own_task_alone():
    found = dict(finished(root, [1.0, -1.0, 4.0, 9.0, 16.0], jobs=2))
    assert isinstance(found.pop(1), UserError)
    assert found == {0: 1.0, 2: 2.0, 3: 3.0, 4: 4.0}


def test_a_task_whose_worker_was_killed_is_run_again(tmp_path):
    ((_, process),) = finished(killed_once, [str(tmp_path / 'mark')])
    assert isinstance(process, int) and process not in (0, os.getpid())


@pytest.mark.parametrize('greeting', [None, b'', b'SSH-2.0-OpenSSH_9.6\r\n'])
def test_an_address_that_does_not_answer_as_a_scheduler_does(monkeypatch, greeting):
    """Refused, silent, another protocol."""
    pytest.importorskip('dask.distributed')
    monkeypatch.setattr(scheduler, 'CONNECT_TIMEOUT', 1)
    with socket.create_server(('127.0.0.1', 0)) as server:
        address = f'tcp://127.0.0.1:{server.getsockname()[1]}'
        if greeting is None:
            server.close()
        else:
            Thread(target=lambda: server.accept()[0].sendall(greeting), daemon=True).start()
        begin = time.monotonic()
        with pytest.raises(UserError, match=f'--scheduler {address}: no Dask scheduler'):
            next(finished(root, [1.0], address=address))
        assert time.monotonic() - begin < 10.0


def test_a_cluster_without_workers_is_said_and_one_that_gets_some_is_used(monkeypatch):
    distributed = pytest.importorskip('dask.distributed')
    monkeypatch.setattr(scheduler, 'CONNECT_TIMEOUT', 60)
    monkeypatch.setattr(scheduler, 'WORKER_TIMEOUT', 1)
    with distributed.LocalCluster(n_workers=0, processes=False, dashboard_address=None) as cluster:
        address = cluster.scheduler_address
        with pytest.raises(UserError, match=f'no workers; start one with: dask worker {address}'):
            list(finished(root, [1.0, 4.0], address=address))
        monkeypatch.setattr(scheduler, 'WORKER_TIMEOUT', 60)
        cluster.scale(1)
        found = dict(finished(root, [4.0, -4.0], address=address))
        assert found[0] == 2.0 and isinstance(found[1], ValueError)


def test_an_empty_address_is_refused(capsys):
    with pytest.raises(SystemExit):
        main(['replay', 'a', 'b', '-o', 'c', '--scheduler', ''])
    assert 'argument --scheduler: an empty address' in capsys.readouterr().err


@pytest.mark.slow
def test_a_cluster_that_loses_a_worker_ends_all_tasks(tmp_path, monkeypatch):
    distributed = pytest.importorskip('dask.distributed')
    monkeypatch.setattr(scheduler, 'CONNECT_TIMEOUT', 60)  # on a machine that is busy
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None
    ) as cluster:
        address = cluster.scheduler_address
        here = Path(__file__).parent
        with distributed.Client(address) as client:
            client.run(lambda: __import__('sys').path.insert(0, str(here)))
        tasks = [str(tmp_path / str(i)) for i in range(3)]
        for task in tasks[1:]:
            Path(task).touch()  # only the first kills its worker, once
        found = dict(finished(killed_once, tasks, address=address))
        assert sorted(found) == [0, 1, 2]
        assert all(isinstance(process, int) for process in found.values()), found


@pytest.mark.parametrize('text', ['0', '-1', '1.5', 'all', '²', '9' * 5000])
def test_no_number_of_processes(text, capsys):
    parser = argparse.ArgumentParser()
    add_jobs_argument(parser)
    with pytest.raises(SystemExit):
        parser.parse_args([f'--jobs={text}'])
    said = capsys.readouterr().err
    assert 'is not a number of processes; give 1 or more' in said
    assert len(said) < 300


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
