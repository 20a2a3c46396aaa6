# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Slip-sinkage by backward flow of soil, constructed from a slip surface.

Ding et al. 2010, equations 3 to 8 (doi 10.1007/s11771-010-0021-7), their geometry completed here.
A diagnostic: the load balance contains this part already (through the peak angle), so it must not
be added to the model's sinkage.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from wheel_terra_estimator.terramechanics.checks import check_range


@dataclass(frozen=True)
class SlipSurface:
    """Log spiral below the rear of the contact.

    Attributes
    ----------
    centre : tuple of float
        O', forward and up from the lowest point of the rim [m].
    first_radius, first_angle : float
        rho0 [m] and alpha0 [rad], at the point of greatest stress.
    passive_angle : float
        Xc = pi/4 - phi/2, rise of the straight part [rad].
    friction_angle : float
        phi [rad].
    """

    centre: tuple[float, float]
    first_radius: float
    first_angle: float
    passive_angle: float
    friction_angle: float

    def point(self, angle: float) -> tuple[float, float]:
        """Point of the spiral rho = rho0 exp((alpha - alpha0) tan phi) (equation 3) [m]."""
        radius = self.first_radius * math.exp(
            (angle - self.first_angle) * math.tan(self.friction_angle)
        )
        x, y = self.centre
        return x + radius * math.cos(angle), y - radius * math.sin(angle)


def slip_surface(
    radius: float, peak_angle: float, leaving_angle: float, friction_angle: float
) -> SlipSurface:
    """Spiral through the point of greatest stress A (equations 4 to 6).

    O' is where the radius through A, in the direction of the greatest principal stress
    (alpha0 = pi/4 + phi/2 - tm), meets the line through the leaving point E that rises at Xc.

    Parameters
    ----------
    radius, peak_angle, leaving_angle, friction_angle : float
        r [m], tm, t2, phi [rad].
    """
    check_range('radius', radius, 0.0, unit='m', open_lower=True)
    check_range('peak angle', peak_angle, 0.0, math.pi / 2, 'rad', open_lower=True)
    check_range('leaving angle', leaving_angle, -math.pi / 2, 0.0, 'rad')
    check_range('friction angle', friction_angle, 0.0, math.pi / 3, 'rad')
    passive = math.pi / 4 - friction_angle / 2
    first = math.pi / 4 + friction_angle / 2 - peak_angle
    x_a, y_a = radius * math.sin(peak_angle), radius * (1.0 - math.cos(peak_angle))
    x_e, y_e = radius * math.sin(leaving_angle), radius * (1.0 - math.cos(leaving_angle))
    x = (y_a - y_e + x_a * math.tan(first) + x_e * math.tan(passive)) / (
        math.tan(first) + math.tan(passive)
    )
    y = y_a + math.tan(first) * (x_a - x)
    return SlipSurface((x, y), math.hypot(x_a - x, y_a - y), first, passive, friction_angle)


def longitudinal_slip_sinkage(
    slip: float, radius: float, peak_angle: float, leaving_angle: float, friction_angle: float
) -> float:
    """Sinkage gained because soil that sticks to the rim moves with it (equations 7 and 8) [m].

    While point A rolls down to the bottom, the hub advances r (1 - s) tm; the depth of the slip
    surface at that place is the sinkage gained. Zero at s = 0, grows with slip, finite at s = 1;
    nan where the surface ends before that place.

    Parameters
    ----------
    slip : float
        In [0, 1].
    radius, peak_angle, leaving_angle, friction_angle : float
        r [m], tm > 0, t2 <= 0, phi [rad].
    """
    if not 0.0 <= slip <= 1.0:
        raise ValueError(f'slip is {slip:g}; allowed is [0, 1]: the construction is for driving')
    surface = slip_surface(radius, peak_angle, leaving_angle, friction_angle)
    target = radius * (1.0 - slip) * peak_angle
    low, high = surface.first_angle, math.pi - surface.passive_angle
    if target >= surface.point(low)[0]:
        return 0.0
    if target < surface.point(high)[0]:
        return math.nan
    # x falls along the spiral over this range: bisection.
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if surface.point(middle)[0] > target else (low, middle)
    return max(0.0, -surface.point(low)[1])
