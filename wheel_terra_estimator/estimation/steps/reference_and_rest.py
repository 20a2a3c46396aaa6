# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Updates of the speed: fixes, rest, spin in place."""

from __future__ import annotations

import math

import numpy as np

from wheel_terra_estimator.estimation.filter import chi_square_gate
from wheel_terra_estimator.estimation.filter_state import SPEED
from wheel_terra_estimator.estimation.measurements import ReferenceVelocity
from wheel_terra_estimator.estimation.steps.context import (
    Context,
    fastest_rim,
    note_nis,
    torque_known,
)

_FAIR_NIS = 3.0


def fuse_reference(c: Context, time: float, reference: ReferenceVelocity, still: bool) -> None:
    """Fuse a fix; open the state to fixes that keep disagreeing."""
    run, s = c.run, c.settings
    sensors = s.sensors
    variance = reference.variance if reference.variance > 0.0 else float(sensors.reference_std) ** 2
    variance = max(variance, float(sensors.reference_std_floor) ** 2)
    if run.reference_time is not None:
        gap = min(time - run.reference_time, 10.0)
        run.reference_gap += 0.3 * (gap - run.reference_gap)
    x, P = c.filter.mean, c.filter.covariance
    if still:
        # Wheels that stand: either the fix agrees with rest, or the rover slides on them.
        moving = abs(reference.forward) > max(3.0 * math.sqrt(variance), 2.0 * s.rest_speed)
        if moving:
            run.sliding_until = time + max(2.0 * run.reference_gap, 1.0)
            c.filter.widen(SPEED, reference.forward**2)
        else:
            run.sliding_until = time
    residual = reference.forward - float(x[SPEED])
    total = float(P[SPEED, SPEED]) + variance
    nis = residual * residual / total
    note_nis(c, 'reference', nis)
    gate = float(s.filter.gate)
    if nis > gate:
        run.reference_rejected += 1
        run.rejected['reference'] += 1
        beyond = abs(reference.forward) > 1.5 * fastest_rim(c) + 5.0 * math.sqrt(total)
        same = abs(residual - run.reference_doubt) < 4.0 * math.sqrt(2.0 * variance + total)
        run.reference_doubt = residual
        if same and run.reference_rejected >= (4 if beyond else fixes_needed(c)):
            # Fixes that keep disagreeing are right: open the state to them.
            c.filter.widen(SPEED, residual * residual)
            c.monitor.forget_trend()
            run.reference_rejected = 0
        else:
            variance += chi_square_gate(residual, total, 4.0 if not beyond else 0.01)
    else:
        run.reference_rejected = 0
        if nis > _FAIR_NIS:
            # More than chance, less than an outlier: the prediction was too sure of itself.
            c.filter.widen(SPEED, residual * residual / _FAIR_NIS - total)
    H = np.zeros((1, c.layout.size))
    H[0, SPEED] = 1.0
    c.filter.update(np.array([residual]), H, np.array([variance]))
    run.reference_time = time


def fixes_needed(c: Context) -> int:
    """Return how many fixes in a row must disagree by the same amount before they are believed.

    A real change of the slip shows in torque, slope or rim speed, unless the traction curve is
    flat: two will do with such a witness, or where there is no torque to ask.
    """
    return 3 if torque_known(c) and c.run.time - c.run.unrest_time > 2.5 else 2


def fuse_rest(c: Context, time: float, rims: list[float], rim: float | None, still: bool) -> None:
    """Fuse rest (zero velocity) or a spin in place; learn the zero of the gyro."""
    run, s = c.run, c.settings
    if not still:
        run.still_since = None
        spread = [abs(r) for r in rims if r == r]
        typical = sum(spread) / len(spread) if spread else 0.0
        if rim is not None and typical > s.rest_speed and abs(rim) < 0.2 * typical:
            # Spin in place: the body stays where it is, to a share of the rim speed.
            fuse_speed(c, 0.0, max(typical, 0.002) ** 2)
        return
    if run.still_since is None:
        run.still_since = time
    if time < run.sliding_until:
        return
    x, P = c.filter.mean, c.filter.covariance
    settled = time - run.still_since
    if settled < 0.15:
        return
    variance = 0.0005**2
    if settled < 2.0:
        # A fast rover slides on for a moment: do not stop it against the accelerometer.
        variance += chi_square_gate(float(x[SPEED]), float(P[SPEED, SPEED]) + variance, 9.0)
    fuse_speed(c, 0.0, variance)
    if settled > 0.5 and run.window.count and abs(run.yaw_rate) < 0.05:
        weight = min(run.gyro_bias_weight + 1.0, 200.0)
        run.yaw_bias += run.yaw_rate / weight
        run.pitch_bias += run.window.pitch_rate / run.window.count / weight
        run.gyro_bias_weight = weight


def fuse_speed(c: Context, value: float, variance: float) -> None:
    """Fuse a speed [m/s] and its variance."""
    H = np.zeros((1, c.layout.size))
    H[0, SPEED] = 1.0
    residual = np.array([value - float(c.filter.mean[SPEED])])
    c.filter.update(residual, H, np.array([variance]))
