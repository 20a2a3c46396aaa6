# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A page of a sentence and tables: what ``check`` and ``bench`` print, to be kept or sent."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wheel_terra_estimator.checks.finding import CheckReport
from wheel_terra_estimator.checks.series import Recording
from wheel_terra_estimator.reporting.html import render, write_page


@dataclass(frozen=True)
class Table:
    """A table with a title; the first cell of a row is its name."""

    title: str
    head: tuple[str, ...]
    rows: Sequence[Sequence[Any]]


def write_tables(
    path: Path, title: str, verdict: str, tone: str, tables: Sequence[Table], overwrite: bool
) -> None:
    """Write the page; ``tone``: ``good``, ``warn`` or ``bad``; tables without rows are left out."""
    shown = [table for table in tables if table.rows]
    page = render('tables.html', title=title, verdict=verdict, tone=tone, tables=shown)
    write_page(path, page, overwrite)


def write_check(path: Path, recording: Recording, report: CheckReport, overwrite: bool) -> None:
    """Write what a check found, what it could not look at, and the figures behind both."""
    findings = [
        (f.wheel or f.topic, f.words, f.cure, f'{100 * f.confidence:.0f} %')
        for f in report.findings
    ]
    count = len(findings)
    verdict = f'{count or "No"} finding{"" if count == 1 else "s"}.'
    tables = (
        Table('Findings', ('where', 'what was seen', 'what to do', 'confidence'), findings),
        Table('Not checked', ('what', 'why'), [(n.kind, n.reason) for n in report.not_checked]),
        Table('Topics', ('topic', 'type', 'messages'), recording.topics),
        Table('Figures', ('what', 'value'), list(report.figures.items())),
    )
    tone = 'bad' if count else 'good'
    write_tables(path, f'{recording.name}: check', verdict, tone, tables, overwrite)
