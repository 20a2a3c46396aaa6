# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What the filter needs of the configuration, as plain floats and lists (fast in scalar code)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.load_distribution import LoadDistribution, load_distribution


@dataclass(frozen=True)
class FilterSettings:
    """Constants of one rover; lists have one entry per wheel."""

    wheel_count: int
    slip_radius: list[float]
    rim_radius: list[float]
    shear_radius: list[float]
    lateral: list[float]  # y [m]
    longitudinal: list[float]  # x [m]
    passes: list[float]
    torque_limit: list[float]
    mass: float
    gravity: float
    load: LoadDistribution
    load_std: float  # relative
    rut_tilt: list[float]  # body pitch up per metre of sinkage of each wheel [rad/m]
    rest_speed: float
    rest_time: float
    silence: float
    sensors: Any
    filter: Any
    shear_strength_std: float  # prior of the common shear strength [ln]
    shear_modulus_std: float
    stiffness_std: float
    shear_error_std: float

    @classmethod
    def from_configuration(cls, configuration: Configuration) -> FilterSettings:
        """Collect and derive the constants."""
        wheels, rover, sensors = configuration.wheels, configuration.rover, configuration.sensors
        x = np.asarray(wheels.x, dtype=float)
        spread = x - x.mean()
        tilt = -spread / max(float(spread @ spread), 1e-9) if np.ptp(x) > 1e-6 else 0.0 * x
        tuning = configuration.filter
        soil, soil_std = configuration.soil, configuration.soil_std
        phi_std = soil_std['friction_angle'] / max(
            math.sin(soil.friction_angle) * math.cos(soil.friction_angle), 0.05
        )
        modulus_std = soil_std['frictional_modulus'] / max(float(soil.frictional_modulus), 1.0)
        shear_modulus_std = soil_std['shear_modulus'] / float(soil.shear_modulus)
        return cls(
            wheel_count=wheels.count,
            slip_radius=[float(r) for r in wheels.slip_radius],
            rim_radius=[float(r) for r in wheels.radius],
            shear_radius=[
                float(r + h) for r, h in zip(wheels.radius, wheels.lug_height, strict=True)
            ],
            lateral=[float(y) for y in wheels.y],
            longitudinal=[float(v) for v in x],
            passes=[float(p) for p in wheels.passes],
            torque_limit=[float(t) for t in wheels.torque_limit],
            mass=float(rover.mass),
            gravity=float(rover.gravity),
            load=_load_distribution(configuration),
            load_std=float(rover.load_std),
            rut_tilt=[float(t) for t in tilt],
            rest_speed=configuration.rest_speed,
            rest_time=float(tuning.rest_time),
            silence=float(tuning.silence),
            sensors=sensors,
            filter=tuning,
            shear_strength_std=max(phi_std, 0.1),
            shear_modulus_std=max(shear_modulus_std, 0.3),
            stiffness_std=max(modulus_std, 0.2),
            shear_error_std=math.hypot(
                float(tuning.shear_error_std), float(sensors.torque_gain_std)
            ),
        )


def _load_distribution(configuration: Configuration) -> LoadDistribution:
    wheels, rover = configuration.wheels, configuration.rover
    shares = np.asarray(rover.load_shares, dtype=float)
    return load_distribution(
        mass=float(rover.mass),
        position=np.column_stack([wheels.x, wheels.y]).astype(float),
        centre_of_gravity=[float(c) for c in rover.centre_of_gravity],
        contact_height=float(np.mean(np.asarray(wheels.z) - np.asarray(wheels.radius))),
        suspension=rover.suspension,
        shares=shares if shares.any() else np.ones(wheels.count),
        rocker_pivot=rover.rocker_pivot,
        bogie_pivot=rover.bogie_pivot,
        bogie_wheels=rover.bogie_wheels,
    )
