# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Which faults are reported while driving, and which raise the stuck warning before that.

python -m wheel_terra_lab.studies.warning_study drive_a=generic_six_wheel drive_b=my_rover.yaml

The faults are those of `fault_study.py`. Each recording is played message by message through what
node and replay share, first as it is, then with each fault. A run ends where the fault is told, by
any words with a remedy; a fault that shows in no window of this part of the drive is not told.
"""

from __future__ import annotations

import argparse
import heapq
import math
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from wheel_terra_estimator.bags.series_reader import read_series
from wheel_terra_estimator.bags.storage import open_bag
from wheel_terra_estimator.checks.run import check_recording
from wheel_terra_estimator.checks.series import Channel, Recording
from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.messages.pipeline import Pipeline
from wheel_terra_lab.studies.fault_study import FAULTS, Case, outcome
from wheel_terra_lab.trials.trial import interval

NOT_THERE = -1.0
"""First entry of a covariance where the message has no such value (REP 145)."""

CURE = ' -> '
"""Stands between what is wrong and what mends it."""

Heard = tuple[int, int, str, Any]
"""Log time [ns], place among those of one time, input topic, message."""


def messages(recording: Recording) -> Iterator[Heard]:
    """Yield the messages of a recording in the order in which they came."""
    makers = {
        'joint_states': (recording.joints, _joints),
        'imu/data': (recording.imu, _imu),
        'sinkage': (recording.sinkage, _sinkage),
        'reference_odom': (recording.reference, _odometry),
    }
    streams = [
        _stream(place, topic, series, make)
        for place, (topic, (series, make)) in enumerate(makers.items())
        if series is not None
    ]
    yield from heapq.merge(*streams, key=lambda heard: heard[:2])


def _stream(place: int, topic: str, series: Channel, make: Any) -> Iterator[Heard]:
    for row, log_time in enumerate(series.log_time.tolist()):
        sec, nanosec = divmod(int(series.stamp[row]), 1_000_000_000)
        message = make(series, row)
        message.header = SimpleNamespace(stamp=SimpleNamespace(sec=sec, nanosec=nanosec))
        yield log_time, place, topic, message


def _joints(series: Any, row: int) -> SimpleNamespace:
    known = [i for i, rate in enumerate(series.rate[row]) if not math.isnan(rate)]
    return SimpleNamespace(
        name=tuple(series.names[i] for i in known),
        velocity=series.rate[row, known],
        effort=series.torque[row, known],
    )


def _sinkage(series: Any, row: int) -> SimpleNamespace:
    return SimpleNamespace(name=series.names, position=series.sinkage[row])


def _imu(series: Any, row: int) -> SimpleNamespace:
    x, y, z, w = series.orientation[row].tolist()
    return SimpleNamespace(
        linear_acceleration=_vector(series.force[row]),
        angular_velocity=_vector(series.rate[row]),
        orientation=SimpleNamespace(x=x, y=y, z=z, w=w),
        linear_acceleration_covariance=[0.0],
        angular_velocity_covariance=[0.0],
        orientation_covariance=[NOT_THERE if math.isnan(w) else 0.0],
    )


def _odometry(series: Any, row: int) -> SimpleNamespace:
    twist = SimpleNamespace(linear=_vector(series.velocity[row]))
    covariance = [float(series.variance[row])]
    return SimpleNamespace(twist=SimpleNamespace(twist=twist, covariance=covariance))


def _vector(values: Any) -> SimpleNamespace:
    x, y, z = values.tolist()
    return SimpleNamespace(x=x, y=y, z=z)


class Course(NamedTuple):
    """Seconds since the first set; nan: never."""

    warned: float
    told: float


def course(case: Case, seconds: float) -> Course:
    """Play a case until something is told of its inputs; return when and when it warned."""
    pipeline = Pipeline(case.rover)
    first, warned = None, math.nan
    for _, _, topic, message in messages(case.recording):
        for estimates in pipeline.hear(topic, message):
            first = estimates.stamp if first is None else first
            time = (estimates.stamp - first) * 1e-9
            if time > seconds:
                return Course(warned, math.nan)
            if any(CURE in words for words in estimates.faults.values()):
                return Course(warned, time)
            if estimates.stuck and math.isnan(warned):
                warned = time
    return Course(warned, math.nan)


def share(right: int, count: int) -> str:
    """Return a share with its 95 % interval (Wilson 1927)."""
    low, high = interval(right, count)
    return f'{right} of {count} ({100 * low:.0f} to {100 * high:.0f} %)'


def main() -> None:
    """Print when each fault was told, and whether the warning came before."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('cases', nargs='+', metavar='BAG=CONFIG', help='several files with a +')
    parser.add_argument('--seconds', type=float, default=60.0, help='of each recording')
    parser.add_argument('--faults', default='', metavar='WORD', help='only those with this word')
    arguments = parser.parse_args()
    faults = [fault for fault in FAULTS if arguments.faults in fault.name]
    runs = untold = early = by_check = false = 0
    times: dict[str, list[float]] = defaultdict(list)
    for text in arguments.cases:
        path, _, files = text.partition('=')
        with open_bag(path) as bag:
            recording = read_series(bag, {}, Path(path).name)
        case = Case(recording, reader.load(files.split('+')))
        report = check_recording(case.recording, case.rover)
        as_it_is = course(case, arguments.seconds)
        false += not math.isnan(as_it_is.told)
        print(f'{recording.name}: as it is: {as_it_is}', flush=True)
        for fault in faults:
            faulty = fault.put(case, np.random.default_rng(0))
            if faulty is None:
                continue
            runs += 1
            found = course(faulty.case, arguments.seconds)
            times[fault.name].append(found.told)
            if not math.isnan(found.warned) and math.isnan(as_it_is.warned):
                late = not math.isnan(found.told)
                before = late or outcome(fault, faulty, report)[0] == 'found'
                early += late
                by_check += before and not late
                untold += not before
                by = (
                    'reported while driving'
                    if late
                    else 'found by check'
                    if before
                    else 'not found'
                )
                print(f'{recording.name}: {fault.name}: {found}, {by}', flush=True)
    print(f'\n{"fault":36}{"found":>7}{"runs":>7}{"first [s]":>12}{"last [s]":>12}')
    for name, told in times.items():
        known = [time for time in told if not math.isnan(time)] or [math.nan]
        count = sum(not math.isnan(time) for time in told)
        print(f'{name:36}{count:7}{len(told):7}{min(known):12.1f}{max(known):12.1f}')
    everything = [time for told in times.values() for time in told]
    heard = sum(not math.isnan(time) for time in everything)
    print(
        f'\nreported while driving: {share(heard, len(everything))}; '
        f'reported without a fault: {share(false, len(arguments.cases))}'
    )
    print(
        f'{runs} runs; warned before the fault was reported: {early}; warned, not reported while '
        f'driving but found by the checks that replay runs first: {by_check}; warned, not found: '
        f'{untold}'
    )


if __name__ == '__main__':
    main()
