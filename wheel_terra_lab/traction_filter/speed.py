# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Speed of the body: the one at which the traction curve gives the torques that are measured."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.estimation.contacts.steering import Headings
from wheel_terra_estimator.estimation.scalars import median
from wheel_terra_lab.traction_filter.curve import (
    LOG_SCALE,
    LOG_STRENGTH,
    OFFSET,
    WHEELS,
    Coefficients,
    WheelSpeeds,
    coefficients,
)
from wheel_terra_lab.traction_filter.steady_wheel import SteadyWheel

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class SolverTuning:
    """Numbers of the solution."""

    most_slip: float = 0.97  # of the body [-]
    least_slope: float = 0.1  # of the torque coefficient over the slip, in a step [-]
    agreement: float = 0.1
    """Torque coefficient within which wheels agree [-]; what is far beyond loses its weight."""
    agreement_share: float = 0.5  # of the median coefficient, besides
    freedom: float = 10.0  # of that heavy tail
    scale_share: float = 0.5  # of the fastest rim, where wheels turn against one another
    tolerance: float = 1e-4  # of the slip
    iterations: int = 8
    reweighted: int = 2


class Rims(NamedTuple):
    """Wheels at a stamp."""

    speed: FloatArray  # (n,) [m/s], 0 where unknown
    turning: NDArray[np.bool_]  # (n,) whether the models hold: it turns, faster than noise
    body: float  # speed of the body if no wheel slipped [m/s]
    scale: float  # signed speed that the body's slip is a share of [m/s]


class MeanTorque(NamedTuple):
    """Mean torque coefficient of the wheels at a slip of the body, in the direction of driving."""

    lacking: float  # measured less that of the curve [-]
    slope: float  # of the curve's over the slip [-]
    gradient: FloatArray  # (3 + n,) of the curve's by the state


class BodySlip(NamedTuple):
    """Solution: the body moves at ``rims.body - slip * rims.scale``."""

    slip: float
    mean: MeanTorque  # there
    expected: FloatArray  # (n,) torque coefficients there
    weight: FloatArray  # (n,) of the wheels in it
    agreement: FloatArray  # (n,) of each wheel with the others: 1, towards 0 far off
    above: float  # slip that a torque higher by one deviation would tell, over this one
    below: float  # the same for a lower torque

    @property
    def std(self) -> float:
        """Mean of both sides, as far as slips go [-]."""
        return 0.5 * (min(self.above, 1.0 - self.slip) + min(self.below, 1.0 + self.slip))


def rims_at(
    speeds: tuple[float, ...],
    headings: Headings,
    yaw_rate: float,
    low_rim: float,
    tuning: SolverTuning = SolverTuning(),
) -> Rims:
    """Return what is needed of rim speeds (n,) [m/s], nan = unknown."""
    rim = np.nan_to_num(np.array(speeds))
    bodies = [
        headings.body_speed(i, speed, yaw_rate) for i, speed in enumerate(speeds) if speed == speed
    ]
    body = median(bodies) if bodies else 0.0
    size = max(abs(body), tuning.scale_share * float(np.abs(rim).max(initial=0.0)))
    return Rims(rim, np.abs(rim) > low_rim, body, size if body >= 0.0 else -size)


