# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Estimates into a rosbag2 folder (MCAP), under the names that the node has by default."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from wheel_terra_estimator import __version__
from wheel_terra_estimator.bags.bag_file import BagFile
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.estimates import EstimateSet
from wheel_terra_estimator.messages import diagnostics, pack
from wheel_terra_estimator.messages.pack import OUTPUT_TYPES

NAMESPACE = f'/{diagnostics.NODE}'
STUCK = f'{NAMESPACE}/stuck'
STUCK_DIRECTION = f'{NAMESPACE}/stuck_direction'
LATCHED = (STUCK, STUCK_DIRECTION)
DIAGNOSTICS = '/diagnostics'
TOPICS = {
    **{f'{NAMESPACE}/{topic}': kind for topic, kind in OUTPUT_TYPES.items()},
    DIAGNOSTICS: 'diagnostic_msgs/msg/DiagnosticArray',
}
"""Full default name of every output and its type."""

_VERSION, _SETTINGS, _RECORDING = (
    f'{diagnostics.NODE}.{key}' for key in ('version', 'settings', 'recording')
)


class EstimateBagWriter(BagFile):
    """Writes estimates as the node would publish them; a context manager that always closes.

    ``statuses``: knows the counters and faults behind the estimates. Raises UserError where the
    path is taken or cannot be written.
    """

    def __init__(
        self,
        path: Path,
        names: tuple[str, ...],
        overwrite: bool = False,
        statuses: diagnostics.Diagnostics | None = None,
    ) -> None:
        super().__init__(path, TOPICS, latched=LATCHED, overwrite=overwrite)
        self._names = names
        self._diagnostics = statuses or diagnostics.Diagnostics(names)
        self._stuck: tuple[bool, int] | None = None

    def state_origin(self, configuration: Configuration, recording: str) -> None:
        """State version, settings and recording in the metadata of the bag."""
        self.note(_VERSION, __version__)
        self.note(_SETTINGS, json.dumps(configuration.flat(), separators=(',', ':')))
        self.note(_RECORDING, recording)

    def add(
        self,
        estimates: EstimateSet,
        log_time: int,
        statuses: Sequence[diagnostics.Status] | None = None,
    ) -> None:
        """Write all messages of a set at the log time [ns] of the input that completed it.

        `statuses` are what diagnostics said live, empty for nothing; None: it is asked now.
        """
        for topic, data in pack.pack(estimates, self._names):
            self.write(f'{NAMESPACE}/{topic}', data, log_time)
        self.write_stuck(estimates.stuck, estimates.stuck_direction, log_time)
        found = self._diagnostics.due(estimates) if statuses is None else statuses
        if found:
            self.write(DIAGNOSTICS, pack.diagnostic_array(estimates.stamp, found), log_time)

    def write_stuck(self, stuck: bool, direction: int, log_time: int) -> None:
        """Write the stuck warning where it changes; none at the start and after a reset."""
        if (stuck, direction) != self._stuck:
            self._stuck = stuck, direction
            self.write(STUCK_DIRECTION, pack.direction(direction), log_time)
            self.write(STUCK, pack.flag(stuck), log_time)
