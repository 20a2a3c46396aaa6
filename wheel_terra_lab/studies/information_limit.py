# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""How well the slip of a drive can be known from its reference velocities alone.

    python -m wheel_terra_lab.studies.information_limit B:climb --seeds 1000 1001

The slip of the rover is taken as a random walk over rim travel, seen by each reference velocity
v = (1 - s) r w. Three estimators know what no estimator knows: the error of each sensor drawn in
this drive (its true standard deviation) and the walk that gives the least error on it, chosen with
hindsight.

causal
    Kalman filter, each reference when it arrives.
smoother
    Fixed-interval smoother (Rauch, Tung and Striebel 1965) over all references of the drive.
bound
    Posterior Cramer-Rao bound of a slip that does not change at all: the deviation of the mean of
    all references that have arrived.

The errors are those of the rover's mean slip, beside which the estimator's stands.
"""

from __future__ import annotations

import argparse
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.estimation.measurements import ReferenceVelocity
from wheel_terra_lab.evaluation.runner import inputs_of_mode, record, run_estimator
from wheel_terra_lab.evaluation.scores import FIRST_SECONDS, LEAST_SPEED
from wheel_terra_lab.evaluation.simulators import SIMULATORS, BenchDrive
from wheel_terra_lab.evaluation.tables import table

FloatArray = NDArray[np.float64]
WALKS = np.geomspace(0.005, 0.6, 13)
"""Random walks that are tried [1/sqrt(m)]."""
FIRST_STD = 0.3  # of the slip before the first reference


class Sight(NamedTuple):
    """What the references of a drive say of the slip, in the order of stamps."""

    row: NDArray[np.int64]  # of the truth at each stamp
    arrival: NDArray[np.int64]  # row of the truth at which each has arrived
    slip: FloatArray
    variance: FloatArray


def mean_slip(drive: BenchDrive) -> tuple[FloatArray, FloatArray]:
    """Return the true slip of the rover and its rim speed [m/s], (k,) each."""
    truth, wheels = drive.truth, drive.configuration.wheels
    rim = truth.wheel_rate * wheels.slip_radius
    ground = rim - truth.slip_velocity
    mean = rim.mean(axis=1)
    moving = np.where(np.abs(mean) > LEAST_SPEED, mean, np.nan)
    return 1.0 - ground.mean(axis=1) / moving, mean


def sight(drive: BenchDrive) -> Sight:
    """Return what the references say, with the noise that they have in this drive."""
    slip, rim = mean_slip(drive)
    stamps = drive.truth.stamp
    found = sorted(
        (a.measurement.stamp, a.arrival, a.measurement.forward)
        for a in drive.arrivals
        if isinstance(a.measurement, ReferenceVelocity)
    )
    stamp, arrival, speed = (np.array(column) for column in zip(*found, strict=True))
    row = np.clip(np.searchsorted(stamps, stamp), 0, len(stamps) - 1)
    come = np.clip(np.searchsorted(stamps, arrival), 0, len(stamps) - 1)
    there = ~np.isnan(slip[row])
    row, come, speed = row[there], come[there], speed[there]
    seen = 1.0 - speed / rim[row]
    error = (seen - slip[row]) * rim[row]
    noise = 1.4826 * np.median(np.abs(error - np.median(error)))  # wild ones aside
    return Sight(row, come, seen, (noise / rim[row]) ** 2)


def filtered(seen: Sight, travel: FloatArray, walk: float) -> tuple[FloatArray, ...]:
    """Return mean and variance before and after each reference of a random walk (j,)."""
    mean, variance, last = 0.1, FIRST_STD**2, 0.0
    rows = []
    for row, slip, noise in zip(seen.row, seen.slip, seen.variance, strict=True):
        variance += walk**2 * max(travel[row] - last, 0.0)
        last = travel[row]
        prior = mean, variance
        gain = variance / (variance + noise)
        mean, variance = mean + gain * (slip - mean), (1.0 - gain) * variance
        rows.append((*prior, mean, variance))
    return tuple(np.array(rows).T)


def errors(drive: BenchDrive, walk: float) -> tuple[FloatArray, FloatArray]:
    """Return the errors (k,) of the causal filter and of the smoother; nan where not scored."""
    slip, rim = mean_slip(drive)
    stamps, seen = drive.truth.stamp, sight(drive)
    time = (stamps - stamps[0]) * 1e-9
    travel = np.concatenate([[0.0], np.cumsum(np.abs(rim[1:]) * np.diff(time))])
    prior, spread, mean, variance = filtered(seen, travel, walk)
    smooth = mean.copy()
    for k in range(len(mean) - 2, -1, -1):
        smooth[k] += variance[k] / spread[k + 1] * (smooth[k + 1] - prior[k + 1])
    heard = np.searchsorted(seen.arrival, np.arange(len(stamps)), side='right') - 1
    causal = np.where(heard >= 0, mean[np.maximum(heard, 0)], 0.1)
    between = np.interp(travel, travel[seen.row], smooth)
    unscored = time <= FIRST_SECONDS
    return tuple(np.where(unscored, np.nan, values - slip) for values in (causal, between))


def bound(drive: BenchDrive) -> float:
    """Return the root mean square of the bound over the scored part of a drive."""
    slip, _ = mean_slip(drive)
    stamps, seen = drive.truth.stamp, sight(drive)
    told = np.cumsum(1.0 / seen.variance) + FIRST_STD**-2
    heard = np.searchsorted(seen.arrival, np.arange(len(stamps)), side='right') - 1
    variance = np.where(heard >= 0, 1.0 / told[np.maximum(heard, 0)], FIRST_STD**2)
    scored = ((stamps - stamps[0]) * 1e-9 > FIRST_SECONDS) & ~np.isnan(slip)
    return float(np.sqrt(variance[scored].mean()))


def rms(values: FloatArray) -> float:
    """Return the root mean square of what is there."""
    return float(np.sqrt(np.nanmean(values**2)))


def estimator_error(drive: BenchDrive) -> float:
    """Return the error of the estimator's mean slip."""
    kept = record(*run_estimator(drive.configuration, inputs_of_mode(drive.arrivals, 'reference')))
    slip, rim = mean_slip(drive)
    stamps = drive.truth.stamp
    row = np.clip(np.searchsorted(kept.stamp, stamps), 0, len(kept.stamp) - 1)
    moving = np.where(np.abs(rim) > LEAST_SPEED, rim, np.nan)
    error = 1.0 - kept.speed[row] / moving - slip
    late = (stamps - stamps[0]) * 1e-9 > FIRST_SECONDS
    return rms(np.where(late & (kept.stamp[row] == stamps), error, np.nan))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument('kinds', nargs='+', metavar='SIMULATOR:KIND')
    parser.add_argument('--seeds', nargs='+', type=int, default=[1000])
    arguments = parser.parse_args()
    rows = []
    for name in arguments.kinds:
        simulator, kind = name.split(':')
        for seed in arguments.seeds:
            drive = SIMULATORS[simulator].simulate(kind, seed, None, None)
            tried = [tuple(map(rms, errors(drive, walk))) for walk in WALKS]
            causal, smoother = (min(column) for column in zip(*tried, strict=True))
            figures = estimator_error(drive), causal, smoother, bound(drive)
            rows.append((f'{simulator} {kind} {seed}', *(f'{value:.4f}' for value in figures)))
            print(*rows[-1], flush=True)
    head = 'drive', 'estimator', 'causal, hindsight', 'smoother, hindsight', 'bound, constant slip'
    print(table(head, rows))


if __name__ == '__main__':
    main()
