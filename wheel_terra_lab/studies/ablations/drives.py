# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Drives of the ablation study, and the figures of a run of the estimator over one."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.estimates import SlipClass
from wheel_terra_estimator.estimation.measurements import Measurement, ReferenceVelocity
from wheel_terra_lab.evaluation import real_drives, scores
from wheel_terra_lab.evaluation.runner import Record, inputs_of_mode
from wheel_terra_lab.evaluation.simulators import SIMULATORS, BenchDrive
from wheel_terra_lab.evaluation.two_state_filters import SlipCourse
from wheel_terra_lab.studies.ablations import odd_drives

Figures = dict[str, float]
SHORT, LONG = 25.0, 42.0
"""Of a drive of simulator B, which is compressed into it, and of A, which is cut [s]."""

NEITHER = 'no_torque_no_reference'
"""Mode without torque and reference, beside those of the bench."""
WANDER_TOLD = 'reference_wander_told'
"""Mode whose file says that the error of the reference lasts."""
NO_SOIL = 'reference_no_soil'
"""Mode whose file states no soil."""
_WANDER_STD = 0.02  # [m/s], of the satellite velocities of simulator B


@dataclass(frozen=True)
class Plan:
    """A simulated drive: `tags` say what there is to treat, beside what its mode says."""

    simulator: str
    kind: str
    tags: frozenset[str] = frozenset()
    mode: str = 'reference'  # with reference simulator B's come at once: half the time
    seconds: float | None = None  # None: `SHORT` or `LONG`


def _plan(simulator: str, kind: str, tags: str = '', **more: Any) -> Plan:
    return Plan(simulator, kind, frozenset(tags.split()), **more)


PLANS = (
    _plan('B', 'climb', 'slope'),
    _plan('A', 'turns', 'turning spin', seconds=52.0),
    _plan('B', 'stop_and_go', 'slope stops', mode='no_reference'),
    _plan('A', 'wheel_faults', 'slope faults', seconds=66.0),
    _plan('B', 'spin', 'turning spin stops'),
    _plan('A', 'soft_patch', mode='no_reference'),
    _plan('B', 'creeping_entrapment', 'slope entraps'),
    _plan('A', 'wild_stops', 'slope stops wild'),
    _plan('B', 'light', 'slope'),
    _plan('A', 'entrapment_patch', 'slope entraps', seconds=60.0),
    _plan('B', 'turns', 'turning', mode='no_reference'),
    _plan('A', 'low_gravity', 'slope', mode='no_torque'),
    _plan('B', 'field', 'slope fast'),
    _plan('A', 'stop_and_go', 'slope stops reversal', seconds=62.0),
    _plan('B', 'wheel_faults', 'slope faults'),
    _plan('A', 'climb', 'slope', mode='no_reference'),
    _plan('B', 'reversal', 'slope stops reversal'),
    _plan('A', 'sensor_faults', 'slope wild'),
    _plan('B', 'steered', 'turning spin stops steered'),
    _plan('A', 'soft_patch', mode='no_sinkage'),
    _plan('B', 'recovery', 'slope entraps'),
    _plan('A', 'stop_and_go', 'slope stops', mode='no_reference'),
    _plan('B', 'climb', 'slope', mode=NEITHER),
    _plan('A', 'towed', 'slope stops slides'),
    _plan('B', 'field', 'slope fast wander', mode=WANDER_TOLD),
    _plan('A', 'jolts', 'slope stops', mode='no_reference'),
    _plan('B', 'entrapment', 'slope entraps', seconds=45.0),
    _plan('A', 'climb', 'slope', mode='no_torque'),
    _plan('B', 'turns', 'turning'),
    _plan('A', 'jumps', 'slope wild'),
    _plan('B', 'soft_patch', 'slope', mode='no_torque'),
    _plan('A', 'fast_stops', 'stops fast'),
    _plan('A', 'mixed_soil', 'slope', mode='no_torque'),
    _plan('A', 'scenarios/stalled_wheel', 'slope faults', seconds=62.0),
    _plan('A', 'scenarios/free_spinning_wheel', 'slope faults', seconds=62.0),
    _plan('A', 'scenarios/steered_turns', 'slope turning steered', seconds=52.0),
    _plan('A', 'firm', 'slope', mode=NO_SOIL, seconds=60.0),
    _plan('B', 'firm', 'slope', mode=NO_SOIL),
    _plan('A', 'soft_patch', 'slope', mode=NO_SOIL),
    _plan('B', 'soft_patch', 'slope', mode=NO_SOIL),
)
"""Any head of the list is a fair sample of simulators A and B."""

