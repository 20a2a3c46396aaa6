# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Torque coefficients of all wheels on the one traction curve of the rover, with derivatives.

Each wheel has its own slip, from its own rim speed and ground speed, and its own sideways motion.
Shear acts against the sum of both (friction circle): with s the slip ratio and b the sideways
speed over the larger of rim and ground speed, the part along the wheel is that of
sigma = sqrt(s^2 + b^2), times s / sigma.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wheel_terra_lab.traction_filter.steady_wheel import TorqueCurves

FloatArray = NDArray[np.float64]

OFFSET, LOG_SCALE, LOG_STRENGTH, WHEELS = range(4)
"""Places in the state: offset of the slip, ln of slip scale and of strength, strength by wheel."""
_LEAST_SPEED = 1e-3  # [m/s], of a wheel that hardly moves
_LEAST_SLIP = 1e-5  # of the sum of slip and sideways motion [-]


class WheelSpeeds(NamedTuple):
    """Speeds of all wheels, (n,) each."""

    rim: FloatArray  # [m/s]; 0 where unknown
    ground: FloatArray  # along the wheel's heading [m/s]
    sideways: FloatArray  # across it [m/s]


class Coefficients(NamedTuple):
    """Torque over load and radius of each wheel, positive forward, and its derivatives; (n,)."""

    value: FloatArray
    by_ground_speed: FloatArray  # [s/m]
    by_offset: FloatArray
    by_log_scale: FloatArray


def coefficients(curves: TorqueCurves, state: FloatArray, speeds: WheelSpeeds) -> Coefficients:
    """Return what the torque of each wheel should be.

    Parameters
    ----------
    curves : TorqueCurves
        Of the soil file, for the stiffness under each wheel.
    state : numpy.ndarray
        (3 + n,) shift of the curve and ln strength of each wheel.
    speeds : WheelSpeeds
        Of the wheels.

    Notes
    -----
    The derivative by ln strength is the value itself.
    """
    rim, ground, sideways = speeds
    scale = math.exp(state[LOG_SCALE])
    larger = np.maximum(np.maximum(np.abs(rim), np.abs(ground)), _LEAST_SPEED)
    rolling = np.where(rim >= 0.0, 1.0, -1.0)
    slip = (rim - ground) / larger * rolling
    slip_by_ground = (
        np.where(np.abs(rim) >= np.abs(ground), -1.0, -rim * np.sign(ground) / larger) / larger
    ) * rolling
    e = (slip - state[OFFSET]) / scale
    b = sideways / larger / scale
    b_by_ground = np.where(np.abs(rim) >= np.abs(ground), 0.0, -b * np.sign(ground) / larger)
    total = np.sqrt(e * e + b * b + _LEAST_SLIP**2)
    along = np.abs(e) / total
    torque, slope = curves.at(np.where(e >= 0.0, total, -total))
    at_rest = curves.at_zero
    sheared = torque - at_rest
    strength = np.exp(state[LOG_STRENGTH] + state[WHEELS:])
    by_e = strength * (slope * along**2 + np.abs(sheared) * b * b / total**3)
    sign = np.where(e >= 0.0, 1.0, -1.0)
    by_b = strength * (slope * sign * along - sheared * np.abs(e) / total**2) * b / total
    return Coefficients(
        value=strength * (at_rest + sheared * along) * rolling,
        by_ground_speed=(by_e / scale * slip_by_ground + by_b * b_by_ground) * rolling,
        by_offset=-by_e / scale * rolling,
        by_log_scale=-(by_e * e + by_b * b) * rolling,
    )
