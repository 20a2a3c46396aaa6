# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What the steps of the estimator share, and what several of them ask of it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.filter import GatedFilter
from wheel_terra_estimator.estimation.filter_settings import FilterSettings
from wheel_terra_estimator.estimation.filter_state import (
    GRAVITY_BIAS,
    SHEAR_STRENGTH,
    SPEED,
    StateLayout,
)
from wheel_terra_estimator.estimation.measurement_models import WheelModels
from wheel_terra_estimator.estimation.slip_classes import SlipClassifier
from wheel_terra_estimator.estimation.speed_process import SpeedStep, median, speed_step
from wheel_terra_estimator.estimation.steps.memory import Memory
from wheel_terra_estimator.estimation.stuck_warning import StuckMonitor, StuckTuning

FloatArray = NDArray[np.float64]
_NAN = math.nan
_SLOPE_KEEP = 0.9  # per cycle


@dataclass
class Context:
    """One rover's estimator as its steps see it.

    Attributes
    ----------
    configuration, settings, layout, models, stuck_tuning
        What stays the same.
    low_rim : float
        Rim speed below which v / rim speed is not told from noise [m/s].
    contact_length : float
        Travel after which a contact is new all along, and its shear that of the steady model [m].
    curvature_length : float
        Half the distance between the first and the last axle [m].
    acceleration_noise : float
        Of the accelerometer and the attitude [m/s^2 sqrt(s)].
    shear_error_covariance : numpy.ndarray
        (n, n) of what the shear model gets wrong at each wheel.
    run, filter, classifier, monitor
        What changes; replaced at the start of a run.
    pull_jacobian : numpy.ndarray
        (n, state) derivatives of the pulls at the last update.
    linear : tuple or None
        State, pulls, derivatives of the torques and torques of the last pass.
    pull_sum : tuple or None
        Sum of the pulls [N] by the specific force along the body, the rover's weight [N] that a
        tilt of the body by its ruts turns into it, and its variance [N^2].
    """

    configuration: Configuration
    settings: FilterSettings
    layout: StateLayout
    models: WheelModels
    stuck_tuning: StuckTuning
    low_rim: float
    contact_length: float
    curvature_length: float
    acceleration_noise: float
    shear_error_covariance: FloatArray
    run: Memory
    filter: GatedFilter = field(init=False)
    classifier: SlipClassifier
    monitor: StuckMonitor
    pull_jacobian: FloatArray
    linear: tuple[FloatArray, FloatArray, FloatArray, FloatArray] | None = None
    pull_sum: tuple[float, float, float] | None = None


def smoothed(old: tuple[float, ...] | None, new: tuple[float, ...]) -> tuple[float, ...]:
    """Return derivatives smoothed over about a second of cycles."""
    if old is None:
        return new
    return tuple(_SLOPE_KEEP * a + (1.0 - _SLOPE_KEEP) * b for a, b in zip(old, new, strict=True))


def rim_speed_of(c: Context, wheel: int) -> float:
    """Rim speed of a wheel [m/s], nan when its rate is unknown or too old."""
    run = c.run
    if run.time - run.rate_time[wheel] > c.settings.silence:
        return _NAN
    return run.rim_speed[wheel]


def fastest_rim(c: Context) -> float:
    """Return the greatest known rim speed, whatever its direction [m/s]; 0 = none is known."""
    return max((abs(rim) for rim in c.run.rim_speed if rim == rim), default=0.0)


def rims_without_turning(c: Context) -> list[float]:
    """Rim speed of each wheel less its share of the turning [m/s]; nan = unknown."""
    yaw_rate, lateral = c.run.yaw_rate, c.settings.lateral
    return [rim_speed_of(c, i) + yaw_rate * y for i, y in enumerate(lateral)]


def typical_rim(rims: list[float]) -> float | None:
    """Median of the known rim speeds, so that no single wheel decides; None = none is known."""
    known = [rim for rim in rims if rim == rim]
    return median(known) if known else None


def speed_step_to(c: Context, time: float) -> SpeedStep:
    """Return how the speed goes on from the last cycle to a time [s]."""
    run = c.run
    dt = 0.0 if run.cycle_time is None else time - run.cycle_time
    rims = rims_without_turning(c)
    return speed_step(
        dt=dt,
        rim_before=typical_rim(run.rims_at_cycle),
        rim_now=typical_rim(rims),
        ratio=run.ratio,
        ratio_std=run.ratio_std,
        low_rim=c.low_rim,
        ratio_walk=run.ratio_walk,
        # Opened without fixes, the speed would follow soil models that are off by as much.
        unrest=run.unrest if reference_known(c) else 0.0,
        window=run.window,
        acceleration_noise=c.acceleration_noise,
        discord=rim_discord(c, rims),
    )


