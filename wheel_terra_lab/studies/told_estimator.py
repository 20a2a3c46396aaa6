# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What the estimator still gets wrong when it is told what it has to learn otherwise.

    python -m wheel_terra_lab.studies.told_estimator A:stop_and_go B:entrapment --seeds 1000

Each drive is run by the estimator as it is and by the same one that is told, with hindsight:

sensors
    zero and gain of each torque sensor, zero of each sinkage sensor, and the noise of torque,
    sinkage and reference, all from the readings of this drive against its truth;
radius
    of the wheels, from rim speed over wheel rate;
soil
    strength, shear modulus, stiffness and the other parameters that the filter learns: medians
    over the drive of what it learns when the true speed comes as its reference at 5 Hz. Their
    deviations are then a tenth of what a file states.

What is left is what perfect learning would leave: noise and rate of the references, changes of the
soil along the way, and what the closed form is off by.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.checks.input_judge import InputJudge
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.core import EstimatorCore
from wheel_terra_estimator.estimation.measurements import (
    Measurement,
    ReferenceVelocity,
    SinkageReading,
    WheelOdometry,
)
from wheel_terra_estimator.estimation.wheel_soil_estimator import WheelSoilEstimator
from wheel_terra_lab.evaluation import scores
from wheel_terra_lab.evaluation.runner import inputs_of_mode, record, run_estimator
from wheel_terra_lab.evaluation.simulators import SIMULATORS, BenchDrive
from wheel_terra_lab.evaluation.tables import table
from wheel_terra_lab.evaluation.two_state_filters import SlipCourse

FloatArray = NDArray[np.float64]
TEACHING_PERIOD = 0.2  # of the true speed as a reference [s]
TEACHING_STD = 2e-4  # [m/s]
SETTLED = 0.3  # of the drive after which what is learned is looked at
LOOK_EVERY = 20  # sets of estimates
TOLD_SHARE = 0.1  # of the soil's stated deviations
TORQUE_GAIN_STD = 0.04  # before a drive is looked at
LEAST_SLIP = 0.02  # that tells the rim speed
LEAST_ZERO_STD = 1e-5  # [m] that a told zero of a sinkage sensor keeps


def robust_std(values: FloatArray) -> float:
    """Return 1.4826 times the median distance from the median: wild ones aside."""
    values = values[~np.isnan(values)]
    return float(1.4826 * np.median(np.abs(values - np.median(values)))) if len(values) else 0.0


def pairs(drive: BenchDrive, kind: type, field: str, truth: FloatArray) -> tuple[FloatArray, ...]:
    """Return readings of a sensor and what is true at their stamps, (m, n) each."""
    stamps = drive.truth.stamp
    found = [
        (a.measurement.stamp, np.atleast_1d(getattr(a.measurement, field)))
        for a in drive.arrivals
        if isinstance(a.measurement, kind)
    ]
    columns = truth.reshape(len(stamps), -1).T
    when = np.array([stamp for stamp, _ in found])
    return np.stack([v for _, v in found]), np.stack(
        [np.interp(when, stamps, column) for column in columns], axis=1
    )


def zero_and_gain(reading: FloatArray, truth: FloatArray) -> tuple[float, float, float]:
    """Return zero, gain and noise of a torque sensor, the gain drawn to 1 by its deviation."""
    told = ~np.isnan(reading)
    reading, truth = reading[told], truth[told]
    off = reading - truth
    near = np.abs(off - np.median(off)) < 5.0 * max(robust_std(off), 1e-9)
    rows = np.stack([np.ones(near.sum()), truth[near]], axis=1)
    noise = max(robust_std(off), 1e-9)
    normal = rows.T @ rows / noise**2 + np.diag([0.0, TORQUE_GAIN_STD**-2])
    zero, gain = np.linalg.solve(normal, rows.T @ off[near] / noise**2)
    return float(zero), 1.0 + float(gain), robust_std(off - zero - gain * truth)


def told_sensors(drive: BenchDrive) -> Configuration:
    """Return the configuration with the sensors and the radius as they are in this drive."""
    truth: Any = drive.truth
    torque, true_torque = pairs(drive, WheelOdometry, 'torque', truth.torque)
    fits = [zero_and_gain(r, t) for r, t in zip(torque.T, true_torque.T, strict=True)]
    depth, true_depth = pairs(drive, SinkageReading, 'sinkage', truth.sinkage)
    depth_error = depth - true_depth
    speed, true_speed = pairs(drive, ReferenceVelocity, 'forward', truth.forward_velocity)
    zeros = np.nanmedian(depth_error, axis=0)
    with np.errstate(divide='ignore', invalid='ignore'):
        slips = np.where(np.abs(truth.slip) > LEAST_SLIP, truth.slip, np.nan)
        driving = np.where(slips > 0.0, truth.slip_velocity / slips, np.nan)
        radius = np.nanmedian(driving / truth.wheel_rate, axis=0)
    wheels = drive.configuration.wheels
    off = np.where(np.isnan(radius), 0.0, radius - wheels.slip_radius)
    return drive.configuration.replace(
        {
            'wheels.radius': (np.asarray(wheels.radius) + off).tolist(),
            'sensors.torque_zero': [zero for zero, _, _ in fits],
            'sensors.torque_gain': [gain for _, gain, _ in fits],
            'sensors.torque_zero_std': 0.0,
            'sensors.torque_gain_std': 0.0,
            'sensors.torque_std': float(np.mean([noise for _, _, noise in fits])),
            'sensors.sinkage_zero': zeros.tolist(),
            'sensors.sinkage_zero_std': LEAST_ZERO_STD,
            'sensors.sinkage_std': robust_std((depth_error - zeros).ravel()),
            'sensors.reference_std': robust_std((speed - true_speed).ravel()),
        }
    )


