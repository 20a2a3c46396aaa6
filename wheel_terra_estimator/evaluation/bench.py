# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Run kinds of drives times seeds times modes, in processes, and keep the scores."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field
from typing import Any

from wheel_terra_estimator.evaluation import baselines, kinds, scores
from wheel_terra_estimator.evaluation.runner import inputs_of_mode, record, run_estimator


@dataclass(frozen=True)
class DriveScore:
    """Scores of one drive in one mode."""

    kind: str
    seed: int
    mode: str
    samples: scores.Samples
    warnings: scores.Warnings
    health: dict[str, Any]


@dataclass
class Results:
    """All scores of a run of the bench."""

    drives: list[DriveScore] = field(default_factory=list)

    def of_mode(self, mode: str) -> dict[str, list[DriveScore]]:
        """Return kind -> drives of a mode."""
        found: dict[str, list[DriveScore]] = defaultdict(list)
        for drive in self.drives:
            if drive.mode == mode:
                found[drive.kind].append(drive)
        return dict(found)


def score_drive(kind: str, seed: int, modes: Sequence[str]) -> list[DriveScore]:
    """Simulate one drive and score the estimator on it in each mode."""
    from wheel_terra_estimator.simulation.drive import simulate
    from wheel_terra_estimator.simulation.scenario import load

    scenario = load(dict(kinds.FIRM if kind == 'firm' else kinds.KINDS[kind]))
    drive = simulate(scenario, seed)
    configuration, truth = drive.configuration, drive.truth
    wheels = configuration.wheels
    rim = truth.wheel_rate * wheels.slip_radius
    found = []
    for mode in modes:
        measurements = list(inputs_of_mode(drive.arrivals, mode))
        sets, health = run_estimator(configuration, measurements)
        kept = record(sets, health)
        held, reckoned = (
            baselines.slip_of(
                speed(configuration, measurements, truth.stamp), truth.yaw_rate, rim, wheels.y
            )
            for speed in (baselines.held_speed, baselines.dead_reckoned_speed)
        )
        found.append(
            DriveScore(
                kind,
                seed,
                mode,
                scores.samples(truth, kept, held, reckoned, wheels.slip_radius),
                scores.warnings(truth, kept, wheels.slip_radius),
                health,
            )
        )
    return found


def run(
    chosen: Sequence[str],
    seeds: Sequence[int],
    modes: Sequence[str],
    processes: int = 1,
    progress: Callable[[str], object] | None = None,
) -> Results:
    """Run the bench; drives come in the order in which they finish, results do not depend on it."""
    results = Results()
    tasks = [(kind, seed) for seed in seeds for kind in chosen]
    if processes == 1:
        for kind, seed in tasks:
            results.drives += score_drive(kind, seed, modes)
            if progress:
                progress(f'{kind} {seed}')
        return results
    with ProcessPoolExecutor(processes) as pool:
        waiting = {pool.submit(score_drive, k, s, modes): f'{k} {s}' for k, s in tasks}
        for future in as_completed(waiting):
            results.drives += future.result()
            if progress:
                progress(waiting[future])
    results.drives.sort(key=lambda d: (d.kind, d.seed, d.mode))
    return results
