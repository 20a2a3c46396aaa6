# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Slip, class and stuck warning of the present stamp; pull margins."""

from __future__ import annotations

import math

from wheel_terra_estimator.estimation.estimates import SlipClass
from wheel_terra_estimator.estimation.filter_state import (
    CENTROID,
    MOUND,
    SHEAR_MODULUS,
    SHEAR_STRENGTH,
)
from wheel_terra_estimator.estimation.steps.context import (
    Context,
    current_speed,
    rim_speed_of,
    slope_share,
    torque_known,
    yaw_rate_std,
)
from wheel_terra_estimator.estimation.stuck_warning import WheelMotionState

_NAN = math.nan
_TURNING_SLIP_STD = 0.05


def judge(c: Context, time: float) -> None:
    """Judge slip and class of each wheel and the stuck warning at a time [s]."""
    run, s = c.run, c.settings
    speed, variance = current_speed(c)
    speed_std = math.sqrt(max(variance, 0.0))
    yaw = run.yaw_rate
    yaw_std = yaw_rate_std(c)
    rate_std = float(s.sensors.wheel_rate_std)
    motion = []
    stopped = run.still_since is not None and time >= run.sliding_until
    for i in range(s.wheel_count):
        rim = rim_speed_of(c, i)
        v = speed - yaw * s.lateral[i]
        v_std = math.hypot(speed_std, yaw_std * s.lateral[i])
        if stopped and abs(speed) < s.rest_speed:
            # All wheels stand: what the gyro says beside them is noise.
            v, v_std = 0.0, 0.0
        if rim != rim:
            run.slip_std[i] = min(run.slip_std[i] + 0.02, 1.0)
            run.resting[i] = False
            run.wheel_class[i] = c.classifier.unknown(i)
        else:
            slip_of_wheel(c, i, time, rim, v, v_std, rate_std)
        limit = s.torque_limit[i]
        torque = run.torque_held[i]
        motion.append(
            WheelMotionState(
                slip=run.slip[i],
                slip_std=run.slip_std[i],
                rim_speed=rim if rim == rim else 0.0,
                known=rim == rim and not run.resting[i] and abs(rim) > s.rest_speed,
                torque_share=abs(torque) / limit if limit > 0.0 else _NAN,
                sinkage=float(c.filter.mean[c.layout.sinkage.start + i]),
                radius=s.rim_radius[i],
            )
        )
    known = run.reference_time is not None and time - run.reference_time < 10.0
    run.assessment = c.monitor.update(
        time,
        speed,
        known,
        motion,
        turning=run.side_motion > 0.3,
        margin=margin_share(c),
    )
    if time - run.margin_time >= 1.0:
        run.margin_time = time
        work_out_margins(c)


def slip_of_wheel(
    c: Context, i: int, time: float, rim: float, v: float, v_std: float, rate_std: float
) -> None:
    """Work out slip and class of a turning wheel with ground speed `v` [m/s]."""
    run, s = c.run, c.settings
    rest = s.rest_speed
    if abs(rim) < rest and abs(v) < max(rest, 2.0 * v_std):
        if run.rest_since[i] != run.rest_since[i]:
            run.rest_since[i] = time
        run.resting[i] = time - run.rest_since[i] >= s.rest_time - 1e-6
        if run.resting[i]:
            run.wheel_class[i] = c.classifier.unknown(i)
        # Slip holds its last value.
        return
    run.rest_since[i] = _NAN
    run.resting[i] = False
    sliding_back = False
    if abs(rim) <= rest:
        slip, slip_std = -1.0, v_std / max(abs(v), rest)
    elif v * rim < 0.0:
        slip, slip_std = 1.0, v_std / abs(rim)
        # Told from standing still only where it is more than noise.
        sliding_back = abs(v) > max(rest, v_std)
    elif abs(v) <= abs(rim):
        slip = 1.0 - v / rim
        slip_std = math.hypot(v_std / rim, (1.0 - slip) * rate_std * s.slip_radius[i] / rim)
    else:
        slip = rim / v - 1.0
        slip_std = math.hypot(v_std * rim / (v * v), rate_std * s.slip_radius[i] / v)
    # Turning scrubs the soil sideways, which no model here knows.
    slip_std = math.hypot(slip_std, _TURNING_SLIP_STD * run.side_motion)
    run.slip[i], run.slip_std[i] = slip, min(max(slip_std, 1e-3), 1.0)
    if slip_std >= 1.0 and run.wheel_class[i] == SlipClass.UNKNOWN:
        run.wheel_class[i] = c.classifier.unknown(i)  # nothing is known of it yet
        return
    run.wheel_class[i] = c.classifier.update(i, time, slip, slip_std, sliding_back)


def margin_share(c: Context) -> float:
    """Return the pull left over, as a share of the load; nan where torque does not tell."""
    run, s = c.run, c.settings
    if not torque_known(c) or run.margin_time < 0.0 or float(s.sensors.torque_gain_std) > 0.3:
        return _NAN
    return sum(run.pull_margin) / max(sum(run.load), 1e-3)


def work_out_margins(c: Context) -> None:
    """Greatest pull that the present soil gives each wheel minus what the slope asks [N]."""
    run, s, layout = c.run, c.settings, c.layout
    x = c.filter.mean
    for i in range(s.wheel_count):
        load = run.load[i]
        if load < 1e-3:
            run.pull_margin[i] = 0.0
            continue
        strength = float(x[SHEAR_STRENGTH] + x[layout.shear_error.start + i])
        best = max(
            c.models.forces(
                i,
                1.0 - slip,
                float(x[layout.sinkage.start + i]),
                load,
                strength,
                float(x[SHEAR_MODULUS]),
                float(x[CENTROID]),
                float(x[MOUND]),
                _NAN,
                _NAN,
            ).pull
            for slip in (0.3, 0.6, 0.9)
        )
        direction = run.drive_direction or 1.0
        demand = direction * load * slope_share(c)
        run.pull_margin[i] = best - demand
