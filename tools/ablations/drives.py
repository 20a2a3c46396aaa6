# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Drives of the ablation study, and the figures of a run of the estimator over one."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.estimates import SlipClass
from wheel_terra_estimator.estimation.measurements import Measurement
from wheel_terra_estimator.evaluation import bench, real_drives, scores
from wheel_terra_estimator.evaluation.runner import record, run_estimator
from wheel_terra_estimator.evaluation.worlds import WORLDS, BenchDrive

SIMULATED = (
    ('rival', 'climb', 'reference'),
    ('own', 'soft_patch', 'no_reference'),
    ('rival', 'creeping_entrapment', 'reference'),
    ('own', 'turns', 'reference'),
    ('rival', 'stop_and_go', 'no_reference'),
    ('own', 'wheel_faults', 'reference'),
    ('rival', 'turns', 'reference'),
    ('own', 'climb', 'no_reference'),
    ('rival', 'wheel_faults', 'reference'),
    ('own', 'stop_and_go', 'reference'),
    ('rival', 'soft_patch', 'no_reference'),
    ('own', 'sensor_faults', 'reference'),
    ('rival', 'light', 'reference'),
    ('own', 'entrapment_slope', 'reference'),
)
"""World, kind and mode: any head of the list is a fair sample of both worlds."""

WITH_WARNINGS = ('entrapment', 'creeping_entrapment', 'entrapment_slope', 'entrapment_patch')
_HUSKY = {
    'rover.mass': 50.0,
    'wheels.names': [
        f'{end}_{side}_wheel' for end in ('front', 'rear') for side in ('left', 'right')
    ],
    'wheels.radius': [0.1651] * 4,
    'wheels.width': [0.125] * 4,
    'wheels.x': [0.256, 0.256, -0.256, -0.256],
    'wheels.y': [0.2854, -0.2854, 0.2854, -0.2854],
}
_MOVING = 0.1  # [m/s]
_RECORDED_HUSKY = ('boreal_husky_flooring_01_mcap', 'boreal_husky_asphalt_05_mcap')

Figures = dict[str, float]


@dataclass(frozen=True)
class Drive:
    """A drive that can be run again and again: its name, its world, and what gives its figures."""

    world: str
    name: str
    entraps: bool
    run: Callable[[], Figures]


def simulated(count: int, seed: int, duration: Mapping[str, float]) -> Iterator[Drive]:
    """Yield the first `count` drives, each world with its duration [s]; each round a new seed."""
    for i in range(count):
        world, kind, mode = SIMULATED[i % len(SIMULATED)]
        number = seed + i // len(SIMULATED)
        drive = WORLDS[world].simulate(kind, number, duration[world], None)

        run = partial(_scored, world, kind, number, mode, drive)
        name = f'{world} {kind} {number}' + ('' if mode == 'reference' else ' without reference')
        yield Drive(world, name, kind in WITH_WARNINGS, run)


def _scored(world: str, kind: str, seed: int, mode: str, drive: BenchDrive) -> Figures:
    return _figures(bench.score_mode(world, kind, seed, mode, drive))


def recorded(measured: Path) -> Iterator[Drive]:
    """Yield the recorded drives: immobilisations in snow, and firm ground without any."""
    folder = measured / 'frostyboy_snow'
    if folder.is_dir():
        for event in real_drives.snow_events(folder):
            run = partial(_snow, event)
            yield Drive('recorded', f'snow {event.name}', True, run)
    yield from _firm(measured / 'bags')


def _snow(event: real_drives.SnowEvent) -> Figures:
    score, kept = real_drives.score_snow_event(event, 1.0)
    place = np.clip(np.searchsorted(kept.stamp, event.stamp), 0, len(kept.stamp) - 1)
    moving = np.maximum(np.abs(event.rim), np.abs(event.speed)[:, None]) > _MOVING
    error = (kept.slip[place] - event.slip)[moving]
    std = kept.slip_std[place][moving]
    there = ~np.isnan(error)
    return {
        'slip_square': float(np.sum(error[there] ** 2)),
        'slip_count': float(there.sum()),
        'covered': float((np.abs(error[there]) <= 1.96 * std[there]).sum()),
        'missed': float(score.warned is None),
        'lead': float(score.lead or 0.0),
    }


def _firm(bags: Path) -> Iterator[Drive]:
    from wheel_terra_estimator.bags.reader import read

    for name in _RECORDED_HUSKY:
        if (bags / name).is_dir():
            configuration = reader.from_parameters(_HUSKY)
            measurements = [m for _, m in read(bags / name, {}, configuration)]

            yield Drive(
                'recorded',
                name.removesuffix('_mcap'),
                True,
                partial(_husky, configuration, measurements),
            )
    pathfinder = bags / 'wvu_pathfinder_test17_mcap'
    if pathfinder.is_dir():
        yield Drive(
            'recorded',
            'pathfinder',
            True,
            lambda: _false(real_drives.pathfinder_record(pathfinder, 1.0).stuck),
        )


def _husky(configuration: Configuration, measurements: Sequence[Measurement]) -> Figures:
    return _false(record(*run_estimator(configuration, measurements)).stuck)


def _false(stuck: Any) -> Figures:
    rises = np.flatnonzero(np.diff(np.concatenate([[0], stuck.astype(int)])) == 1)
    return {'false': float(len(rises))}


def _figures(score: bench.DriveScore) -> Figures:
    data = score.samples
    slip, pull = (e[~np.isnan(e)] for e in (data.slip_error, data.pull_error))
    inside = scores.coverage(data.slip_error, data.slip_std) * len(slip) if len(slip) else 0.0
    missed = score.warnings.entrapped is not None and score.warnings.lead_time is None
    return {
        'slip_square': float(np.sum(slip**2)),
        'slip_count': float(len(slip)),
        'pull_square': float(np.sum(pull**2)),
        'pull_count': float(len(pull)),
        'covered': float(inside),
        'false': float(score.warnings.false_alarms),
        'missed': float(missed),
        'lead': float(score.warnings.lead_time or 0.0),
        'class_too_high': float(_too_high(data).sum()),
    }


def _too_high(data: scores.Samples) -> Any:
    """Return where a class is told that is higher than the true one."""
    return (data.said_class != SlipClass.UNKNOWN) & (data.said_class > data.true_class)
