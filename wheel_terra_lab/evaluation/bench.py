# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Run kinds of drives times seeds times modes, in processes, and keep the scores."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

from wheel_terra_estimator.configuration.ros_yaml import Value
from wheel_terra_estimator.estimation.judgement.stuck.forecast import StuckSettings
from wheel_terra_estimator.estimation.measurements import Measurement
from wheel_terra_estimator.scheduler import finished
from wheel_terra_lab.evaluation import baselines, scores
from wheel_terra_lab.evaluation.bench_drive import BenchDrive
from wheel_terra_lab.evaluation.foresight import Foresight, foresight
from wheel_terra_lab.evaluation.runner import (
    SMOOTHED,
    inputs_of_mode,
    record,
    run_estimator,
)
from wheel_terra_lab.evaluation.simulators import SIMULATORS
from wheel_terra_lab.evaluation.two_state_filters import slip_course


@dataclass(frozen=True)
class DriveScore:
    """Scores of one drive in one mode."""

    kind: str
    seed: int
    mode: str
    samples: scores.Samples
    warnings: scores.Warnings
    health: dict[str, Any]
    simulator: str = 'A'
    foresight: Foresight | None = None


@dataclass
class Results:
    """All scores of a run of the bench."""

    drives: list[DriveScore] = field(default_factory=list)
    interrupted: str = ''  # in words, if not all drives were run

    @property
    def simulators(self) -> list[str]:
        """Simulators of which there are drives."""
        return [name for name in SIMULATORS if any(d.simulator == name for d in self.drives)]

    def of_mode(self, mode: str, simulator: str | None = None) -> dict[str, list[DriveScore]]:
        """Return kind -> drives of a mode, of one simulator or of all."""
        found: dict[str, list[DriveScore]] = defaultdict(list)
        for drive in self.drives:
            if drive.mode == mode and simulator in (None, drive.simulator):
                found[drive.kind].append(drive)
        return dict(found)


def score_drive(
    simulator: str,
    kind: str,
    seed: int,
    modes: Sequence[str],
    rover: str | None = None,
    overrides: Mapping[str, Value] | None = None,
) -> list[DriveScore]:
    """Simulate one drive and score the estimator on it in each mode.

    ``overrides`` are parameters of the estimator that differ from those of the drive.
    """
    drive = SIMULATORS[simulator].simulate(kind, seed, None, rover)
    if overrides:
        drive = replace(drive, configuration=drive.configuration.replace(overrides))
    return [score_mode(simulator, kind, seed, mode, drive) for mode in modes]


def score_mode(simulator: str, kind: str, seed: int, mode: str, drive: BenchDrive) -> DriveScore:
    """Score the estimator in one mode on a drive."""
    configuration, truth = drive.configuration, drive.truth
    measurements = list(inputs_of_mode(drive.arrivals, mode))
    smooth = mode.startswith(SMOOTHED)
    sets, health = run_estimator(configuration, measurements, smooth)
    kept = record(sets, health)
    radius = configuration.wheels.slip_radius
    return DriveScore(
        kind=kind,
        seed=seed,
        mode=mode,
        samples=scores.samples(truth, kept, _baselines(drive, measurements), radius),
        warnings=scores.warnings(truth, kept, radius),
        health=health,
        simulator=simulator,
        foresight=foresight(truth, kept, radius, StuckSettings.from_configuration(configuration)),
    )


def _baselines(drive: BenchDrive, measurements: Sequence[Measurement]) -> scores.BaselineSlips:
    """Run the baselines over the measurements that the estimator got."""
    configuration, truth = drive.configuration, drive.truth
    wheels = configuration.wheels
    rim = truth.wheel_rate * wheels.slip_radius
    held, reckoned = (
        baselines.slip_of(
            speed(configuration, measurements, truth.stamp), truth.yaw_rate, rim, wheels.y
        )
        for speed in (baselines.held_speed, baselines.dead_reckoned_speed)
    )
    return scores.BaselineSlips(
        held,
        reckoned,
        slip_course(configuration, measurements, truth.stamp, 'torque'),
        slip_course(configuration, measurements, truth.stamp, 'pitch'),
        slip_course(configuration, measurements, truth.stamp, 'curve'),
    )


def run(
    chosen: Sequence[tuple[str, str]],
    seeds: Sequence[int],
    modes: Sequence[str],
    processes: int = 1,
    progress: Callable[[str], object] | None = None,
    rover: str | None = None,
    overrides: Mapping[str, Value] | None = None,
) -> Results:
    """Run the bench over pairs of simulator and kind, with a rover file in place of the kinds' own.

    ``overrides`` as in `score_drive`.

    Drives come in the order in which they finish, results do not depend on it. Interrupted, it
    returns the drives that are done.
    """
    results = Results()
    tasks = [(simulator, kind, seed) for seed in seeds for simulator, kind in chosen]
    done = 0
    try:
        for scores_of_drive, words in _scored(tasks, modes, processes, rover, overrides):
            results.drives += scores_of_drive
            done += 1
            if progress:
                progress(words)
    except KeyboardInterrupt:
        if not done:
            raise
        results.interrupted = f'interrupted: {done} of {len(tasks)} drives'
    results.drives.sort(key=lambda d: (d.simulator, d.kind, d.seed, d.mode))
    return results


def _scored(
    tasks: Sequence[tuple[str, str, int]],
    modes: Sequence[str],
    processes: int,
    rover: str | None,
    overrides: Mapping[str, Value] | None,
) -> Iterator[tuple[list[DriveScore], str]]:
    """Yield the scores of each drive and its name."""
    if processes == 1:
        for task in tasks:
            yield score_drive(*task, modes, rover, overrides), ' '.join(map(str, task))
        return
    score = partial(_score, modes=modes, rover=rover, overrides=overrides)
    with closing(finished(score, tasks, processes)) as outcomes:
        for index, outcome in outcomes:
            if isinstance(outcome, Exception):
                raise outcome
            yield outcome, ' '.join(map(str, tasks[index]))


def _score(
    task: tuple[str, str, int],
    modes: Sequence[str],
    rover: str | None,
    overrides: Mapping[str, Value] | None,
) -> list[DriveScore]:
    return score_drive(*task, modes, rover, overrides)