def with_noise(drive: BenchDrive, std: float, mode: str) -> Iterator[Measurement]:
    """Yield what a mode gets, references with their true deviation [m/s]."""
    for m in inputs_of_mode(drive.arrivals, mode):
        yield replace(m, variance=std**2) if isinstance(m, ReferenceVelocity) else m


def taught(drive: BenchDrive) -> Iterator[Measurement]:
    """Yield the measurements with the true speed as the reference, at once and often."""
    truth: Any = drive.truth
    last = -np.inf
    for m in inputs_of_mode(drive.arrivals, 'reference'):
        if isinstance(m, ReferenceVelocity):
            continue
        yield m
        if isinstance(m, WheelOdometry) and (m.stamp - last) * 1e-9 >= TEACHING_PERIOD:
            last = m.stamp
            speed = float(np.interp(m.stamp, truth.stamp, truth.forward_velocity))
            yield ReferenceVelocity(m.stamp, speed, TEACHING_STD**2)


def told_soil(drive: BenchDrive, sensors: Configuration) -> Configuration:
    """Return the configuration with the soil that is learned where the speed is known."""
    estimator = WheelSoilEstimator(sensors)
    core = EstimatorCore(sensors, estimator, judged_by=InputJudge)
    looks: list[dict[str, Any]] = []
    count = 0
    for measurement in taught(drive):
        for _ in core.add(measurement):
            count += 1
            if count % LOOK_EVERY == 0:
                looks.append(estimator.learned())
    core.flush()
    late = looks[int(SETTLED * len(looks)) :]
    learned = {
        key: float(np.median([look[key] for look in late]))
        for key in late[0]
        if key.split('.')[0] in ('soil', 'effects') and '_std' not in key
    }
    share = TOLD_SHARE * float(np.asarray(sensors.flat()['soil.relative_std']))
    return sensors.replace({**learned, 'soil.relative_std': share})


def figures(
    drive: BenchDrive, configuration: Configuration, measurements: Iterator[Measurement]
) -> dict[str, float]:
    """Return the errors of the estimator: slip, its slow part, pull over the load, sinkage [mm]."""
    kept = record(*run_estimator(configuration, measurements))
    nothing = np.full(drive.truth.slip.shape, np.nan)
    course = SlipCourse(nothing, nothing)
    data = scores.samples(
        drive.truth,
        kept,
        scores.BaselineSlips(nothing, nothing, course, course, course),
        drive.configuration.wheels.slip_radius,
    )
    return {
        'slip': scores.rms(data.slip_error),
        'slow part': scores.rms(data.slow_slip_error),
        'pull [%]': 100.0 * scores.rms(data.pull_error),
        'sinkage [mm]': 1e3 * scores.rms(data.sinkage_error),
    }


def compared(drive: BenchDrive, modes: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Return errors of the estimator as it is and told, by name; `no_torque` adds its pull."""
    sensors = told_sensors(drive)
    told = told_soil(drive, sensors)
    noise = float(told.sensors.reference_std)
    found: dict[str, tuple[float, float]] = {}
    for mode in modes:
        plain = figures(drive, drive.configuration, inputs_of_mode(drive.arrivals, mode))
        knowing = figures(drive, told, with_noise(drive, noise, mode))
        for name in plain if mode == 'reference' else ('pull [%]',):
            key = name if mode == 'reference' else f'{name} {mode}'
            found[key] = plain[name], knowing[name]
    return found


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument('kinds', nargs='+', metavar='SIMULATOR:KIND')
    parser.add_argument('--seeds', nargs='+', type=int, default=[1000])
    parser.add_argument('--modes', nargs='+', default=['reference', 'no_torque'])
    arguments = parser.parse_args()
    rows: list[tuple[str, ...]] = []
    head: tuple[str, ...] = ('drive',)
    for name in arguments.kinds:
        simulator, kind = name.split(':')
        for seed in arguments.seeds:
            found = compared(
                SIMULATORS[simulator].simulate(kind, seed, None, None), arguments.modes
            )
            head = ('drive', *(f'{n}: as it is, told' for n in found))
            shown = (f'{plain:.4g}, {told:.4g}' for plain, told in found.values())
            rows.append((f'{simulator} {kind} {seed}', *shown))
            print(*rows[-1], sep=' | ', flush=True)
    print(table(head, rows))


if __name__ == '__main__':
    main()
