# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""One drive of many hours with faults: nothing of it is stored, an interrupted run goes on.

The rover drives new ground all the time (slopes, turns, stops, reverse, random sensor faults, late
and jittered messages). After every hour its figures are one line of JSON, and simulator and
estimator are kept whole in a file, so that a run that goes on gives the figures of one that was
never interrupted.
"""

from __future__ import annotations

import gc
import heapq
import json
import math
import pickle
import resource
import sys
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator import __version__
from wheel_terra_estimator.checks.input_judge import InputJudge
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.estimation.core import EstimatorCore
from wheel_terra_estimator.estimation.estimates import EstimateSet
from wheel_terra_estimator.estimation.judgement.entrapment import FORESIGHT, NEAR_MISS_SLIP
from wheel_terra_estimator.estimation.measurements import Measurement
from wheel_terra_estimator.output_folder import working_folder
from wheel_terra_estimator.simulation.commands import Command
from wheel_terra_estimator.simulation.drive import Drive
from wheel_terra_estimator.simulation.scenario import Scenario, load
from wheel_terra_estimator.simulation.sensors import START
from wheel_terra_estimator.simulation.truth import Truth
from wheel_terra_lab.evaluation import kinds

HOUR = 3600.0
LAP = (  # time [s], forward [m/s], turn rate [rad/s]; linear between
    (0, 0.05, 0.0),
    (150, 0.05, 0.0),
    (151, 0.0, 0.0),  # stop
    (170, 0.0, 0.0),
    (171, 0.07, 0.0),
    (250, 0.07, 0.0),
    (252, 0.05, 0.03),  # arcs
    (280, 0.05, 0.03),
    (282, 0.05, -0.03),
    (310, 0.05, -0.03),
    (312, 0.0, 0.06),  # spins in place
    (340, 0.0, 0.06),
    (342, 0.0, -0.06),
    (370, 0.0, -0.06),
    (372, 0.0, 0.0),
    (400, 0.0, 0.0),
    (402, -0.05, 0.0),  # reverse
    (470, -0.05, 0.0),
    (472, 0.05, 0.0),
    (599, 0.05, 0.0),
)
LAP_TIME = 600.0  # [s]
HILLS = (0.0, 8.0, 2.0, -7.0, 5.0, -4.0)  # [deg], HILL_SPACING apart
HILL_SPACING = 5.0  # [m]
MOST_SPEED = 0.1  # [m/s] that a lap makes on average, and more
FAULTS_PER_HOUR = 20.0

FIGURES, STATE = 'hours.jsonl', 'state.pickle'
FILES = (FIGURES, STATE, f'.{STATE}.new')
"""All that a run writes into its folder."""

OF_THE_PROCESS = ('living_objects', 'memory_peak', 'processor_time')
"""Figures in which an interrupted run may differ."""
_REMEMBERED = 100
"""Rows of truth that wait for the estimates of their stamp."""
_WITHIN = 1.96
"""Deviations that hold 95 % of a Gaussian."""


@dataclass
class Figures:
    """What is kept of one hour."""

    hour: float = 0.0  # at its end
    sets: int = 0
    metres: float = 0.0
    slip_rmse: float = math.nan
    slip_std: float = math.nan  # stated, root mean square
    slip_coverage: float = math.nan  # of 95 % intervals
    warnings: int = 0  # times that the stuck warning was raised
    false_warnings: int = 0
    not_finite: int = 0  # fields of sets
    filter_restarts: int = 0  # since the start
    reruns: int = 0  # since the start
    accelerometer_bias: float = math.nan  # [m/s^2], state at the end of the hour
    gyro_zero_yaw: float = math.nan  # [rad/s], the same
    living_objects: int = 0
    memory_peak: float = 0.0  # [MiB] of the process
    processor_time: float = 0.0  # [s] of the hour

    def line(self) -> str:
        """Return them as a line of JSON."""
        return json.dumps(asdict(self))


@dataclass
class _Sums:
    """Sums over the sets of an hour."""

    sets: int = 0
    not_finite: int = 0
    warnings: int = 0
    false_warnings: int = 0
    count: float = 0.0
    squared_error: float = 0.0
    within: float = 0.0
    variance: float = 0.0


@dataclass
class _Warned:
    """The stuck warning against the truth that follows."""

    stands: bool = False
    waiting: list[float] = field(default_factory=list)  # until when each may prove right [s]


def scenario(hours: float) -> Scenario:
    """Return the scenario of so many hours."""
    laps = math.ceil(hours * HOUR / LAP_TIME)
    knots = np.arange(0.0, hours * HOUR * MOST_SPEED + 10.0 * HILL_SPACING, HILL_SPACING)
    return load(
        {
            **kinds.KINDS['cruise'],
            'duration': hours * HOUR,
            'drive.time': [LAP_TIME * i + knot[0] for i in range(laps) for knot in LAP],
            'drive.forward': [knot[1] for knot in LAP] * laps,
            'drive.turn_rate': [knot[2] for knot in LAP] * laps,
            'slope.position': [float(x) for x in knots],
            'slope.angle_deg': [HILLS[i % len(HILLS)] for i in range(len(knots))],
            'faults.random_rate': FAULTS_PER_HOUR,
        }
    )


class LongDrive:
    """A drive of many hours and the estimator that follows it; it can be pickled at any time.

    Parameters
    ----------
    hours : float
        Length.
    seed : int
        Decides all random quantities.
    """

    def __init__(self, hours: float, seed: int) -> None:
        self.hours, self.seed = hours, seed
        self._scenario = scenario(hours)
        self._drive = Drive(self._scenario, seed)
        self.core = EstimatorCore(self._scenario.configuration, judged_by=InputJudge)
        self._under_way: list[tuple[int, int, Measurement]] = []  # arrival [ns], order
        self._sent = 0
        self._known: OrderedDict[int, Truth] = OrderedDict()  # by time [ms]
        self._warned = _Warned()
        self._sums = _Sums()
        self._way = 0.0

    @property
    def over(self) -> bool:
        """Whether the rover has arrived."""
        return self._drive.plant.time >= self.hours * HOUR - self._drive.step_length / 2.0

    def go_on(self, span: float = HOUR) -> Figures:
        """Drive until the next full `span` [s], or to the end; return its figures."""
        plant, step = self._drive.plant, self._drive.step_length
        until = (math.floor(plant.time / span + step / span) + 1.0) * span
        until = min(until, self.hours * HOUR)
        processor = time.process_time()
        while plant.time < until - step / 2.0:
            self._step()
        figures = self._figures(plant.time / HOUR)
        figures.processor_time = time.process_time() - processor
        self._sums = _Sums()
        return figures

    def _step(self) -> None:
        drive = self._drive
        before = drive.last_truth.position
        told = self._scenario.profile.at(drive.plant.time)
        factor = drive.speed_factor
        for arrival in drive.step(Command(factor * told.forward, factor * told.turn_rate)):
            self._sent += 1
            heapq.heappush(self._under_way, (arrival.arrival, self._sent, arrival.measurement))
        truth = drive.last_truth
        # Summed up steps drift by nanoseconds.
        self._known[round(truth.time * 1e3)] = truth
        if len(self._known) > _REMEMBERED:
            self._known.popitem(last=False)
        self._way += math.dist(truth.position[:2], before[:2])
        self._judge_warnings(truth)
        now = START + round(drive.plant.time * 1e9)
        while self._under_way and self._under_way[0][0] <= now:
            for estimates in self.core.add(heapq.heappop(self._under_way)[2]):
                self._take(estimates)

    def _judge_warnings(self, truth: Truth) -> None:
        """Let warnings that wait prove right, or count them as false when their time is over."""
        waiting = self._warned.waiting
        if not waiting:
            return
        slip = np.abs(truth.slip[~np.isnan(truth.slip)])
        if slip.size and np.median(slip) > NEAR_MISS_SLIP:
            waiting.clear()
        while waiting and truth.time > waiting[0]:
            waiting.pop(0)
            self._sums.false_warnings += 1

    def _take(self, estimates: EstimateSet) -> None:
        sums, warned = self._sums, self._warned
        sums.sets += 1
        for entry in fields(estimates):
            value = getattr(estimates, entry.name)
            if isinstance(value, (np.ndarray, float)):
                sums.not_finite += not np.isfinite(value).all()
        if estimates.stuck and not warned.stands:
            sums.warnings += 1
            warned.waiting.append((estimates.stamp - START) * 1e-9 + FORESIGHT)
        warned.stands = estimates.stuck
        truth = self._known.get(round((estimates.stamp - START) * 1e-6))
        if truth is None:
            return
        moving = ~np.isnan(truth.slip)
        error: NDArray[np.float64] = np.abs(estimates.slip - truth.slip)[moving]
        std = estimates.slip_std[moving]
        sums.count += error.size
        sums.squared_error += float(error @ error)
        sums.within += int((error <= _WITHIN * std).sum())
        sums.variance += float(std @ std)

    def _figures(self, hour: float) -> Figures:
        gc.collect()
        sums, health = self._sums, self.core.health()
        count = max(sums.count, 1.0)
        return Figures(
            hour=round(hour, 6),
            sets=sums.sets,
            metres=self._way,
            slip_rmse=math.sqrt(sums.squared_error / count),
            slip_std=math.sqrt(sums.variance / count),
            slip_coverage=sums.within / count,
            warnings=sums.warnings,
            false_warnings=sums.false_warnings,
            not_finite=sums.not_finite,
            filter_restarts=health['filter_restarts'],
            reruns=health['reruns'],
            accelerometer_bias=health['accelerometer_bias_m_s2'],
            gyro_zero_yaw=health['gyro_zero_yaw_rad_s'],
            living_objects=sys.getallocatedblocks(),
            memory_peak=resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0,
        )


def drive_for_hours(
    folder: Path,
    hours: float,
    seed: int,
    *,
    resume: bool = False,
    overwrite: bool = False,
    span: float = HOUR,
    progress: Callable[[str], object] = print,
) -> list[dict[str, Any]]:
    """Drive for so many hours and return the figures of each, also those of an earlier run.

    Parameters
    ----------
    folder : Path
        Where figures and state are kept. The state is a pickle: go on only with a folder of your
        own.
    hours, seed
        See `LongDrive`; a run that goes on must be given the same.
    resume, overwrite : bool
        As in `output_folder.working_folder`.
    span : float
        Length of what stands in one line [s].
    progress : callable
        Is told each new line.

    Raises
    ------
    UserError
        The folder cannot be written, or it holds another drive.
    """
    with working_folder(folder, overwrite, resume, FILES):
        figures, state = folder / FIGURES, folder / STATE
        lines: list[str] = []
        if resume and state.is_file():
            drive, lines = _resumed(state, hours, seed)
        else:
            drive = LongDrive(hours, seed)
        figures.write_text(''.join(f'{line}\n' for line in lines), encoding='utf-8')
        while not drive.over:
            lines.append(drive.go_on(span).line())
            with figures.open('a', encoding='utf-8') as stream:
                stream.write(lines[-1] + '\n')
            fresh = folder / f'.{STATE}.new'
            fresh.write_bytes(pickle.dumps((__version__, drive, lines)))
            fresh.replace(state)
            progress(lines[-1])
    return [json.loads(line) for line in lines]


def _resumed(state: Path, hours: float, seed: int) -> tuple[LongDrive, list[str]]:
    """Return the drive and the lines of an earlier run."""
    try:
        version, drive, lines = pickle.loads(state.read_bytes())
    except Exception as error:
        raise UserError(f'{state}: cannot be gone on with ({error}); give --overwrite') from None
    if version != __version__:
        raise UserError(f'{state}: of version {version}, this is {__version__}; give --overwrite')
    if (drive.hours, drive.seed) != (hours, seed):
        raise UserError(
            f'{state}: of a drive of {drive.hours:g} h, seed {drive.seed}; give these, or '
            '--overwrite'
        )
    return drive, lines


def report(rows: list[dict[str, Any]]) -> str:
    """Return the figures of all hours as a table, and what they come to."""
    from wheel_terra_lab.evaluation.tables import table

    head = (
        'hour',
        'way [m]',
        'slip RMSE',
        'stated',
        'coverage',
        'warnings',
        'false',
        'accelerometer bias [m/s^2]',
        'zero of the gyro [rad/s]',
        'peak of memory [MiB]',
    )
    cells = [
        (
            f'{row["hour"]:.2f}',
            f'{row["metres"]:.0f}',
            f'{row["slip_rmse"]:.4f}',
            f'{row["slip_std"]:.4f}',
            f'{row["slip_coverage"]:.1%}',
            str(row['warnings']),
            str(row['false_warnings']),
            f'{row["accelerometer_bias"]:+.4f}',
            f'{row["gyro_zero_yaw"]:+.2g}',
            f'{row["memory_peak"]:.0f}',
        )
        for row in rows
    ]
    last = rows[-1]
    return (
        f'{table(head, cells)}\n\n{sum(row["sets"] for row in rows)} sets, '
        f'{sum(row["false_warnings"] for row in rows)} false warnings of '
        f'{sum(row["warnings"] for row in rows)}, {last["filter_restarts"]} restarts of the '
        f'filter, {sum(row["not_finite"] for row in rows)} fields that are no number, '
        f'{sum(row["processor_time"] for row in rows):.0f} s of processor time.'
    )
