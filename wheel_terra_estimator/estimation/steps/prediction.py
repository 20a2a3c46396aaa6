# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""From the last cycle to this one: speed, sinkage, soil."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.estimation.filter_state import (
    CENTROID,
    GRAVITY_BIAS,
    MOUND,
    SHEAR_MODULUS,
    SHEAR_STRENGTH,
    SLIP_SINKAGE,
    SPEED,
)
from wheel_terra_estimator.estimation.measurement_models import slip_of_speed_ratio
from wheel_terra_estimator.estimation.speed_process import SpeedStep
from wheel_terra_estimator.estimation.steps.context import (
    Context,
    leaving_angle_of,
    reference_known,
    rims_without_turning,
    slope_share,
    smoothed,
    speed_step_to,
    torque_known,
    typical_rim,
)

FloatArray = NDArray[np.float64]
# Slip of a rover in loose soil on level ground, its spread, and the rim travel of its changes [m].
_USUAL_SLIP, _USUAL_STD, _USUAL_LENGTH = 0.12, 0.2, 1.5
# Of the slip that the bearing law would see in the sinkage, without fixes. Its errors (n0, n1, the
# zero of the sensor) stay the same all the way: readings do not average them out.
_LAW_SHARE = 0.5
_OWN_STIFFNESS_WALK = 0.3  # of the logarithm, in units of `filter.soil_walk`
# Correlation of a wheel's own stiffness and strength, and how much more the strength differs from
# wheel to wheel than what torque shows as errors of the shear model.
_SOFT_IS_WEAK, _STRENGTH_SPREAD = 0.7, 2.0


def predict(c: Context, time: float, dt: float, rims: list[float], still: bool) -> None:
    """Predict speed, sinkage, soil and errors of the shear model over `dt` [s]."""
    run, s, layout = c.run, c.settings, c.layout
    x = c.filter.mean
    step = speed_step_to(c, time)
    size = layout.size
    mean = x.copy()
    F = np.eye(size)
    Q = np.zeros((size, size))
    if not still and not reference_known(c):
        step = lean_on_experience(c, step, dt)
    mean[SPEED] = step.speed_gain * x[SPEED] + step.bias_gain * x[GRAVITY_BIAS] + step.constant
    F[SPEED, SPEED] = step.speed_gain
    F[SPEED, GRAVITY_BIAS] = step.bias_gain
    Q[SPEED, SPEED] = step.variance
    # The residual of gravity changes as the rover drives over rough ground.
    leak = s.gravity * float(s.sensors.orientation_std)
    Q[GRAVITY_BIAS, GRAVITY_BIAS] = (1e-3**2 + (0.3 * leak) ** 2 * 0.1) * dt
    travel = 0.0
    if not still and dt > 0.0:
        travel = predict_wheels(c, x, mean, F, Q, dt, rims)
    run.fresh_travel += travel
    if travel > 0.0:
        walk = float(s.filter.soil_walk) ** 2 * travel
        learn = walk if reference_known(c) else 0.0
        forget = math.exp(-travel / 100.0)
        for index, walk_std, rate in (
            (SHEAR_STRENGTH, 0.1, learn),
            (SHEAR_MODULUS, 0.1, learn),
            (SLIP_SINKAGE, 0.05, learn),
            (CENTROID, 0.05, walk),
        ):
            mean[index] *= forget
            F[index, index] = forget
            Q[index, index] = walk_std**2 * rate
        Q[MOUND, MOUND] = 0.05**2 * walk
        n = s.wheel_count
        k = layout.stiffness
        Q[k, k] = (0.15**2 + np.eye(n) * _OWN_STIFFNESS_WALK**2) * walk
        hold = math.exp(-travel / float(s.filter.shear_error_length))
        e = layout.shear_error
        mean[e] *= hold
        F[e, e] *= hold
        Q[e, e] = c.shear_error_covariance * (1.0 - hold * hold)
        if not torque_known(c):
            # Softer ground is weaker ground: where no torque says how weak, the sinkage does.
            fresh = (1.0 - hold * hold) * s.shear_error_std**2
            Q[e, e] += (_STRENGTH_SPREAD**2 - 1.0) * fresh * np.eye(n)
            both = _OWN_STIFFNESS_WALK * math.sqrt(walk * fresh) * _STRENGTH_SPREAD
            Q[k, e] = Q[e, k] = _SOFT_IS_WEAK * both * np.eye(n)
    c.filter.predict(mean, F, Q)


