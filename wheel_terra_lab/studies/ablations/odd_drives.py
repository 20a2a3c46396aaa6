# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Drives of simulator A for the ablation alone, for what happens in no kind of the bench."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from wheel_terra_estimator.estimation.estimates import SlipClass
from wheel_terra_estimator.estimation.measurements import (
    InertialReading,
    Measurement,
    ReferenceVelocity,
)
from wheel_terra_estimator.simulation import drive as own_world
from wheel_terra_estimator.simulation.scenario import load
from wheel_terra_lab.evaluation import kinds, scores
from wheel_terra_lab.evaluation.simulators import BenchDrive, Truth

_TWO_STOPS = {
    **kinds.KINDS['stop_and_go'],
    'drive.time': [0.0, 14.0, 15.0, 21.0, 22.0, 32.0, 33.0, 39.0, 40.0],
    'drive.forward': [0.05, 0.05, 0, 0, 0.06, 0.06, 0, 0, 0.05],
}
KINDS: Mapping[str, Mapping[str, Any]] = {
    'wild_stops': {**_TWO_STOPS, 'sensors.reference_outliers': 0.15},
    'jolts': _TWO_STOPS,
    'jumps': kinds.KINDS['climb'],
    'towed': {
        **_TWO_STOPS,
        'drive.time': [0.0, 14.0, 15.0, 31.0, 32.0],
        'drive.forward': [0.05, 0.05, 0, 0, 0.05],
    },
    'fast_stops': {
        **_TWO_STOPS,
        'slope.angle_deg': [0.0],
        'drive.time': [0.0, 14.0, 14.1, 20.0, 21.0, 32.0, 32.1, 38.0, 39.0],
        'drive.forward': [0.8, 0.8, 0, 0, 0.6, 0.6, 0, 0, 0.8],
    },
}
"""Stops among wild references; starts that jolt; references that are off for some readings in a
row; a rover that is pulled along on standing wheels; a fast one whose wheels stop at once."""

_JOLTS, _JOLT_TIME, _JOLT = (0.1, 21.3, 39.3), 0.3, -0.3  # [s], [s], [m/s^2]
_JUMP, _JUMPS, _JUMP_PERIOD = 0.3, range(5, 8), 12  # [m/s], readings of so many
_TOWED_FROM, _TOWED_TO, _TOWED_SPEED, _TOWED_RAMP = 18.0, 28.0, 0.04, 1.0  # [s], [m/s], [s]

Change = Callable[[Measurement, float], Measurement]
"""What becomes of a measurement so many seconds after the start."""


def simulated(kind: str, seed: int, seconds: float | None) -> BenchDrive:
    """Return a drive of one of `KINDS`."""
    drive = own_world.simulate(load(KINDS[kind]), seed, seconds)
    start = int(drive.truth.stamp[0])
    change = {'jolts': _jolted, 'jumps': _jumping(), 'towed': _pulled}.get(kind, _as_it_is)
    arrivals = [
        a._replace(measurement=change(a.measurement, (a.measurement.stamp - start) * 1e-9))
        for a in drive.arrivals
    ]
    truth = _of_towed(drive.truth) if kind == 'towed' else drive.truth
    return BenchDrive(drive.configuration, arrivals, truth)


def _as_it_is(measurement: Measurement, time: float) -> Measurement:
    return measurement


def _jolted(measurement: Measurement, time: float) -> Measurement:
    now = any(begin < time < begin + _JOLT_TIME for begin in _JOLTS)
    if not (now and isinstance(measurement, InertialReading)):
        return measurement
    force = measurement.specific_force + np.array([_JOLT, 0.0, 0.0])
    return replace(measurement, specific_force=force)


def _jumping() -> Change:
    count = 0

    def jumped(measurement: Measurement, time: float) -> Measurement:
        nonlocal count
        if not isinstance(measurement, ReferenceVelocity):
            return measurement
        count += 1
        off = _JUMP if count % _JUMP_PERIOD in _JUMPS else 0.0
        return replace(measurement, forward=measurement.forward + off)

    return jumped


def _pulled(measurement: Measurement, time: float) -> Measurement:
    if not isinstance(measurement, ReferenceVelocity):
        return measurement
    return replace(measurement, forward=measurement.forward + float(_pull_speed(time)))


def _pull_speed(time: Any) -> Any:
    """Return the speed of the towed rover at a time [s]."""
    ramp = np.minimum(time - _TOWED_FROM, _TOWED_TO - time) / _TOWED_RAMP
    return _TOWED_SPEED * np.clip(ramp, 0.0, 1.0)


def _of_towed(truth: Any) -> Truth:
    """Return the truth of the towed rover; its pulls are unknown."""
    pulled = _pull_speed((truth.stamp - truth.stamp[0]) * 1e-9)[:, None]
    towed = np.broadcast_to(pulled > scores.LEAST_SPEED, truth.slip.shape)
    top_class = np.full(truth.slip.shape, int(SlipClass.STUCK), dtype=np.uint8)
    changed: Truth = replace(
        truth,
        slip=np.where(towed, -1.0, truth.slip),
        slip_velocity=truth.slip_velocity - pulled,
        slip_class=np.where(towed, top_class, truth.slip_class),
        drawbar_pull=np.where(towed, np.nan, truth.drawbar_pull),
    )
    return changed
