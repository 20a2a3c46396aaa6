# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Takes the measurements of a stamp in: sums until the next cycle, the newest rates."""

from __future__ import annotations

import math

from wheel_terra_estimator.estimation.measurements import (
    LeavingAngleReading,
    SinkageReading,
    StepInputs,
    WheelOdometry,
)
from wheel_terra_estimator.estimation.speed_process import take_inertial
from wheel_terra_estimator.estimation.steps.context import Context


def collect(c: Context, time: float, inputs: StepInputs) -> None:
    """Take in the measurements of a stamp, `time` [s] after the start of the run."""
    run = c.run
    if inputs.inertial is not None:
        dt = 0.0 if run.inertial_time is None else time - run.inertial_time
        run.inertial_time = time
        take_inertial(
            run.window,
            run.attitude,
            inputs.inertial,
            dt,
            c.settings.gravity,
            run.yaw_bias,
            run.pitch_bias,
        )
    if inputs.sinkage is not None:
        _collect_sinkage(c, inputs.sinkage)
    if inputs.leaving_angle is not None:
        _collect_leaving_angle(c, time, inputs.leaving_angle)
    if inputs.wheel_odometry is not None:
        _collect_wheel_odometry(c, time, inputs.wheel_odometry)


def _collect_sinkage(c: Context, reading: SinkageReading) -> None:
    run = c.run
    for i, value in enumerate(reading.sinkage.tolist()):
        if value == value:
            run.sinkage_sum[i] += value
            run.sinkage_count[i] += 1


def _collect_leaving_angle(c: Context, time: float, reading: LeavingAngleReading) -> None:
    run = c.run
    for i, value in enumerate(reading.leaving_angle.tolist()):
        if value == value:
            fresh = time - run.leaving_time[i] > 1.0
            old = value if fresh else run.leaving_angle[i]
            run.leaving_angle[i] = old + 0.3 * (value - old)
            run.leaving_time[i] = time


def _collect_wheel_odometry(c: Context, time: float, odometry: WheelOdometry) -> None:
    run, s = c.run, c.settings
    rates, torques = odometry.rate.tolist(), odometry.torque.tolist()
    dt = 1.0 if run.odometry_time is None else time - run.odometry_time
    # Fast odometry is noisy or quantised: smooth it over 50 ms, less than its use anywhere.
    keep = 0.0 if dt >= 0.06 else math.exp(-dt / 0.05)
    for i in range(s.wheel_count):
        rate = rates[i]
        if rate == rate:
            rim = rate * s.slip_radius[i]
            old = run.rim_speed[i]
            run.rim_speed[i] = rim if old != old else keep * old + (1.0 - keep) * rim
            run.rate_time[i] = time
        torque = torques[i]
        if torque == torque:
            run.torque_sum[i] += torque
            run.torque_count[i] += 1
            run.torque_time = time
    run.odometry_time = time
