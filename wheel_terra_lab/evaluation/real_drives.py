# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The nine snow immobilisations of FrostyBoy and the firm-ground drive of Pathfinder."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wheel_terra_estimator.arrays import FloatArray, IntArray
from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.estimation.measurements import (
    InertialReading,
    Measurement,
    ReferenceVelocity,
    WheelOdometry,
)
from wheel_terra_lab.evaluation.runner import Record, record, run_estimator

_WHEELS = ('fl', 'fr', 'rl', 'rr')
_START = 1_000_000_000
LONGEST_LEAD = 20.0
"""A warning counts for an event if it is in force at the end of the event [s] and not older."""


@dataclass(frozen=True)
class SnowEvent:
    """One recorded immobilisation, rows at 10 Hz; indices count from 0."""

    name: str
    stamp: IntArray
    measurements: list[Measurement]
    speed: FloatArray  # truth [m/s]
    rim: FloatArray  # (k, 4) [m/s]
    slip: FloatArray  # (k, 4) truth
    start: int
    stop: int
    author: int  # last index at which the author's detector warned


@dataclass(frozen=True)
class EventScore:
    """When the estimator warned of an event."""

    name: str
    warned: float | None  # [s] from the start of the recording, of the warning in force
    author: float
    start: float
    stop: float
    all_warnings: tuple[float, ...]
    late_classes: int  # wheels whose slip above 0.9 was not in class 3 within the time allowed
    high_slip_runs: int

    @property
    def lead(self) -> float | None:
        """Time by which the warning is before the author's [s]."""
        return None if self.warned is None else self.author - self.warned


def snow_events(folder: Path) -> Iterator[SnowEvent]:
    """Read the events of a folder with ``events.csv`` and one file per event."""
    index = folder / 'events.csv'
    if not index.is_file():
        raise UserError(f'{index}: not found; --measured names the folder of the measured data')
    with index.open(encoding='utf-8', newline='') as stream:
        for row in csv.DictReader(stream):
            yield _snow_event(folder / f'{row["event"]}.csv', row)


def _snow_event(path: Path, row: dict[str, str]) -> SnowEvent:
    data = np.genfromtxt(path, delimiter=',', names=True)
    stamp = _START + np.round(data['t'] * 1e9).astype(np.int64)
    rate = np.stack([data[f'w{w}'] for w in _WHEELS], axis=1)
    torque = np.stack([data[f'T_{w}'] for w in _WHEELS], axis=1)
    force = np.stack([data[f'a_{a}'] for a in 'XYZ'], axis=1)
    yaw_rate = -data['angAccel_Z']  # recorded clockwise positive
    roll, pitch = 0.5 * np.radians(data['roll']), 0.5 * np.radians(data['pitch'])
    orientation = np.stack(
        [
            np.sin(roll) * np.cos(pitch),
            np.cos(roll) * np.sin(pitch),
            -np.sin(roll) * np.sin(pitch),
            np.cos(roll) * np.cos(pitch),
        ],
        axis=1,
    )
    measurements: list[Measurement] = []
    for i, when in enumerate(stamp.tolist()):
        measurements += [
            WheelOdometry(when, rate[i], torque[i]),
            InertialReading(when, force[i], np.array([0.0, 0.0, yaw_rate[i]]), orientation[i]),
            ReferenceVelocity(when, float(data['v_X'][i]), 0.0),
        ]
    y = np.array([0.571, -0.571, 0.571, -0.571])
    rim = 0.265 * rate
    from wheel_terra_lab.evaluation.baselines import slip_of

    return SnowEvent(
        name=row['event'],
        stamp=stamp,
        measurements=measurements,
        speed=data['v_X'],
        rim=rim,
        slip=slip_of(data['v_X'], yaw_rate, rim, y),
        start=int(row['start_index_1based']) - 1,
        stop=int(row['stop_index_1based']) - 1,
        author=int(row['author_detection_indices'].split(';')[-1]) - 1,
    )


def score_snow_event(event: SnowEvent, reference_rate: float) -> tuple[EventScore, Record]:
    """Run the estimator over an event; `reference_rate` 0 = without any speed."""
    configuration = snow_configuration(reference_rate)
    given = (
        m
        for m in event.measurements
        if reference_rate > 0.0 or not isinstance(m, ReferenceVelocity)
    )
    kept = record(*run_estimator(configuration, given))
    return event_score(event, kept), kept


def event_score(event: SnowEvent, kept: Record) -> EventScore:
    """Return when the estimator warned of an event, from its record."""
    time = (kept.stamp - _START) * 1e-9
    rises = np.flatnonzero(np.diff(np.concatenate([[0], kept.stuck.astype(int)])) == 1)
    last = int(np.searchsorted(kept.stamp, event.stamp[event.stop]))
    before = rises[rises <= last]
    warned = None
    if len(before) and kept.stuck[min(last, len(kept.stuck) - 1)]:
        rise = float(time[before[-1]])
        if time[min(last, len(time) - 1)] - rise <= LONGEST_LEAD:
            warned = rise
    late, runs = _late_classes(event, kept)
    return EventScore(
        name=event.name,
        warned=warned,
        author=(event.stamp[event.author] - _START) * 1e-9,
        start=(event.stamp[event.start] - _START) * 1e-9,
        stop=(event.stamp[event.stop] - _START) * 1e-9,
        all_warnings=tuple(float(time[r]) for r in rises),
        late_classes=late,
        high_slip_runs=runs,
    )


