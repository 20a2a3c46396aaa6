# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What the operator has stated of rover, soil and sensors: with errors, or not at all."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_lab.evaluation.simulator_c.ground import (
    Ground,
    bearing_terms,
    draw_soil,
    pressure,
)
from wheel_terra_lab.evaluation.simulator_c.plans import Kind
from wheel_terra_lab.evaluation.simulator_c.rover import Rover
from wheel_terra_lab.evaluation.simulator_c.sensors import Instruments

_EARTH = 9.80665
_PLATE_DEPTHS = np.linspace(0.004, 0.06, 15)  # of a plate test [m]


def configuration_of(
    rng: np.random.Generator, kind: Kind, rover: Rover, instruments: Instruments, soil: Ground
) -> Configuration:
    """Return the configuration that the estimator is given."""
    stated = _lines(rng, rover)
    if kind.file != 'lines':
        stated |= _details(rng, rover)
        stated |= _sensors(rng, instruments)
        what = rng.choice(['near', 'other', 'none'], p=[0.4, 0.15, 0.45])
        if what != 'none':
            known = soil if what == 'near' else draw_soil(rng)
            stated |= _soil(rng, known, rover)
    return reader.from_parameters(stated, source='rover file of simulator C')


def _lines(rng: np.random.Generator, rover: Rover) -> dict[str, Any]:
    """Return geometry and mass, as measured with tape and scales."""
    rims, n = rover.rims, rover.count
    tape = rng.normal(1.0, 0.003)
    stated: dict[str, Any] = {
        'wheels.names': [f'wheel_{i // 2}_{"lr"[i % 2]}' for i in range(n)],
        'wheels.radius': _rounded(rims.radius * tape, 4),
        'wheels.width': _rounded(rims.width, 3),
        'wheels.x': _rounded(rover.x, 3),
        'wheels.y': _rounded(rover.y, 3),
        'rover.mass': float(rover.mass * rng.normal(1.0, 0.015)),
    }
    if rims.lug_height[0] > 0.0:
        stated['wheels.lug_height'] = _rounded(rims.lug_height, 4)
    if abs(rover.gravity - _EARTH) > 0.1:
        stated['rover.gravity'] = rover.gravity
    if rover.steered.any():
        stated['wheels.steering_joints'] = [
            f'steer_{i}' if s else '' for i, s in enumerate(rover.steered)
        ]
    return stated


def _details(rng: np.random.Generator, rover: Rover) -> dict[str, Any]:
    """Return what a careful operator adds."""
    x, y, height = rover.centre
    length = rover.x.max()
    stated: dict[str, Any] = {
        'rover.centre_of_gravity': [
            float(x + rng.normal(0.0, 0.03) * length),
            float(y + rng.normal(0.0, 0.005) * length),
            float((height - rover.rims.radius[0]) * rng.normal(1.0, 0.1)),
        ],
        'wheels.lug_count': [int(c) for c in rover.lug_count],
    }
    if rng.uniform() < 0.5:
        stated['wheels.torque_limit'] = [float(v) for v in rover.motors.limit]
    if rng.uniform() < 0.5:
        stated['wheels.passes'] = [1 + i // 2 for i in range(rover.count)]
    if rover.family.suspension == 'rocker_bogie':
        pivot = float(rover.x[0] - rover.modes[0, 2])
        bogie = float(rover.x[2] - rover.modes[2, 4])
        above = rover.bogie_height - float(rover.rims.radius[0])
        stated['rover.suspension'] = 'rocker_bogie'
        stated['rover.rocker_pivot'] = [pivot, above + 0.3 * length]
        stated['rover.bogie_pivot'] = [bogie, above]
    return stated


def _sensors(rng: np.random.Generator, instruments: Instruments) -> dict[str, Any]:
    """Return what the data sheets say, each wrong by a third or so."""

    def sheet(value: float) -> float:
        return float(value * np.exp(rng.normal(0.0, 0.25)))

    stated = {
        'sensors.wheel_odometry_rate': instruments.odometry_rate,
        'sensors.imu_rate': instruments.imu_rate,
        'sensors.torque_std': sheet(instruments.torque_std),
        'sensors.wheel_rate_std': sheet(
            0.5 * instruments.encoder_step * instruments.odometry_rate + 1e-4
        ),
        'sensors.specific_force_std': sheet(
            float(np.hypot(instruments.force_std, instruments.vibration))
        ),
    }
    if instruments.sinkage_rate:
        stated['sensors.sinkage_rate'] = instruments.sinkage_rate
        stated['sensors.sinkage_std'] = sheet(instruments.sinkage_std)
    if instruments.reference_rate:
        stated['sensors.reference_rate'] = instruments.reference_rate
        stated['sensors.reference_std'] = sheet(instruments.reference_std)
        stated['sensors.reference_delay'] = sheet(instruments.reference_lag)
    return stated


def _soil(rng: np.random.Generator, soil: Ground, rover: Rover) -> dict[str, Any]:
    """Return Bekker's and Janosi's parameters of a soil, as plate and shear tests give them."""
    terms = bearing_terms(soil, rover.rims.width[0], rover.gravity)
    found = pressure(terms, _PLATE_DEPTHS)
    exponent, logarithm = np.polyfit(np.log(_PLATE_DEPTHS), np.log(found), 1)

    def off(value: NDArray[np.float64] | float, share: float = 0.2) -> float:
        return float(value * np.exp(rng.normal(0.0, share)))

    exponent_stated = off(exponent, 0.07)
    middle = 0.02  # the depth at which a wrong exponent leaves the pressure as it is [m]
    modulus = np.exp(logarithm) * middle ** (exponent - exponent_stated)
    stated = {
        'soil.cohesive_modulus': 0.0,
        'soil.frictional_modulus': off(modulus),
        'soil.sinkage_exponent': exponent_stated,
        'soil.cohesion': off(soil.cohesion, 0.3),
        'soil.friction_angle_deg': float(
            np.degrees(np.arctan(soil.friction)) + rng.normal(0.0, 2.0)
        ),
        'soil.shear_modulus': off(soil.shear_length),
        'soil.density': off(soil.density, 0.05),
    }
    if rng.uniform() < 0.6:
        stated['soil.relative_std'] = float(rng.uniform(0.15, 0.35))
    return stated


def _rounded(values: NDArray[np.float64], digits: int) -> list[float]:
    return [round(float(v), digits) for v in values]
