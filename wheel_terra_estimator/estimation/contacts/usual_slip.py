# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Slip at which the configured soil gives the pull that the ground asks: what is usual there."""

from __future__ import annotations

import math
from bisect import bisect_left
from functools import cached_property

from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.contacts.contact_models import contact_models
from wheel_terra_estimator.estimation.contacts.wheel_models import WheelModels, WheelState
from wheel_terra_estimator.estimation.rover import Rover

_SLIPS = (-0.5, -0.3, -0.2, -0.1, -0.05, 0.0, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.75, 0.9)
"""Slips of the curve, close together where it is steep."""
_BISECTIONS = 20  # of the logarithm of the sinkage: to a hundred thousandth
_SHALLOWEST = 1e-4  # sinkage [m]
_DEEPEST = 0.9  # of the radius


class UsualSlip:
    """Steady traction curve of the whole rover on the configured soil, read backwards.

    Each wheel stands at the sinkage at which the bearing law carries its load on level ground, at
    each slip; its pull there holds its resistance already (closed form, Ding et al. 2015). The
    curve is worked out when it is first asked for: with a reference velocity it never is.

    Parameters
    ----------
    configuration : Configuration
        Soil, wheels, effects.
    rover : Rover
        Its constants.
    """

    def __init__(self, configuration: Configuration, rover: Rover) -> None:
        self._configuration, self._rover = configuration, rover

    def at(self, demand: float, beyond: float) -> float:
        """Return the slip for what is asked, as a share of the load [-].

        `beyond` is the most that is returned, and what is where the soil does not give as much.
        """
        pulls, slips = self.curve
        after = bisect_left(pulls, demand)
        if after == len(pulls):
            return beyond
        if after == 0:
            return slips[0]
        low, high = pulls[after - 1], pulls[after]
        share = (demand - low) / (high - low)
        return min(slips[after - 1] + share * (slips[after] - slips[after - 1]), beyond)

    @cached_property
    def curve(self) -> tuple[list[float], list[float]]:
        """Pull over load and slip, both increasing, up to the greatest pull."""
        models, rover = contact_models(self._configuration), self._rover
        pulls: list[float] = []
        slips: list[float] = []
        for slip in _SLIPS:
            share = steady_pull(models, rover, slip)
            if pulls and share <= pulls[-1]:
                continue
            pulls.append(share)
            slips.append(slip)
        return pulls, slips


def steady_pull(
    models: WheelModels,
    rover: Rover,
    slip: float,
    *,
    strength: float = 0.0,
    shear_modulus: float = 0.0,
    stiffness: float = 0.0,
) -> float:
    """Return the pull of the whole rover over its load on level ground [-].

    The three factors are those of the filter's state: logarithms, 0 for the configured soil.
    """
    loads = rover.load.loads((0.0, 0.0, rover.gravity)).tolist()
    ratio = 1.0 - slip if slip >= 0.0 else 1.0 / (1.0 + slip)
    pull = 0.0
    for i, load in enumerate(loads):
        wheel = WheelState(ratio, 0.0, load, strength, shear_modulus, stiffness=stiffness)
        sinkage = steady_sinkage(models, i, wheel, rover.rim_radius[i])
        pull += models.forces(i, wheel._replace(sinkage=sinkage)).pull
    return pull / sum(loads)


def steady_sinkage(models: WheelModels, index: int, wheel: WheelState, radius: float) -> float:
    """Return the sinkage at which the bearing law carries the load of a wheel [m]."""
    low, high = _SHALLOWEST, _DEEPEST * radius
    for _ in range(_BISECTIONS):
        z = math.sqrt(low * high)
        if models.bearing(index, wheel._replace(sinkage=z)).load < wheel.load:
            low = z
        else:
            high = z
    return high
