# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""One update from sinkage readings, torques and the balance of forces."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.estimation.filter_state import (
    SHEAR_MODULUS,
    SHEAR_STRENGTH,
    SLIP_SINKAGE,
    SPEED,
)
from wheel_terra_estimator.estimation.speed_process import InertialWindow
from wheel_terra_estimator.estimation.steps.context import (
    Context,
    note_nis,
    reference_known,
    sinkage_known,
)
from wheel_terra_estimator.estimation.steps.force_rows import model_rows
from wheel_terra_estimator.estimation.steps.odd_wheels import watch_torques

FloatArray = NDArray[np.float64]
_NAN = math.nan


def fuse_models(c: Context, dt: float, rims: list[float], still: bool) -> None:
    """Fuse sinkage, torque and the balance of forces, h and H from one pass."""
    run, s, layout = c.run, c.settings, c.layout
    x, P = c.filter.mean, c.filter.covariance
    n, size = s.wheel_count, layout.size
    gate = float(s.filter.gate)
    residuals: list[float] = []
    variances: list[float] = []
    rows: list[FloatArray] = []

    for i in range(n):
        count = run.sinkage_count[i]
        if not count:
            continue
        reading = run.sinkage_sum[i] / count
        run.sinkage_sum[i], run.sinkage_count[i] = 0.0, 0
        zi = layout.sinkage.start + i
        variance = float(s.sensors.sinkage_std) ** 2 / count + 1e-10
        residual = reading - float(x[zi])
        total = float(P[zi, zi]) + variance
        nis = residual * residual / total
        if run.sinkage_time[i] > -math.inf and nis > gate:
            run.rejected['sinkage'] += 1
            run.sinkage_rejected[i] += 1
            if run.sinkage_rejected[i] < 8:
                continue
            # So many in a row are no spikes: the wheel is somewhere else.
            c.filter.widen(zi, residual * residual)
        run.sinkage_rejected[i] = 0
        note_nis(c, 'sinkage', min(nis, gate))
        run.sinkage_time[i] = run.time
        row = np.zeros(size)
        row[zi] = 1.0
        residuals.append(residual)
        variances.append(variance)
        rows.append(row)

    torque = [
        run.torque_sum[i] / run.torque_count[i] if run.torque_count[i] else _NAN for i in range(n)
    ]
    for i in range(n):
        if run.torque_count[i]:
            run.torque_held[i] = torque[i]
        run.torque_sum[i], run.torque_count[i] = 0.0, 0
    watch_torques(c, torque, rims)
    if still:
        run.fresh_travel = 0.0
        run.starting = True
        run.torque_slopes = [None] * n
        run.pull_slopes = [None] * n
        run.bearing_slopes = [None] * n
        run.stand_pull = [_NAN] * n
    elif run.fresh_travel > c.contact_length:
        model_rows(c, dt, rims, torque, residuals, variances, rows)
    if rows:
        # Without fixes slip and shear strength are not told apart: do not let them drift.
        held = []
        if not reference_known(c):
            held = [SHEAR_STRENGTH, SHEAR_MODULUS]
            if run.fresh_travel < c.contact_length:
                held.append(SPEED)  # the rut of a start is no steady one
        unread = [i for i in range(n) if not sinkage_known(c, i)]
        # Nor are sinkage and the errors of the shear model, where no sensor sees the sinkage.
        for part in (layout.sinkage, layout.stiffness):
            held += [part.start + i for i in unread]
        if len(unread) == n:
            held.append(SLIP_SINKAGE)
        c.filter.update(np.array(residuals), np.array(rows), np.array(variances), considered=held)
    run.window = InertialWindow()