class TorqueBalance:
    """Torques that are measured against those of the curve, over the slip of the body.

    Parameters
    ----------
    steady : SteadyWheel
        Curve of the soil file.
    rims, headings, yaw_rate
        Motion of the wheels.
    demand : numpy.ndarray
        (n,) measured torque over load and radius [-].
    load : numpy.ndarray
        (n,) [N].
    stiffness : numpy.ndarray
        (n,) ln of stiffness over load, see `SteadyWheel.torques`.
    """

    def __init__(
        self,
        steady: SteadyWheel,
        rims: Rims,
        headings: Headings,
        yaw_rate: float,
        *,
        demand: FloatArray,
        load: FloatArray,
        stiffness: FloatArray,
        tuning: SolverTuning = SolverTuning(),
    ) -> None:
        self._steady, self._stiffness, self._tuning = steady, stiffness, tuning
        self._curves = steady.torques(stiffness)
        self.rims, self.demand = rims, demand
        self._by_speed = np.array(headings.by_speed)
        self._ground = np.array(headings.by_yaw_rate) * yaw_rate
        self._side_by_speed = np.array(headings.side_by_speed)
        self._side = np.array(headings.side_by_yaw_rate) * yaw_rate
        self._direction = 1.0 if rims.scale >= 0.0 else -1.0
        self._carried = load * rims.turning
        usual = np.median(np.abs(demand[rims.turning])) if rims.turning.any() else 0.0
        self._usual = tuning.agreement + tuning.agreement_share * float(usual)

    def at(self, state: FloatArray, slip: float) -> Coefficients:
        """Return the torque coefficients of the curve at a slip of the body."""
        body = self.rims.body - slip * self.rims.scale
        speeds = WheelSpeeds(
            self.rims.speed,
            self._by_speed * body + self._ground,
            self._side_by_speed * body + self._side,
        )
        return coefficients(self._curves, state, speeds)

    def mean(self, u: Coefficients, weight: FloatArray) -> MeanTorque:
        """Return the weighted mean of coefficients of `at`."""
        gradient = np.empty(WHEELS + len(weight))
        gradient[OFFSET] = weight @ u.by_offset
        gradient[LOG_SCALE] = weight @ u.by_log_scale
        gradient[LOG_STRENGTH] = weight @ u.value
        gradient[WHEELS:] = weight * u.value
        return MeanTorque(
            float(weight @ (self.demand - u.value)) * self._direction,
            -float(weight @ (u.by_ground_speed * self._by_speed)) * abs(self.rims.scale),
            gradient * self._direction,
        )

    def solved(self, state: FloatArray, start: float, variance: float, P: FloatArray) -> BodySlip:
        """Return the slip at which the curve gives the demand.

        Newton's method with bisection on sum(W weight (demand - u)) = 0, three times: each time
        wheels that disagree with the others lose weight.

        Parameters
        ----------
        state, P : numpy.ndarray
            (3 + n,) and its covariance.
        start : float
            A slip near the solution.
        variance : float
            Of the mean of the measured torque coefficients [-].
        """
        tuning = self._tuning
        slip, weight = start, self._carried / self._carried.sum()
        for _ in range(tuning.reweighted):
            slip, u = self._root(state, slip, weight)
            residual = (self.demand - u.value) / self._usual
            agreement = (1.0 + residual**2 / tuning.freedom) ** -2
            weight = self._carried * agreement
            weight = weight / weight.sum()
        slip, u = self._root(state, slip, weight)
        mean = self.mean(u, weight)
        std = math.sqrt(variance + float(mean.gradient @ P @ mean.gradient))
        scale = math.exp(state[LOG_SCALE])
        below, above = self._steady.reach(
            (slip - state[OFFSET]) / scale,
            float(weight @ self._stiffness),
            std / math.exp(state[LOG_STRENGTH] + float(weight @ state[WHEELS:])),
        )
        return BodySlip(
            slip,
            mean,
            u.value,
            weight,
            agreement,
            above=max(min(above * scale, 1.0), 0.0),
            below=max(min(below * scale, 1.0), 0.0),
        )

    def _root(
        self, state: FloatArray, slip: float, weight: FloatArray
    ) -> tuple[float, Coefficients]:
        tuning = self._tuning
        low, high = -tuning.most_slip, tuning.most_slip
        size = abs(self.rims.scale)
        for _ in range(tuning.iterations):
            u = self.at(state, slip)
            lacking = float(weight @ (self.demand - u.value)) * self._direction
            low, high = (slip, high) if lacking > 0.0 else (low, slip)
            slope = -float(weight @ (u.by_ground_speed * self._by_speed)) * size
            ahead = slip + lacking / max(slope, tuning.least_slope)
            ahead = ahead if low <= ahead <= high else 0.5 * (low + high)
            done = abs(ahead - slip) < tuning.tolerance
            slip = ahead
            if done:
                break
        return slip, u
