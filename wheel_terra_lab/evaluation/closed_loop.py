# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The simulator as the plant of the traction limiter: the same drive with it and without it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.checks.watched_estimator import WatchedEstimator
from wheel_terra_estimator.estimation.core import EstimatorCore
from wheel_terra_estimator.estimation.traction_law import (
    TractionDecision,
    TractionLimits,
    traction_decision,
)
from wheel_terra_estimator.simulation.commands import Command
from wheel_terra_estimator.simulation.drive import Drive
from wheel_terra_estimator.simulation.scenario import Scenario, load
from wheel_terra_estimator.simulation.sensors import START, Arrival
from wheel_terra_lab.evaluation.kinds import LIMITER
from wheel_terra_lab.evaluation.tables import table

FloatArray = NDArray[np.float64]
_FRONT = 0.5  # [m] from the middle of the rover to beyond its front wheels


@dataclass(frozen=True)
class ClosedLoopDrive:
    """Course of a drive, one row per step of the plant."""

    time: FloatArray
    position: FloatArray  # along the path [m]
    sinkage: FloatArray  # (k, n) truth [m]
    slip: FloatArray  # (k, n) truth, nan at rest
    scale: FloatArray  # of the command
    stopped: float | None  # when the limiter stopped the rover [s]
    reason: str
    health: dict[str, Any]  # of the estimator


def closed_loop(
    scenario: Scenario, seed: int, *, limited: bool, limits: TractionLimits | None = None
) -> ClosedLoopDrive:
    """Drive the scenario's profile, the command scaled by the traction law or not.

    A stop is latched, as the node does it until a reset: what was about to entrap the rover is
    still below its wheels.
    """
    drive = Drive(scenario, seed)
    core = EstimatorCore(drive.configuration, watched_by=WatchedEstimator)
    limits = limits or TractionLimits()
    decision = TractionDecision(1.0, False, 'command passes')
    pending: list[Arrival] = []
    rows: list[tuple[float, float, FloatArray, FloatArray, float]] = []
    stopped: float | None = None
    while drive.plant.time < scenario.duration - 1e-9:
        wanted = scenario.profile.at(drive.plant.time)
        scale = decision.scale if limited else 1.0
        pending += drive.step(Command(scale * wanted.forward, scale * wanted.turn_rate))
        truth = drive.last_truth
        now = START + round(truth.time * 1e9)
        due = sorted((a for a in pending if a.arrival <= now), key=lambda a: a.arrival)
        pending = [a for a in pending if a.arrival > now]
        for arrival in due:
            for s in core.add(arrival.measurement):
                if stopped is None:
                    decision = traction_decision(
                        s.slip.tolist(),
                        s.slip_class.tolist(),
                        s.rim_travel_left.tolist(),
                        s.stuck,
                        limits,
                    )
                    if limited and decision.stop:
                        stopped = truth.time
        rows.append(
            (truth.time, float(truth.position[0]), truth.sinkage.copy(), truth.slip.copy(), scale)
        )
    columns = list(zip(*rows, strict=True))
    return ClosedLoopDrive(
        time=np.array(columns[0]),
        position=np.array(columns[1]),
        sinkage=np.array(columns[2]),
        slip=np.array(columns[3]),
        scale=np.array(columns[4]),
        stopped=stopped,
        reason=decision.reason,
        health=core.health(),
    )


@dataclass(frozen=True)
class Comparison:
    """The same drive without and with the limiter; `radius` of the wheels [m]."""

    seed: int
    radius: float
    free: ClosedLoopDrive
    limited: ClosedLoopDrive


def compare(seeds: Sequence[int]) -> list[Comparison]:
    """Drive the scenario ``kinds.LIMITER`` twice for each seed."""
    scenario = load(dict(LIMITER))
    radius = float(np.min(scenario.configuration.wheels.radius))
    return [
        Comparison(
            seed,
            radius,
            closed_loop(scenario, seed, limited=False),
            closed_loop(scenario, seed, limited=True),
        )
        for seed in seeds
    ]


def report(drives: Sequence[Comparison]) -> str:
    """Return a table of the deepest wheel in shares of the radius, one row per seed."""
    start = LIMITER['patches.start'][0] - LIMITER['patches.border']
    rows = []
    for d in drives:
        good = d.limited.position < start - _FRONT
        deepest = [
            f'{part.max() / d.radius:.2f}'
            for part in (d.limited.sinkage[good], d.limited.sinkage, d.free.sinkage)
        ]
        stopped = 'got through' if d.limited.stopped is None else f'{d.limited.stopped:.1f}'
        rows.append((str(d.seed), *deepest, stopped, d.limited.reason))
    return table(
        ('seed', 'good ground', 'with limiter', 'without', 'stopped at [s]', 'because'), rows
    )
