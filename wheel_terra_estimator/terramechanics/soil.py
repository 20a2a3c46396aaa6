# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Soil parameters of the wheel-soil model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

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

    def bearing(self, width: Quantity, gravity: float) -> tuple[Any, Any]:
        """Pressure at the reference depth [Pa], and that depth [m], of a wheel of a width [m]."""
        return bearing_law(
            self.pressure_law,
            self.cohesive_modulus,
            self.frictional_modulus,
            width,
            self.cohesion,
            self.density * gravity,
        )
