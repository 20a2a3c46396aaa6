# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The checks before a recording is replayed, or played to the node."""

from __future__ import annotations

from collections.abc import Mapping

from wheel_terra_estimator.bags.series_reader import read_series
from wheel_terra_estimator.bags.storage import Bag
from wheel_terra_estimator.checks.finding import INTERNAL_ERROR, CheckReport, shown
from wheel_terra_estimator.checks.run import check_recording, run_apart
from wheel_terra_estimator.configuration.configuration import Configuration

QUICK_MESSAGES = 60_000
"""Messages of a topic that the checks before a replay look at."""


def check_before(bag: Bag, configuration: Configuration, remaps: Mapping[str, str]) -> CheckReport:
    """Return what the checks found; nothing that fails there keeps the replay from its work."""
    report = CheckReport()
    recording = run_apart(
        report,
        'order',
        None,
        lambda: read_series(bag, remaps, bag.path.resolve().name, QUICK_MESSAGES),
    )
    return report if recording is None else check_recording(recording, configuration, tuple(remaps))


def as_lines(checked: CheckReport) -> list[str]:
    """Return the lines of a terminal."""
    return [
        *(f'finding: {line}' for line in shown(checked.findings)),
        *(
            f'not checked: {entry.kind}: {entry.reason}'
            for entry in checked.not_checked
            if entry.reason == INTERNAL_ERROR
        ),
    ]
