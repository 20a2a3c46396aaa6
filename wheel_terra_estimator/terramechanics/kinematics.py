# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Slip ratio and what follows from it for the soil under the rim."""

from __future__ import annotations

import numpy as np

from wheel_terra_estimator.arrays import FloatArray, Quantity

# A locked wheel (s = -1) has v/w without bound; this floor on 1 + s keeps it finite, with a shear
# that is saturated long before.
_LOCKED = 1e-6
STEADY_SLIP = 0.95  # |s| above which no steady state is known [-]


def slip_ratio(speed: Quantity, rim_speed: Quantity, rest_speed: float = 2e-3) -> FloatArray:
    """Slip ratio s of a wheel from its ground speed and its rim speed.

    Driving (``|v| <= |r w|``): s = 1 - v/(r w). Braking or skidding: s = r w/v - 1. Symmetric in
    direction. If v opposes r w and ``|r w|`` exceeds `rest_speed`, s = 1; a wheel held still while
    the rover moves has s = -1.

    ``speed``, ``rim_speed``: ground speed v and rim speed r w, any common shape [m/s].
    ``rest_speed``: below it a speed counts as rest [m/s]. Returns the slip ratio in [-1, 1]; nan
    where both speeds are below `rest_speed`.
    """
    v, rw = np.broadcast_arrays(np.asarray(speed, float), np.asarray(rim_speed, float))
    turning, moving = np.abs(rw) > rest_speed, np.abs(v) > rest_speed
    with np.errstate(divide='ignore', invalid='ignore'):
        driving = 1.0 - v / rw
        braking = rw / v - 1.0
    slip = np.where(np.abs(v) <= np.abs(rw), driving, braking)
    slip = np.where(turning & (v * rw < 0.0), 1.0, slip)
    slip = np.where(~turning & moving, -1.0, slip)
    return np.clip(np.where(turning | moving, slip, np.nan), -1.0, 1.0)


def speed_ratio(slip: Quantity) -> FloatArray:
    """Return v/(r w) for a slip ratio [-]."""
    driving = 1.0 - slip
    braking = 1.0 / np.maximum(1.0 + slip, _LOCKED)
    return np.where(slip >= 0.0, driving, braking)


def slip_of_speed_ratio(ratio: Quantity) -> FloatArray:
    """Return the slip ratio for u = v/(r w); the inverse of `speed_ratio` for u >= 0 [-]."""
    driving = 1.0 - np.maximum(ratio, 0.0)
    braking = 1.0 / np.maximum(ratio, 1.0) - 1.0
    return np.where(ratio <= 1.0, driving, braking)
