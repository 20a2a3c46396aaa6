# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Equilibrium slip: at it the configured soil gives the required traction coefficient."""

from __future__ import annotations

from bisect import bisect_left
from functools import cached_property

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.contacts.contact_models import contact_models
from wheel_terra_estimator.estimation.contacts.measured_wheels import torque_of_slip
from wheel_terra_estimator.estimation.contacts.wheel_models import WheelModels, WheelStates
from wheel_terra_estimator.estimation.rover import Rover
from wheel_terra_estimator.terramechanics.kinematics import speed_ratio

_SLIPS = (-0.5, -0.3, -0.2, -0.1, -0.05, 0.0, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.75, 0.9)
"""Slips of the curve, close together where it is steep."""
_MOST_ON_LEVEL = 0.3  # slip of a rover that drives on level ground, whatever it is [-]
_ROLLING_RESISTANCE = 0.1  # of measured wheels on loose soil, over the load [-]
_BISECTIONS = 20  # of the logarithm of the sinkage: to a hundred thousandth
_SHALLOWEST = 1e-4  # least sinkage looked at [m]
_DEEPEST = 0.9  # greatest sinkage looked at, over the radius [-]


class EquilibriumSlip:
    """Inverse of the steady traction curve of the whole rover on the configured soil.

    At each slip each wheel stands at the sinkage at which the bearing law carries its load on level
    ground; its pull there already includes its rolling resistance (closed form, Ding et al. 2015).
    The curve is computed when it is first needed: with a reference velocity it never is.
    """

    def __init__(self, configuration: Configuration, rover: Rover) -> None:
        self._configuration, self._rover = configuration, rover

    def at(self, demand: float, beyond: float) -> float:
        """Return the slip [-] for a required traction coefficient (pull over load) [-].

        `beyond` is the upper limit, returned also where the soil cannot give this pull.
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
        all_slips = np.array(_SLIPS)
        shares = steady_pull(models, rover, all_slips)
        carries = np.interp(_MOST_ON_LEVEL, all_slips, shares) > 0.0
        if not (self._configuration.soil_stated or carries):
            # The default soil would immobilise this rover on level ground, so it does not apply.
            shares = torque_of_slip(all_slips) - _ROLLING_RESISTANCE
        pulls: list[float] = []
        slips: list[float] = []
        for slip, share in zip(_SLIPS, shares.tolist(), strict=True):
            if pulls and share <= pulls[-1]:
                continue
            pulls.append(share)
            slips.append(slip)
        return pulls, slips


def steady_pull(
    models: WheelModels,
    rover: Rover,
    slip: FloatArray,
    *,
    strength: float = 0.0,
    shear_modulus: float = 0.0,
    stiffness: float = 0.0,
) -> FloatArray:
    """Return the pull of the whole rover over its load on level ground, at slips (m,) [-].

    The three factors are those of the filter's state: logarithms, 0 for the configured soil.
    """
    load = rover.load.loads((0.0, 0.0, rover.gravity))
    wheels = WheelStates(
        speed_ratio(slip)[:, None], 0.0, load, strength, shear_modulus, stiffness=stiffness
    )
    sinkage = steady_sinkage(models, wheels, np.array(rover.rim_radius))
    _, pull = models.torque_and_pull(wheels._replace(sinkage=sinkage))
    return np.asarray(pull.sum(-1) / load.sum())


def steady_sinkage(models: WheelModels, wheels: WheelStates, radius: FloatArray) -> FloatArray:
    """Return the sinkages at which the bearing law carries the loads of n wheels, (..., n) [m]."""
    shape = np.broadcast_shapes(np.shape(wheels.speed_ratio), radius.shape)
    low, high = np.full(shape, _SHALLOWEST), np.broadcast_to(_DEEPEST * radius, shape)
    for _ in range(_BISECTIONS):
        z = np.sqrt(low * high)
        sinks = models.bearing(wheels._replace(sinkage=z)).load < wheels.load
        low, high = np.where(sinks, z, low), np.where(sinks, high, z)
    return high
