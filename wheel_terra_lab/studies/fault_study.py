# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""How many faults `wheel-terra check` finds: 37 kinds, each put into every recording given.

python -m wheel_terra_lab.studies.fault_study drive_a=generic_six_wheel drive_b=my_rover.yaml

A fault counts as found if a finding has its kind, its wheel where one wheel is concerned, and a
cure; as not checked if the check says that this recording cannot tell; else as missed. Findings on
the recordings without a fault are listed one by one.
"""

from __future__ import annotations

import argparse
import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from wheel_terra_estimator.bags.series_reader import read_series
from wheel_terra_estimator.bags.storage import open_bag
from wheel_terra_estimator.checks.finding import KINDS, CheckReport
from wheel_terra_estimator.checks.run import check_recording
from wheel_terra_estimator.checks.series import Recording
from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.configuration.configuration import Configuration


@dataclass(frozen=True)
class Case:
    """A recording with its rover file."""

    recording: Recording
    rover: Configuration


Injection = Callable[[Case], 'Case | None']


@dataclass(frozen=True)
class Fault:
    """A fault: how it is put in (None: the recording lacks the channel), what should be found."""

    name: str
    kinds: tuple[str, ...]
    put: Injection
    first_wheel: bool = False


def _joints(**change: Callable[[Any, Case], Any]) -> Injection:
    return _channel('joints', **change)


def _channel(name: str, **change: Callable[[Any, Case], Any]) -> Injection:
    def put(case: Case) -> Case | None:
        series = getattr(case.recording, name)
        if series is None:
            return None
        values = {key: make(series, case) for key, make in change.items()}
        if any(value is None for value in values.values()):
            return None
        changed = replace(series, **values)
        return replace(case, recording=replace(case.recording, **{name: changed}))

    return put


def _column(series: Any, case: Case, wheel: int = 0) -> int:
    return series.names.index(case.rover.wheels.names[wheel])


def _scaled(series: Any, case: Case, field: str, factor: float, wheel: int | None = 0) -> Any:
    values = getattr(series, field).copy()
    if not np.isfinite(values).any() or not np.nan_to_num(values).any():
        return None
    if wheel is None:
        return factor * values
    values[:, _column(series, case, wheel)] *= factor
    return values


def _swap(series: Any, case: Case, pairs: list[tuple[int, int]], field: str) -> Any:
    values = getattr(series, field).copy()
    for a, b in pairs:
        i, j = _column(series, case, a), _column(series, case, b)
        values[:, [i, j]] = values[:, [j, i]]
    return values


def _sides(case: Case) -> list[tuple[int, int]]:
    return [(i, i + 1) for i in range(0, case.rover.wheels.count, 2)]


def _turned(axis: str, degrees: float) -> Injection:
    angle = math.radians(degrees)
    cosine, sine = math.cos(angle), math.sin(angle)
    matrix = {
        'x': [[1, 0, 0], [0, cosine, -sine], [0, sine, cosine]],
        'y': [[cosine, 0, sine], [0, 1, 0], [-sine, 0, cosine]],
        'z': [[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]],
    }[axis]
    turn = np.array(matrix, float)
    return _channel(
        'imu',
        force=lambda s, c: s.force @ turn,
        rate=lambda s, c: s.rate @ turn,
        orientation=lambda s, c: np.full_like(s.orientation, np.nan),
    )


def _rover(key: str, factor: float) -> Injection:
    def put(case: Case) -> Case | None:
        value = case.rover.flat()[key]
        wrong = [factor * v for v in value] if isinstance(value, list) else factor * value
        return replace(case, rover=case.rover.replace({key: wrong}))

    return put


def _frozen(series: Any, case: Case) -> Any:
    rate, column = series.rate.copy(), _column(series, case)
    busy = np.abs(np.median(np.nan_to_num(rate), axis=1))
    start = int(np.argmax(busy > 0.5 * busy.max()))
    rate[start:, column] = rate[start, column]
    return rate


def _noisy(field: str, factor: float) -> Callable[[Any, Case], Any]:
    def make(series: Any, case: Case) -> Any:
        values = getattr(series, field)
        size = factor * float(np.nanmean(np.abs(values)))
        return values + size * np.random.default_rng(1).standard_normal(values.shape)

    return make


def _counted(series: Any, case: Case) -> Any:
    """Rates of an encoder that counts twice in the usual interval at the usual rate."""
    seconds = (series.stamp - series.stamp[0]) * 1e-9
    interval = np.maximum(np.diff(seconds, prepend=-float(np.median(np.diff(seconds)))), 1e-3)
    size = np.abs(series.rate[np.isfinite(series.rate)])
    usual = float(np.median(size[size > 0.2 * np.quantile(size, 0.95)]))
    angle = 0.5 * usual * float(np.median(interval))
    turned = np.cumsum(np.nan_to_num(series.rate) * interval[:, None], axis=0)
    counts = np.diff(np.floor(turned / angle), axis=0, prepend=0.0)
    return np.where(np.isfinite(series.rate), angle * counts / interval[:, None], np.nan)


def _late(seconds: float) -> Callable[[Any, Case], Any]:
    return lambda series, case: series.stamp + round(seconds * 1e9)


def _gaps(series: Any, case: Case) -> np.ndarray:
    seconds = (series.stamp - series.stamp[0]) * 1e-9
    return np.asarray(seconds % 10.0 > 1.5)


def _dropping(name: str) -> Injection:
    def put(case: Case) -> Case | None:
        series = getattr(case.recording, name)
        if series is None:
            return None
        keep = _gaps(series, case)
        changed = {
            key: value[keep] if isinstance(value, np.ndarray) else value
            for key, value in vars(series).items()
        }
        return replace(case, recording=replace(case.recording, **{name: type(series)(**changed)}))

    return put


def _renamed(case: Case) -> Case | None:
    joints = case.recording.joints
    assert joints is not None
    names = tuple(f'base_{n}' if n == case.rover.wheels.names[0] else n for n in joints.names)
    return replace(case, recording=replace(case.recording, joints=replace(joints, names=names)))


def _absent(case: Case) -> Case | None:
    joints = case.recording.joints
    assert joints is not None
    rate, torque = joints.rate.copy(), joints.torque.copy()
    rate[:, _column(joints, case)] = np.nan
    torque[:, _column(joints, case)] = np.nan
    changed = replace(joints, rate=rate, torque=torque)
    return replace(case, recording=replace(case.recording, joints=changed))


def _jumping(series: Any, case: Case) -> Any:
    velocity = series.velocity.copy()
    speed = float(np.quantile(np.abs(velocity[:, 0]), 0.9))
    wild = np.random.default_rng(2).uniform(size=velocity.shape[0]) < 0.05
    velocity[wild, 0] += 3.0 * speed
    return velocity


def _zero_force(series: Any, case: Case) -> Any:
    return series.force - np.array([0.0, 0.0, 9.80665])


FAULTS = (
    Fault('one wheel counts backwards', ('sign',), _joints(
        rate=lambda s, c: _scaled(s, c, 'rate', -1.0)), True),
    Fault('all wheels count backwards', ('sign',), _joints(
        rate=lambda s, c: -s.rate, torque=lambda s, c: -s.torque)),
    Fault('left wheels count backwards', ('sign',), _joints(
        rate=lambda s, c: s.rate * np.where(
            np.isin(s.names, c.rover.wheels.names[::2]), -1.0, 1.0)), True),
    Fault('left and right swapped', ('swapped_sides',), _joints(
        rate=lambda s, c: _swap(s, c, _sides(c), 'rate'),
        torque=lambda s, c: _swap(s, c, _sides(c), 'torque'))),
    Fault('front wheels exchanged', ('exchanged_wheels',), _joints(
        rate=lambda s, c: _swap(s, c, [(0, 1)], 'rate'),
        torque=lambda s, c: _swap(s, c, [(0, 1)], 'torque')), True),
    Fault('a wheel without rate', ('missing_wheel',), _absent, True),
    Fault('a wheel under another name', ('unknown_name',), _renamed, True),
    Fault('rates in rpm', ('unit',), _joints(rate=lambda s, c: s.rate * 30.0 / math.pi)),
    Fault('rates in degrees', ('unit',), _joints(rate=lambda s, c: np.degrees(s.rate))),
    Fault('a frozen rate', ('frozen',), _joints(rate=_frozen), True),
    Fault('noisy rates', ('noise',), _joints(rate=_noisy('rate', 0.5))),
    Fault('rates in coarse steps', ('noise',), _joints(rate=_counted)),
    Fault('rates in encoder counts', ('unit',), _joints(
        rate=lambda s, c: s.rate * 4096 / (2.0 * math.pi))),
    Fault('gaps in the wheel rates', ('drop_outs',), _dropping('joints')),
    Fault('stamps that repeat', ('order',), _joints(
        stamp=lambda s, c: s.stamp[np.maximum(np.arange(s.stamp.size) // 2 * 2, 0)])),
    Fault('IMU upside down', ('mounting',), _turned('x', 180.0)),
    Fault('IMU turned by 90 degrees', ('mounting',), _turned('z', 90.0)),
    Fault('IMU tilted by 8 degrees', ('mounting',), _turned('y', 8.0)),
    Fault('gyro in degrees per second', ('unit',), _channel(
        'imu', rate=lambda s, c: np.degrees(s.rate))),
    Fault('acceleration in g', ('unit',), _channel('imu', force=lambda s, c: s.force / 9.80665)),
    Fault('gravity taken off', ('gravity',), _channel('imu', force=_zero_force)),
    Fault('gyro all zero', ('placeholder',), _channel('imu', rate=lambda s, c: 0.0 * s.rate)),
    Fault('yaw rate reversed', ('sign',), _channel(
        'imu', rate=lambda s, c: s.rate * np.array([1.0, 1.0, -1.0]))),
    Fault('gyro bias', ('zero',), _channel(
        'imu', rate=lambda s, c: s.rate + np.array([0.0, 0.0, 0.05]))),
    Fault('IMU 0.8 s late', ('delay',), _channel('imu', stamp=_late(0.8))),
    Fault('torque of a wheel reversed', ('sign',), _joints(
        torque=lambda s, c: _scaled(s, c, 'torque', -1.0)), True),
    Fault('torque in N mm', ('unit',), _joints(
        torque=lambda s, c: _scaled(s, c, 'torque', 1000.0, None))),
    Fault('a current in place of torque', ('gain',), _joints(
        torque=lambda s, c: _scaled(s, c, 'torque', 12.0, None))),
    Fault('sinkage in millimetres', ('unit',), _channel(
        'sinkage', sinkage=lambda s, c: 1000.0 * s.sinkage)),
    Fault('sinkage reversed', ('sign',), _channel('sinkage', sinkage=lambda s, c: -s.sinkage)),
    Fault('front sinkage sensors exchanged', ('exchanged_wheels',), _channel(
        'sinkage', sinkage=lambda s, c: _swap(s, c, [(0, 1)], 'sinkage')), True),
    Fault('reference reversed', ('sign',), _channel(
        'reference', velocity=lambda s, c: -s.velocity)),
    Fault('reference 1 s late by its stamps', ('delay',), _channel(
        'reference', stamp=_late(1.0))),
    Fault('reference that jumps', ('jumps',), _channel('reference', velocity=_jumping)),
    Fault('covariance of 1e6', ('covariance',), _channel(
        'reference', variance=lambda s, c: np.full_like(s.variance, 1e6))),
    Fault('radius 8 % too small', ('radius',), _rover('wheels.radius', 0.92)),
    Fault('mass 50 % too small', ('mass',), _rover('rover.mass', 0.5)),
)  # fmt: skip


def outcome(fault: Fault, case: Case, before: CheckReport) -> str:
    """Return found, not checked, missed or no channel."""
    faulty = fault.put(case)
    if faulty is None:
        return 'no channel'
    report = check_recording(faulty.recording, faulty.rover)
    wheel = case.rover.wheels.names[0] if fault.first_wheel else None
    old = {(f.kind, f.topic, f.wheel) for f in before.findings}
    for finding in report.findings:
        fresh = (finding.kind, finding.topic, finding.wheel) not in old or fault.kinds[0] in (
            'gain',
            'covariance',
            'radius',  # a rover file that is wrong as it is needs the same cure
        )
        right = finding.kind in fault.kinds and (
            wheel is None or wheel in (finding.wheel or '').split(', ')
        )
        if right and fresh and finding.cure:
            return 'found'
    told = {entry.kind for entry in report.not_checked}
    silent = told & set(fault.kinds) or (fault.kinds == ('sign',) and 'swapped_sides' in told)
    return 'not checked' if silent else 'missed'


def main() -> None:
    """Print the table of the study."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('cases', nargs='+', metavar='BAG=CONFIG', help='several files with a +')
    totals: Counter[str] = Counter()
    by_fault: dict[str, Counter[str]] = {fault.name: Counter() for fault in FAULTS}
    clean = 0
    arguments = parser.parse_args()
    for text in arguments.cases:
        path, _, files = text.partition('=')
        with open_bag(path) as bag:
            recording = read_series(bag, {}, Path(path).name)
        case = Case(recording, reader.load(files.split('+')))
        before = check_recording(case.recording, case.rover)
        clean += len(before.findings)
        for finding in before.findings:
            print(f'without a fault: {recording.name}: {finding}', flush=True)
        for fault in FAULTS:
            result = outcome(fault, case, before)
            by_fault[fault.name][result] += 1
            totals[result] += 1
            if result == 'missed':
                print(f'missed: {recording.name}: {fault.name}', flush=True)
    print(f'\n{"fault":36}{"found":>7}{"not checked":>13}{"missed":>8}{"no channel":>12}')
    for name, counts in by_fault.items():
        row = [counts[key] for key in ('found', 'not checked', 'missed', 'no channel')]
        print(f'{name:36}{row[0]:7}{row[1]:13}{row[2]:8}{row[3]:12}')
    tellable = max(totals['found'] + totals['missed'], 1)
    print(
        f'\nfound {totals["found"]} of {tellable} that the recording can tell: '
        f'{100 * totals["found"] / tellable:.1f} %'
    )
    checks = len(KINDS) * len(arguments.cases)
    print(f'findings without a fault: {clean} of {checks} checks: {100 * clean / checks:.1f} %')


if __name__ == '__main__':
    main()
