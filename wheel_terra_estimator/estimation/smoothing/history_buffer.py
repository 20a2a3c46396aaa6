# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What the forward pass of the estimator keeps, and the backward pass over it.

* A prediction, a covariance inflation (process noise) and a reset of one entry (its row of the
  transition matrix is zero) are transitions: mean and covariance before and after, and F are kept.
* Of a measurement update nothing is kept: the backward pass needs its result alone, which is the
  state before the next transition.
* A restart of the filter is a cut: nothing is carried back over it.

Of a covariance one triangle is kept, of F the entries that differ from the identity.

Backward pass (Rauch, Tung and Striebel 1965; Särkkä 2013, algorithm 9.1): with x, P after the last
update, x', P' after the transition and x_s', P_s' smoothed there::

    G   = P F^T P'^-1
    x_s = x + G (x_s' - x')
    P_s = P + G (P_s' - P') G^T
"""

from __future__ import annotations

import os
import pickle
import tempfile
import weakref
from array import array
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.errors import UserError

Item = TypeVar('Item')
LARGE_FILES = Path('/var/tmp')
"""Folder for large temporary files: on many systems /tmp lies in memory."""
_LEAST_PIVOT = 1e-7
"""Least pivot of the Cholesky factor of a correlation matrix [-]: with a smaller one its inverse is
lost in rounding."""


class DiskBuffer(Generic[Item]):
    """A list in a temporary file, so that a long drive does not fill the memory.

    Items are in the order in which they were added; only their positions are in memory. The file is
    deleted with the object. It lies in the folder that the environment variable ``TMPDIR`` names,
    else in ``/var/tmp`` where there is one.
    """

    def __init__(self) -> None:
        folder = LARGE_FILES if not os.environ.get('TMPDIR') and LARGE_FILES.is_dir() else None
        self._file = tempfile.TemporaryFile(dir=folder)  # noqa: SIM115 - closed with the object
        weakref.finalize(self, self._file.close)
        self._places = array('q', [0])  # where each item begins, and where the next one will
        self._at_end = True

    def __len__(self) -> int:
        return len(self._places) - 1

    def append(self, item: Item) -> None:
        """Add an item; a `UserError` where no room is left."""
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
    """A change of the state, linearised: x' = F x + constant + noise."""

    before: Gaussian
    F: FloatArray  # (size, size)
    after: Gaussian


class Mark(NamedTuple):
    """Inputs of the forward pass whose outputs are recomputed from the smoothed state."""

    position: int  # transitions before it
    content: Any


class HistoryBuffer:
    """Transitions and marks of a drive in the order of their stamps.

    Like a component of the estimator it has snapshots: where the estimator returns to an earlier
    state for a late input, the buffer is truncated to that state.
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
        """Keep inputs that belong to the present state."""
        position = len(self)
        self.marks.append(Mark(position, content))
        self._end = position, present

    @property
    def end(self) -> Gaussian | None:
        """The filter's state after the last transition; None where it is not known."""
        if self._end is None or self._end[0] != len(self):
            return None
        return self._end[1]

    # -- Part of the estimator -------------------------------------------------------------------

    def reset(self) -> None:
        """Keep everything: a new run of the same recording follows after the cut."""

    @property
    def state(self) -> tuple[int, int]:
        """How far the buffer is: transitions and marks; setting it winds back."""
        return len(self), len(self.marks)

    @state.setter
    def state(self, lengths: tuple[int, int]) -> None:
        self._transitions.truncate(lengths[0])
        self.marks.truncate(lengths[1])


def packed(state: Gaussian) -> tuple[FloatArray, FloatArray]:
    """Return the mean and the lower triangle of the covariance, row by row."""
    return state.mean.copy(), state.covariance[np.tril_indices(len(state.mean))]


def unpacked(kept: tuple[FloatArray, FloatArray]) -> Gaussian:
    """Return the state of which `packed` gave the parts."""
    mean, triangle = kept
    covariance = np.zeros((len(mean),) * 2)
    covariance[np.tril_indices(len(mean))] = triangle
    return Gaussian(mean, covariance + np.tril(covariance, -1).T)


def smoothed_before(
    transition: Transition, later: Gaussian | None, lower: FloatArray, upper: FloatArray
) -> Gaussian:
    """Return the smoothed state before a transition of the forward pass, within bounds (size,).

    `later` is the smoothed state after it, None at a cut. Where the covariance cannot be inverted
    the filter's own state is returned.
    """
    before, F, after = transition
    if later is None:
        return before
    scale = 1.0 / np.sqrt(np.diagonal(after.covariance))
    correlation = after.covariance * np.outer(scale, scale)
    try:
        pivots = np.diagonal(np.linalg.cholesky(correlation))
    except np.linalg.LinAlgError:
        return before
    if not pivots.min() > _LEAST_PIVOT:
        return before
    crossed = (F @ before.covariance) * scale[:, None]
    gain = np.linalg.solve(correlation, crossed).T * scale
    mean = before.mean + gain @ (later.mean - after.mean)
    covariance = before.covariance + gain @ (later.covariance - after.covariance) @ gain.T
    covariance = 0.5 * (covariance + covariance.T)
    if not (np.isfinite(mean).all() and np.diagonal(covariance).min() > 0.0):
        return before
    return Gaussian(np.clip(mean, lower, upper), covariance)


def smoothed_states(
    buffer: HistoryBuffer, lower: FloatArray, upper: FloatArray
) -> Iterator[Gaussian | None]:
    """Yield the smoothed state at each position of a buffer, the last one (its length) first.

    None before a restart of the filter.
    """
    state = buffer.end
    yield state
    for position in range(len(buffer) - 1, -1, -1):
        transition = buffer.transition(position)
        state = None if transition is None else smoothed_before(transition, state, lower, upper)
        yield state