def rim_discord(c: Context, rims: list[float]) -> float:
    """Return by how much the wheels disagree on the change of rim speed since the cycle [m/s].

    Median deviation from the median: one odd wheel makes none, two that spin up beside two that
    stand do. What the noise of the rates makes is taken off.
    """
    s = c.settings
    changes = [
        now - before
        for now, before in zip(
            rims, c.run.rims_at_cycle, strict=False
        )  # none is kept before the first cycle
        if now == now and before == before
    ]
    if len(changes) < 3:
        return 0.0
    middle = median(changes)
    noise = 3.0 * float(s.sensors.wheel_rate_std) * max(s.slip_radius)
    return max(median([abs(change - middle) for change in changes]) - noise, 0.0)


def current_speed(c: Context) -> tuple[float, float]:
    """Return speed and variance at the present stamp, carried on from the last cycle."""
    run = c.run
    x, P = c.filter.mean, c.filter.covariance
    if run.cycle_time is None or run.time - run.cycle_time < 1e-6:
        return float(x[SPEED]), float(P[SPEED, SPEED])
    step = speed_step_to(c, run.time)
    a, b = step.speed_gain, step.bias_gain
    speed = a * float(x[SPEED]) + b * float(x[GRAVITY_BIAS]) + step.constant
    variance = (
        a * a * float(P[SPEED, SPEED])
        + 2.0 * a * b * float(P[SPEED, GRAVITY_BIAS])
        + b * b * float(P[GRAVITY_BIAS, GRAVITY_BIAS])
        + step.variance
    )
    return speed, variance


def reference_known(c: Context) -> bool:
    """Say whether a fix came within the last travel over which soil is learned."""
    run = c.run
    return run.reference_time is not None and run.time - run.reference_time < 20.0


def torque_known(c: Context) -> bool:
    """Say whether a torque was read of late."""
    return c.run.torque_time is not None and c.run.time - c.run.torque_time < 2.0


def sinkage_known(c: Context, wheel: int) -> bool:
    """Say whether a wheel's sinkage was read of late."""
    return c.run.time - c.run.sinkage_time[wheel] < 2.0


def open_shear(c: Context, std: float) -> None:
    """Widen the shear strength, where fixes will settle it again."""
    if reference_known(c):
        c.filter.widen(SHEAR_STRENGTH, std * std)


def yaw_rate_std(c: Context) -> float:
    """Return the standard deviation of the smoothed yaw rate [rad/s]."""
    sensors = c.settings.sensors
    per_cycle = max(float(sensors.imu_rate) * float(c.settings.filter.period), 1.0)
    noise = float(sensors.angular_rate_std) / math.sqrt(per_cycle)
    return math.hypot(0.4 * noise, float(sensors.angular_rate_bias_std))


def leaving_angle_of(c: Context, wheel: int) -> float:
    """Return the measured leaving angle of a wheel [rad]; nan when there is none of late."""
    run = c.run
    return run.leaving_angle[wheel] if run.time - run.leaving_time[wheel] < 1.0 else _NAN


def note_nis(c: Context, channel: str, nis: float) -> None:
    """Keep the normalised innovation squared of a channel, smoothed."""
    nis_of = c.run.nis
    nis_of[channel] = 0.95 * nis_of.get(channel, 1.0) + 0.05 * min(nis, 100.0)


def slope_share(c: Context) -> float:
    """Return what the ground asks of each wheel along the body, as a share of its load [-]."""
    force = c.run.force
    return force[0] / max(force[2], 0.1)


def bears_and_turns(c: Context, wheel: int, rim: float) -> bool:
    """Say whether the contact models hold for a wheel: it turns under a load."""
    return rim == rim and abs(rim) >= 2.0 * c.settings.rest_speed and c.run.load[wheel] >= 1e-3


def distrusted(c: Context, channel: str, variance: float) -> float:
    """Return the variance of a channel whose residuals keep being larger than foreseen."""
    return variance * max(c.run.nis.get(channel, 1.0), 1.0) ** 2
