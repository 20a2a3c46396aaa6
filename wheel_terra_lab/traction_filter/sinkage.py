# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Sinkage and soil stiffness under each wheel: the wheel sinks towards what its load asks.

It sinks deeper as it slips. So an error of the slip that torques and references tell is a state
beside them: where the torque lies on the plateau of its curve, the sinkage tells the slip.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter
from numpy.typing import NDArray

from wheel_terra_estimator.estimation.filter.initial_state import SoilPriors
from wheel_terra_estimator.estimation.inputs.contact_sensors import SinkageSums
from wheel_terra_estimator.estimation.rover import Rover
from wheel_terra_estimator.estimation.smoothing.tape import Gaussian
from wheel_terra_lab.traction_filter.steady_wheel import SteadyWheel
from wheel_terra_lab.traction_filter.tape import Prediction

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class SinkageTuning:
    """Numbers of the law."""

    own_stiffness: float = 0.5  # spread between wheels over that of all together
    stiffness_walk: float = 0.5  # of ln stiffness [1/sqrt(m)]
    law_error: float = 0.1  # of the sinkage per contact length
    digging: float = 0.05  # of rim travel times slip squared
    spin_share: float = 0.3  # of the slip velocity that counts as travel over new soil
    least_contact: float = 0.02  # [m]
    start_share: float = 0.5  # deviation at the start over the sinkage
    start_floor: float = 0.005  # [m]
    freedom: float = 4.0  # of the heavy tail of a reading
    rejected: float = 16.0  # squared innovation over its variance that counts as a wild reading
    walk: float = 1e-9  # of a wheel that stands [m^2/s]
    error_time: float = 30.0  # [s] that an error of the slip lasts
    most_error: float = 2.5  # of it, in its deviations
    most_stiffness: float = 2.2  # of its logarithm
    step: float = 0.05  # of ln stiffness and slip, for derivatives
    shallowest: float = 1e-4  # [m]
    loads: tuple[float, float] = (0.05, 20.0)  # over the mean, that the law follows


