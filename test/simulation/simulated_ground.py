# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A rover, soils and grounds for the tests of the simulation."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.simulation.drives import Drives
from wheel_terra_estimator.simulation.terrain import Ground, Terrain

EFFECTS = [
    'effects.slip_sinkage_exponent.enabled:=true',
    'effects.stress_peak_shift.enabled:=true',
    'effects.lug_shear_radius.enabled:=true',
    'effects.lug_digging.enabled:=true',
    'effects.soil_mound.enabled:=true',
    'effects.multipass.enabled:=true',
    'effects.bulldozing.enabled:=true',
]
SOIL = [
    'soil.cohesive_modulus:=15.6e3',
    'soil.frictional_modulus:=2407.4e3',
    'soil.sinkage_exponent:=1.1',
    'soil.cohesion:=250.0',
    'soil.friction_angle_deg:=31.9',
    'soil.shear_modulus:=0.0114',
    'soil.leaving_angle_ratio:=-0.1',
]


def rover(*parameters: str, effects: Sequence[str] = EFFECTS) -> Configuration:
    return reader.load(['generic_six_wheel'], [*SOIL, *effects, *parameters])


def ground(slope_deg: float = 0.0, side_deg: float = 0.0, **changes: Any) -> Terrain:
    given: dict[str, Any] = {
        'slope_position': np.array([0.0]),
        'slope_angle': np.radians([slope_deg]),
        'side_slope': np.radians(side_deg),
        'patches': [],
        'border': 0.3,
        'base_factors': {},
        'undulation': 0.0,
        'undulation_length': 0.5,
        'patchiness': 0.0,
        'patchiness_length': 0.5,
        'extent': (-10.0, 20.0),
    }
    return Terrain(Ground(**{**given, **changes}), np.random.default_rng(0))


def drives(configuration: Configuration, speed: float = 0.05) -> Drives:
    radius = configuration.wheels.slip_radius
    return Drives(configuration.wheels.torque_limit, speed / radius, 0.1 / radius)
