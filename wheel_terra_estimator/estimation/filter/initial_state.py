# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""State and covariance at the start of a run, and the bounds of the state."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.contacts.equilibrium_slip import steady_sinkage
from wheel_terra_estimator.estimation.contacts.wheel_models import WheelModels, WheelStates
from wheel_terra_estimator.estimation.filter.ekf import FilterMemory, GatedFilter
from wheel_terra_estimator.estimation.filter.state import (
    CENTROID,
    GRAVITY_BIAS,
    RUT_SHARE,
    SHEAR_MODULUS,
    SHEAR_STRENGTH,
    SLIP_PER_DEMAND,
    SLIP_SINKAGE,
    SPEED,
    StateLayout,
)
from wheel_terra_estimator.estimation.rover import Rover, SensorFigures

_BY_SLIP = 'slip_sinkage_exponent'

# Standard deviations at the start that the configuration does not state, and bounds. The spreads
# are those between a soil and its model in published fits (docs/models), or wide enough to say
# nothing; the bounds are physical limits, or far outside any fit.
_SPEED_STD = 1.0  # [m/s]
_SLIP_SINKAGE_STD = 0.1  # of n1 [-]
_CENTROID_STD = 0.06  # [-]
_SLIP_PER_DEMAND_MEAN = 1.0
"""Slip per required traction coefficient: the inverse slope of a traction curve [-], 0.5 on
firm ground to 3 near the greatest pull (docs/models/validation.md)."""
_SLIP_PER_DEMAND_STD = 1.0
_RUT_SHARE_MEAN = 0.3
_RUT_SHARE_STD = 0.4
_SINKAGE_SHARE = 0.5  # of the sinkage at rest
_SINKAGE_FLOOR = 0.005  # [m]
OWN_STIFFNESS_SHARE = 0.5
"""Spread of the stiffness between wheels, over that of all wheels together."""
_LEAST_STRENGTH_STD = 0.2  # [ln]
LEAST_SHEAR_MODULUS_STD = 0.3  # [ln]
_LEAST_STIFFNESS_STD = 0.2  # [ln]
_UNSTATED_STRENGTH_STD = 0.3
"""Where no soil is stated: the spread of the shipped soils (config/soils) [ln]."""
_UNSTATED_SHEAR_MODULUS_STD = 1.0  # [ln]
_UNSTATED_STIFFNESS_STD = 1.3  # of the pressure one centimetre deep [ln]
_MOST_DEVIATIONS = 3.0
"""Least bounds of soil parameters about the configured ones, in prior deviations."""
_KEPT_SHARE = 0.5
"""Weight of the old covariance, against that of a start, where a new run keeps the soil [-]."""
_MOST_SPEED = 20.0  # [m/s]
_MOST_GRAVITY_BIAS = 2.0  # [m/s^2]
_MOST_STRENGTH = 2.0  # [ln]
_MOST_SHEAR_MODULUS = 1.3  # [ln]
_MOST_SLIP_SINKAGE = 0.8
_MOST_CENTROID = 0.3
_MOST_RUT_SHARE = 0.9  # soil springs back
_MOST_SLIP_PER_DEMAND = 8.0  # near the top of the traction curve
_MOST_STIFFNESS = 3.0  # [ln]; more, if the configured soil is softer than that:
_HARDEST_SINKAGE = 2e-3  # of a wheel at rest on the hardest ground [m]
_MOST_SHEAR_ERROR = 1.5  # [ln]
_MOST_TORQUE_ZERO = 1e4  # [N m]
_HIGHEST = 0.02  # of a wheel above the surface, over its radius [-]


