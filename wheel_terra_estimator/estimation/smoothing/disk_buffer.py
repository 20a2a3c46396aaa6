# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A list that lies in a temporary file, so that a long drive does not fill the memory."""

from __future__ import annotations

import os
import pickle
import tempfile
from array import array
from pathlib import Path
from typing import Generic, TypeVar

from wheel_terra_estimator.errors import UserError

Item = TypeVar('Item')
LASTING = Path('/var/tmp')
"""Where temporary files may be large: on many systems /tmp lies in memory."""


class DiskBuffer(Generic[Item]):
    """Items in the order in which they were added; only their places are in memory.

    The file has no name and goes away with the object. It lies in the folder that the environment
    variable ``TMPDIR`` names, else in ``/var/tmp`` where there is one.
    """

    def __init__(self) -> None:
        lasting = LASTING if not os.environ.get('TMPDIR') and LASTING.is_dir() else None
        self._file = tempfile.TemporaryFile(dir=lasting)  # noqa: SIM115 - closed with the object
        self._places = array('q', [0])  # where each item begins, and where the next one will
        self._at_end = True

    def __len__(self) -> int:
        return len(self._places) - 1

    def append(self, item: Item) -> None:
        """Add an item.

        Raises
        ------
        UserError
            No room is left.
        """
        end = self._places[-1]
        data = pickle.dumps(item, protocol=pickle.HIGHEST_PROTOCOL)
        try:
            if not self._at_end:
                self._file.seek(end)
                self._at_end = True
            self._file.write(data)
        except OSError as error:
            raise UserError(
                f'temporary files of the smoother: {error.strerror or error} after {end} bytes; '
                'set TMPDIR to a folder with more room'
            ) from None
        self._places.append(end + len(data))

    def __getitem__(self, index: int) -> Item:
        """Return an item by its index from 0 on."""
        if not 0 <= index < len(self):
            raise IndexError(index)
        begin, end = self._places[index], self._places[index + 1]
        self._file.seek(begin)
        self._at_end = False
        item: Item = pickle.loads(self._file.read(end - begin))
        return item

    def truncate(self, length: int) -> None:
        """Forget all items from an index on."""
        if length < len(self):
            del self._places[length + 1 :]
            self._at_end = False
