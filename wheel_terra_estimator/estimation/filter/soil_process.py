# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Process model of soil and shear-model errors: they change with travel, not with time."""

from __future__ import annotations

import math

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

# Random walks per root metre of travel at ``filter.soil_walk`` 1; tuned on simulated drives, seeds
# 1000 to 1019.
_MEMORY = 100.0  # travel over which the soil reverts to the configured one [m]
_STRENGTH_WALK = 0.1  # [ln]
_SHEAR_MODULUS_WALK = 0.1  # [ln]
_SLIP_SINKAGE_WALK = 0.05
_CENTROID_WALK = 0.05
_RUT_SHARE_WALK = 0.02
_STIFFNESS_WALK = 0.15  # of all wheels together [ln]
_OWN_STIFFNESS_WALK = 0.3  # of each wheel [ln]
_SOFT_IS_WEAK = 0.7  # correlation of a wheel's own stiffness and strength [-]
_COMMON_ERROR_LENGTH = 5.0
"""Correlation length [m] of the error of the shear model common to all wheels, which is that of
the law. A wheel's own error, that of the place, has ``filter.shear_error_length``. Tuned on
seeds 1001 (simulators A, B) and 5003 (C)."""
_STRENGTH_SPREAD = 2.0
"""Spread of the strength between wheels over that of the errors of the shear model that torques
show [-]."""


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
        self._stiffness = _STIFFNESS_WALK**2 + self._each * _OWN_STIFFNESS_WALK**2

    def predict(self, prediction: Prediction, travel: float, *, torque_known: bool) -> None:
        """Add the soil to a prediction over a `travel` [m]."""
        layout = self._layout
        mean, F, Q = prediction
        walk = self._walk * travel
        forget = math.exp(-travel / _MEMORY)
        for index, std in (
            (SHEAR_STRENGTH, _STRENGTH_WALK),
            (SHEAR_MODULUS, _SHEAR_MODULUS_WALK),
            (SLIP_SINKAGE, _SLIP_SINKAGE_WALK),
            (CENTROID, _CENTROID_WALK),
        ):
            mean[index] *= forget
            F[index, index] = forget
            Q[index, index] = std**2 * walk
        Q[RUT_SHARE, RUT_SHARE] = _RUT_SHARE_WALK**2 * walk
        k, e = layout.stiffness, layout.shear_error
        Q[k, k] = self._stiffness * walk
        hold = math.exp(-travel / self._error_length)
        common = math.exp(-travel / _COMMON_ERROR_LENGTH)
        mean[e] = hold * mean[e] + (common - hold) * mean[e].mean()
        F[e, e] = hold * self._each + (common - hold) * self._mean
        own = self._error_variance * (1.0 - hold * hold)
        shared = self._mean_variance * (1.0 - common * common)
        Q[e, e] = own * self._each + (shared - own) * self._mean
        if not torque_known:
            # Softer ground is weaker ground: without torques the sinkage indicates the strength.
            Q[e, e] += (_STRENGTH_SPREAD**2 - 1.0) * own * self._each
            both = _OWN_STIFFNESS_WALK * math.sqrt(walk * own) * _STRENGTH_SPREAD
            Q[k, e] = Q[e, k] = _SOFT_IS_WEAK * both * self._each
