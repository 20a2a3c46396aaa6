# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The simulator as the plant of the traction limiter: the same drive with it and without it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.checks.input_judge import InputJudge
from wheel_terra_estimator.control.traction_law import LimiterTuning
from wheel_terra_estimator.control.traction_limiter import (
    Estimates,
    Interlock,
    LimiterState,
    after_command,
    after_direction,
    after_estimates,
    after_stuck,
)
from wheel_terra_estimator.estimation.core import EstimatorCore
from wheel_terra_estimator.estimation.estimates import EstimateSet
from wheel_terra_estimator.reporting.style import LINE_COLOURS, picture_style
from wheel_terra_estimator.simulation.drive import Drive
from wheel_terra_estimator.simulation.drives import Command
from wheel_terra_estimator.simulation.scenario import Scenario, load
from wheel_terra_estimator.simulation.sensors import START, Arrival
from wheel_terra_lab.evaluation.kinds import LIMITER
from wheel_terra_lab.evaluation.tables import table

DEFAULTS = LimiterTuning()
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


def closed_loop(scenario: Scenario, seed: int, *, limited: bool) -> ClosedLoopDrive:
    """Drive the scenario's profile, with the traction limiter or without."""
    drive = Drive(scenario, seed)
    core = EstimatorCore(drive.configuration, judged_by=InputJudge)
    state = LimiterState(still_since=drive.plant.time)
    pending: list[Arrival] = []
    rows: list[tuple[float, float, FloatArray, FloatArray, float]] = []
    stopped: float | None = None
    reason = ''
    while drive.plant.time < scenario.duration - 1e-9:
        wanted = scenario.profile.at(drive.plant.time)
        command = (wanted.forward, 0.0, 0.0, 0.0, 0.0, wanted.turn_rate)
        state, decision = after_command(state, drive.plant.time, command, DEFAULTS)
        sent = state.sent if limited else command
        pending += drive.step(Command(sent[0], sent[5]))
        truth = drive.last_truth
        now = START + round(truth.time * 1e9)
        due = sorted((a for a in pending if a.arrival <= now), key=lambda a: a.arrival)
        pending = [a for a in pending if a.arrival > now]
        for arrival in due:
            for estimates in core.add(arrival.measurement):
                state = _after_set(state, truth.time, now, estimates)
        if stopped is None and state.interlock is not Interlock.FREE:
            stopped, reason = (truth.time if limited else None), state.reason
        scale = decision.scale if limited else 1.0
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
        reason=reason,
        health=core.health(),
    )


def _after_set(state: LimiterState, time: float, now: int, estimates: EstimateSet) -> LimiterState:
    """Return the state of the limiter after all messages of a set, as the nodes send them."""
    received = Estimates(
        (now - estimates.stamp) * 1e-9,
        estimates.slip.tolist(),
        estimates.slip_velocity.tolist(),
        estimates.slip_class.tolist(),
        estimates.rim_travel_left.tolist(),
    )
    state = after_estimates(state, time, received, DEFAULTS)
    if estimates.stuck != (state.interlock is Interlock.STUCK):
        state = after_direction(state, estimates.stuck_direction)
        state = after_stuck(state, estimates.stuck, change=True)
    return state


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


def draw(drive: Comparison, path: Path) -> None:
    """Draw a drive with and without the limiter: way, slip, sinkage, scale of the command."""
    from matplotlib.figure import Figure

    with picture_style():
        figure = Figure(figsize=(8.0, 7.2))
        axes = figure.subplots(4, 1, sharex=True)
        for name, run, colour in (
            ('without limiter', drive.free, LINE_COLOURS[1]),
            ('with limiter', drive.limited, LINE_COLOURS[0]),
        ):
            panels = {
                'way [m]': run.position,
                'median slip [-]': np.median(np.nan_to_num(run.slip), axis=1),
                'deepest wheel [mm]': 1e3 * run.sinkage.max(axis=1),
                'scale of the command [-]': run.scale,
            }
            for axis, (title, values) in zip(axes, panels.items(), strict=True):
                axis.plot(run.time, values, color=colour, label=name)
                axis.set_title(title)
        axes[0].legend(loc='lower right', bbox_to_anchor=(1.0, 1.0), ncols=2)
        axes[-1].set_xlabel('time [s]')
        figure.savefig(path, format='png', dpi=110)