WHOLE_PLANS = (
    _plan('B', 'entrapment', 'entraps'),
    _plan('A', 'entrapment_patch', 'entraps'),
    _plan('B', 'creeping_entrapment', 'entraps'),
    _plan('A', 'entrapment_slope', 'entraps'),
    _plan('B', 'spin', 'spin'),
    _plan('A', 'near_stuck'),
    _plan('B', 'entrapment', 'entraps', mode='no_reference'),
    _plan('A', 'wheel_faults'),
    _plan('B', 'wheel_faults'),
    _plan('A', 'turns', 'spin'),
    _plan('B', 'recovery'),
    _plan('A', 'entrapment_slope', 'entraps', mode='no_reference'),
    _plan('B', 'stop_and_go'),
    _plan('A', 'sensor_faults'),
)
"""Drives at full length, on which only treatments of the warning are tried."""

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
_PATHFINDER = 'wvu_pathfinder_test17_mcap'
_UNAIDED_SNOW = ('event_1_4', 'event_1_6', 'event_1_8')
_REAL = frozenset(('slope', 'turning', 'spin', 'stops', 'fast', 'entraps', 'faults', 'wild'))
"""Tags of recorded drives: nobody knows what is in them."""


@dataclass(frozen=True)
class Case:
    """What the estimator gets of a drive, and what makes figures of what it says."""

    configuration: Configuration
    measurements: Sequence[Measurement]
    figures: Callable[[Record], Figures]


@dataclass(frozen=True)
class Drive:
    """A drive of the study; `make` simulates or reads it."""

    simulator: str
    name: str
    tags: frozenset[str]
    make: Callable[[], Case]
    seed: int | None = None  # None: recorded
    warning_only: bool = False
    """Whether only treatments of the warning are tried on it."""


def simulated(plans: Sequence[Plan], first: int, *, whole: bool = False) -> Iterator[Drive]:
    """Yield simulated drives, each with the next seed, at full length if `whole`."""
    for seed, plan in enumerate(plans, first):
        mode = '' if plan.mode == 'reference' else f' {plan.mode}'.replace('_', ' ')
        yield Drive(
            plan.simulator,
            f'{plan.simulator} {plan.kind} {seed}{mode}' + (' whole' if whole else ''),
            plan.tags | _inputs(plan.mode),
            partial(_simulated, plan, seed, whole),
            seed,
            whole,
        )


def _inputs(mode: str) -> frozenset[str]:
    """Return tags of what a mode has, `reference`, and of what it lacks, `no_reference`."""
    names = ('reference', 'torque', 'sinkage', 'soil')
    return frozenset(f'no_{name}' if f'no_{name}' in mode else name for name in names)


def _simulated(plan: Plan, seed: int, whole: bool) -> Case:
    short = SHORT if plan.simulator == 'B' else LONG
    drive = _bench_drive(plan, seed, None if whole else plan.seconds or short)
    configuration = drive.configuration
    if plan.mode == WANDER_TOLD:
        configuration = configuration.replace({'sensors.reference_wander_std': _WANDER_STD})
    if plan.mode == NO_SOIL:
        stated = frozenset(key for key in configuration.stated if not key.startswith('soil.'))
        configuration = replace(configuration, stated=stated).replace({})
    mode = 'reference' if plan.mode == NO_SOIL else plan.mode
    if plan.simulator == 'B' and mode == 'reference':
        mode = 'reference_at_once'
    return Case(configuration, list(_measurements(drive, mode)), partial(_figures, drive))


def _bench_drive(plan: Plan, seed: int, seconds: float | None) -> BenchDrive:
    if plan.kind in odd_drives.KINDS:
        return odd_drives.simulated(plan.kind, seed, seconds)
    return SIMULATORS[plan.simulator].simulate(plan.kind, seed, seconds, None)


