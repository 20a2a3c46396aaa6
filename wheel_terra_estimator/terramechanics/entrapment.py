# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Above a slip of 0.9 there is no steady state: the wheel digs itself in with every turn."""

from __future__ import annotations

from typing import Any

import numpy as np

from wheel_terra_estimator.terramechanics.checks import check_range

# Below the first slip nothing is dug beyond the steady sinkage, above the second all of it.
DIGGING_STARTS, DIGGING_FULL = 0.85, 0.95
# Share of the conveyed layer that does not fall back under the wheel; no measurement found, the
# value puts a rover wheel at half its radius within some metres of rim travel, as mission reports
# tell (Purgatory, Troy).
DIGGING_EFFICIENCY = 0.2
# Layer that a smooth rim drags along, about ten grains of fine sand [m].
ENTRAINED_LAYER = 0.002


def digging_share(slip: Any) -> Any:
    """Share of full digging at a slip ratio: 0 below 0.85, 1 above 0.95, smooth between [-]."""
    share = np.clip((np.abs(slip) - DIGGING_STARTS) / (DIGGING_FULL - DIGGING_STARTS), 0.0, 1.0)
    return share * share * (3.0 - 2.0 * share)


def sinkage_growth(
    slip: Any,
    wheel: Any,
    contact_length: Any,
    efficiency: float = DIGGING_EFFICIENCY,
    entrained_layer: float = ENTRAINED_LAYER,
) -> Any:
    """Sinkage gained per metre of rim travel, beyond the steady sinkage [m/m].

    Mass balance: lugs and rim convey a layer h + d backwards; what does not fall back deepens the
    contact, dz/dx = efficiency (h + d)/L.

    Parameters
    ----------
    slip : float or array_like
        Slip ratio; only driving wheels dig.
    wheel : Wheel
        Its lug height counts.
    contact_length : float or array_like
        L = r (t1 - t2) [m], positive.
    """
    check_range('slip', slip, -1.0, 1.0)
    check_range('contact length', contact_length, 0.0, unit='m', open_lower=True)
    check_range('efficiency', efficiency, 0.0, 1.0)
    check_range('entrained layer', entrained_layer, 0.0, unit='m')
    conveyed = wheel.lug_height + entrained_layer
    driving = np.where(np.asarray(slip) > 0.0, digging_share(slip), 0.0)
    return efficiency * driving * conveyed / contact_length


def rim_travel_to_depth(
    sinkage: Any, depth: Any, slip: Any, wheel: Any, efficiency: float = DIGGING_EFFICIENCY
) -> Any:
    """Rim travel until the sinkage reaches a depth at constant slip [m]; inf where it never does.

    The contact lengthens as the wheel sinks, L = r arccos(1 - z/r), so that digging slows down:
    integral of L dz over the conveyed layer, from the geometry of the circle.
    """
    radius = wheel.radius
    for name, value in (('sinkage', sinkage), ('depth', depth)):
        check_range(name, value, 0.0, float(np.min(radius)), 'm')
    rate = sinkage_growth(slip, wheel, 1.0, efficiency)  # times L: layer per rim travel

    def integral(z: Any) -> Any:
        # Int arccos(1 - z/r) dz = r [sin a - a cos a], a = arccos(1 - z/r); times r.
        angle = np.arccos(np.clip(1.0 - np.asarray(z) / radius, -1.0, 1.0))
        return radius * radius * (np.sin(angle) - angle * np.cos(angle))

    missing = np.maximum(integral(depth) - integral(sinkage), 0.0)
    with np.errstate(divide='ignore', invalid='ignore'):
        travel = missing / rate
    return np.where(missing == 0.0, 0.0, np.where(rate > 0.0, travel, np.inf))
