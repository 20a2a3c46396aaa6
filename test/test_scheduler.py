# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Tasks side by side: a worker that dies takes no other task along."""

import argparse
import os
import signal
import socket
import time
from pathlib import Path
from threading import Thread

import pytest

from wheel_terra_estimator import scheduler
from wheel_terra_estimator.cli.main import main
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.scheduler import add_jobs_argument, finished


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


@pytest.mark.parametrize('greeting', [None, b'', b'SSH-2.0-OpenSSH_9.6\r\n', os.urandom(4096)])
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


def test_a_cluster_without_workers_is_said(monkeypatch):
    distributed = pytest.importorskip('dask.distributed')
    monkeypatch.setattr(scheduler, 'CONNECT_TIMEOUT', 60)
    monkeypatch.setattr(scheduler, 'WORKER_TIMEOUT', 1)
    with distributed.LocalCluster(n_workers=0, processes=False, dashboard_address=None) as cluster:
        address = cluster.scheduler_address
        with pytest.raises(UserError, match=f'no workers; start one with: dask worker {address}'):
            list(finished(root, [1.0, 4.0], address=address))


def test_an_empty_address_is_refused(capsys):
    with pytest.raises(SystemExit):
        main(['replay', 'a', 'b', '-o', 'c', '--scheduler', ''])
    assert 'argument --scheduler: an empty address' in capsys.readouterr().err


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
    assert 'is no number of processes; give 1 or more' in said
    assert len(said) < 300