@dataclass(frozen=True)
class SoilPriors:
    """Prior standard deviations of the soil and of the errors of the shear model [ln]; n1."""

    strength_std: float
    shear_modulus_std: float
    stiffness_std: float
    shear_error_std: float  # of each wheel
    shear_error_common_std: float
    slip_sinkage: float  # n1 as configured [-]

    @classmethod
    def from_configuration(cls, configuration: Configuration) -> SoilPriors:
        """Derive them from the deviations of the configured soil, if one is stated."""
        figures = configuration.filter
        strength, modulus, stiffness = _soil_deviations(configuration)
        return cls(
            strength_std=strength,
            shear_modulus_std=modulus,
            stiffness_std=stiffness,
            shear_error_std=math.hypot(
                float(figures.shear_error_std), float(configuration.sensors.torque_gain_std)
            ),
            shear_error_common_std=float(figures.shear_error_common_std),
            slip_sinkage=float(configuration.effects.get(_BY_SLIP, {}).get('n1', 0.0)),
        )


def _soil_deviations(configuration: Configuration) -> tuple[float, float, float]:
    """Return the deviations of strength, shear modulus and stiffness [ln]."""
    if not configuration.soil_stated:
        return (
            _UNSTATED_STRENGTH_STD,
            _UNSTATED_SHEAR_MODULUS_STD,
            _UNSTATED_STIFFNESS_STD,
        )
    soil, std = configuration.soil, configuration.soil_std
    phi = float(soil.friction_angle)
    # d ln tan(phi) = d phi / (sin phi cos phi)
    strength = std['friction_angle'] / max(math.sin(phi) * math.cos(phi), _LEAST_SINE)
    stiffness = std['frictional_modulus'] / max(float(soil.frictional_modulus), 1.0)
    modulus = std['shear_modulus'] / float(soil.shear_modulus)
    return (
        max(strength, _LEAST_STRENGTH_STD),
        max(modulus, LEAST_SHEAR_MODULUS_STD),
        max(stiffness, _LEAST_STIFFNESS_STD),
    )


def gravity_bias_std(rover: Rover, sensors: SensorFigures, orientation_std: float) -> float:
    """Return the initial deviation of accelerometer bias plus gravity component [m/s^2]."""
    return math.hypot(sensors.specific_force_bias_std, rover.gravity * orientation_std)


LOAD_EXPONENT = 0.5  # beside n: load = k z^(n + 1/2), since contacts grow with sqrt(z) (Bekker)
_LEAST_SINE = 0.05  # of sin(phi) cos(phi): soil without friction


def layout_of(rover: Rover, sensors: SensorFigures) -> StateLayout:
    """Return the layout of the state for a rover with these sensors."""
    return StateLayout(
        rover.wheel_count, sensors.torque_zero_std > 0.0, sensors.reference_wander_std > 0.0
    )


def initial_filter(
    configuration: Configuration,
    rover: Rover,
    sensors: SensorFigures,
    layout: StateLayout,
    models: WheelModels,
    loads: tuple[float, ...],
) -> GatedFilter:
    """Return the filter at the start of a run: the nominal soil, wheels at their sinkage at rest.

    `loads` are those of each wheel on level ground [N].
    """
    priors = SoilPriors.from_configuration(configuration)
    n = rover.wheel_count
    mean = np.zeros(layout.size)
    deviations = {
        SPEED: _SPEED_STD,
        GRAVITY_BIAS: gravity_bias_std(rover, sensors, sensors.orientation_std),
        SHEAR_STRENGTH: priors.strength_std,
        SHEAR_MODULUS: priors.shear_modulus_std,
        SLIP_SINKAGE: _SLIP_SINKAGE_STD,
        CENTROID: _CENTROID_STD,
        SLIP_PER_DEMAND: _SLIP_PER_DEMAND_STD,
        RUT_SHARE: _RUT_SHARE_STD,
    }
    P = np.zeros((layout.size, layout.size))
    for index, std in deviations.items():
        P[index, index] = std**2
    mean[RUT_SHARE] = _RUT_SHARE_MEAN
    mean[SLIP_PER_DEMAND] = _SLIP_PER_DEMAND_MEAN
    level = WheelStates(1.0, 0.0, np.array(loads))
    z = steady_sinkage(models, level, np.array(rover.rim_radius))
    mean[layout.sinkage] = z
    spread = _SINKAGE_SHARE * z + _SINKAGE_FLOOR
    P[layout.sinkage, layout.sinkage] = np.diag(spread**2)
    own = OWN_STIFFNESS_SHARE * priors.stiffness_std
    P[layout.stiffness, layout.stiffness] = priors.stiffness_std**2 + np.eye(n) * own**2
    own_error = np.eye(n) * priors.shear_error_std**2
    P[layout.shear_error, layout.shear_error] = own_error + priors.shear_error_common_std**2
    zeros = range(layout.size)[layout.torque_zero]
    P[zeros, zeros] = sensors.torque_zero_std**2
    if layout.reference_error is not None:
        P[layout.reference_error, layout.reference_error] = sensors.reference_wander_std**2
    lower, upper = bounds(rover, layout, priors)
    # However soft the configured soil is, the ground may be hard.
    exponent = float(configuration.soil.sinkage_exponent) + LOAD_EXPONENT
    hardest = exponent * np.log(np.maximum(z, _HARDEST_SINKAGE) / _HARDEST_SINKAGE)
    upper[layout.stiffness] = np.maximum(upper[layout.stiffness], hardest)
    return GatedFilter(mean, P, lower, upper)


