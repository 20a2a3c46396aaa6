# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What the learned shift of the traction curve says of the soil.

Another soil shifts the curve: strength and shear modulus one deviation off move offset, scale and
strength of the curve by the columns of J. With theta ~ N(0, 1) in deviations, the shift
x = J theta + own error, of covariance S at the start, and x ~ N(m, P) learned (law of total
covariance)::

    theta = G m,   cov(theta) = 1 - G S G^T + G P G^T,   G = J^T S^-1

so that what the curve was not taught leaves the deviation of the soil file.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.filter.initial_state import SoilPriors
from wheel_terra_lab.traction_filter.curve import WHEELS
from wheel_terra_lab.traction_filter.steady_wheel import SteadyWheel

FloatArray = NDArray[np.float64]
STRENGTH, SHEAR_MODULUS, STIFFNESS = range(3)
_MOST_DEVIATIONS = 3.0
"""Of the soil from the configured one, in prior deviations: a curve that is further off is none of
such a soil."""
NAMES = (
    'soil.friction_angle_deg',
    'soil.cohesion',
    'soil.shear_modulus',
    'soil.frictional_modulus',
    'soil.cohesive_modulus',
)
"""Of what is learned of the soil, in the order of `NamedSoil.soil`."""


class SoilLogs(NamedTuple):
    """Logarithms of the factors on strength (c and tan phi), shear and bearing moduli, (3,)."""

    mean: FloatArray
    std: FloatArray


class NamedSoil(NamedTuple):
    """Soil parameters by name, as in the configuration."""

    names: tuple[str, ...]
    soil: FloatArray  # (5,)
    std: FloatArray  # (5,)


def soil_shifts(steady: SteadyWheel, priors: SoilPriors) -> FloatArray:
    """Return J (3, 2): shift of the curve by one deviation of strength and of shear modulus."""
    columns = []
    for name, std in (
        ('strength', priors.strength_std),
        ('shear_modulus', priors.shear_modulus_std),
    ):
        up, down = (steady.shift_to(**{name: sign * std}) for sign in (1.0, -1.0))
        columns.append(
            [
                0.5 * (up.offset - down.offset),
                0.5 * (up.log_scale - down.log_scale),
                0.5 * (up.log_strength - down.log_strength),
            ]
        )
    return np.array(columns).T


class SoilPosterior:
    """Soil of one rover from the state of its curve.

    Parameters
    ----------
    shifts : numpy.ndarray
        (3, 2) of `soil_shifts`.
    start : numpy.ndarray
        (3 + n, 3 + n) covariance of the state at the start of a run.
    priors : SoilPriors
        Deviations of the configured soil.
    """

    def __init__(self, shifts: FloatArray, start: FloatArray, priors: SoilPriors) -> None:
        n = len(start) - WHEELS
        # The strength under all wheels: what they have in common and the mean of their own.
        self._common = np.hstack([np.eye(WHEELS), np.zeros((WHEELS, n))])
        self._common[2, WHEELS:] = 1.0 / n
        prior = self._common @ start @ self._common.T
        self._gain = np.linalg.solve(prior, shifts).T
        self._left = np.eye(2) - self._gain @ shifts
        stiffness = priors.stiffness_std
        self.prior_std = np.array([priors.strength_std, priors.shear_modulus_std, stiffness])

    def logs(self, x: FloatArray, P: FloatArray, stiffness: tuple[float, float]) -> SoilLogs:
        """Return what is known of the soil.

        Parameters
        ----------
        x, P : numpy.ndarray
            (3 + n,) state of the curve and its covariance.
        stiffness : tuple[float, float]
            Mean over the wheels of the logarithm of their factor on the bearing moduli, and its
            deviation.
        """
        gain = self._gain @ self._common
        known = np.clip(gain @ x, -_MOST_DEVIATIONS, _MOST_DEVIATIONS)
        variance = np.diagonal(self._left + gain @ P @ gain.T)
        std = np.sqrt(np.clip(variance, 0.0, 1.0))
        logs = np.append(known * self.prior_std[:STIFFNESS], stiffness[0])
        deviations = np.append(std * self.prior_std[:STIFFNESS], stiffness[1])
        return SoilLogs(logs, np.minimum(deviations, self.prior_std))


def named_soil(configuration: Configuration, logs: SoilLogs) -> NamedSoil:
    """Return the parameters of the soil and their deviations."""
    soil = configuration.soil
    strength, modulus, stiffness = np.exp(logs.mean).tolist()
    strength_std, modulus_std, stiffness_std = logs.std.tolist()
    tangent = math.tan(float(soil.friction_angle)) * strength
    cohesion, shear = float(soil.cohesion) * strength, float(soil.shear_modulus) * modulus
    frictional = float(soil.frictional_modulus) * stiffness
    cohesive = float(soil.cohesive_modulus) * stiffness
    return NamedSoil(
        NAMES,
        np.array([math.degrees(math.atan(tangent)), cohesion, shear, frictional, cohesive]),
        np.array(
            [
                math.degrees(tangent * strength_std / (1.0 + tangent * tangent)),
                cohesion * strength_std,
                shear * modulus_std,
                frictional * stiffness_std,
                abs(cohesive) * stiffness_std,
            ]
        ),
    )
