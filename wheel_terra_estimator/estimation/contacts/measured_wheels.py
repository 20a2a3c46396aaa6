# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Typical slip at a torque on any loose soil, from single-wheel measurements.

Over load and radius, the torque of wheels on very different soils follows one curve of the form of
Janosi and Hanamoto (1961), u = u_max (1 - exp(-s / s_0)). HIT's smooth and lugged wheel (Ding et
al. 2011) and KLS-1's two (Wang and Han 2016) have u_max of 0.42 to 0.62 and s_0 of 0.05 to 0.18.
"""

from __future__ import annotations

import math
from math import isnan
from typing import NamedTuple

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.estimation.scalars import NAN

# The curve and its spread, with that of wheels in three simulators of different laws.
_GREATEST_TORQUE = 0.55  # u_max, over load times radius [-]
_GREATEST_TORQUE_STD = 0.17  # [ln]
_SLIP_SCALE = 0.17  # s_0 [-]
_SLIP_SCALE_STD = 0.6  # [ln]
_LEAST_STD = 0.04  # of the slip [-]: the torque of rolling without pull
_MOST_MOBILISED = 0.9  # of the greatest torque: beyond, the curve is flat and not used


class SlipOfTorque(NamedTuple):
    """Slip and its standard deviation [-]; nan = nothing is known."""

    slip: float
    std: float


def torque_of_slip(slip: FloatArray) -> FloatArray:
    """Return the torque of measured wheels over load times radius at slips [-]; odd in the slip."""
    return np.sign(slip) * _GREATEST_TORQUE * -np.expm1(-np.abs(slip) / _SLIP_SCALE)


def slip_of_torque(coefficient: float) -> SlipOfTorque:
    """Return the slip of measured wheels at a torque over load times radius [-], nan = unknown.

    Negative where the wheels brake. Valid on loose soil, for wheels that roll straight; near the
    greatest torque, and beyond, nothing is returned.
    """
    share = abs(coefficient) / _GREATEST_TORQUE
    if isnan(coefficient) or share > _MOST_MOBILISED:
        return SlipOfTorque(NAN, NAN)
    slip = -_SLIP_SCALE * math.log(1.0 - share)
    by_greatest = _SLIP_SCALE * share / (1.0 - share) * _GREATEST_TORQUE_STD
    std = math.hypot(_SLIP_SCALE_STD * slip, by_greatest, _LEAST_STD)
    return SlipOfTorque(math.copysign(slip, coefficient), std)


class SpeedAndVariance(NamedTuple):
    """An estimate of the body speed."""

    speed: float  # [m/s]
    variance: float
    widening: float = 1.0  # of its deviation by the bend of the traction curve [-]


class Opinion(NamedTuple):
    """A second estimate of the body speed, pooled with that of the filter."""

    speed: float  # [m/s]
    variance: float
    share: float  # of the weight by its inverse variance that it has in a pool [-]
    rim: float  # typical rim speed, not 0 [m/s]


def pooled(one: SpeedAndVariance, other: Opinion) -> SpeedAndVariance:
    """Return the linear opinion pool (Stone 1961) of two estimates from the same readings.

    Mean and variance of the mixture of both, weighted by their inverse variances. Consistent
    however strongly their errors are correlated: with the whole weight its variance is never below
    that of covariance intersection, and grows with the square of their difference. It is widened
    where the curve bends.
    """
    difference = other.speed - one.speed
    weight = other.share * one.variance / (one.variance + other.variance)
    variance = (1.0 - weight) * one.variance + weight * other.variance
    spread = weight * (1.0 - weight) * difference**2
    speed, variance = one.speed + weight * difference, variance + spread
    slip, std = 1.0 - speed / other.rim, math.sqrt(max(variance, 0.0)) / abs(other.rim)
    by_curve = _deviation_by_curve(slip, std, other.share * _GREATEST_TORQUE_STD)
    widening = max(by_curve / max(std, _LEAST_STD), 1.0)
    return SpeedAndVariance(speed, variance * widening**2, widening)


def _deviation_by_curve(slip: float, std: float, most: float) -> float:
    """Return half of the distance of the slips at the same torque on stronger and weaker soil [-].

    The greatest torque is off by as much as explains `std` at the tangent of the curve, `most` at
    the most [ln]. Weaker soil takes far more slip than the tangent says, up to 1.
    """
    mobilised = -math.expm1(-max(abs(slip), _LEAST_STD) / _SLIP_SCALE)
    relative = min(std * (1.0 - mobilised) / (_SLIP_SCALE * mobilised), most)
    at_one = -math.expm1(-1.0 / _SLIP_SCALE)
    low, high = (
        -_SLIP_SCALE * math.log(1.0 - min(mobilised * math.exp(change), at_one))
        for change in (-relative, relative)
    )
    return 0.5 * (high - low)
