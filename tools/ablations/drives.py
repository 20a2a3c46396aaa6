# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Drives of the ablation study, and the figures of a run of the estimator over one."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.estimates import SlipClass
from wheel_terra_estimator.estimation.measurements import (
    InertialReading,
    Measurement,
    ReferenceVelocity,
)
from wheel_terra_estimator.evaluation import kinds, real_drives, scores
from wheel_terra_estimator.evaluation.runner import Record, inputs_of_mode
from wheel_terra_estimator.evaluation.two_state_filters import SlipCourse
from wheel_terra_estimator.evaluation.worlds import WORLDS, BenchDrive
from wheel_terra_estimator.simulation import drive as own_world
from wheel_terra_estimator.simulation.scenario import load

Figures = dict[str, float]
SHORT, LONG = 25.0, 42.0
"""Of a drive of the rival world, which is compressed into it, and of the own, which is cut [s]."""

NEITHER = 'no_torque_no_reference'
"""Mode without torque and reference, beside those of the bench."""
WANDER_TOLD = 'reference_wander_told'
"""Mode whose file says that the error of the reference lasts."""
_WANDER_STD = 0.02  # [m/s], of the satellite velocities of the rival world


@dataclass(frozen=True)
class Plan:
    """A simulated drive: `tags` say what there is to treat, beside what its mode says."""

    world: str
    kind: str
    tags: frozenset[str] = frozenset()
    mode: str = 'reference'  # with reference the rival world's come at once: half the time
    seconds: float | None = None  # None: `SHORT` or `LONG`


def _plan(world: str, kind: str, tags: str = '', **more: Any) -> Plan:
    return Plan(world, kind, frozenset(tags.split()), **more)


PLANS = (
    _plan('rival', 'climb', 'slope'),
    _plan('own', 'turns', 'turning spin', seconds=52.0),
    _plan('rival', 'stop_and_go', 'slope stops', mode='no_reference'),
    _plan('own', 'wheel_faults', 'slope faults', seconds=66.0),
    _plan('rival', 'spin', 'turning spin stops'),
    _plan('own', 'soft_patch', mode='no_reference'),
    _plan('rival', 'creeping_entrapment', 'slope entraps'),
    _plan('own', 'wild_stops', 'slope stops wild'),
    _plan('rival', 'light', 'slope'),
    _plan('own', 'entrapment_patch', 'slope entraps', seconds=60.0),
    _plan('rival', 'turns', 'turning', mode='no_reference'),
    _plan('own', 'low_gravity', 'slope', mode='no_torque'),
    _plan('rival', 'field', 'slope fast'),
    _plan('own', 'stop_and_go', 'slope stops reversal', seconds=62.0),
    _plan('rival', 'wheel_faults', 'slope faults'),
    _plan('own', 'climb', 'slope', mode='no_reference'),
    _plan('rival', 'reversal', 'slope stops reversal'),
    _plan('own', 'sensor_faults', 'slope wild'),
    _plan('rival', 'steered', 'turning spin stops steered'),
    _plan('own', 'soft_patch', mode='no_sinkage'),
    _plan('rival', 'recovery', 'slope entraps'),
    _plan('own', 'stop_and_go', 'slope stops', mode='no_reference'),
    _plan('rival', 'climb', 'slope', mode=NEITHER),
    _plan('own', 'towed', 'slope stops slides'),
    _plan('rival', 'field', 'slope fast wander', mode=WANDER_TOLD),
    _plan('own', 'jolts', 'slope stops', mode='no_reference'),
)
"""Any head of the list is a fair sample of both worlds."""

WHOLE_PLANS = (
    _plan('rival', 'entrapment', 'entraps'),
    _plan('own', 'entrapment_patch', 'entraps'),
    _plan('rival', 'creeping_entrapment', 'entraps'),
    _plan('own', 'entrapment_slope', 'entraps'),
    _plan('rival', 'spin'),
    _plan('own', 'near_stuck'),
    _plan('rival', 'entrapment', 'entraps', mode='no_reference'),
    _plan('own', 'wheel_faults'),
    _plan('rival', 'wheel_faults'),
    _plan('own', 'turns'),
    _plan('rival', 'recovery'),
    _plan('own', 'entrapment_slope', 'entraps', mode='no_reference'),
    _plan('rival', 'stop_and_go'),
    _plan('own', 'sensor_faults'),
)
"""Drives at full length, on which only treatments of the warning are tried."""

_STOPS = kinds.KINDS['stop_and_go']
_TWO_STOPS = {
    **_STOPS,
    'drive.time': [0.0, 14.0, 15.0, 21.0, 22.0, 32.0, 33.0, 39.0, 40.0],
    'drive.forward': [0.05, 0.05, 0, 0, 0.06, 0.06, 0, 0, 0.05],
}
_OWN: Mapping[str, Mapping[str, Any]] = {
    'wild_stops': {**_TWO_STOPS, 'sensors.reference_outliers': 0.15},
    'jolts': _TWO_STOPS,
    'towed': {
        **_STOPS,
        'drive.time': [0.0, 14.0, 15.0, 31.0, 32.0],
        'drive.forward': [0.05, 0.05, 0, 0, 0.05],
    },
}
"""Kinds of the own world for this study alone: stops among wild references, starts that jolt, and
a rover that is pulled along on standing wheels."""
_JOLTS, _JOLT_TIME, _JOLT = (0.1, 21.3, 39.3), 0.3, -0.3  # [s], [s], [m/s^2]
_TOWED_FROM, _TOWED_TO, _TOWED_SPEED, _TOWED_RAMP = 18.0, 28.0, 0.04, 1.0  # [s], [m/s], [s]

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

    world: str
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
            plan.world,
            f'{plan.world} {plan.kind} {seed}{mode}' + (' whole' if whole else ''),
            plan.tags | _inputs(plan.mode),
            partial(_simulated, plan, seed, whole),
            seed,
            whole,
        )


