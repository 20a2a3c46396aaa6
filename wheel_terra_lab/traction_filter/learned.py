# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What a drive taught of soil and sensors, as parameters that the next drive starts from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.inputs.inertial import GyroZero
from wheel_terra_lab.traction_filter.soil import FloatArray, SoilLogs, named_soil


@dataclass(frozen=True)
class PlaceToPlace:
    """By how much soil varies from place to place, one standard deviation of the logarithm [-].

    Mean coefficients of variation of sand within a site (Phoon and Kulhawy 1999, Canadian
    Geotechnical Journal 36, tables 1 and 3): friction angle 9 %, cone resistance 38 %. The first is
    12 % of the tangent at 37.6 degrees; the second stands for the stiffness, and for want of a
    source of its own for the shear deformation modulus too.
    """

    strength: float = 0.12
    shear_modulus: float = 0.38
    stiffness: float = 0.38


def learned_parameters(
    configuration: Configuration,
    logs: SoilLogs,
    prior_std: FloatArray,
    zero: GyroZero,
    spread: PlaceToPlace = PlaceToPlace(),
) -> dict[str, Any]:
    """Return configuration key -> value, with the deviations ``_std``.

    Soil: the values of ``~/soil``, with deviations widened to hold in another place, but never
    beyond those before the drive. Gyro: the zero stated plus the one learned at rest. The other
    biases as stated: they are not told from the soil. The deviations of sensors are those stated,
    since a start may bring another bias of the same kind.
    """
    places = np.array([spread.strength, spread.shear_modulus, spread.stiffness])
    wide = np.maximum(logs.std, np.minimum(np.hypot(logs.std, places), prior_std))
    names, soil, stds = named_soil(configuration, SoilLogs(logs.mean, wide))
    found: dict[str, Any] = {}
    for key, value, std in zip(names, soil.tolist(), stds.tolist(), strict=True):
        found[key] = value
        found[_deviation(key)] = std
    sensors = configuration.sensors
    rate = sensors.angular_rate_bias + np.array([0.0, zero.pitch, zero.yaw])
    for name, values in (
        ('torque_zero', sensors.torque_zero),
        ('torque_gain', sensors.torque_gain),
        ('sinkage_zero', sensors.sinkage_zero),
        ('specific_force_bias', sensors.specific_force_bias),
        ('angular_rate_bias', rate),
    ):
        found[f'sensors.{name}'] = values.tolist()
        found[f'sensors.{name}_std'] = float(getattr(sensors, f'{name}_std'))
    return found


def _deviation(key: str) -> str:
    """Return the key of the standard deviation of a key."""
    name = key.removesuffix('_deg')
    return f'{name}_std_deg' if name != key else f'{key}_std'
