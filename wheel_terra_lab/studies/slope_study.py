# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Slip on slopes: what a climb taught, held against the slip on steeper ground of the same climb.

python -m wheel_terra_lab.studies.slope_study --simulator A B C --seeds 6000 6001

Every fifth second of a drive, what `~/slip_on_slope` says is read at the slopes that come later in
the drive and are steeper, by each of `STEEPER`, than all that the rover has driven till then.
"""

from __future__ import annotations

import argparse
import math

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.estimation.estimates import SLOPES, EstimateSet
from wheel_terra_lab.evaluation.runner import run_estimator
from wheel_terra_lab.evaluation.scores import WITHIN
from wheel_terra_lab.evaluation.simulators import SIMULATORS, Truth

FloatArray = NDArray[np.float64]

CLIMBS = {
    'A': ('climb', 'entrapment_slope', 'near_stuck', 'low_gravity'),
    'B': ('climb', 'recovery', 'low_gravity', 'field', 'heavy', 'light'),
    'C': ('climb', 'climb_soft_patch', 'near_miss', 'low_gravity', 'heavy', 'light'),
}
STEEPER = 3.0, 10.0  # [deg]
FIRST_SECONDS, EVERY, SAMPLES = 10.0, 5.0, 1.0  # [s]
SMOOTHING = 11  # rows over which the slope is averaged


def slopes_of(truth: Truth) -> FloatArray:
    """Return the slope that the pulls carry, in the direction of driving (k,) [deg]."""
    share = truth.drawbar_pull.sum(axis=1) / truth.normal_load.sum(axis=1)
    even = np.convolve(share, np.ones(SMOOTHING) / SMOOTHING, 'same')
    forward = np.where(truth.wheel_rate.mean(axis=1) < 0.0, -1.0, 1.0)
    return np.degrees(np.arctan(even * forward))


def errors(truth: Truth, sets: list[EstimateSet], steeper: float) -> FloatArray:
    """Return (k, 4): error, deviation, probability said, whether it was above 0.9."""
    time = (truth.stamp - truth.stamp[0]) * 1e-9
    slope, found = slopes_of(truth), []
    known = ~np.isnan(truth.slip).all(axis=1)
    slip = np.full(time.size, np.nan)
    slip[known] = np.nanmedian(truth.slip[known], axis=1)
    last = -math.inf
    for said in (e.slip_on_slope and e for e in sets):
        if not said or said.slip_on_slope is None:
            continue
        now = (said.stamp - int(truth.stamp[0])) * 1e-9
        if now < FIRST_SECONDS or now - last < EVERY:
            continue
        last = now
        driven = slope[(time > FIRST_SECONDS / 2) & (time <= now)]
        steepest = float(driven.max()) if driven.size else 0.0
        later = np.flatnonzero(known & (time > now) & (slope > steepest + steeper))
        later = later[np.unique(np.floor(time[later] / SAMPLES), return_index=True)[1]]
        later = later[slope[later] <= SLOPES[-1]]
        expected, std, entrapment = (
            np.interp(slope[later], SLOPES, column) for column in said.slip_on_slope
        )
        beyond = slip[later] > 0.9
        found.append(np.column_stack([expected - slip[later], std, entrapment, beyond]))
    return np.concatenate(found) if found else np.empty((0, 4))


def of_drive(data: FloatArray) -> FloatArray | None:
    """Return coverage, RMS error, deviation, entrapments said and come of a drive's `errors`."""
    if not len(data):
        return None
    error, std, said, came = data.T
    within = np.abs(error) < WITHIN * std
    rms = np.sqrt(np.mean(error**2))
    return np.array([within.mean(), rms, std.mean(), said.mean(), came.mean()])


def main() -> None:
    """Print error, deviation and coverage for each drive and simulator."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('--simulator', nargs='+', default=list(CLIMBS), choices=list(CLIMBS))
    parser.add_argument('--seeds', nargs='+', type=int, default=[6000, 6001])
    arguments = parser.parse_args()
    for name in arguments.simulator:
        rows: dict[float, list[FloatArray]] = {steeper: [] for steeper in STEEPER}
        for kind in CLIMBS[name]:
            for seed in arguments.seeds:
                drive = SIMULATORS[name].simulate(kind, seed, None, None)
                sets, _ = run_estimator(
                    drive.configuration, [a.measurement for a in drive.arrivals]
                )
                for steeper, found in rows.items():
                    row = of_drive(errors(drive.truth, sets, steeper))
                    if row is not None:
                        found.append(row)
                        numbers = ' '.join(f'{value:.2f}' for value in row)
                        print(f'{name} {kind} {seed}, {steeper:g} deg: {numbers}', flush=True)
        for steeper, found in rows.items():
            if found:
                coverage, rms, std, said, came = np.mean(found, axis=0)
                print(
                    f'{name}, {steeper:g} degrees steeper, {len(found)} drives: coverage of 95 % '
                    f'{coverage:.3f}, worst {min(row[0] for row in found):.2f}; RMS error '
                    f'{rms:.3f}, deviation {std:.3f}; entrapment said {said:.3f}, came {came:.3f}'
                )


if __name__ == '__main__':
    main()
