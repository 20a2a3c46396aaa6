# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""How the rover turns, how the ground curves, what each wheel carries."""

from __future__ import annotations

import math

from wheel_terra_estimator.estimation.filter_state import SPEED
from wheel_terra_estimator.estimation.speed_process import InertialWindow
from wheel_terra_estimator.estimation.steps.context import (
    Context,
    fastest_rim,
    open_shear,
    slope_share,
)

_COMMON_CURVATURE = 0.1  # [rad/m]


def follow_turning(c: Context, window: InertialWindow, dt: float) -> None:
    """Smooth the yaw rate while it is steady; measure how the ground curves along the path."""
    run, s = c.run, c.settings
    yaw_rate = window.yaw_rate / window.count
    noise = float(s.sensors.angular_rate_std) / math.sqrt(window.count)
    # Smooth what may be noise; follow what is more.
    gain = min(max(0.25 * abs(yaw_rate - run.yaw_rate) / max(noise, 1e-6), 0.25), 1.0)
    run.yaw_rate += gain * (yaw_rate - run.yaw_rate)
    # Nose-up rotation over travel, both forgotten over the length of the rover.
    travel = float(c.filter.mean[SPEED]) * dt
    keep = math.exp(-abs(travel) / max(c.curvature_length, 0.1))
    run.turned_up = keep * run.turned_up - window.pitch_rate / window.count * dt
    run.turned_over = keep * run.turned_over + travel


def note_turning(c: Context, dt: float) -> None:
    """Note where turning begins or ends: the contacts form anew."""
    run = c.run
    fastest = fastest_rim(c)
    if fastest <= c.low_rim:
        return
    side = min(abs(run.yaw_rate) * c.curvature_length / fastest, 1.0)
    run.side_slow += -math.expm1(-dt / 1.0) * (side - run.side_slow)
    change = abs(side - run.side_slow) - 0.05
    if change > 0.0:
        run.unrest = max(run.unrest, 1.5 * change * fastest)
        run.renewal = max(run.renewal, change)
    run.renewal *= math.exp(-fastest * dt / c.contact_length)
    run.side_motion = side


def ground_curvature(c: Context) -> float:
    """Return slope gained per travel [rad/m]: front wheels may climb steeper ground."""
    over = c.run.turned_over
    if abs(over) < 0.1 * c.curvature_length:
        return 0.0
    curvature = min(max(c.run.turned_up / over, -0.3), 0.3)
    # What the gyro's zero makes of it, against the curvature of common ground.
    zero = float(c.settings.sensors.angular_rate_bias_std)
    doubt = zero / max(abs(float(c.filter.mean[SPEED])), 1e-4)
    return curvature / (1.0 + (doubt / _COMMON_CURVATURE) ** 2)


def wheel_loads(c: Context) -> list[float]:
    """Return the wheel loads for the last specific force, pulls and torques [N]."""
    run, s = c.run, c.settings
    moment = [
        (torque if torque == torque else 0.0) - pull * r
        for torque, pull, r in zip(run.torque_now, run.model_pull, s.rim_radius, strict=True)
    ]
    loads = [float(w) for w in s.load.loads(run.force, run.model_pull, moment)]
    if any(run.unloaded):
        total = sum(loads)
        loads = [0.0 if off else w for w, off in zip(loads, run.unloaded, strict=True)]
        loads = [w * total / max(sum(loads), 1e-9) for w in loads]
    return loads


def follow_direction(c: Context, rim: float | None) -> None:
    """Forget v / rim speed where the drive changes its direction (up becomes down)."""
    run = c.run
    if rim is None or abs(rim) < c.low_rim:
        return
    if run.starting:
        # The contact forms anew, and with it what the shear model gets wrong.
        run.starting = False
        open_shear(c, 0.3)
    direction = 1.0 if rim > 0.0 else -1.0
    if direction != run.drive_direction:
        if run.drive_direction != 0.0:
            run.ratio = min(max(0.9 - direction * slope_share(c), 0.2), 1.1)
        run.ratio_std = 0.3
        run.drive_direction = direction
        run.fresh_travel = 0.0
