# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Estimates into a rosbag2 folder (MCAP), under the names that the node has by default."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from wheel_terra_estimator.bags.bag_file import BagFile
from wheel_terra_estimator.estimation.estimates import EstimateSet
from wheel_terra_estimator.messages import diagnostics
from wheel_terra_estimator.messages.convert import (
    OUTPUT_TYPES,
    joint_fields,
    twist_covariance,
)

NAMESPACE = f'/{diagnostics.NODE}'
STUCK = f'{NAMESPACE}/stuck'
DIAGNOSTICS = '/diagnostics'
TOPICS = {
    **{f'{NAMESPACE}/{topic}': kind for topic, kind in OUTPUT_TYPES.items()},
    DIAGNOSTICS: 'diagnostic_msgs/msg/DiagnosticArray',
}
"""Full default name of every output and its type."""


class EstimateBagWriter(BagFile):
    """Writes estimates as the node would publish them; a context manager that always closes.

    Parameters
    ----------
    path : Path
        Folder to be made.
    names : tuple of str
        Wheel names.
    overwrite : bool
        Whether an earlier bag at the same path is replaced.
    statuses : Diagnostics, optional
        Knows the counters and faults behind the estimates.
    inputs : iterable of Path
        See `BagFile`.

    Raises
    ------
    UserError
        The path is taken or cannot be written.
    """

    def __init__(
        self,
        path: Path,
        names: tuple[str, ...],
        overwrite: bool = False,
        statuses: diagnostics.Diagnostics | None = None,
        inputs: Iterable[Path] = (),
    ) -> None:
        super().__init__(path, TOPICS, latched=(STUCK,), overwrite=overwrite, inputs=inputs)
        self.names = names
        self._diagnostics = statuses or diagnostics.Diagnostics(names)
        self._stuck: bool | None = None

    def clear_stuck(self, log_time: int) -> None:
        """Write what the node sends at its start and after a reset: no stuck warning."""
        self._write_stuck(False, log_time)

    def add(self, estimates: EstimateSet, log_time: int) -> None:
        """Write all messages of a set at the log time [ns] of the input that completed it."""
        make = self.messages
        header = make.header(estimates.stamp)
        for topic, fields in joint_fields(estimates, self.names).items():
            self.write(f'{NAMESPACE}/{topic}', make.joint_state(header, *fields), log_time)
            if topic == 'slip':
                classes = make.slip_class(estimates.slip_class)
                self.write(f'{NAMESPACE}/slip_class', classes, log_time)
        twist = make.twist_stamped(
            header,
            estimates.forward_velocity,
            estimates.yaw_rate,
            twist_covariance(estimates),
        )
        self.write(f'{NAMESPACE}/twist', twist, log_time)
        self._write_stuck(estimates.stuck, log_time)
        if found := self._diagnostics.due(estimates):
            self.write(DIAGNOSTICS, make.diagnostic_array(header, found), log_time)

    def _write_stuck(self, stuck: bool, log_time: int) -> None:
        if stuck != self._stuck:
            self._stuck = stuck
            self.write(STUCK, self.messages.bool(stuck), log_time)
