# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Soil parameters of the wheel-soil model."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass

import numpy as np

from wheel_terra_estimator.arrays import Quantity
from wheel_terra_estimator.terramechanics.checks import check_range
from wheel_terra_estimator.terramechanics.stresses import bearing_law

PRESSURE_LAWS = ('bekker', 'reece')


@dataclass(frozen=True)
class Soil:
    """Soil parameters as the model without any effect uses them.

    Every number is a float, or an array that broadcasts against the operating points.
    """

    # kc [N/m^(n+1)] in p = (kc/b + kphi) z^n (Bekker); kc' [-] in p = (c kc' + density g b kphi')
    # (z/b)^n (Reece)
    cohesive_modulus: Quantity
    frictional_modulus: Quantity  # kphi [N/m^(n+2)] (Bekker) or kphi' [-] (Reece)
    sinkage_exponent: Quantity  # n0 [-]
    cohesion: Quantity  # c [Pa]
    friction_angle: Quantity  # phi [rad]
    shear_modulus: Quantity  # K, shear deformation modulus of Janosi and Hanamoto [m]
    # c1 = angle of greatest stress over entrance angle at zero slip [-]
    peak_stress_ratio: Quantity = 0.4
    # c3 = leaving angle over entrance angle [-], zero or negative
    leaving_angle_ratio: Quantity = 0.0
    density: Quantity = 1600.0  # bulk density [kg/m^3]
    pressure_law: str = 'bekker'  # ``bekker`` or ``reece``; says how the two moduli are read

    def __post_init__(self) -> None:
        if self.pressure_law not in PRESSURE_LAWS:
            raise ValueError(
                f'pressure law is {self.pressure_law!r}; allowed is one of {PRESSURE_LAWS}'
            )
        # kc may be slightly negative in fits to plates of two sizes; what counts is kc/b + kphi.
        check_range('cohesive modulus', self.cohesive_modulus)
        check_range('frictional modulus', self.frictional_modulus, 0.0)
        check_range('sinkage exponent', self.sinkage_exponent, 0.0, 4.0, open_lower=True)
        check_range('cohesion', self.cohesion, 0.0, unit='Pa')
        check_range('friction angle', self.friction_angle, 0.0, np.pi / 3, unit='rad')
        check_range('shear deformation modulus', self.shear_modulus, 0.0, unit='m', open_lower=True)
        check_range('peak stress ratio', self.peak_stress_ratio, 0.0, 1.0)
        check_range('leaving angle ratio', self.leaving_angle_ratio, -1.5, 0.0)
        check_range('density', self.density, 0.0, unit='kg/m^3')

    def bearing(self, width: Quantity, gravity: float) -> tuple[Quantity, Quantity]:
        """Pressure at the reference depth [Pa], and that depth [m], of a wheel of a width [m]."""
        return bearing_law(
            self.pressure_law,
            self.cohesive_modulus,
            self.frictional_modulus,
            width,
            self.cohesion,
            self.density * gravity,
        )


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