def snow_configuration(reference_rate: float) -> Configuration:
    """Return FrostyBoy's configuration with the reference thinned."""
    rate = reference_rate if reference_rate > 0.0 else 0.0
    return reader.load(['frostyboy'], [f'reference_odom_max_rate:={rate}'])


def _late_classes(event: SnowEvent, kept: Record) -> tuple[int, int]:
    """Count stretches of slip above 0.9 for 0.5 s (rim above 0.1 m/s) not in class 3 within 1 s."""
    high = (event.slip > 0.9) & (np.abs(event.rim) > 0.1)
    position = np.clip(np.searchsorted(kept.stamp, event.stamp), 0, len(kept.stamp) - 1)
    said = kept.slip_class[position] == 3
    late = runs = 0
    for wheel in range(high.shape[1]):
        row = 0
        while row < len(high):
            end = row
            while end < len(high) and high[end, wheel]:
                end += 1
            if end - row > 5:  # 0.5 s at 10 Hz
                if end - row > 15 or end == len(high):
                    runs += 1
                    late += not said[row : min(row + 16, end), wheel].any()
                elif end - row > 5:
                    runs += 1
                    late += not said[row : min(row + 16, len(high)), wheel].any()
            row = max(end, row + 1)
    return late, runs


def measurements_of(
    bag: Path, remaps: Mapping[str, str], configuration: Configuration
) -> Iterator[Measurement]:
    """Yield the measurements in a bag, in the order of log times."""
    from wheel_terra_estimator.bags.reader import MeasurementReader
    from wheel_terra_estimator.bags.storage import open_bag

    with open_bag(bag) as opened:
        yield from MeasurementReader(opened, remaps, configuration).measurements()


def pathfinder_record(bag: Path, reference_rate: float) -> Record:
    """Run the estimator over the Pathfinder bag; `reference_rate` 0 = without the reference."""
    configuration = reader.load(['pathfinder'], [f'reference_odom_max_rate:={reference_rate}'])
    remaps = {'reference_odom': '/truth/odometry'}
    given = (
        m
        for m in measurements_of(bag, remaps, configuration)
        if reference_rate > 0.0 or not isinstance(m, ReferenceVelocity)
    )
    return record(*run_estimator(configuration, given))


def report(measured: Path) -> tuple[str, list[dict[str, Any]]]:
    """Return the tables of the real drives in a folder of measured data, and each run's health."""
    from wheel_terra_lab.evaluation.tables import table

    parts = []
    healths = []
    for rate, title in ((1.0, 'reference at 1 Hz'), (0.0, 'without any speed')):
        rows, leads, late, runs = [], [], 0, 0
        for event in snow_events(measured / 'frostyboy_snow'):
            score, kept = score_snow_event(event, rate)
            healths.append(kept.health)
            error = kept.speed - event.speed[: len(kept.speed)]
            late, runs = late + score.late_classes, runs + score.high_slip_runs
            if score.lead is not None:
                leads.append(score.lead)
            rows.append(
                (
                    event.name,
                    f'{score.start:.1f} to {score.stop:.1f}',
                    f'{score.author:.1f}',
                    '-' if score.warned is None else f'{score.warned:.1f}',
                    '-' if score.lead is None else f'{score.lead:+.1f}',
                    ', '.join(f'{t:.1f}' for t in score.all_warnings) or '-',
                    f'{np.sqrt(np.mean(error**2)):.2f}',
                )
            )
        parts.append(f'## FrostyBoy, {title}\n')
        head = ('event', 'interval [s]', 'author', 'warned', 'lead [s]', 'all', 'speed RMSE [m/s]')
        parts.append(table(head, rows))
        parts.append(
            f'\nWarned: {len(leads)} of {len(rows)}; mean lead {np.mean(leads):+.2f} s. Stretches '
            f'of truth slip above 0.9 for 0.5 s: {runs}, of which {late} not in class 3 within '
            '1 s.\n'
        )
    bag = measured / 'bags' / 'wvu_pathfinder_test17_mcap'
    for rate, title in ((1.0, 'reference at 1 Hz'), (0.0, 'without reference')):
        kept = pathfinder_record(bag, rate)
        healths.append(kept.health)
        moving = np.abs(kept.speed) > 0.1
        median = float(np.median(kept.slip[moving])) if moving.any() else 0.0
        parts.append(
            f'Pathfinder, {title}: {"a" if kept.stuck.any() else "no"} stuck warning, median slip '
            f'{median:+.3f}.\n'
        )
    return '\n'.join(parts), healths
