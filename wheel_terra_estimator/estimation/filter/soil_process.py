# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Process model of soil and shear-model errors: they change with travel, not with time."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.filter.initial_state import SoilPriors
from wheel_terra_estimator.estimation.filter.state import (
    CENTROID,
    RUT_SHARE,
    SHEAR_MODULUS,
    SHEAR_STRENGTH,
    SLIP_SINKAGE,
    Prediction,
    StateLayout,
)


@dataclass(frozen=True)
class SoilTuning:
    """Random walks per root metre of travel at ``filter.soil_walk`` 1.

    Tuned on simulated drives, seeds 1000 to 1019.
    """

    memory: float = 100.0  # travel over which the soil reverts to the configured one [m]
    strength_walk: float = 0.1  # [ln]
    shear_modulus_walk: float = 0.1  # [ln]
    slip_sinkage_walk: float = 0.05
    centroid_walk: float = 0.05
    rut_share_walk: float = 0.02
    stiffness_walk: float = 0.15  # of all wheels together [ln]
    own_stiffness_walk: float = 0.3  # of each wheel [ln]
    soft_is_weak: float = 0.7  # correlation of a wheel's own stiffness and strength [-]
    common_error_length: float = 5.0
    """Correlation length [m] of the error of the shear model common to all wheels, which is that of
    the law. A wheel's own error, that of the place, has ``filter.shear_error_length``. Tuned on
    seeds 1001 (simulators A, B) and 5003 (C)."""
    strength_spread: float = 2.0
    """Spread of the strength between wheels over that of the errors of the shear model that torques
    show [-]."""


_TUNING = SoilTuning()


class SoilProcess:
    """Predicts soil and errors of the shear model; it has no memory of its own."""

    def __init__(self, configuration: Configuration, layout: StateLayout) -> None:
        priors = SoilPriors.from_configuration(configuration)
        n = layout.wheel_count
        self._layout = layout
        self._walk = float(configuration.filter.soil_walk) ** 2
        self._error_length = float(configuration.filter.shear_error_length)
        self._error_variance = priors.shear_error_std**2
        self._each = np.eye(n)
        self._mean = np.full((n, n), 1.0 / n)
        self._mean_variance = self._error_variance + n * priors.shear_error_common_std**2
        self._stiffness = _TUNING.stiffness_walk**2 + self._each * _TUNING.own_stiffness_walk**2

    def predict(self, prediction: Prediction, travel: float, *, torque_known: bool) -> None:
        """Add the soil to a prediction over a `travel` [m]."""
        layout = self._layout
        mean, F, Q = prediction
        walk = self._walk * travel
        forget = math.exp(-travel / _TUNING.memory)
        for index, std in (
            (SHEAR_STRENGTH, _TUNING.strength_walk),
            (SHEAR_MODULUS, _TUNING.shear_modulus_walk),
            (SLIP_SINKAGE, _TUNING.slip_sinkage_walk),
            (CENTROID, _TUNING.centroid_walk),
        ):
            mean[index] *= forget
            F[index, index] = forget
            Q[index, index] = std**2 * walk
        Q[RUT_SHARE, RUT_SHARE] = _TUNING.rut_share_walk**2 * walk
        k, e = layout.stiffness, layout.shear_error
        Q[k, k] = self._stiffness * walk
        hold = math.exp(-travel / self._error_length)
        common = math.exp(-travel / _TUNING.common_error_length)
        mean[e] = hold * mean[e] + (common - hold) * mean[e].mean()
        F[e, e] = hold * self._each + (common - hold) * self._mean
        own = self._error_variance * (1.0 - hold * hold)
        shared = self._mean_variance * (1.0 - common * common)
        Q[e, e] = own * self._each + (shared - own) * self._mean
        if not torque_known:
            # Softer ground is weaker ground: without torques the sinkage indicates the strength.
            Q[e, e] += (_TUNING.strength_spread**2 - 1.0) * own * self._each
            both = _TUNING.own_stiffness_walk * math.sqrt(walk * own) * _TUNING.strength_spread
            Q[k, e] = Q[e, k] = _TUNING.soft_is_weak * both * self._each