def _measurements(drive: BenchDrive, mode: str) -> Iterator[Measurement]:
    for measurement in inputs_of_mode(drive.arrivals, 'no_torque' if mode == NEITHER else mode):
        if mode != NEITHER or not isinstance(measurement, ReferenceVelocity):
            yield measurement


def recorded(measured: Path) -> Iterator[Drive]:
    """Yield the recorded drives: immobilisations in snow, and firm ground without any."""
    folder = measured / 'frostyboy_snow'
    if folder.is_dir():
        for event in real_drives.snow_events(folder):
            for rate in (1.0, 0.0) if event.name in _UNAIDED_SNOW else (1.0,):
                mode = 'reference' if rate else 'no_reference'
                yield Drive(
                    'recorded',
                    f'snow {event.name}' + ('' if rate else ' no reference'),
                    _REAL | _inputs(f'{mode} no_sinkage'),
                    partial(_snow, event, rate),
                )
    for name in (*_RECORDED_HUSKY, _PATHFINDER):
        if (measured / 'bags' / name).is_dir():
            yield Drive(
                'recorded',
                name.removesuffix('_mcap'),
                _REAL | {'imu_covariance'} | _inputs('reference no_torque no_sinkage'),
                partial(_firm, measured / 'bags' / name),
            )


def _snow(event: real_drives.SnowEvent, rate: float) -> Case:
    measurements = [m for m in event.measurements if rate or not isinstance(m, ReferenceVelocity)]
    configuration = real_drives.snow_configuration(rate)
    return Case(configuration, measurements, partial(_snow_figures, event))


def _snow_figures(event: real_drives.SnowEvent, kept: Record) -> Figures:
    score = real_drives.event_score(event, kept)
    place = np.clip(np.searchsorted(kept.stamp, event.stamp), 0, len(kept.stamp) - 1)
    moving = np.maximum(np.abs(event.rim), np.abs(event.speed)[:, None]) > _MOVING
    error = (kept.slip[place] - event.slip)[moving]
    return {
        **_errors('slip', error, kept.slip_std[place][moving]),
        'missed': float(score.warned is None),
        'lead': float(score.lead or 0.0),
    }


def _firm(bag: Path) -> Case:
    from wheel_terra_estimator.bags.reader import read

    remaps = {}
    if bag.name == _PATHFINDER:
        configuration = reader.load(['pathfinder'], ['reference_odom_max_rate:=1.0'])
        remaps = {'reference_odom': '/truth/odometry'}
    else:
        configuration = reader.from_parameters(_HUSKY)
    measurements = [m for _, m in read(bag, remaps, configuration)]
    return Case(configuration, measurements, _firm_figures)


def _firm_figures(kept: Record) -> Figures:
    rises = np.flatnonzero(np.diff(np.concatenate([[0], kept.stuck.astype(int)])) == 1)
    return {'false': float(len(rises))}


def _figures(drive: BenchDrive, kept: Record) -> Figures:
    radius = drive.configuration.wheels.slip_radius
    nothing = np.full(drive.truth.slip.shape, np.nan)
    course = SlipCourse(nothing, nothing)
    baselines = scores.BaselineSlips(nothing, nothing, course, course, course)
    data = scores.samples(drive.truth, kept, baselines, radius)
    warnings = scores.warnings(drive.truth, kept, radius)
    told = data.said_class != SlipClass.UNKNOWN
    return {
        **_errors('slip', data.slip_error, data.slip_std),
        **_errors('pull', data.pull_error, data.pull_std),
        **_errors('sinkage', data.sinkage_error, data.sinkage_std),
        'false': float(warnings.false_alarms),
        'missed': float(warnings.entrapped is not None and warnings.lead_time is None),
        'lead': float(warnings.lead_time or 0.0),
        'class_wrong': float((told & (data.said_class != data.true_class)).sum()),
        'class_too_high': float((told & (data.said_class > data.true_class)).sum()),
    }


def _errors(what: str, error: Any, std: Any) -> Figures:
    """Return square, count, coverage and deviation of the errors that are known, as sums."""
    there = ~np.isnan(error)
    return {
        f'{what}_square': float(np.sum(error[there] ** 2)),
        f'{what}_count': float(there.sum()),
        f'{what}_covered': float((np.abs(error) <= scores.WITHIN * std)[there].sum()),
        f'{what}_std': float(np.nansum(std[there])),
    }
