# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Independent tasks side by side: in processes of this machine, or on a Dask cluster."""

from __future__ import annotations

import argparse
import asyncio
import logging
import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection
from multiprocessing.connection import wait as wait_for_one
from typing import Any, TypeVar

from wheel_terra_estimator.end_signals import terminations
from wheel_terra_estimator.errors import UserError

Task = TypeVar('Task')
Result = TypeVar('Result')

_MOST_DIGITS = 4  # of a number of processes
CONNECT_TIMEOUT = 10  # timeout of a Dask scheduler [s]
WORKER_TIMEOUT = 120  # time [s] in which a cluster has to have a worker


def add_jobs_argument(
    parser: argparse.ArgumentParser, default: int = 1, words: str = 'in parallel'
) -> None:
    """Declare ``--jobs``, the same for every command."""
    parser.add_argument('--jobs', type=_count, default=default, metavar='N', help=words)


def add_scheduler_argument(parser: argparse.ArgumentParser, what: str) -> None:
    """Declare ``--scheduler``, the same for every command."""
    words = f'Dask scheduler whose workers take the {what}, over files that all of them see'
    parser.add_argument('--scheduler', type=_address, metavar='ADDRESS', help=words)


def finished(
    function: Callable[[Task], Result], tasks: Sequence[Task], jobs: int = 1, address: str = ''
) -> Generator[tuple[int, Result | Exception], None, None]:
    """Run a function on tasks and yield (index, result or exception) in the order of finishing.

    A worker that dies (killed, out of memory) takes no other task along: those that it may have
    worked on are run once more. Raises UserError where Dask is not installed or its scheduler does
    not answer.

    ``function`` stands at the top of a module and ``tasks`` can be pickled, so that both can be
    sent to another process. ``jobs``: processes on this machine; ``address``: of a Dask scheduler,
    whose workers are used in their place.
    """
    if address:
        return _on_cluster(function, tasks, address)
    return _on_this_machine(function, tasks, jobs)


def _on_this_machine(
    function: Callable[[Task], Result], tasks: Sequence[Task], jobs: int
) -> Generator[tuple[int, Result | Exception], None, None]:
    waiting = deque(range(len(tasks)))
    suspects: list[int] = []
    while waiting:
        with worker_pool(min(jobs, len(waiting))) as pool:
            running: dict[Future[Result], int] = {}
            broken = False
            while (waiting or running) and not broken:
                while waiting and len(running) < jobs and not broken:
                    try:
                        running[pool.submit(function, tasks[waiting[0]])] = waiting[0]
                        waiting.popleft()
                    except BrokenProcessPool:
                        broken = True
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    index = running.pop(future)
                    outcome = _outcome(future)
                    if isinstance(outcome, BrokenProcessPool):
                        suspects.append(index)
                        broken = True
                    else:
                        yield index, outcome
            suspects += running.values()
    for index in suspects:
        with worker_pool(1) as pool:
            outcome = _outcome(pool.submit(function, tasks[index]))
        if isinstance(outcome, BrokenProcessPool):
            outcome = UserError('its process was killed twice; not enough memory?')
        yield index, outcome


@contextmanager
def worker_pool(processes: int) -> Iterator[ProcessPoolExecutor]:
    """Yield a pool of processes; after an error in the block its workers are stopped at once.

    Raises UserError where the machine has no shared memory left for them.
    """
    receiver, sender = multiprocessing.Pipe(duplex=False)
    try:
        pool = ProcessPoolExecutor(processes, initializer=_watch, initargs=(receiver,))
    except (OSError, ImportError) as error:  # its semaphores are files there
        raise UserError(
            f'parallel processes need shared memory: {error}; look at df -h /dev/shm and make '
            'room (in a container: --shm-size)'
        ) from None
    try:
        yield pool
    except BaseException:
        sender.send_bytes(b'stop')  # never removed, so that every worker sees it
        raise
    finally:
        pool.shutdown(cancel_futures=True)
        sender.close()
        receiver.close()


def _watch(receiver: Connection) -> None:
    """End a worker with its parent or at its request; Ctrl-C is handled by the parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    for number in terminations():
        signal.signal(number, signal.SIG_DFL)
    parent = multiprocessing.parent_process()
    watched: list[Any] = [receiver] if parent is None else [receiver, parent.sentinel]

    def end_with_parent() -> None:
        wait_for_one(watched)
        os._exit(1)

    threading.Thread(target=end_with_parent, daemon=True).start()


def _on_cluster(
    function: Callable[[Task], Result], tasks: Sequence[Task], address: str
) -> Generator[tuple[int, Result | Exception], None, None]:
    with _client(address) as client:
        from dask.distributed import as_completed

        futures = client.map(function, tasks, pure=False)
        index = {future.key: i for i, future in enumerate(futures)}
        done = 0
        try:
            for future in as_completed(futures):
                if future.cancelled():
                    raise UserError(
                        f'--scheduler {address}: the connection was lost; {done} of {len(tasks)} '
                        'tasks are done: look at the scheduler and run it again'
                    )
                yield index[future.key], _outcome(future)
                done += 1
        except BaseException:
            with suppress(Exception):  # a cluster that is gone has nothing to cancel
                client.cancel(futures)
            raise


def _client(address: str) -> Any:
    """Return a client of a scheduler that has answered and has a worker."""
    try:
        from dask.distributed import Client, Security
        from distributed.comm import connect
    except ImportError as error:
        raise UserError(
            f"--scheduler: Dask is missing; pip install 'dask[distributed]' ({error})"
        ) from None
    for name in ('distributed', 'distributed.client'):
        logging.getLogger(name).setLevel(logging.CRITICAL)  # what is lost is reported here

    async def greet() -> None:
        keys = Security().get_connection_args('client')
        (await connect(address, timeout=CONNECT_TIMEOUT, **keys)).abort()

    try:  # a client waits for ever for what accepts and is silent
        asyncio.run(asyncio.wait_for(greet(), CONNECT_TIMEOUT))
        client = Client(address, timeout=CONNECT_TIMEOUT)
    except Exception as error:
        said = str(error) or f'no answer for {CONNECT_TIMEOUT} s'
        raise UserError(
            f'--scheduler {address}: no Dask scheduler answers there ({said}); '
            'start one with: dask scheduler'
        ) from None
    try:
        client.wait_for_workers(1, timeout=WORKER_TIMEOUT)
    except (TimeoutError, asyncio.TimeoutError):
        client.close()
        raise UserError(
            f'--scheduler {address}: it has no workers; start one with: dask worker {address}'
        ) from None
    return client


def _outcome(future: Any) -> Any:
    """Return the result of a future (of either kind), or the exception that it ended with."""
    error = future.exception()
    if error is None:
        return future.result()
    if isinstance(error, Exception):
        return error
    return UserError(f'a task ended its process ({error!r})')


def _count(text: str) -> int:
    if not (text.isdecimal() and len(text) <= _MOST_DIGITS and int(text) > 0):
        raise argparse.ArgumentTypeError(
            f"'{text[:20]}' is not a number of processes; give 1 or more"
        )
    return int(text)


def _address(text: str) -> str:
    if not text.strip():
        raise argparse.ArgumentTypeError('an empty address; leave the option out to run here')
    return text
