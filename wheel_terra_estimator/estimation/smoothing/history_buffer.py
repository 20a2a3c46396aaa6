# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What the forward pass of the estimator keeps for the backward pass.

The filter changes its state in four ways, and each is one thing to a smoother:

* a prediction, a widening (process noise by another name) and an entry that is set (its row of the
  transition matrix is zero) are transitions: mean and covariance before and after, and F;
* a measurement changes what is known of the state and not the state: nothing is kept;
* a start anew is a cut, over which nothing of the future is carried back.

So the prediction on the buffer is exactly what the next update started from. Of a covariance one
triangle is kept, of F what differs from no change.
"""

from __future__ import annotations

import os
import pickle
import tempfile
import weakref
from array import array
from pathlib import Path
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.errors import UserError

Item = TypeVar('Item')
LASTING = Path('/var/tmp')
"""Where temporary files may be large: on many systems /tmp lies in memory."""


class DiskBuffer(Generic[Item]):
    """A list in a temporary file, so that a long drive does not fill the memory.

    Items are in the order in which they were added; only their places are in memory.
    The file has no name and goes away with the object. It lies in the folder that the environment
    variable ``TMPDIR`` names, else in ``/var/tmp`` where there is one.
    """

    def __init__(self) -> None:
        lasting = LASTING if not os.environ.get('TMPDIR') and LASTING.is_dir() else None
        self._file = tempfile.TemporaryFile(dir=lasting)  # noqa: SIM115 - closed with the object
        weakref.finalize(self, self._file.close)
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


class Gaussian(NamedTuple):
    """Mean (size,) and covariance (size, size) of the state."""

    mean: FloatArray
    covariance: FloatArray


class Transition(NamedTuple):
    """A step of the state: x' = F x + ... + noise, to first order."""

    before: Gaussian
    F: FloatArray  # (size, size)
    after: Gaussian


class Mark(NamedTuple):
    """An item of the forward pass that is recomputed from the smoothed state."""

    position: int  # transitions before it
    content: Any


class HistoryBuffer:
    """Transitions and marks of a drive in the order of their stamps.

    It is a part of the estimator like any other: where the estimator goes back to an earlier state
    for a late input, the buffer is wound back with it.
    """

    def __init__(self) -> None:
        self._transitions: DiskBuffer[tuple[FloatArray, ...] | None] = DiskBuffer()  # None: a cut
        self.marks: DiskBuffer[Mark] = DiskBuffer()
        self._end: tuple[int, Gaussian] | None = None

    def __len__(self) -> int:
        return len(self._transitions)

    def add(self, before: Gaussian, F: FloatArray, after: Gaussian) -> None:
        """Keep a transition."""
        change = F - np.eye(len(F))
        places = np.flatnonzero(change)
        self._transitions.append(
            (*packed(before), places.astype(np.uint16), change.ravel()[places], *packed(after))
        )

    def cut(self) -> None:
        """Record a restart of the filter."""
        self._transitions.append(None)

    def transition(self, index: int) -> Transition | None:
        """Return a transition; None: a cut."""
        kept = self._transitions[index]
        if kept is None:
            return None
        mean, triangle, places, change, mean_after, triangle_after = kept
        F = np.eye(len(mean))
        F.ravel()[places] += change
        return Transition(unpacked((mean, triangle)), F, unpacked((mean_after, triangle_after)))

    def mark(self, content: Any, present: Gaussian) -> None:
        """Keep something that belongs to the present state."""
        position = len(self)
        self.marks.append(Mark(position, content))
        self._end = position, Gaussian(present.mean.copy(), present.covariance.copy())

    @property
    def end(self) -> Gaussian | None:
        """The filter's state after the last transition; None where it is not known."""
        if self._end is None or self._end[0] != len(self):
            return None
        return self._end[1]

    # -- Part of the estimator -------------------------------------------------------------------

    def reset(self) -> None:
        """Leave everything: a new run of the same recording goes on behind the cut."""

    def snapshot(self) -> tuple[int, int]:
        """Return how far the buffer is: transitions and marks."""
        return len(self), len(self.marks)

    def restore(self, snapshot: tuple[int, int]) -> None:
        """Wind the buffer back."""
        self._transitions.truncate(snapshot[0])
        self.marks.truncate(snapshot[1])


def packed(state: Gaussian) -> tuple[FloatArray, FloatArray]:
    """Return the mean and the lower triangle of the covariance, row by row."""
    return state.mean.copy(), state.covariance[np.tril_indices(len(state.mean))]


def unpacked(kept: tuple[FloatArray, FloatArray]) -> Gaussian:
    """Return the state of which `packed` gave the parts."""
    mean, triangle = kept
    covariance = np.zeros((len(mean),) * 2)
    covariance[np.tril_indices(len(mean))] = triangle
    return Gaussian(mean, covariance + np.tril(covariance, -1).T)