def bounds(rover: Rover, layout: StateLayout, priors: SoilPriors) -> tuple[FloatArray, FloatArray]:
    """Return the lower and upper bounds of the state, (size,) each."""
    upper = np.zeros(layout.size)
    most = _MOST_DEVIATIONS
    upper[[SPEED, GRAVITY_BIAS]] = _MOST_SPEED, _MOST_GRAVITY_BIAS
    upper[SHEAR_STRENGTH] = max(_MOST_STRENGTH, most * priors.strength_std)
    upper[SHEAR_MODULUS] = _MOST_SHEAR_MODULUS
    upper[SLIP_SINKAGE] = _MOST_SLIP_SINKAGE
    upper[CENTROID] = _MOST_CENTROID
    upper[RUT_SHARE] = _MOST_RUT_SHARE
    upper[SLIP_PER_DEMAND] = _MOST_SLIP_PER_DEMAND
    upper[layout.stiffness] = max(_MOST_STIFFNESS, most * priors.stiffness_std)
    upper[layout.shear_error] = _MOST_SHEAR_ERROR
    upper[layout.torque_zero] = _MOST_TORQUE_ZERO
    if layout.reference_error is not None:
        upper[layout.reference_error] = _MOST_SPEED
    lower = -upper
    lower[[SLIP_PER_DEMAND, RUT_SHARE]] = 0.0
    # Slip makes a wheel sink, never rise; else wheels that leave soft ground would seem to slip.
    lower[SLIP_SINKAGE] = -max(priors.slip_sinkage, 0.0)
    # Ground may be harder than any soil (K small), but no soil has a K of decimetres.
    lower[SHEAR_MODULUS] = -max(_MOST_SHEAR_MODULUS, most * priors.shear_modulus_std)
    upper[layout.sinkage] = rover.rim_radius
    lower[layout.sinkage] = [-_HIGHEST * r for r in rover.rim_radius]
    return lower, upper


def with_soil_of(old: FilterMemory, start: FilterMemory, layout: StateLayout) -> FilterMemory:
    """Return the start of a run that keeps soil and biases of an old one, inflated."""
    kept = [GRAVITY_BIAS, SHEAR_STRENGTH, SHEAR_MODULUS, SLIP_SINKAGE, CENTROID]
    kept += [SLIP_PER_DEMAND, RUT_SHARE]
    kept += range(layout.size)[layout.stiffness]
    kept += range(layout.size)[layout.torque_zero]
    block = np.ix_(kept, kept)
    covariance, mean = start.covariance.copy(), start.mean.copy()
    share = _KEPT_SHARE
    covariance[block] = share * old.covariance[block] + (1.0 - share) * covariance[block]
    mean[kept] = old.mean[kept]
    return FilterMemory(mean, covariance, start.restarts)
