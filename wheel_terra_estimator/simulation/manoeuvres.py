# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Which manoeuvre would teach what a drive has not: a few are simulated, each filtered on.

The simulated rover drives on the soil as it is estimated, with the sensors that spoke, and a
filter that starts from the present covariance follows it. What deviations that filter ends with is
the promise: in a Kalman filter they hang on where the rover goes, not on what the readings are.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.core import EstimatorCore
from wheel_terra_estimator.estimation.filter.ekf import FilterMemory
from wheel_terra_estimator.estimation.taught import LEARNED, Taught
from wheel_terra_estimator.estimation.wheel_soil_estimator import WheelSoilEstimator
from wheel_terra_estimator.simulation import scenario
from wheel_terra_estimator.simulation.drive import SimulatedDrive, simulate

DURATION = 20.0
"""Of a manoeuvre [s]."""
WORTH = 0.85
"""Share of the present deviation that a manoeuvre must promise at most [-]: a quarter of a bit."""
HIGHEST_SLIP, DEEPEST = 0.6, 0.5
"""Slip [-] and sinkage [radius] of a simulated wheel above which a manoeuvre is not proposed."""
LEAST_ACCELERATION = 0.1
"""Of the rims [m/s^2]; faster rovers take a second to their speed."""


@dataclass(frozen=True)
class Manoeuvre:
    """A short straight drive."""

    words: str  # with {distance} [m], where there is one
    slope: float = 0.0  # uphill positive [deg]
    time: tuple[float, ...] = (0.0,)  # knots of the command, as shares of the duration
    forward: tuple[float, ...] = (1.0,)  # speed there, over that of the drive

    def keys(self, speed: float) -> dict[str, Any]:
        """Return command and slope as keys of a scenario, for a rover at a `speed` [m/s]."""
        return {
            'description': self.words,
            'duration': DURATION,
            'slope.position': [0.0],
            'slope.angle_deg': [self.slope],
            'drive.time': [DURATION * share for share in self.time],
            'drive.forward': [speed * share for share in self.forward],
            'drive.acceleration': max(speed, LEAST_ACCELERATION),
        }


SENSORS = ('torque', 'sinkage', 'reference')
_STOPS = (0.0, 0.3, 0.32, 0.4, 0.42, 0.7, 0.72, 0.8, 0.82)
_AND_GOES = (1.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0)
MANOEUVRES = (
    Manoeuvre('{distance} on the level'),
    Manoeuvre('{distance} up 5 degrees', 5.0),
    Manoeuvre('{distance} up 10 degrees', 10.0),
    Manoeuvre('{distance} up 15 degrees', 15.0),
    Manoeuvre('{distance} down 10 degrees', -10.0),
    Manoeuvre('{distance} at full and at half speed', 0.0, (0.0, 0.5, 0.52), (1.0, 1.0, 0.5)),
    Manoeuvre('stop and start twice within {distance}', 0.0, _STOPS, _AND_GOES),
    Manoeuvre('{distance} forth and back', 0.0, (0.0, 0.45, 0.5, 0.55), (1.0, 1.0, 0.0, -1.0)),
)


def with_manoeuvres(
    taught: Sequence[Taught],
    configuration: Configuration,
    posterior: FilterMemory,
    *,
    # Configuration key -> value as learned, see `EstimatorCore.learned`; others are ignored
    soil: Mapping[str, Any],
    speed: float,  # that the rover is to drive at [m/s]
    sensors: Collection[str],  # which of `SENSORS` there are
    candidates: Sequence[Manoeuvre] = MANOEUVRES,
) -> tuple[Taught, ...]:
    """Return what was taught with the manoeuvre that would teach most of what was not learned."""
    truth = configuration.replace(
        {k: v for k, v in soil.items() if k.startswith('soil.') and '_std' not in k}
    )
    there = {f'sensors.{name}': name in sensors for name in SENSORS}
    promised = []
    for manoeuvre in candidates:
        keys = scenario.load({**manoeuvre.keys(speed), **there})
        drive = simulate(replace(keys, configuration=configuration, truth=truth))
        if _is_safe(drive):
            promised.append((_in_words(manoeuvre, drive), after(drive, posterior)))
    return tuple([_with_best(row, promised) for row in taught])


def after(drive: SimulatedDrive, posterior: FilterMemory) -> dict[str, Taught]:
    """Return what is known of each parameter after one more drive, from the `posterior` on."""
    estimator = WheelSoilEstimator(drive.configuration)
    estimator.start_from(posterior)
    core = EstimatorCore(drive.configuration, estimator)
    for arrival in drive.arrivals:
        core.add(arrival.measurement)
    core.flush()
    return {row.name: row for row in core.taught()}


def _is_safe(drive: SimulatedDrive) -> bool:
    truth = drive.truth
    slip = np.abs(truth.slip[np.isfinite(truth.slip)])
    deep = (truth.sinkage / drive.configuration.wheels.radius).max(initial=0.0)
    return bool(np.percentile(slip, 90.0) < HIGHEST_SLIP and deep < DEEPEST)


def _in_words(manoeuvre: Manoeuvre, drive: SimulatedDrive) -> str:
    distance = float(np.abs(np.diff(drive.truth.position[:, 0])).sum())
    return manoeuvre.words.format(distance=f'{distance:.2g} m')


def _with_best(row: Taught, promised: Sequence[tuple[str, dict[str, Taught]]]) -> Taught:
    if row.verdict == LEARNED:
        return row
    found = [(then[row.name].std, words) for words, then in promised if row.name in then]
    std, words = min(found, default=(np.inf, ''))
    if std > WORTH * row.std:
        return replace(row, manoeuvre='')
    return replace(row, manoeuvre=words, promised_std=std)