def lean_on_experience(c: Context, step: SpeedStep, dt: float) -> SpeedStep:
    """Without fixes, let v / rim speed return to what such a slope usually takes.

    On deep or saturated contacts torque and pull hardly change with slip. There the posterior
    is the prior, and a random walk is no prior: it ends anywhere.
    """
    rim = typical_rim(rims_without_turning(c))
    if rim is None or abs(rim) < c.low_rim:
        return step
    demand = c.run.drive_direction * slope_share(c)
    usual = 1.0 - min(max(_USUAL_SLIP + (1.2 if demand > 0.0 else 0.4) * demand, -0.2), 0.8)
    keep = math.exp(-abs(rim) * dt / _USUAL_LENGTH)
    return SpeedStep(
        keep * step.speed_gain,
        keep * step.bias_gain,
        keep * step.constant + (1.0 - keep) * usual * rim,
        keep * keep * step.variance + (1.0 - keep * keep) * (_USUAL_STD * rim) ** 2,
    )


def predict_wheels(
    c: Context,
    x: FloatArray,
    mean: FloatArray,
    F: FloatArray,
    Q: FloatArray,
    dt: float,
    rims: list[float],
) -> float:
    """Let each sinkage relax towards where the bearing law carries the load; return travel."""
    run, s, layout = c.run, c.settings, c.layout
    share = 1.0 if reference_known(c) else _LAW_SHARE
    travels = []
    for i, rim in enumerate(rims):
        zi, ki = layout.sinkage.start + i, layout.stiffness.start + i
        if rim != rim or abs(rim) < s.rest_speed:
            Q[zi, zi] = 1e-10 * dt
            continue
        direction = 1.0 if rim > 0.0 else -1.0
        speed = direction * (float(x[SPEED]) - run.yaw_rate * s.lateral[i])
        rim = abs(rim)
        ratio = speed / rim
        slip = slip_of_speed_ratio(ratio)
        travels.append(abs(speed) + 0.1 * abs(rim - speed))
        z, load = float(x[zi]), run.load[i]
        if load <= 1e-3:
            Q[zi, zi] = 1e-4 * dt
            continue
        contact_length = max(math.sqrt(2.0 * s.rim_radius[i] * max(z, 1e-3)), 0.02)
        alpha = -math.expm1(-(abs(speed) + 0.3 * abs(rim - speed)) * dt / contact_length)
        soil = (
            float(x[SHEAR_STRENGTH]),
            float(x[SHEAR_MODULUS]),
            float(x[ki]),
            float(x[SLIP_SINKAGE]),
            leaving_angle_of(c, i),
        )
        bearing = c.models.bearing(i, ratio, z, load, *soil)
        slower = c.models.bearing(i, ratio - 0.02, z, load, *soil)
        # One Newton step on log load over log sinkage, bounded: relaxation does the rest.
        power = bearing.exponent + 0.5
        growth = min(max(math.log(load / bearing.load) / power, -0.7), 0.7)
        z_floor = max(z, 5e-4)
        # No steady state where the wheel stands and digs: the sensor leads.
        trust = min(max((0.95 - slip) / 0.15, 0.0), 1.0)
        target = z_floor * math.exp(growth)
        mean[zi] = z + trust * alpha * (target - z)
        if trust < 1.0:
            # It digs at its own pace: carry on with the rate seen last.
            mean[zi] += 0.9 * (1.0 - trust) * max(run.sinkage_rate[i], 0.0) * dt
        sensitivity = trust * alpha * target / power
        F[zi, zi] = max(1.0 - trust * alpha * 0.9, 0.05)
        F[zi, ki] = -sensitivity
        slopes = (math.log(bearing.load / slower.load) / 0.02, abs(slip) * bearing.log_depth)
        by_ratio, by_slip_sinkage = run.bearing_slopes[i] = smoothed(run.bearing_slopes[i], slopes)
        F[zi, SLIP_SINKAGE] = -sensitivity * by_slip_sinkage
        F[zi, SPEED] = -share * sensitivity * by_ratio * direction / rim
        # What the law does not know: a twentieth of the sinkage per contact length, and digging.
        digging = 0.05 * max(slip, 0.0) ** 2 * rim * dt
        Q[zi, zi] = (0.05 * z_floor) ** 2 * 2.0 * alpha + digging**2 + 1e-9 * dt
    return dt * math.fsum(travels) / len(rims) if travels else 0.0
