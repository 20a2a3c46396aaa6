# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Independent tasks side by side: in processes of this machine, or on a Dask cluster."""

from __future__ import annotations

import argparse
import asyncio
import logging
import sys
import time
from collections import deque
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from queue import Empty, Queue
from typing import Any, TypeVar

from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.worker_pool import worker_pool

Task = TypeVar('Task')
Result = TypeVar('Result')

_MOST_DIGITS = 4  # of a number of processes
CONNECT_TIMEOUT = 10
"""Time [s] in which a Dask scheduler has to answer."""
LOOK = 5
"""Time [s] without a finished task after which the workers of a cluster are looked for."""
WORKER_TIMEOUT = 120
"""Time [s] that a cluster may be without workers."""


def add_jobs_argument(
    parser: argparse.ArgumentParser, *aliases: str, default: int = 1, words: str = 'in parallel'
) -> None:
    """Declare ``--jobs``, the same for every command; aliases are not shown in the help."""
    parser.add_argument('--jobs', type=_count, default=default, metavar='N', help=words)
    for alias in aliases:
        parser.add_argument(alias, dest='jobs', type=_count, help=argparse.SUPPRESS)


def add_scheduler_argument(parser: argparse.ArgumentParser, *aliases: str, what: str) -> None:
    """Declare ``--scheduler``, the same for every command; aliases are not shown in the help."""
    words = f'Dask scheduler whose workers take the {what}, over files that all of them see'
    for name in ('--scheduler', *aliases):
        parser.add_argument(
            name,
            dest='scheduler',
            type=_address,
            metavar='ADDRESS',
            help=argparse.SUPPRESS if name in aliases else words,
        )


def finished(
    function: Callable[[Task], Result], tasks: Sequence[Task], jobs: int = 1, address: str = ''
) -> Generator[tuple[int, Result | Exception], None, None]:
    """Run a function on tasks and yield (index, result or exception) in the order of finishing.

    A worker that dies (killed, out of memory) takes no other task along: those that it may have
    worked on are run once more. Raises UserError where Dask is not installed or its scheduler does
    not answer.

    Parameters
    ----------
    function : callable
        One at the top of a module, so that it can be sent to another process.
    tasks : sequence
        Its arguments, which can be pickled.
    jobs : int
        Processes on this machine.
    address : str
        Of a Dask scheduler; its workers are used in place of processes of this machine.
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
            outcome = UserError('its process was killed twice; is there enough memory?')
        yield index, outcome


def _on_cluster(
    function: Callable[[Task], Result], tasks: Sequence[Task], address: str
) -> Generator[tuple[int, Result | Exception], None, None]:
    client = _client(address)
    with client:
        done: Queue[int] = Queue()
        futures = client.map(function, tasks, pure=False)
        for i, future in enumerate(futures):
            future.add_done_callback(lambda _, i=i: done.put(i))
        watch = _ClusterWatch(client, address)
        try:
            for count in range(len(tasks)):
                while True:
                    try:
                        index = done.get(timeout=LOOK)
                        break
                    except Empty:
                        watch.look(count, len(tasks))
                if futures[index].cancelled():
                    raise UserError(
                        f'--scheduler {address}: the connection was lost; {count} of {len(tasks)} '
                        'tasks are done: look at the scheduler and run it again'
                    )
                yield index, _outcome(futures[index])
        except BaseException:
            with suppress(Exception):  # of a cluster that is gone there is nothing to call off
                client.cancel(futures, callback_timeout=LOOK)
            raise


def _client(address: str) -> Any:
    """Return a client of a scheduler that has answered."""
    try:
        from dask.distributed import Client, Security
        from distributed.comm import connect
    except ImportError as error:
        raise UserError(
            f"--scheduler: Dask is missing; pip install 'dask[distributed]' ({error})"
        ) from None
    for name in ('distributed', 'distributed.client'):
        logging.getLogger(name).setLevel(logging.CRITICAL)  # what is lost is told here

    async def greet() -> None:
        keys = Security().get_connection_args('client')
        comm = await connect(address, timeout=CONNECT_TIMEOUT, **keys)
        comm.abort()

    try:  # a client waits for ever for what accepts and is silent
        asyncio.run(asyncio.wait_for(greet(), CONNECT_TIMEOUT))
        return Client(address, timeout=CONNECT_TIMEOUT)
    except Exception as error:
        said = 'it speaks something else'
        if isinstance(error, (OSError, asyncio.TimeoutError)):
            said = str(error) or f'it is silent for {CONNECT_TIMEOUT} s'
        raise UserError(
            f'--scheduler {address}: no Dask scheduler answers there ({said}); '
            'start one with: dask scheduler'
        ) from None


class _ClusterWatch:
    """Says that no worker is there, and ends it when that lasts."""

    def __init__(self, client: Any, address: str) -> None:
        self._client, self._address = client, address
        self._alone_since: float | None = None

    def look(self, done: int, total: int) -> None:
        """Ask for the workers, some time after the last task was finished."""
        try:
            workers = self._client.sync(self._client.scheduler.ncores, callback_timeout=LOOK)
            state = 'has no workers; start one with: dask worker ADDRESS'
        except Exception:
            workers = None
            state = 'does not answer any more'
        if workers:
            self._alone_since = None
            return
        state = f'--scheduler {self._address}: it {state.replace("ADDRESS", self._address)}'
        now = time.monotonic()
        if self._alone_since is None:
            self._alone_since = now
            print(f'{state} (waiting for {WORKER_TIMEOUT:g} s)', file=sys.stderr, flush=True)
        elif now - self._alone_since > WORKER_TIMEOUT:
            raise UserError(f'{state}; {done} of {total} tasks are done')


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
        raise argparse.ArgumentTypeError(f"'{text[:20]}' is no number of processes; give 1 or more")
    return int(text)


def _address(text: str) -> str:
    if not text.strip():
        raise argparse.ArgumentTypeError('an empty address; leave the option out to run here')
    return text