class SinkageFilter:
    """State (2 n + 1,): sinkage [m] of each wheel, ln stiffness under each, error of the slip.

    Parameters
    ----------
    rover : Rover
        Constants.
    steady : SteadyWheel
        Steady sinkage of the soil file.
    priors : SoilPriors
        Deviations of the configured soil.
    """

    def __init__(
        self,
        rover: Rover,
        steady: SteadyWheel,
        priors: SoilPriors,
        tuning: SinkageTuning = SinkageTuning(),
    ) -> None:
        self._n = n = rover.wheel_count
        self._radius = np.array(rover.rim_radius)
        self._steady, self._tuning = steady, tuning
        self._start = np.concatenate([steady.sinkage(np.zeros(n), np.zeros(n)), np.zeros(n + 1)])
        spread = (tuning.start_share * self._start[:n] + tuning.start_floor) ** 2
        stiffness = np.full((n, n), priors.stiffness_std**2)
        stiffness += np.eye(n) * (tuning.own_stiffness * priors.stiffness_std) ** 2
        self._spread = np.zeros((2 * n + 1, 2 * n + 1))
        self._spread[:n, :n] = np.diag(spread)
        self._spread[n:-1, n:-1] = stiffness
        self._ekf = ExtendedKalmanFilter(dim_x=2 * n + 1, dim_z=n)
        self.reset()

    def reset(self) -> None:
        """Go back to the start of a run."""
        self.rejected = 0
        self._ekf.x, self._ekf.P = self._start.copy(), self._spread.copy()

    def snapshot(self) -> tuple[FloatArray, FloatArray, int]:
        """Return the memory."""
        return self._ekf.x, self._ekf.P, self.rejected

    def restore(self, snapshot: tuple[FloatArray, FloatArray, int]) -> None:
        """Go back to a snapshot."""
        self._ekf.x, self._ekf.P, self.rejected = snapshot

    @property
    def gaussian(self) -> Gaussian:
        """Whole state and its covariance."""
        return Gaussian(self._ekf.x, self._ekf.P)

    @gaussian.setter
    def gaussian(self, state: Gaussian) -> None:
        self._ekf.x, self._ekf.P = state

    @property
    def sinkage(self) -> FloatArray:
        """Sinkage (n,) [m]."""
        return np.asarray(self._ekf.x[: self._n])

    @property
    def stiffness(self) -> FloatArray:
        """Logarithm of the factor on the bearing moduli (n,)."""
        return np.asarray(self._ekf.x[self._n : -1])

    @property
    def slip_error(self) -> float:
        """What the sinkage adds to the slip of the body [-]."""
        return float(self._ekf.x[-1])

    @property
    def slip_variance(self) -> float:
        """Of the slip with it [-]."""
        return float(self._ekf.P[-1, -1])

    @property
    def common_stiffness(self) -> tuple[float, float]:
        """Mean of the wheels' stiffness, and its deviation."""
        n, P = self._n, self._ekf.P
        variance = float(P[n:-1, n:-1].sum()) / n**2
        return float(self._ekf.x[n:-1].mean()), float(np.sqrt(max(variance, 0.0)))

    @property
    def std(self) -> FloatArray:
        """Deviations of the whole state (2 n,)."""
        return np.sqrt(np.maximum(np.diagonal(self._ekf.P), 0.0))

    def relative_stiffness(self, load: FloatArray) -> FloatArray:
        """Return ln of stiffness over load (n,), as the steady wheel takes it."""
        share = np.clip(load / self._steady.load, *self._tuning.loads)
        return np.asarray(self.stiffness - np.log(share))

    def predict(
        self,
        slip: FloatArray,
        by_body: FloatArray,
        slip_variance: float,
        rim_travel: FloatArray,
        load: FloatArray,
        dt: float,
    ) -> None:
        """Sink on over a step.

        Parameters
        ----------
        slip : numpy.ndarray
            (n,) of each wheel, with the error that is known.
        by_body : numpy.ndarray
            (n,) derivative of it by the slip of the body.
        slip_variance : float
            Of the error of the body's slip that the sinkage may tell [-].
        rim_travel : numpy.ndarray
            (n,) travel of the rims in the step, unsigned [m].
        load : numpy.ndarray
            (n,) [N].
        dt : float
            [s].
        """
        n, tuning, steady = self._n, self._tuning, self._steady
        depth = np.maximum(self.sinkage, tuning.shallowest)
        travel = rim_travel * (1.0 - (1.0 - tuning.spin_share) * np.clip(slip, 0.0, 1.0))
        contact = np.maximum(np.sqrt(2.0 * self._radius * depth), tuning.least_contact)
        gain = -np.expm1(-travel / contact)
        stiffness = self.relative_stiffness(load)
        target = steady.sinkage(slip, stiffness)
        step = np.where(
            stiffness > 0.0, -tuning.step, tuning.step
        )  # towards the middle of its table
        by_stiffness = (steady.sinkage(slip, stiffness + step) - target) / step
        by_slip = (steady.sinkage(slip + tuning.step, stiffness) - target) / tuning.step
        F = np.eye(2 * n + 1)
        wheels = np.arange(n)
        F[wheels, wheels] = 1.0 - gain
        F[wheels, n + wheels] = gain * by_stiffness
        F[wheels, -1] = gain * by_slip * by_body
        F[-1, -1] = keep = float(np.exp(-dt / tuning.error_time))
        noise = (
            2.0 * gain * (tuning.law_error * depth) ** 2
            + (tuning.digging * np.clip(slip, 0.0, 1.0) ** 2 * rim_travel) ** 2
            + tuning.walk * dt
        )
        ekf = self._ekf
        mean = ekf.x.copy()
        mean[:n] += gain * (target - mean[:n])
        mean[-1] *= keep
        ekf.F = F
        walk = tuning.stiffness_walk**2 * rim_travel
        ekf.Q = np.diag(np.concatenate([noise, walk, [(1.0 - keep**2) * slip_variance]]))
        ekf.predict()
        ekf.x = mean
        self.predicted = Prediction.of(ekf)
        self.limit_slip(slip_variance)

    def limit_slip(self, variance: float) -> None:
        """Let torques and references tell the slip with a variance: its error is no larger."""
        ekf = self._ekf
        if ekf.P[-1, -1] > variance:
            share = np.sqrt(variance / ekf.P[-1, -1])
            x, P = ekf.x.copy(), ekf.P.copy()
            x[-1] *= share
            P[-1, :] *= share
            P[:, -1] *= share
            ekf.x, ekf.P = x, P

    def update(self, sums: SinkageSums, variance: float) -> float:
        """Fuse the readings of a cycle; `variance` is that of one reading [m^2].

        Returns
        -------
        float
            Mean of the squared innovations over their variances; nan = none came.
        """
        read = [i for i, count in enumerate(sums.readings) if count]
        if not read:
            return np.nan
        ekf, tuning = self._ekf, self._tuning
        count = np.array(sums.readings, dtype=float)[read]
        z = np.array(sums.total)[read] / count
        H = np.eye(2 * self._n + 1)[read]
        R = variance / count
        spread = np.diagonal(ekf.P)[read] + R
        nis = (z - ekf.x[read]) ** 2 / spread
        weight = (tuning.freedom + 1.0) / (tuning.freedom + nis)
        self.rejected += int(np.count_nonzero(nis > tuning.rejected))
        R = R / np.minimum(weight, 1.0)
        ekf.update(z, lambda x: H, lambda x: x[read], R=np.diag(R))
        far = np.concatenate(
            [
                np.full(self._n, np.inf),
                np.full(self._n, tuning.most_stiffness),
                [tuning.most_error * np.sqrt(self._ekf.P[-1, -1])],
            ]
        )
        ekf.x = np.clip(ekf.x, -far, far)
        return float(nis.mean())
