# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The set of estimates of the present stamp, with reasons and faults in words."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.estimation.estimates import EstimateSet
from wheel_terra_estimator.estimation.filter_state import SHEAR_MODULUS, SHEAR_STRENGTH
from wheel_terra_estimator.estimation.steps.context import (
    Context,
    current_speed,
    reference_known,
    rim_speed_of,
    sinkage_known,
    torque_known,
    yaw_rate_std,
)
from wheel_terra_estimator.estimation.stuck_warning import StuckAssessment

FloatArray = NDArray[np.float64]


def estimate_set(c: Context) -> EstimateSet:
    """Return all outputs at the present stamp; nothing changes."""
    run, s, layout = c.run, c.settings, c.layout
    n = s.wheel_count
    x, P = c.filter.mean, c.filter.covariance
    speed, variance = current_speed(c)
    rims = [rim_speed_of(c, i) for i in range(n)]
    yaw_std = yaw_rate_std(c)
    slip_velocity, slip_velocity_std = [], []
    for i in range(n):
        rim = rims[i]
        v = speed - run.yaw_rate * s.lateral[i]
        known = rim == rim
        slip_velocity.append(rim - v if known else 0.0)
        std = math.sqrt(max(variance, 0.0) + (yaw_std * s.lateral[i]) ** 2)
        rate = float(s.sensors.wheel_rate_std) * s.slip_radius[i]
        slip_velocity_std.append(math.hypot(std, rate) if known else 1.0)
    sinkage = x[layout.sinkage]
    zero = float(s.sensors.sinkage_zero_std)
    sinkage_std = np.sqrt(np.maximum(np.diagonal(P)[layout.sinkage], 0.0) + zero**2)
    assessment = run.assessment or c.monitor.update(run.time, speed, False, [])
    names, soil, soil_std = learned_soil(c)
    lost = [w if w > 0 else 1.0 for w in run.load]
    return EstimateSet(
        stamp=run.stamp,
        slip=np.array(run.slip),
        slip_std=np.array(run.slip_std),
        slip_velocity=np.array(slip_velocity),
        slip_velocity_std=np.array(slip_velocity_std),
        drawbar_pull=np.array(run.pull),
        drawbar_pull_std=np.minimum(np.array(run.pull_std), np.array(lost)),
        sinkage=sinkage.copy(),
        sinkage_std=np.minimum(sinkage_std, s.rim_radius),
        sinkage_rate=np.array(run.sinkage_rate),
        sinkage_rate_std=np.array(run.sinkage_rate_std),
        normal_load=np.array(run.load),
        normal_load_std=np.array(
            [s.load_std * sum(run.load) / n if run.force_known else w for w in run.load]
        ),
        slip_class=np.array(run.wheel_class, dtype=np.uint8),
        rim_travel_left=np.array(assessment.rim_travel_left or [10.0] * n),
        pull_margin=np.array(run.pull_margin),
        soil_names=names,
        soil=soil,
        soil_std=soil_std,
        forward_velocity=speed,
        forward_velocity_variance=max(variance, 1e-12),
        yaw_rate=run.yaw_rate,
        yaw_rate_variance=yaw_std**2 if run.force_known else 1.0,
        stuck=assessment.stuck,
        stuck_probability=np.array(assessment.probability or [0.0] * n),
        time_to_stuck=np.array(assessment.time_to_stuck or [600.0] * n),
        reasons=reasons_in_words(c, assessment),
        faults=faults_in_words(c),
    )


def learned_soil(c: Context) -> tuple[tuple[str, ...], FloatArray, FloatArray]:
    """Return name, value and standard deviation of what was learned of the soil."""
    x, P = c.filter.mean, c.filter.covariance
    soil, k = c.configuration.soil, c.layout.stiffness
    strength = math.exp(float(x[SHEAR_STRENGTH]))
    strength_std = math.sqrt(float(P[SHEAR_STRENGTH, SHEAR_STRENGTH]))
    tangent = math.tan(float(soil.friction_angle)) * strength
    angle = math.degrees(math.atan(tangent))
    angle_std = math.degrees(tangent * strength_std / (1.0 + tangent * tangent))
    cohesion = float(soil.cohesion) * strength
    modulus = float(soil.shear_modulus) * math.exp(float(x[SHEAR_MODULUS]))
    stiffness = math.exp(float(x[k].mean()))
    stiffness_std = math.sqrt(max(float(P[k, k].mean()), 0.0))
    entries = (
        ('soil.friction_angle_deg', angle, angle_std),
        ('soil.cohesion', cohesion, cohesion * strength_std),
        (
            'soil.shear_modulus',
            modulus,
            modulus * math.sqrt(float(P[SHEAR_MODULUS, SHEAR_MODULUS])),
        ),
        (
            'soil.frictional_modulus',
            float(soil.frictional_modulus) * stiffness,
            float(soil.frictional_modulus) * stiffness * stiffness_std,
        ),
        (
            'soil.cohesive_modulus',
            float(soil.cohesive_modulus) * stiffness,
            abs(float(soil.cohesive_modulus)) * stiffness * stiffness_std,
        ),
    )
    return (
        tuple(e[0] for e in entries),
        np.array([e[1] for e in entries]),
        np.array([e[2] for e in entries]),
    )


def reasons_in_words(c: Context, assessment: StuckAssessment) -> tuple[str, ...]:
    """Return for each wheel why it is judged as it is."""
    run, s = c.run, c.settings
    words = []
    for i in range(s.wheel_count):
        rim = rim_speed_of(c, i)
        if rim != rim:
            text = 'no wheel rate'
        elif assessment.stalled and assessment.stalled[i]:
            text = 'stalled: torque near its limit, hardly turning while others turn'
        elif run.resting[i]:
            text = 'at rest'
        else:
            text = f'slip {run.slip[i]:.2f} +- {run.slip_std[i]:.2f}'
        if assessment.stuck and assessment.reason:
            text += f'; rover: {assessment.reason}'
        words.append(text)
    return tuple(words)


def faults_in_words(c: Context) -> dict[str, str]:
    """Return what is missing, and what that costs."""
    run, s = c.run, c.settings
    faults: dict[str, str] = {}
    stale = s.silence
    if run.odometry_time is None or run.time - run.odometry_time > stale:
        faults['wheel_odometry'] = 'no wheel odometry: slip held'
    if run.inertial_time is None or run.time - run.inertial_time > stale:
        faults['imu'] = 'no IMU: loads of level ground, no balance of forces'
    elif not run.attitude.reported:
        faults['orientation'] = 'no orientation: slope from gyro and specific force'
    if not torque_known(c):
        faults['torque'] = 'no torque: pull from the balance of forces and the soil model'
    if not any(sinkage_known(c, i) for i in range(s.wheel_count)):
        faults['sinkage'] = 'no sinkage: held by its model'
    if not reference_known(c):
        faults['reference'] = 'no reference velocity: slip from forces and soil model'
    return faults
