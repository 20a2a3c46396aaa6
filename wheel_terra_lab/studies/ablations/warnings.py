# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Tell the stuck warning of a drive once more what it was told, without the filter.

A treatment of the warning changes nothing but the warning, so the filter need not run again: what
its monitor was told is kept, steps that were made again for late inputs included, and told to
another monitor. That takes a tenth of the time.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.judgement.stuck.monitor import StuckMonitor
from wheel_terra_estimator.estimation.judgement.stuck.settings import StuckSettings
from wheel_terra_estimator.estimation.wheel_soil_estimator import WheelSoilEstimator
from wheel_terra_lab.studies.ablations.switches import patched

_PUBLISHED = 'published'
_MONITOR = 'judgement.stuck.monitor:StuckMonitor.'


class Told:
    """What the monitor of one estimator was told, in order."""

    def __init__(self) -> None:
        self._calls: list[tuple[str, tuple[Any, ...]]] = []
        self._states: list[Any] = [None]  # before the first call, after each
        self._place: dict[int, int] = {}  # of a state among them, by its identity
        self._said: list[bool] = []

    def note(self, monitor: Any, name: str, arguments: tuple[Any, ...] = ()) -> None:
        """Keep a call that was made, and the state that it left."""
        self._calls.append((name, arguments))
        self._place[id(monitor.state)] = len(self._states)
        self._states.append(monitor.state)
        if name == _PUBLISHED:
            self._said.append(monitor.state.stuck)

    @property
    def said(self) -> NDArray[np.bool_]:
        """Whether this monitor warned, at each set that was published."""
        return np.array(self._said, dtype=bool)

    def place(self, state: Any) -> int:
        """Return behind how many calls the monitor was in a state."""
        return self._place.get(id(state), 0)

    def played(self, configuration: Configuration) -> NDArray[np.bool_]:
        """Return whether another monitor warns, at each set that was published."""
        monitor = StuckMonitor(StuckSettings.from_configuration(configuration))
        states, stuck = [monitor.state], []
        for name, arguments in self._calls:
            if name == _PUBLISHED:
                stuck.append(monitor.state.stuck)
            elif name == 'restore':
                monitor.restore(states[arguments[0]])
            else:
                getattr(monitor, name)(*arguments)
            states.append(monitor.state)
        return np.array(stuck, dtype=bool)


@contextlib.contextmanager
def listening() -> Iterator[Told]:
    """Keep what the monitor of the estimator that runs meanwhile is told."""
    told = Told()
    with contextlib.ExitStack() as stack:
        for name in ('update', 'reset'):
            stack.enter_context(patched(f'{_MONITOR}{name}', _noted(told, name))())
        restore, estimates = StuckMonitor.restore, WheelSoilEstimator.estimates

        def restored(self: StuckMonitor, snapshot: Any) -> None:
            place = told.place(snapshot)
            restore(self, snapshot)
            told.note(self, 'restore', (place,))

        def published(self: WheelSoilEstimator) -> Any:
            told.note(self._stuck, _PUBLISHED)
            return estimates(self)

        stack.enter_context(patched(f'{_MONITOR}restore', restored)())
        stack.enter_context(
            patched('wheel_soil_estimator:WheelSoilEstimator.estimates', published)()
        )
        yield told


def _noted(told: Told, name: str) -> Any:
    call = getattr(StuckMonitor, name)

    def noted(self: StuckMonitor, *arguments: Any) -> Any:
        result = call(self, *arguments)
        told.note(self, name, arguments)
        return result

    return noted
