# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""One cycle of the filter: what came since the last one, in the order of its use."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.estimation.filter_state import SPEED
from wheel_terra_estimator.estimation.measurements import ReferenceVelocity
from wheel_terra_estimator.estimation.steps.context import (
    Context,
    reference_known,
    rim_speed_of,
    rims_without_turning,
    typical_rim,
)
from wheel_terra_estimator.estimation.steps.odd_wheels import note_unrest, watch_demand
from wheel_terra_estimator.estimation.steps.prediction import predict
from wheel_terra_estimator.estimation.steps.pulls import floor_speed_variance, work_out_pulls
from wheel_terra_estimator.estimation.steps.reference_and_rest import fuse_reference, fuse_rest
from wheel_terra_estimator.estimation.steps.sensor_and_model_update import fuse_models
from wheel_terra_estimator.estimation.steps.turning_and_loads import (
    follow_direction,
    follow_turning,
    note_turning,
    wheel_loads,
)

FloatArray = NDArray[np.float64]


def run_cycle(c: Context, time: float, reference: ReferenceVelocity | None) -> None:
    """Predict to a time [s], fuse what came since the last cycle, work out the outputs."""
    run, s = c.run, c.settings
    dt = 0.0 if run.cycle_time is None else time - run.cycle_time
    window = run.window
    if window.count:
        count = window.count
        run.force = (window.force_x / count, window.force_y / count, window.force_z / count)
        run.force_known = True
        follow_turning(c, window, dt)
        run.load = wheel_loads(c)
        note_turning(c, dt)
        watch_demand(c, dt)
    unturned = rims_without_turning(c)
    rim = typical_rim(unturned)
    follow_direction(c, rim)
    if typical_rim(run.rims_at_cycle) is None and rim is not None:
        # First sight of the wheels: between rolling and spinning, or at rest.
        spread = max(0.3 * abs(rim), s.rest_speed)
        c.filter.set(SPEED, run.ratio * rim, spread * spread)
    rims = [rim_speed_of(c, i) for i in range(s.wheel_count)]
    still = all(r != r or abs(r) < s.rest_speed for r in rims) and any(r == r for r in rims)
    before = c.filter.mean[c.layout.sinkage].copy()
    note_unrest(c, time, rim)
    predict(c, time, dt, rims, still)
    begin_rolling(c, rim)
    if reference is not None:
        fuse_reference(c, time, reference, still)
    fuse_rest(c, time, rims, rim, still)
    fuse_models(c, dt, rims, still)
    run.rims_at_cycle = unturned
    finish(c, time, dt, rim, rims, before)


def begin_rolling(c: Context, rim: float | None) -> None:
    """Let a rover that starts without fixes roll as it did before.

    A jolt of the accelerometer weighs much while the wheels turn slowly, and from a speed of
    nothing the wheels' prediction, v' = v rim'/rim, goes on with nothing.
    """
    run = c.run
    if rim is None or reference_known(c) or run.fresh_travel > c.contact_length:
        return
    usual = run.ratio * rim
    off = abs(float(c.filter.mean[SPEED]) - usual)
    # A rover that slides, or wheels that spin up at once, differ by more than the accelerometer's
    # noise over a second.
    if abs(rim) > c.low_rim and 0.5 * abs(usual) < off < 3.0 * c.acceleration_noise:
        c.filter.set(SPEED, usual, (run.ratio_std * rim) ** 2)


def finish(
    c: Context,
    time: float,
    dt: float,
    rim: float | None,
    rims: list[float],
    sinkage_before: FloatArray,
) -> None:
    """Keep what the next cycle needs, work out pulls and sinkage rates."""
    run, s, layout = c.run, c.settings, c.layout
    x, P = c.filter.mean, c.filter.covariance
    run.unrest *= math.exp(-dt / 0.3)
    run.cycle_time = time
    settled = run.fresh_travel > c.contact_length
    if rim is not None and abs(rim) > 2.0 * c.low_rim and settled:
        run.ratio = min(max(float(x[SPEED]) / rim, -0.5), 2.0)
        run.ratio_std = min(max(math.sqrt(float(P[SPEED, SPEED])) / abs(rim), 0.1), 0.5)
    if dt > 0.0:
        keep = math.exp(-dt / 0.5)
        change = (x[layout.sinkage] - sinkage_before) / dt
        for i in range(s.wheel_count):
            run.sinkage_rate[i] += (1.0 - keep) * (float(change[i]) - run.sinkage_rate[i])
            zi = layout.sinkage.start + i
            run.sinkage_rate_std[i] = math.sqrt(2.0 * float(P[zi, zi]))
    floor_speed_variance(c, rims)
    work_out_pulls(c, rims)
