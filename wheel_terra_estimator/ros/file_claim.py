# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Which of several nodes writes to a file."""

from __future__ import annotations

import errno
import os
from pathlib import Path
from typing import IO

from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.output_folder import cannot_write

_TAKEN = (errno.EWOULDBLOCK, errno.EACCES, errno.EAGAIN)  # by another process


class FileClaim:
    """The right of one node to write to a file: it holds the lock beside it (``.NAME.lock``).

    ``parameter`` is the one that names the file.
    """

    def __init__(self, path: Path, parameter: str) -> None:
        self._path = path
        self._parameter = parameter
        self._lock: IO[str] | None = None

    def take(self) -> None:
        """Make sure that this node, and no other, writes to the file.

        Raises UserError where another node does, or there is no place for the lock.
        """
        if not self._path.parent.is_dir():
            raise UserError(f'{self._path}: there is no folder {self._path.parent}; make it')
        if self._lock is not None:
            return
        try:
            import fcntl
        except ImportError:  # not a POSIX system
            return
        try:
            lock = self._path.with_name(f'.{self._path.name}.lock').open('a+', encoding='utf-8')
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError as error:
                lock.seek(0)
                holder = lock.read(100).strip()
                lock.close()
                if error.errno not in _TAKEN:
                    return  # a file system without locks
                raise UserError(
                    f'{self._path}: another node ({holder}) writes to it, so this one does not; '
                    f'give each a {self._parameter} of its own'
                ) from None
            self._lock = lock
            lock.truncate(0)
            lock.write(f'process {os.getpid()} on {os.uname().nodename}\n')
            lock.flush()
        except OSError as error:
            raise cannot_write(self._path, error) from None

    def release(self) -> None:
        """Let another node write to the file."""
        if self._lock is not None:
            self._lock.close()
            self._lock = None
