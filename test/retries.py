# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Tests that were tried again are named at the end of a run, and too many of them fail it."""

from typing import Any

import pytest

MOST = 3
"""More retries in one run are no whim of the machine."""


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """Name each retry, its place in the test and its reason."""
    retried = terminalreporter.stats.get('rerun', [])
    for report in retried:
        lines = report.longreprtext.splitlines() or ['']
        places = [line for line in lines if line.startswith(f'{report.location[0]}:')]
        reason = ' '.join([*places[:1], lines[-1]])
        terminalreporter.write_line(f'tried again: {report.nodeid} ({reason})')
    if len(retried) > MOST:
        terminalreporter.write_line(f'{len(retried)} retries, {MOST} are allowed: the run fails')


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Fail a run with too many; workers of a run have no reporter."""
    reporter = session.config.pluginmanager.get_plugin('terminalreporter')
    if reporter is not None and len(reporter.stats.get('rerun', [])) > MOST:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED
