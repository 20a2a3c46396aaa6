# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Many drives in one table and on one page, the worst first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from wheel_terra_estimator.checks.finding import CheckReport
from wheel_terra_estimator.csv_file import write_csv
from wheel_terra_estimator.estimation.estimates import SlipClass
from wheel_terra_estimator.reporting.drive_style import CLASS_COLOURS
from wheel_terra_estimator.reporting.drive_summary import DriveSummary
from wheel_terra_estimator.reporting.html import render, write_page

CLASSES = tuple(c.name.lower() for c in SlipClass)


@dataclass(frozen=True)
class DriveRow:
    """A drive among many; a drive that failed has an `error` and nothing else."""

    bag: str
    folder: str = ''  # below the output folder
    error: str = ''
    verdict: str = ''
    duration: float = 0.0  # [s]
    sets: int = 0
    stuck_warnings: int = 0
    first_warning: float | None = None  # [s] since the first set
    seconds: Mapping[str, float] = field(default_factory=dict)  # by class, mean of the wheels
    longest_stuck: float = 0.0  # [s], of the wheel that was longest in the class stuck
    max_slip: float | None = None  # None: not known
    max_sinkage: float | None = None  # [m]
    findings: tuple[str, ...] = ()

    @classmethod
    def from_drive(cls, bag: str, summary: DriveSummary, checked: CheckReport) -> DriveRow:
        """Return the row of a drive."""
        wheels = summary.wheels
        return cls(
            bag=bag,
            verdict=summary.verdict,
            duration=summary.duration,
            sets=summary.sets,
            stuck_warnings=len(summary.warnings),
            first_warning=summary.warnings[0].start if summary.warnings else None,
            seconds={c: sum(w.seconds[c] for w in wheels) / max(len(wheels), 1) for c in CLASSES},
            longest_stuck=max((w.seconds['stuck'] for w in wheels), default=0.0),
            max_slip=max((w.max_slip for w in wheels if w.max_slip is not None), default=None),
            max_sinkage=max(
                (w.max_sinkage for w in wheels if w.max_sinkage is not None), default=None
            ),
            findings=tuple(str(finding) for finding in checked.findings),
        )

    @classmethod
    def from_json(cls, kept: Mapping[str, Any]) -> DriveRow:
        """Return the row that was written with `dataclasses.asdict`."""
        known = {f.name for f in fields(cls)} & set(kept)
        return cls(**{**{k: kept[k] for k in known}, 'findings': tuple(kept.get('findings', ()))})

    @property
    def as_line(self) -> str:
        """The drive in a line."""
        if self.error:
            return f'{self.bag}: {self.error}'
        plural = '' if len(self.findings) == 1 else 's'
        found = f' {len(self.findings)} finding{plural}.' if self.findings else ''
        return f'{self.bag}: {self.duration:.1f} s. {self.verdict}{found}'


def write_table(rows: Sequence[DriveRow], path: Path) -> None:
    """Write ``summary.csv``: one row per recording in the order given, units in the header."""
    header = ['bag', 'folder', 'duration [s]', 'sets', 'stuck_warnings', 'first_warning [s]']
    header += [f'{c} [s]' for c in CLASSES]
    header += ['longest_stuck [s]', 'max_slip', 'max_sinkage [m]', 'findings', 'error']
    blank = [''] * (len(header) - 4)
    table: list[list[Any]] = [
        [r.bag, r.folder, *(blank if r.error else _figures(r)), '; '.join(r.findings), r.error]
        for r in rows
    ]
    write_csv(path, header, table)


def _figures(row: DriveRow) -> list[Any]:
    def text(value: float | None, digits: int) -> str:
        return '' if value is None else f'{value:.{digits}f}'

    figures = [text(row.duration, 3), row.sets, row.stuck_warnings, text(row.first_warning, 3)]
    figures += [text(row.seconds[c], 3) for c in CLASSES]
    return [*figures, text(row.longest_stuck, 3), text(row.max_slip, 4), text(row.max_sinkage, 4)]


def write_summary_page(rows: Sequence[DriveRow], path: Path, report: str) -> None:
    """Write the page over all drives; ``report``: name of the report in the folder of each."""
    drives = sorted(
        (row for row in rows if not row.error),
        key=lambda r: (r.stuck_warnings, r.longest_stuck, r.seconds['high'], r.max_slip or 0.0),
        reverse=True,
    )
    warned = sum(bool(row.stuck_warnings) for row in drives)
    page = render(
        'fleet.html',
        drives=drives,
        failed=[row for row in rows if row.error],
        cards=[
            (str(len(drives)), 'drives replayed'),
            (f'{sum(row.duration for row in drives) / 3600:.2f} h', 'of driving'),
            (str(warned), 'drives with a stuck warning'),
            (str(sum(bool(row.findings) for row in drives)), 'drives with findings'),
            (str(len(rows) - len(drives)), 'recordings that failed'),
        ],
        classes=[(c.name.lower(), colour) for c, colour in CLASS_COLOURS.items()],
        report=report,
    )
    write_page(path, page, overwrite=True)
