# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""One recording from beginning to end: checks, estimates, errors against a truth, summary."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from wheel_terra_estimator.bags.replay import Options, Replay, replay
from wheel_terra_estimator.bags.series_reader import read_series
from wheel_terra_estimator.bags.storage import Bag, open_bag
from wheel_terra_estimator.bags.truth import Truth, read_truth
from wheel_terra_estimator.checks.finding import INTERNAL_ERROR, CheckReport, shown
from wheel_terra_estimator.checks.run import check_recording, run_apart
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.output_folder import new_file
from wheel_terra_estimator.reporting import drive_summary, estimates_table, truth_scores
from wheel_terra_estimator.reporting.drive_style import Border
from wheel_terra_estimator.reporting.drive_summary import DriveSummary, summarise
from wheel_terra_estimator.reporting.replay_report import write_replay_report

NO_SOIL = 'no soil was stated (--config): starting from sand with the spread of all shipped soils'

QUICK_MESSAGES = 60_000  # messages of a topic that the checks before a replay look at


@dataclass(frozen=True)
class Drive:
    """Summary of a recording after its replay."""

    configuration: Configuration
    checked: CheckReport
    result: Replay
    truth: Truth | None
    errors: truth_scores.TruthErrors | None
    summary: DriveSummary

    @property
    def as_text(self) -> str:
        """What the terminal shows."""
        lines = [drive_summary.as_text(self.summary)]
        if self.errors:
            lines += truth_scores.as_lines(self.errors)
        return '\n'.join(lines)

    def write(self, files: Mapping[str, Path], overwrite: bool) -> None:
        """Write those that have a path: ``table`` of the estimates, ``track``, ``report``."""
        history, track = self.result.history, self.result.track
        if 'table' in files:
            with new_file(files['table'], overwrite) as fresh:
                estimates_table.write_table(history, fresh)
        if 'track' in files:
            assert track is not None  # kept where it is asked for
            with new_file(files['track'], overwrite) as fresh:
                estimates_table.write_track(track, fresh)
        if 'report' in files:
            write_replay_report(
                files['report'],
                self.summary,
                self.result,
                self.truth,
                self.configuration,
                findings=self.checked.findings,
                errors=self.errors,
                overwrite=overwrite,
            )


def replay_drive(
    path: Path,
    configuration: Configuration,
    remaps: Mapping[str, str],
    output: Path | None,
    options: Options,
    on_checked: Callable[[CheckReport], None] = lambda checked: None,
) -> Drive:
    """Check a recording, run the estimator over it and sum it up.

    ``on_checked``: called with what the checks found, before the replay begins. Raises UserError as
    `bags.replay.replay`.
    """
    with open_bag(path) as bag:
        checked = check_before(bag, configuration, remaps)
        on_checked(checked)
        result = replay(bag, configuration, remaps, output, options)
        truth = read_truth(bag, remaps, configuration)
    return summed_up(path.resolve().name, configuration, checked, result, truth)


def summed_up(
    title: str,
    configuration: Configuration,
    checked: CheckReport,
    result: Replay,
    truth: Truth | None,
) -> Drive:
    """Return the summary of a recording after its replay."""
    errors = truth_scores.judged(result.history, truth, result.topics, configuration)
    notes = () if configuration.soil_stated else (NO_SOIL,)
    summary = summarise(title, result, Border.of(configuration), notes)
    return Drive(configuration, checked, result, truth, errors, summary)


def check_before(bag: Bag, configuration: Configuration, remaps: Mapping[str, str]) -> CheckReport:
    """Return the findings of the checks; a check that fails does not stop the replay."""
    report = CheckReport()
    recording = run_apart(
        report,
        'order',
        None,
        lambda: read_series(bag, remaps, bag.path.resolve().name, QUICK_MESSAGES),
    )
    return report if recording is None else check_recording(recording, configuration, tuple(remaps))


def findings_as_lines(checked: CheckReport) -> list[str]:
    """Return the lines of a terminal."""
    return [
        *(f'finding: {line}' for line in shown(checked.findings)),
        *(
            f'not checked: {entry.kind}: {entry.reason}'
            for entry in checked.not_checked
            if entry.reason == INTERNAL_ERROR
        ),
    ]
