# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Whether `wheel-terra calibrate` ever makes a replay worse.

python -m wheel_terra_lab.studies.calibration_study B:turns C:soft_patch --seeds 9300 9301

One drive for each KIND, seed and `--each` further draws; a fault of the rover file is drawn by the
seed, the recording calibrated, and the drive replayed with the wrong file, the calibrated and the
right one. Printed are slip error and share of right classes of each; *worse* is an error more than
0.001 and 2 % larger, or classes more than 1 % fewer, than with the file as it was.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from wheel_terra_estimator.arrays import IntArray
from wheel_terra_estimator.bags.message_factory import MessageFactory
from wheel_terra_estimator.checks.calibration import calibrate
from wheel_terra_estimator.checks.run import check_recording
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.measurements import (
    InertialReading,
    Measurement,
    ReferenceVelocity,
    SinkageReading,
    WheelOdometry,
)
from wheel_terra_estimator.messages.pipeline import Pipeline
from wheel_terra_lab.evaluation.runner import record
from wheel_terra_lab.evaluation.scores import rms, scored_rows
from wheel_terra_lab.evaluation.simulators import SIMULATORS, BenchDrive
from wheel_terra_lab.studies.fault_study import recording_of

Random = np.random.Generator
Draw = Callable[[Configuration, Random], dict[str, Any]]
LONGEST = 90.0
"""Of a drive that is replayed [s]."""


def _either(random: Random, low: float, high: float) -> float:
    return float(random.choice([-1.0, 1.0]) * random.uniform(low, high))


def _factor(key: str, low: float, high: float) -> Draw:
    def draw(rover: Configuration, random: Random) -> dict[str, Any]:
        value: Any = rover.flat()[key]
        return {key: np.multiply(value, 1.0 + _either(random, low, high)).tolist()}

    return draw


def _of(key: str, low: float, high: float) -> Draw:
    return lambda rover, random: {key: _either(random, low, high)}


def _backwards(which: str) -> Draw:
    def draw(rover: Configuration, random: Random) -> dict[str, Any]:
        wheels = rover.wheels
        turned = np.arange(wheels.count) == random.integers(wheels.count)
        if which == 'side':
            turned = np.sign(wheels.y) == random.choice([-1, 1])
        turned = turned | (which == 'all')
        return {'wheels.direction': np.where(turned, -wheels.direction, wheels.direction).tolist()}

    return draw


def _exchanged(rover: Configuration, random: Random) -> dict[str, Any]:
    names, y = list(rover.wheels.names), rover.wheels.y
    i, j = (int(random.choice(np.flatnonzero(side))) for side in (y > 0.0, y < 0.0))
    names[i], names[j] = names[j], names[i]
    return {'wheels.names': names}


def _torque_zero(rover: Configuration, random: Random) -> dict[str, Any]:
    size = rover.rover.mass * rover.rover.gravity * np.mean(rover.wheels.slip_radius)
    zero = np.zeros(rover.wheels.count)
    zero[random.integers(zero.size)] = _either(random, 0.2, 0.8) * size / zero.size
    return {'sensors.torque_zero': zero.tolist()}


FAULTS: dict[str, Draw] = {
    'a wheel backwards': _backwards('one'),
    'a side backwards': _backwards('side'),
    'all wheels backwards': _backwards('all'),
    'two wheels exchanged': _exchanged,
    'radius': _factor('wheels.radius', 0.05, 0.18),
    'track': _factor('wheels.y', 0.15, 0.3),
    'mass': _factor('rover.mass', 0.3, 0.5),
    'IMU tilted': _of('sensors.imu_mounting_pitch_deg', 4.0, 12.0),
    'IMU turned about z': _of('sensors.imu_mounting_yaw_deg', 60.0, 180.0),
    'IMU upside down': _of('sensors.imu_mounting_roll_deg', 180.0, 180.0),
    'gyro bias': lambda c, r: {'sensors.angular_rate_bias': [0.0, 0.0, _either(r, 0.02, 0.08)]},
    'scale of the torques': lambda c, r: {
        'sensors.torque_gain': [float(r.choice([0.5, 0.7, 1.4, 2.0]))] * c.wheels.count},
    'zero of a torque': _torque_zero,
    'stamps of the IMU': _of('sensors.imu_stamp_offset', 0.3, 1.5),
    'stamps of the wheels': _of('sensors.wheel_odometry_stamp_offset', 0.3, 1.5),
    'stamps of the reference': _of('sensors.reference_stamp_offset', 0.4, 2.0),
    'stamps of the sinkage': _of('sensors.sinkage_stamp_offset', 0.4, 2.0),
    'noise of the rates': lambda c, r: {
        'sensors.wheel_rate_std': c.sensors.wheel_rate_std * float(r.choice([0.1, 10.0]))},
    'noise of the IMU': lambda c, r: {
        'sensors.specific_force_std': c.sensors.specific_force_std * float(r.choice([0.1, 10.0]))},
    'gravity of another planet': _factor('rover.gravity', 0.6, 0.6),
}  # fmt: skip


