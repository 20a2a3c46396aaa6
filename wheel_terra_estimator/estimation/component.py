# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What all parts of the estimator have in common."""

from __future__ import annotations

from typing import Generic, TypeVar

State = TypeVar('State')


class Component(Generic[State]):
    """A part of the estimator whose whole memory is one immutable value.

    ``update`` replaces that value; it never changes it. So `state`, the present memory, is a
    snapshot for everyone to read, and setting it goes back to one.
    """

    def __init__(self, start: State) -> None:
        self._start = start
        self.state = start

    def reset(self) -> None:
        """Go back to the start of a run."""
        self.state = self._start
