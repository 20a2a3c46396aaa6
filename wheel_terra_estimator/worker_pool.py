# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Worker processes that end with their parent, however it ends (INT, TERM or KILL)."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing.connection import Connection, wait
from typing import Any

from wheel_terra_estimator.errors import UserError


@contextmanager
def worker_pool(processes: int) -> Iterator[ProcessPoolExecutor]:
    """Yield a pool of processes; after an error in the block its workers are stopped at once.

    Raises UserError where the machine has no shared memory left for them.
    """
    told, tell = multiprocessing.Pipe(duplex=False)
    try:
        pool = ProcessPoolExecutor(processes, initializer=_watch, initargs=(told,))
    except (OSError, ImportError) as error:  # its semaphores are files there
        raise UserError(
            f'processes side by side need shared memory: {error}; look at df -h /dev/shm and make '
            'room (in a container: --shm-size)'
        ) from None
    try:
        yield pool
    except BaseException:
        tell.send_bytes(b'stop')  # nobody takes it out, so that every worker sees it
        raise
    finally:
        pool.shutdown(cancel_futures=True)
        tell.close()
        told.close()


def _watch(told: Connection) -> None:
    """Let a worker end when its parent has ended or says so; Ctrl-C is the parent's affair."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    parent = multiprocessing.parent_process()
    watched: list[Any] = [told] if parent is None else [told, parent.sentinel]

    def end_with_parent() -> None:
        wait(watched)
        os._exit(1)

    threading.Thread(target=end_with_parent, daemon=True).start()
