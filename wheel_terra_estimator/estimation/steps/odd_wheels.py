# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Wheels that carry nothing, and sudden changes of what the wheels must give."""

from __future__ import annotations

import math

from wheel_terra_estimator.estimation.speed_process import median
from wheel_terra_estimator.estimation.steps.context import (
    Context,
    fastest_rim,
    slope_share,
    typical_rim,
)

_NAN = math.nan
_UNLOADED_HOLD = 0.3
_EFFORT_GAIN = 0.5
_RESTLESS_SHARE, _RESTLESS_RIM = 0.05, 0.02  # of the rim speed; its change in a cycle


def watch_demand(c: Context, dt: float) -> None:
    """Note a change of what the ground asks: the slip follows, over the slope of the curve."""
    run, s = c.run, c.settings
    demand = slope_share(c)
    if run.demand != run.demand:
        run.demand = demand
    change = demand - run.demand
    run.demand -= math.expm1(-dt / 1.0) * change
    noise = float(s.sensors.specific_force_std) / math.sqrt(run.window.count) / s.gravity
    excess = abs(change) - 1.5 * noise
    if excess > 0.0 and run.steepness > 0.0 and run.fresh_travel > c.contact_length:
        share = min(excess / max(run.steepness, 0.1), 0.3)
        run.unrest = max(run.unrest, share * fastest_rim(c))


def note_unrest(c: Context, time: float, rim: float | None) -> None:
    """Remember when contacts or commands last changed: a witness for fixes that jump."""
    run = c.run
    before = typical_rim(run.rims_at_cycle)
    if rim is None:
        return
    changed = before is None or abs(rim - before) > _RESTLESS_RIM * abs(rim)
    if changed or run.unrest > _RESTLESS_SHARE * abs(rim):
        run.unrest_time = time


def watch_torques(c: Context, torque: list[float], rims: list[float]) -> None:
    """Find wheels that carry nothing, and sudden changes of what the wheels must give."""
    run, s = c.run, c.settings
    rolling = [
        i
        for i, rim in enumerate(rims)
        if rim == rim and abs(rim) > c.low_rim and torque[i] == torque[i]
    ]
    if len(rolling) < 2:
        if any(value == value for value in torque):
            run.effort = [_NAN, _NAN]
            run.unloaded = [False] * s.wheel_count
        return
    dt, run.effort_time = run.time - run.effort_time, run.time
    typical_torque = median([torque[i] for i in rolling])
    middle_rim = median([rims[i] for i in rolling])
    fastest = max(abs(rims[i]) for i in rolling)
    noise = float(s.sensors.torque_std) + float(s.sensors.torque_zero_std)
    telling = abs(typical_torque) > 5.0 * noise and run.side_motion < 0.1
    for i in rolling:
        share = torque[i] / typical_torque if telling else 1.0
        free = telling and abs(share) < 0.2 and rims[i] / middle_rim > 0.95
        if run.unloaded[i]:
            free = not telling or share < 0.4
        if free == run.unloaded[i]:
            run.unloaded_since[i] = _NAN
        elif run.unloaded_since[i] != run.unloaded_since[i]:
            run.unloaded_since[i] = run.time
        elif run.time - run.unloaded_since[i] > _UNLOADED_HOLD:
            run.unloaded[i], run.unloaded_since[i] = free, _NAN
    carrying = [i for i in rolling if not run.unloaded[i]]
    weight = sum(run.load[i] * s.shear_radius[i] for i in carrying)
    if weight <= 0.0:
        return
    effort = sum(math.copysign(torque[i], torque[i] * rims[i]) for i in carrying) / weight
    fast, slow = run.effort
    if fast != fast or dt <= 0.0:
        run.effort = [effort, effort]
        return
    fast += -math.expm1(-dt / 0.15) * (effort - fast)
    slow += -math.expm1(-dt / 1.0) * (effort - slow)
    run.effort = [fast, slow]
    noise = float(s.sensors.torque_std) * math.sqrt(len(carrying)) / weight
    excess = abs(fast - slow) - 3.0 * noise * 0.5
    if excess > 0.0 and run.steepness > 0.0:
        change = min(_EFFORT_GAIN * excess / max(run.steepness, 0.1), 0.4)
        run.unrest = max(run.unrest, change * fastest)
