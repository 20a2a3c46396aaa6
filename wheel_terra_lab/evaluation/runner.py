# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Run the estimator over a drive and keep what it said, aligned with the truth."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.arrays import BoolArray, FloatArray, IntArray
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.estimates import EstimateSet
from wheel_terra_estimator.estimation.measurements import (
    InertialReading,
    Measurement,
    ReferenceVelocity,
    SinkageReading,
    WheelOdometry,
)
from wheel_terra_lab.evaluation.bench_drive import Arrival

LATE = 'reference_2s_late'
LATE_BY = 2_000_000_000  # [ns], in place of what the sensor file says

MODES = (
    'reference',
    'no_reference',
    'no_torque',
    'no_sinkage',
    'no_orientation',
    LATE,
    'smoothed',
    'smoothed_no_reference',
)
"""What the estimator gets: everything, all but one input, or the reference later; and
what the smoother makes of it."""
SMOOTHED = 'smoothed'


@dataclass(frozen=True)
class Record:
    """Estimates of a drive: k sets, n wheels."""

    stamp: IntArray
    slip: FloatArray
    slip_std: FloatArray
    sinkage: FloatArray
    sinkage_std: FloatArray
    drawbar_pull: FloatArray
    drawbar_pull_std: FloatArray
    normal_load: FloatArray
    slip_class: NDArray[np.uint8]
    stuck: BoolArray
    rim_travel_left: FloatArray
    stuck_probability: FloatArray
    speed: FloatArray  # (k,)
    speed_std: FloatArray
    health: dict[str, Any]


def inputs_of_mode(arrivals: Iterable[Arrival], mode: str) -> Iterator[Measurement]:
    """Yield what a mode gets of a drive, in the order of arrival."""
    mode = mode.removeprefix(SMOOTHED).removeprefix('_')
    timed = [(a.arrival, a.measurement) for a in arrivals]
    if mode == LATE:
        timed = [
            (m.stamp + LATE_BY if isinstance(m, ReferenceVelocity) else arrival, m)
            for arrival, m in timed
        ]
        timed.sort(key=lambda pair: pair[0])
    for _, measurement in timed:
        if mode == 'no_reference' and isinstance(measurement, ReferenceVelocity):
            continue
        if mode == 'no_sinkage' and isinstance(measurement, SinkageReading):
            continue
        if mode == 'no_torque' and isinstance(measurement, WheelOdometry):
            yield replace(measurement, torque=np.full_like(measurement.torque, np.nan))
        elif mode == 'no_orientation' and isinstance(measurement, InertialReading):
            yield replace(measurement, orientation=None)
        else:
            yield measurement


def run_estimator(
    configuration: Configuration, measurements: Iterable[Measurement], smooth: bool = False
) -> tuple[list[EstimateSet], dict[str, Any]]:
    """Run what node and replay run over measurements in the order of arrival, or the smoother.

    Returns its sets and its health.
    """
    from wheel_terra_estimator.checks.input_judge import InputJudge
    from wheel_terra_estimator.estimation.core import EstimatorCore
    from wheel_terra_estimator.estimation.smoothing.smoother import DriveSmoother

    smoother = DriveSmoother(configuration) if smooth else None
    estimator = smoother.estimator if smoother else None
    core = EstimatorCore(configuration, estimator, judged_by=InputJudge)
    sets = core.run(measurements)
    return list(smoother.smoothed(sets) if smoother else sets), core.health()


def record(sets: Sequence[EstimateSet], health: dict[str, Any]) -> Record:
    """Stack the sets of a drive."""
    return Record(
        stamp=np.array([s.stamp for s in sets], dtype=np.int64),
        speed=np.array([s.forward_velocity for s in sets]),
        speed_std=np.sqrt([s.forward_velocity_variance for s in sets]),
        stuck=np.array([s.stuck for s in sets]),
        health=health,
        **{
            name: np.array([getattr(s, name) for s in sets])
            for name in (
                'slip',
                'slip_std',
                'sinkage',
                'sinkage_std',
                'drawbar_pull',
                'drawbar_pull_std',
                'normal_load',
                'slip_class',
                'rim_travel_left',
                'stuck_probability',
            )
        },
    )
