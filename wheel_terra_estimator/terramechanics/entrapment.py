# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Above a slip of 0.9 there is no steady state: the wheel digs itself in with every turn."""

from __future__ import annotations

import numpy as np

from wheel_terra_estimator.arrays import Quantity
from wheel_terra_estimator.terramechanics.checks import check_range
from wheel_terra_estimator.terramechanics.wheel import Wheel

# Below the first slip nothing is dug beyond the steady sinkage, at the second all of it.
DIGGING_SLIP = (0.85, 1.0)
# Share of the soil between passing lugs that does not fall back; no measurement found, the value
# puts a rover wheel at half its radius within some metres of rim travel, as mission reports tell
# (Purgatory, Troy).
DIGGING_EFFICIENCY = 0.05
# Soil that a smooth rim throws out per turn, a band of a few grains, as a share of its radius.
SMOOTH_BAND = 0.02


def digging_share(slip: Quantity) -> Quantity:
    """Share of full digging at a slip ratio: 0 up to 0.85, 1 at 1, a straight line between [-]."""
    start, full = DIGGING_SLIP
    return np.clip((np.asarray(slip) - start) / (full - start), 0.0, 1.0)


def digging_per_turn(wheel: Wheel, efficiency: float = DIGGING_EFFICIENCY) -> Quantity:
    """Depth gained per turn of a wheel that spins on the spot [m].

    Every lug that passes throws out a share of a layer of its height: efficiency h n, or a thin
    band for a smooth rim.
    """
    check_range('efficiency', efficiency, 0.0, 1.0)
    lugs = np.multiply(wheel.lug_height, wheel.lug_count)
    return efficiency * np.maximum(lugs, np.multiply(SMOOTH_BAND, wheel.radius))


def digging_rate(
    slip: Quantity,  # slip ratio, positive when driving; a braking wheel does not dig itself in
    wheel: Wheel,  # its radius and lugs count
    angular_velocity: Quantity,  # [rad/s], either sign
    efficiency: float = DIGGING_EFFICIENCY,
) -> Quantity:
    """Rate at which a driving wheel digs itself in, beyond its steady sinkage [m/s]."""
    turns = np.abs(angular_velocity) / (2.0 * np.pi)
    return digging_per_turn(wheel, efficiency) * turns * digging_share(slip)