def _inputs(mode: str) -> frozenset[str]:
    """Return tags of what a mode has, `reference`, and of what it lacks, `no_reference`."""
    names = ('reference', 'torque', 'sinkage')
    return frozenset(f'no_{name}' if f'no_{name}' in mode else name for name in names)


def _simulated(plan: Plan, seed: int, whole: bool) -> Case:
    short = SHORT if plan.world == 'rival' else LONG
    drive = _bench_drive(plan, seed, None if whole else plan.seconds or short)
    configuration = drive.configuration
    if plan.mode == WANDER_TOLD:
        configuration = configuration.replace({'sensors.reference_wander_std': _WANDER_STD})
    mode = plan.mode
    if plan.world == 'rival' and mode == 'reference':
        mode = 'reference_at_once'
    return Case(configuration, list(_measurements(drive, mode)), partial(_figures, drive))


def _bench_drive(plan: Plan, seed: int, seconds: float | None) -> BenchDrive:
    if plan.kind not in _OWN:
        return WORLDS[plan.world].simulate(plan.kind, seed, seconds, None)
    drive = own_world.simulate(load(_OWN[plan.kind]), seed, seconds)
    if plan.kind == 'towed':
        return _towed(drive)
    if plan.kind == 'jolts':
        return _jolted(drive)
    return BenchDrive(drive.configuration, drive.arrivals, drive.truth)


def _jolted(drive: own_world.SimulatedDrive) -> BenchDrive:
    """Return a drive whose accelerometer takes a jolt as the wheels begin to turn."""
    start = int(drive.truth.stamp[0])

    def jolt(stamp: int) -> Any:
        time = (stamp - start) * 1e-9
        now = any(begin < time < begin + _JOLT_TIME for begin in _JOLTS)
        return np.array([_JOLT if now else 0.0, 0.0, 0.0])

    arrivals = [
        a._replace(measurement=replace(m, specific_force=m.specific_force + jolt(m.stamp)))
        if isinstance(m := a.measurement, InertialReading)
        else a
        for a in drive.arrivals
    ]
    return BenchDrive(drive.configuration, arrivals, drive.truth)


def _towed(drive: own_world.SimulatedDrive) -> BenchDrive:
    """Return a drive whose rover is pulled along while its wheels stand; its pulls are unknown."""
    truth = drive.truth
    start = int(truth.stamp[0])

    def speed(stamp: Any) -> Any:
        time = (stamp - start) * 1e-9
        ramp = np.minimum(time - _TOWED_FROM, _TOWED_TO - time) / _TOWED_RAMP
        return _TOWED_SPEED * np.clip(ramp, 0.0, 1.0)

    pulled = speed(truth.stamp)[:, None]
    towed = np.broadcast_to(pulled > scores.LEAST_SPEED, truth.slip.shape)
    top_class = np.full(truth.slip.shape, int(SlipClass.STUCK), dtype=np.uint8)
    truth = replace(
        truth,
        slip=np.where(towed, -1.0, truth.slip),
        slip_velocity=truth.slip_velocity - pulled,
        slip_class=np.where(towed, top_class, truth.slip_class),
        drawbar_pull=np.where(towed, np.nan, truth.drawbar_pull),
    )
    arrivals = [
        a._replace(measurement=replace(m, forward=m.forward + float(speed(m.stamp))))
        if isinstance(m := a.measurement, ReferenceVelocity)
        else a
        for a in drive.arrivals
    ]
    return BenchDrive(drive.configuration, arrivals, truth)


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
    baselines = scores.BaselineSlips(nothing, nothing, course, course)
    data = scores.samples(drive.truth, kept, baselines, radius)
    warnings = scores.warnings(drive.truth, kept, radius)
    told = data.said_class != SlipClass.UNKNOWN
    return {
        **_errors('slip', data.slip_error, data.slip_std),
        **_errors('pull', data.pull_error, data.pull_std),
        'false': float(warnings.false_alarms),
        'missed': float(warnings.entrapped is not None and warnings.lead_time is None),
        'lead': float(warnings.lead_time or 0.0),
        'class_wrong': float((told & (data.said_class != data.true_class)).sum()),
        'class_too_high': float((told & (data.said_class > data.true_class)).sum()),
    }


def _errors(what: str, error: Any, std: Any) -> Figures:
    """Return square, count and coverage of the errors that are known, as sums."""
    there = ~np.isnan(error)
    return {
        f'{what}_square': float(np.sum(error[there] ** 2)),
        f'{what}_count': float(there.sum()),
        f'{what}_covered': float((np.abs(error) <= scores.WITHIN * std)[there].sum()),
    }
