# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Soil numbers that are a thousand times off: stated in kPa, kN or mm."""

from __future__ import annotations

from collections.abc import Collection, Iterator

from wheel_terra_estimator.terramechanics.soil import Soil

# Of 38 soils of the literature (config/soils): c from 50 to 6100 Pa, kphi from 1.8e5 to 8e6
# N/m^(n+2), K from 0.5 to 200 mm, density from 1200 to 2000 kg/m^3; fits may leave that.
LEAST_COHESION = 10.0  # [Pa]
LEAST_MODULUS = 1e4  # [N/m^(n+2)] of kphi
GREATEST_SHEAR_MODULUS = 0.3  # [m]
LEAST_DENSITY = 20.0  # [kg/m^3]
LEAST_FRICTION_ANGLE = 0.02  # [rad]; 34 degrees stated in radians are 0.6 degrees


def doubtful_units(soil: Soil, stated: Collection[str]) -> Iterator[tuple[str, str]]:
    """Yield key and words of stated soil numbers that look as if they were in another unit.

    ``soil``: one soil (floats). ``stated``: keys that a file states; of the others nothing is said.
    """
    bekker = soil.pressure_law == 'bekker'
    for field, wrong, words in (
        ('cohesion', 0.0 < soil.cohesion < LEAST_COHESION, 'Pa; in kPa? then times 1000'),
        (
            'frictional_modulus',
            bekker and 0.0 < soil.frictional_modulus < LEAST_MODULUS,
            'N/m^(n+2); in kN? then kc and kphi times 1000',
        ),
        (
            'shear_modulus',
            soil.shear_modulus > GREATEST_SHEAR_MODULUS,
            'm; in mm? then divided by 1000',
        ),
        ('density', soil.density < LEAST_DENSITY, 'kg/m^3; in g/cm^3? then times 1000'),
        (
            'friction_angle_deg',
            0.0 < soil.friction_angle < LEAST_FRICTION_ANGLE,
            'rad; stated in radians where degrees are wanted?',
        ),
    ):
        key = f'soil.{field}'
        if wrong and key in stated:
            value = getattr(soil, field.removesuffix('_deg'))
            yield key, f'{key} is {value:.4g} {words}'