def message_of(make: MessageFactory, one: Measurement, rover: Configuration) -> tuple[str, Any]:
    """Return topic and message of a measurement of a rover whose file is right."""
    header, wheels = make.header(one.stamp), rover.wheels
    if isinstance(one, WheelOdometry):
        rate, torque = wheels.direction * one.rate, wheels.direction * one.torque
        return 'joint_states', make.joint_state(header, wheels.names, (), rate, torque)
    if isinstance(one, InertialReading):
        orientation = None if one.orientation is None else list(one.orientation)
        rate = list(one.angular_rate)
        return 'imu/data', make.imu(header, list(one.specific_force), rate, orientation)
    if isinstance(one, SinkageReading):
        return 'sinkage', make.joint_state(header, wheels.names, one.sinkage)
    assert isinstance(one, ReferenceVelocity)
    covariance = [one.variance] + [0.0] * 35
    twist = make.twist_with_covariance(one.forward, 0.0, covariance)
    return 'reference_odom', make.odometry(header, twist)


def replayed(drive: BenchDrive, file: Configuration, order: IntArray) -> tuple[float, float]:
    """Return slip error and share of right classes of a drive with a rover file."""
    pipeline, make, sets = Pipeline(file), MessageFactory(), []
    for timed in drive.arrivals:
        sets += pipeline.hear(*message_of(make, timed.measurement, drive.configuration))
    found = record([*sets, *pipeline.flush()], {})
    radius = drive.configuration.wheels.slip_radius
    if not len(found.stamp):
        return 2.0, 0.0
    found = replace(found, stamp=_nearest(found.stamp, drive.truth.stamp))
    position, scored = scored_rows(drive.truth, found, radius)
    error = np.nan_to_num(found.slip[position][:, order] - drive.truth.slip, nan=1.0)
    right = found.slip_class[position][:, order] == drive.truth.slip_class
    return rms(error[scored]), float(np.mean(right[scored]))


def _nearest(stamp: IntArray, of: IntArray) -> IntArray:
    """Return the nearest stamps of the truth: a file with other offsets publishes others."""
    after = np.clip(np.searchsorted(of, stamp), 1, of.size - 1)
    before = stamp - of[after - 1] < of[after] - stamp
    return of[after - before]


def case(name: str, drive: BenchDrive, random: Random, what: str) -> tuple[float, ...]:
    """Return slip error and right classes with the wrong, calibrated and right file."""
    rover = drive.configuration
    recording = recording_of(drive, name)
    for finding in check_recording(recording, rover).findings:
        print(f'  without a fault: {name}: {finding}', flush=True)
    wrong = rover.replace(FAULTS[what](rover, random))
    told = calibrate(recording, wrong)
    changes = {change.key: change.after for change in told.changes}
    calibrated = wrong.replace(changes)
    order = np.array([wrong.wheels.names.index(n) for n in rover.wheels.names])
    result: tuple[float, ...] = ()
    for file in (wrong, calibrated, rover):
        result += replayed(drive, file, order if file is not rover else np.sort(order))
    bad = result[2] > 1.02 * result[0] + 0.001 or result[3] < result[1] - 0.01
    numbers = ' '.join(f'{value:.3f}' for value in result)
    print(f'{"WORSE" if bad else "":5} {name:28} {what:26} {numbers}', flush=True)
    if bad:
        print(*(f'    {change.key}: {change.after}: {change.source}' for change in told.changes),
              sep='\n', flush=True)  # fmt: skip
    return (*result, float(bad))


def main() -> None:
    """Print a line for each case, and the means."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('kinds', nargs='+', metavar='KIND', help='A:turns')
    parser.add_argument('--seeds', nargs='+', type=int, default=[1])
    arguments = parser.parse_args()
    rows = []
    for kind in arguments.kinds:
        for seed in arguments.seeds:
            simulator, _, name = kind.partition(':')
            drive = SIMULATORS[simulator].simulate(name, seed, LONGEST, None)
            what = list(FAULTS)[(len(rows) + seed) % len(FAULTS)]
            rows.append(case(f'{kind} {seed}', drive, np.random.default_rng(seed), what))
    table = np.array(rows)
    slip = np.exp(np.mean(np.log(table[:, [0, 2, 4]]), axis=0))
    print(f'{len(rows)} drives, wrong file, calibrated, right: slip error (geometric mean)', slip)
    print('right classes', table[:, [1, 3, 5]].mean(axis=0), 'worse', int(table[:, 6].sum()))


if __name__ == '__main__':
    main()
