# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""State and covariance at the start of a run."""

from __future__ import annotations

import math

import numpy as np

from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.filter import GatedFilter
from wheel_terra_estimator.estimation.filter_settings import FilterSettings
from wheel_terra_estimator.estimation.filter_state import (
    CENTROID,
    GRAVITY_BIAS,
    MOUND,
    SHEAR_MODULUS,
    SHEAR_STRENGTH,
    SLIP_SINKAGE,
    SPEED,
    StateLayout,
)
from wheel_terra_estimator.estimation.measurement_models import WheelModels
from wheel_terra_estimator.estimation.slip_classes import SlipClassifier
from wheel_terra_estimator.estimation.steps.context import Context
from wheel_terra_estimator.estimation.steps.memory import Memory
from wheel_terra_estimator.estimation.stuck_warning import StuckMonitor, StuckTuning

_NAN = math.nan


def fresh_memory(settings: FilterSettings) -> Memory:
    """Return the memory at the start of a run: level, at rest, nothing known."""
    run = Memory.fresh(settings.wheel_count)
    run.force = (0.0, 0.0, settings.gravity)
    run.load = [float(w) for w in settings.load.loads(run.force)]
    run.pull_std = list(run.load)
    return run


def slip_classifier(settings: FilterSettings) -> SlipClassifier:
    """Return a classifier that has seen nothing."""
    tuning = settings.filter
    return SlipClassifier(
        settings.wheel_count,
        [float(b) for b in tuning.class_thresholds],
        float(tuning.class_hysteresis),
        float(tuning.class_dwell),
    )


def start_context(configuration: Configuration) -> Context:
    """Return the context of a rover at the start of its first run."""
    settings = FilterSettings.from_configuration(configuration)
    layout = StateLayout(settings.wheel_count)
    tuning, sensors = configuration.filter, settings.sensors
    stuck_tuning = StuckTuning(
        horizon=float(tuning.stuck_horizon),
        travel=float(tuning.stuck_travel),
        clear_slip=float(tuning.stuck_clear_slip),
        clear_time=float(tuning.stuck_clear_time),
    )
    n = settings.wheel_count
    common = float(tuning.shear_error_common_std)
    rate = max(float(sensors.imu_rate), 1.0)
    # Attitude errors change within about half a second over rough ground.
    attitude = settings.gravity * float(sensors.orientation_std)
    c = Context(
        configuration=configuration,
        settings=settings,
        layout=layout,
        models=WheelModels(configuration),
        stuck_tuning=stuck_tuning,
        low_rim=max(3.0 * settings.rest_speed, 0.005),
        contact_length=0.5 * min(settings.rim_radius),
        curvature_length=0.5 * (max(settings.longitudinal) - min(settings.longitudinal)),
        acceleration_noise=math.sqrt(
            float(sensors.specific_force_std) ** 2 / rate + attitude**2 * 0.5
        ),
        shear_error_covariance=np.eye(n) * settings.shear_error_std**2 + common**2,
        run=fresh_memory(settings),
        classifier=slip_classifier(settings),
        monitor=StuckMonitor(stuck_tuning),
        pull_jacobian=np.zeros((n, layout.size)),
    )
    c.filter = initial_filter(c)
    return c


def begin_anew(c: Context, stamp: int) -> None:
    """Forget all but the configuration; the run starts at a stamp [ns]."""
    c.run = fresh_memory(c.settings)
    c.run.origin = c.run.stamp = stamp
    c.classifier = slip_classifier(c.settings)
    c.monitor = StuckMonitor(c.stuck_tuning)
    c.filter = initial_filter(c)
    c.pull_jacobian = np.zeros((c.settings.wheel_count, c.layout.size))
    c.linear = None


def begin_with_soil(c: Context, stamp: int) -> None:
    """Start anew at a stamp [ns]; soil and biases are kept, widened."""
    old, covariance, mean = c.run, c.filter.covariance.copy(), c.filter.mean.copy()
    begin_anew(c, stamp)
    c.run.yaw_bias, c.run.pitch_bias = old.yaw_bias, old.pitch_bias
    c.run.gyro_bias_weight = 0.5 * old.gyro_bias_weight
    c.run.rejected = dict(old.rejected)
    kept = [GRAVITY_BIAS, SHEAR_STRENGTH, SHEAR_MODULUS, SLIP_SINKAGE, CENTROID, MOUND]
    kept += range(c.layout.size)[c.layout.stiffness]
    prior = c.filter.covariance
    fresh = prior.copy()
    block = np.ix_(kept, kept)
    fresh[block] = 0.5 * (covariance[block] + prior[block])
    start = c.filter.mean.copy()
    start[kept] = mean[kept]
    c.filter.restore((start, fresh, c.filter.restarts))


def initial_filter(c: Context) -> GatedFilter:
    """Return the filter at the start of a run: the nominal soil, wheels at static sinkage."""
    s, layout = c.settings, c.layout
    mean = np.zeros(layout.size)
    P = np.zeros((layout.size, layout.size))
    P[SPEED, SPEED] = 1.0
    P[GRAVITY_BIAS, GRAVITY_BIAS] = (
        float(s.sensors.specific_force_bias_std) ** 2
        + (s.gravity * float(s.sensors.orientation_std)) ** 2
    )
    P[SHEAR_STRENGTH, SHEAR_STRENGTH] = s.shear_strength_std**2
    P[SHEAR_MODULUS, SHEAR_MODULUS] = s.shear_modulus_std**2
    P[SLIP_SINKAGE, SLIP_SINKAGE] = 0.1**2
    P[CENTROID, CENTROID] = 0.06**2
    mound_known = 'soil_mound' in c.configuration.effects
    mean[MOUND] = 0.0 if mound_known else 0.05
    P[MOUND, MOUND] = 0.1**2
    n = s.wheel_count
    # Static sinkage by the bearing law: where the law carries the load at zero slip.
    for i in range(n):
        mean[layout.sinkage.start + i] = static_sinkage(c, i)
    z = mean[layout.sinkage]
    P[layout.sinkage, layout.sinkage] = np.diag((0.5 * z + 0.005) ** 2)
    shared, own = s.stiffness_std, 0.5 * s.stiffness_std
    P[layout.stiffness, layout.stiffness] = shared**2 + np.eye(n) * own**2
    P[layout.shear_error, layout.shear_error] = c.shear_error_covariance
    upper = np.full(layout.size, np.inf)
    upper[SPEED], upper[GRAVITY_BIAS] = 20.0, 2.0
    upper[SHEAR_STRENGTH], upper[SHEAR_MODULUS] = 1.0, 1.0
    upper[SLIP_SINKAGE], upper[CENTROID], upper[MOUND] = 0.8, 0.3, 0.6
    upper[layout.stiffness], upper[layout.shear_error] = 3.0, 1.5
    lower = -upper
    upper[layout.sinkage] = s.rim_radius
    lower[layout.sinkage] = [-0.02 * r for r in s.rim_radius]
    return GatedFilter(mean, P, lower, upper)


def static_sinkage(c: Context, wheel: int) -> float:
    """Return the sinkage at which the bearing law carries the load of a wheel at rest [m]."""
    low, high = 1e-4, 0.5 * c.settings.rim_radius[wheel]
    load = c.run.load[wheel]
    for _ in range(30):
        z = math.sqrt(low * high)
        bearing = c.models.bearing(wheel, 1.0, z, load, 0.0, 0.0, 0.0, 0.0, _NAN)
        if bearing.load < load:
            low = z
        else:
            high = z
    return high
