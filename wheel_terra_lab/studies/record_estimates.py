#!/usr/bin/env python3
# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Record what the estimator says on a fixed set of drives, and compare with such a record.

``record FILE`` runs the estimator core over simulated kinds and scenarios, over the shipped
recordings and over the bags in ``--measured``, and keeps every field of every fifth set of
estimates. ``compare FILE`` does the same again and prints the greatest difference of each field;
its exit status is 1 where one is above rounding. So a restructuring shows that it changed nothing:

    python -m wheel_terra_lab.studies.record_estimates record before.npz  # with the code as it was
    python -m wheel_terra_lab.studies.record_estimates compare before.npz  # with the code as it is

Some drives are chaotic: firm ground taken for sand, no torque, no sinkage. So ``record`` runs each
drive once more with wheel rates that differ in the 12th digit, and keeps from which set on this
alone grows above rounding; ``compare`` looks at the sets before.

Simulated measurements are kept in ``--cache``, so that only the first run simulates.
"""

from __future__ import annotations

import argparse
import pickle
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.core import EstimatorCore
from wheel_terra_estimator.estimation.estimates import SLOPES, EstimateSet
from wheel_terra_estimator.estimation.measurements import (
    LeavingAngleReading,
    Measurement,
    ReferenceVelocity,
    SinkageReading,
    WheelOdometry,
)
from wheel_terra_estimator.simulation.drive import simulate
from wheel_terra_estimator.simulation.scenario import Scenario, load
from wheel_terra_lab.evaluation import kinds
from wheel_terra_lab.evaluation.real_drives import measurements_of
from wheel_terra_lab.evaluation.runner import inputs_of_mode

PACKAGE = Path(__file__).resolve().parents[2]
SEEDS = (1000, 1001)
EVERY = 5  # of the sets of estimates
ABSOLUTE, RELATIVE = 1e-9, 1e-6
"""Above both of these a difference is no rounding."""
NUDGE = 1e-12
"""Relative change of the wheel rates that shows where a drive is chaotic."""
IN_WORDS = 'faults', 'soil_names'
STEADY = '|steady'
"""Key of the number of sets up to which it is not."""

LENGTHS = {
    'wheel_faults': 90.0,
    'entrapment_patch': 60.0,
    'entrapment_slope': 100.0,
    'near_stuck': 80.0,
    'turns': 60.0,
    'stop_and_go': 60.0,
    'sensor_faults': 60.0,
    'firm': 60.0,
}
"""Seconds of each kind that hold what it is there for; others: `SHORT`."""
SHORT = 30.0
SCENARIO_LENGTH = 60.0

HUSKY = (
    'rover.mass:=50.0',
    'wheels.names:=[front_left_wheel, front_right_wheel, rear_left_wheel, rear_right_wheel]',
    'wheels.radius:=[0.1651, 0.1651, 0.1651, 0.1651]',
    'wheels.width:=[0.125, 0.125, 0.125, 0.125]',
    'wheels.x:=[0.256, 0.256, -0.256, -0.256]',
    'wheels.y:=[0.2854, -0.2854, 0.2854, -0.2854]',
)


@dataclass(frozen=True)
class Recording:
    """Name, configuration and measurements in the order of arrival."""

    name: str
    configuration: Configuration
    measurements: list[Measurement]


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n', maxsplit=1)[0])
    parser.add_argument('task', choices=('record', 'compare'))
    parser.add_argument('file', type=Path, help='the record (.npz)')
    parser.add_argument('--measured', type=Path, help='folder of measured data with bags/')
    parser.add_argument('--only', default='', help='drives whose name contains this')
    parser.add_argument(
        '--cache',
        type=Path,
        default=Path(tempfile.gettempdir()) / 'wheel_terra_recorded_drives',
        help='folder in which simulated measurements are kept',
    )
    arguments = parser.parse_args()
    arguments.cache.mkdir(parents=True, exist_ok=True)
    started = time.process_time()
    found: dict[str, np.ndarray] = {}
    spent = 0.0
    for recording in recordings(arguments.cache, arguments.measured, arguments.only):
        start = time.process_time()
        values = estimates_of(recording)
        spent += time.process_time() - start
        if arguments.task == 'record':
            nudged = estimates_of(replace(recording, measurements=nudge(recording.measurements)))
            found[f'{recording.name}{STEADY}'] = np.array(sets_alike(values, nudged))
        found |= {f'{recording.name}|{field}': array for field, array in values.items()}
    print(f'CPU time: {spent:.1f} s in the core, {time.process_time() - started:.1f} s in all')
    if arguments.task == 'record':
        np.savez_compressed(arguments.file, **found)
        return 0
    with np.load(arguments.file) as kept:
        return compare({k: kept[k] for k in kept.files if arguments.only in k}, found)


def recordings(cache: Path, measured: Path | None, only: str) -> Iterator[Recording]:
    """Yield all drives whose name contains `only`."""
    for name, scenario, seed, modes in simulated_drives():
        wanted = [mode for mode in modes if only in f'{name}/{seed}/{mode}']
        if wanted:
            arrivals = cached(cache, name, scenario, seed)
        for mode in wanted:
            given = list(inputs_of_mode(arrivals, mode))
            yield Recording(f'{name}/{seed}/{mode}', scenario.configuration, given)
    for recording in spoilt_drives(cache):
        if only in recording.name:
            yield recording
    for recording in recorded_drives(measured):
        if only in recording.name:
            yield recording


def simulated_drives() -> Iterator[tuple[str, Scenario, int, tuple[str, ...]]]:
    """Yield name, scenario, seed and modes: every kind and every shipped scenario."""
    for kind, keys in {**kinds.KINDS, 'firm': kinds.FIRM}.items():
        scenario = load({**keys, 'duration': LENGTHS.get(kind, SHORT)})
        yield kind, scenario, SEEDS[0], ('reference', 'no_reference')
        yield kind, scenario, SEEDS[1], ('reference', 'no_torque')
    for kind in ('cruise', 'mixed_soil', 'stop_and_go'):
        scenario = load({**kinds.KINDS[kind], 'duration': SHORT})
        yield (
            f'{kind}_short',
            scenario,
            SEEDS[1],
            ('no_sinkage', 'no_orientation', 'reference_2s_late'),
        )
    for file in sorted((PACKAGE / 'config' / 'scenarios').glob('*.yaml')):
        scenario = load(str(file))
        scenario = replace(scenario, duration=min(scenario.duration, SCENARIO_LENGTH))
        yield file.stem, scenario, SEEDS[0], ('reference', 'no_reference')


def cached(cache: Path, name: str, scenario: Scenario, seed: int) -> list[Any]:
    """Return the arrivals of a simulated drive, simulated once."""
    file = cache / f'{name}_{seed}.pickle'
    if not file.is_file():
        file.write_bytes(pickle.dumps(simulate(scenario, seed).arrivals))
    arrivals: list[Any] = pickle.loads(file.read_bytes())
    return arrivals


def spoilt_drives(cache: Path) -> Iterator[Recording]:
    """Yield drives with silence, a clock that steps back, parts of the wheels, leaving angles."""
    scenario = load({**kinds.KINDS['climb'], 'duration': SHORT})
    arrivals = cached(cache, 'climb', scenario, SEEDS[0])
    given = [a.measurement for a in arrivals]
    first = min(m.stamp for m in given)

    def between(m: Measurement, start: float, end: float) -> bool:
        return start <= (m.stamp - first) * 1e-9 < end

    def shifted(m: Measurement) -> Measurement:
        return replace(m, stamp=m.stamp - 5_000_000_000) if between(m, 15.0, 1e9) else m

    def partial(m: Measurement) -> Measurement:
        if isinstance(m, WheelOdometry) and between(m, 10.0, 20.0):
            keep = np.arange(len(m.rate)) < 3
            return replace(m, rate=np.where(keep, m.rate, np.nan))
        return m

    def with_angles(measurements: Iterable[Measurement]) -> Iterator[Measurement]:
        for m in measurements:
            yield m
            if isinstance(m, SinkageReading):
                yield LeavingAngleReading(m.stamp, -0.1 - m.sinkage)

    variants: dict[str, list[Measurement]] = {
        'silence': [
            m for m in given if not (isinstance(m, WheelOdometry) and between(m, 12.0, 15.0))
        ],
        'clock_back': [shifted(m) for m in given],
        'part_of_the_wheels': [partial(m) for m in given],
        'leaving_angles': list(with_angles(given)),
        'reference_gap': [
            m for m in given if not (isinstance(m, ReferenceVelocity) and between(m, 8.0, 29.0))
        ],
    }
    for name, measurements in variants.items():
        yield Recording(f'spoilt_{name}', scenario.configuration, measurements)


def recorded_drives(measured: Path | None) -> Iterator[Recording]:
    """Yield the shipped recordings and those of the measured data."""
    demo = PACKAGE / 'data' / 'demo'
    sand = reader.load(['generic_six_wheel', str(PACKAGE / 'config/demo/test_sand.yaml')])
    pathfinder = reader.load(['pathfinder'], ['reference_odom_max_rate:=1.0'])
    yield from bag(demo / 'entrapment', sand, {})
    yield from bag(demo / 'pathfinder', pathfinder, {'reference_odom': '/truth/odometry'})
    if measured is None:
        return
    snow = reader.load(['frostyboy'], ['reference_odom_max_rate:=1.0'])
    husky = reader.load([], HUSKY)
    for folder in sorted((measured / 'bags').iterdir()):
        if 'husky' in folder.name:
            yield from bag(folder, husky, {})
        elif folder.name.startswith('frostyboy'):
            yield from bag(folder, snow, {'reference_odom': '/truth/odometry'})
        elif folder.name.startswith('wvu'):
            yield from bag(folder, pathfinder, {'reference_odom': '/truth/odometry'})


def bag(folder: Path, configuration: Configuration, remaps: dict[str, str]) -> Iterator[Recording]:
    """Yield a recording with its reference velocity, and without where it has one."""
    given = list(measurements_of(folder, remaps, configuration))
    if len(given) > 40_000:  # an IMU at 250 Hz: half of the drive does
        given = given[: len(given) // 2]
    yield Recording(f'{folder.name}/reference', configuration, given)
    blind = [m for m in given if not isinstance(m, ReferenceVelocity)]
    if len(blind) < len(given):
        yield Recording(f'{folder.name}/no_reference', configuration, blind)


def estimates_of(recording: Recording) -> dict[str, np.ndarray]:
    """Return field -> values of every fifth set of estimates; words as texts."""
    core = EstimatorCore(recording.configuration)
    chosen = list(core.run(recording.measurements))[::EVERY]
    found = {
        f.name: np.array([getattr(s, f.name) for s in chosen])
        for f in fields(EstimateSet)
        if f.name not in (*IN_WORDS, 'slip_on_slope', 'sideways')
    }
    found['slip_on_slope'] = np.array(
        [np.zeros((3, len(SLOPES))) if s.slip_on_slope is None else s.slip_on_slope for s in chosen]
    )
    found['sideways'] = np.array([np.hstack([*vars(s.sideways_known).values()]) for s in chosen])
    for name in IN_WORDS:
        found[name] = np.array([str(getattr(s, name)) for s in chosen])
    found['health'] = np.array([str(core.health().get('filter_restarts'))])
    return found


def nudge(measurements: list[Measurement]) -> list[Measurement]:
    """Return the measurements with wheel rates that differ in the 12th digit."""
    return [
        replace(m, rate=m.rate * (1.0 + NUDGE)) if isinstance(m, WheelOdometry) else m
        for m in measurements
    ]


def beyond_rounding(before: np.ndarray, now: np.ndarray) -> np.ndarray:
    """Say for each set whether it differs by more than rounding."""
    if before.dtype.kind in 'US':
        return np.asarray(before != now)
    a, b = before.astype(float), now.astype(float)
    difference = np.abs(a - b)
    beyond = (difference > ABSOLUTE) & (difference > RELATIVE * np.abs(a))
    return np.asarray(beyond.reshape(len(beyond), -1).any(axis=1))


def sets_alike(one: dict[str, np.ndarray], other: dict[str, np.ndarray]) -> int:
    """Return the number of sets before the first that differ by more than rounding."""
    apart = [
        int(np.flatnonzero(beyond_rounding(one[field], other[field]))[0])
        for field in one
        if len(one[field]) == len(one['stamp']) and beyond_rounding(one[field], other[field]).any()
    ]
    return min(apart, default=len(one['stamp']))


def compare(kept: dict[str, np.ndarray], found: dict[str, np.ndarray]) -> int:
    """Print the greatest difference of each field over all drives; return the exit status."""
    status = 0
    steady = {k.removesuffix(STEADY): int(v) for k, v in kept.items() if k.endswith(STEADY)}
    kept = {k: v for k, v in kept.items() if not k.endswith(STEADY)}
    for key in sorted(kept.keys() ^ found.keys()):
        print(f'only in one of the two: {key}')
        status = 1
    worst: dict[str, tuple[float, float, str]] = {}
    words: dict[str, list[str]] = {}
    for key in sorted(kept.keys() & found.keys()):
        drive, _, field = key.partition('|')
        if kept[key].shape != found[key].shape:
            print(f'{key}: shape {kept[key].shape} has become {found[key].shape}')
            status = 1
            continue
        before, now = kept[key][: steady[drive]], found[key][: steady[drive]]
        if not before.size:
            continue
        beyond = beyond_rounding(before, now).any()
        if before.dtype.kind in 'US':
            if beyond:
                words.setdefault(field, []).append(drive)
            continue
        status = max(status, int(beyond))
        a, b = before.astype(float), now.astype(float)
        difference = np.abs(a - b)
        relative = difference / np.maximum(np.abs(a), ABSOLUTE)
        entry = float(difference.max()), float(relative[difference > ABSOLUTE].max(initial=0.0))
        if entry[0] >= worst.get(field, (-1.0, 0.0, ''))[0]:
            worst[field] = (*entry, drive)
    for drive, count in steady.items():
        sets = len(kept[f'{drive}|stamp'])
        if count < sets:
            print(f'{drive}: chaotic from {count / sets:.0%} of its sets on, compared up to there')
    print(f'{len({k.partition("|")[0] for k in found})} drives')
    print(f'{"field":26} {"absolute":>10} {"relative":>10}  drive')
    for field, (absolute, relative, drive) in worst.items():
        print(f'{field:26} {absolute:10.2e} {relative:10.2e}  {drive if absolute else "-"}')
    for field, drives in words.items():
        print(f'{field}: other words in {len(drives)} drives, {", ".join(drives[:4])}')
        status = 1
    print('differs' if status else 'the same to rounding')
    return status


if __name__ == '__main__':
    sys.exit(main())
