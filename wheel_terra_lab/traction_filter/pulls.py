# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Drawbar pull of each wheel from its torque, its slip, its sinkage and the specific force.

The closed form gives torque and pull of each wheel at the slip, strength and sinkage that are
known, with derivatives. What the measured torques lack is shared out by the deviations: slip and
strength of all wheels together, strength and sinkage under each, zero and gain of its torque
sensor. What the model errs besides is a state (n,), a share of the load, that the specific force
tells the sum of.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.contacts.wheel_models import WheelModels, WheelState
from wheel_terra_estimator.estimation.rover import Rover, SensorFigures

FloatArray = NDArray[np.float64]
_RATIO, _SINKAGE, _STRENGTH = 0, 1, 2  # places in the derivatives of `WheelModels.forces`


@dataclass(frozen=True)
class PullTuning:
    """Deviations of the model, shares of the load."""

    own_std: float = 0.015  # of one wheel
    common_std: float = 0.06  # of all wheels together: mound, bulldozing, lugs
    error_time: float = 10.0  # [s] that such errors last
    weight_std: float = 0.005  # of the weight that acts along: attitude, small bumps
    guess_std: float = 0.1  # where no torque tells
    scrub_std: float = 0.3  # at full sideways motion
    soil_std: float = 0.05  # ln strength under one wheel, against the others
    odd_std: float = 0.5  # the same of a wheel whose torque agrees with no other
    most_strength: float = 1.2  # of its logarithm
    most_pull: float = 1.0  # of the load


class SumOfPulls(NamedTuple):
    """What the specific force says of the pulls together."""

    along: float  # [N]
    variance: float  # of its noise [N^2]


class WheelPulls(NamedTuple):
    """One entry per wheel, and what is remembered for the next cycle."""

    pull: FloatArray  # [N]
    std: FloatArray  # [N]
    strength: FloatArray  # ln of the factor on the shear strength
    error: FloatArray
    """(n + 1,) of the models, shares of the load; of the specific force, share of the weight."""
    covariance: FloatArray  # (n + 1, n + 1) of it
    nis: float = math.nan  # of the sum that the specific force says, squared over its variance


class Contact(NamedTuple):
    """What is known of all wheels, (n,) each but for what they have in common."""

    speed_ratio: FloatArray  # v/(r w) in the direction of rolling
    by_slip: FloatArray  # derivative of it by the slip of the body
    slip_std: float  # of the body
    sinkage: FloatArray  # [m]
    sinkage_std: FloatArray
    strength: float  # ln, of all wheels
    strength_std: float
    agreement: FloatArray  # of each torque with the others, 0 to 1
    load: FloatArray  # [N]
    torque: FloatArray  # in the direction of rolling [N m]; nan = unknown
    rolling: FloatArray  # 1 or -1; 0 where the wheel stands
    sideways: FloatArray  # sideways over rim speed, 0 to 1
    leaving_angle: tuple[float, ...]  # [rad], nan = not measured


class PullModel:
    """Pulls of one rover.

    Parameters
    ----------
    configuration : Configuration
        Soil, wheels, effects.
    rover, sensors
        Constants.
    """

    def __init__(
        self,
        configuration: Configuration,
        rover: Rover,
        sensors: SensorFigures,
        tuning: PullTuning = PullTuning(),
    ) -> None:
        self._models = WheelModels(configuration)
        self._rover, self._sensors, self._tuning = rover, sensors, tuning
        n = rover.wheel_count
        self._weight = rover.mass * rover.gravity
        self._spread = np.zeros((n + 1, n + 1))
        self._spread[:n, :n] = np.eye(n) * tuning.own_std**2 + tuning.common_std**2
        self._spread[n, n] = (
            sensors.specific_force_bias_std / rover.gravity
        ) ** 2 + tuning.weight_std**2

    def pulls(
        self,
        contact: Contact,
        before: WheelPulls | None,
        guess: FloatArray,
        total: SumOfPulls | None,
        along: FloatArray,
        dt: float,
    ) -> WheelPulls:
        """Return the pulls of a cycle.

        Parameters
        ----------
        contact : Contact
            Of all wheels.
        before : WheelPulls or None
            Of the last cycle.
        guess : numpy.ndarray
            (n,) pull over load of wheels that do not turn or have no torque [-].
        total : SumOfPulls or None
            Of all wheels; None = not known.
        along : numpy.ndarray
            (n,) cosine of the steering angles: share of a pull that counts in the sum.
        dt : float
            Time since the last cycle [s].
        """
        tuning, n = self._tuning, len(guess)
        told = (contact.rolling != 0.0) & (contact.load > 0.0) & ~np.isnan(contact.torque)
        pull = guess * contact.load
        joint = np.zeros((n, n))
        strength = np.zeros(n) if before is None else before.strength.copy()
        if told.any():
            at = np.flatnonzero(told)
            pull[at], joint[np.ix_(at, at)], strength[at] = self._by_torque(contact, at, strength)
        joint += np.diag(np.square(tuning.scrub_std * contact.sideways * contact.load))
        error, P = self._error_later(before, told, dt)
        scale, nis = contact.load, math.nan
        if total is not None:
            h = np.append(along * scale, self._weight)
            shares = P @ h
            lacking = total.along - float(along @ pull) - float(h @ error)
            S = float(h @ shares) + float(along @ joint @ along) + total.variance
            nis, gain = lacking**2 / S, shares / S
            error = error + gain * lacking
            P = P - np.outer(gain, shares)
            own = joint @ along
            pull = pull + own * (lacking / S)
            joint = joint - np.outer(own, own) / S
        return WheelPulls(
            pull + error[:n] * scale,
            np.sqrt(np.maximum(np.diagonal(joint) + np.diagonal(P)[:n] * scale**2, 0.0)),
            strength,
            error,
            P,
            nis,
        )

    def _error_later(
        self, before: WheelPulls | None, told: NDArray[np.bool_], dt: float
    ) -> tuple[FloatArray, FloatArray]:
        """Return the errors of the model after a time, and their covariance."""
        spread = self._spread + np.diag(
            np.append(np.where(told, 0.0, self._tuning.guess_std**2), 0.0)
        )
        if before is None:
            return np.zeros(len(spread)), spread
        keep = math.exp(-dt / self._tuning.error_time)
        return keep * before.error, keep**2 * before.covariance + (1.0 - keep**2) * spread

    def _by_torque(
        self, contact: Contact, at: NDArray[np.intp], strength: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return pulls (k,) [N], their covariance and ln strengths of wheels with a torque."""
        tuning, sensors, k = self._tuning, self._sensors, len(at)
        torque, pull = np.empty(k), np.empty(k)
        # Unknowns: slip, strength of all; strength of each; sinkage of each.
        by_torque, by_pull = np.zeros((k, 2 + 2 * k)), np.zeros((k, 2 + 2 * k))
        for row, i in enumerate(at):
            state = WheelState(
                float(contact.speed_ratio[i]),
                float(contact.sinkage[i]),
                float(contact.load[i]),
                float(strength[i]),
                0.0,
                leaving_angle=contact.leaving_angle[i],
            )
            forces = self._models.forces(int(i), state)
            torque[row], pull[row] = forces.torque, forces.pull
            for matrix, slopes in ((by_torque, forces.d_torque), (by_pull, forces.d_pull)):
                matrix[row, 0] = slopes[_RATIO] * contact.by_slip[i]
                matrix[row, 1] = matrix[row, 2 + row] = slopes[_STRENGTH]
                matrix[row, 2 + k + row] = slopes[_SINKAGE]
        odd = 1.0 - contact.agreement[at]
        std = np.concatenate(
            [
                [contact.slip_std, contact.strength_std],
                np.hypot(tuning.soil_std, tuning.odd_std * odd),
                contact.sinkage_std[at],
            ]
        )
        about = np.zeros(2 + 2 * k)  # where the forces were taken, against what is known
        about[2 : 2 + k] = strength[at] - contact.strength
        D = np.square(std)
        measured = contact.torque[at]
        R = sensors.torque_zero_std**2 + np.square(sensors.torque_gain_std * measured)
        S = (by_torque * D) @ by_torque.T + np.diag(R)
        gain = np.linalg.solve(S, by_torque * D).T
        found = gain @ (measured - torque + by_torque @ about)
        P = np.diag(D) - gain @ (by_torque * D)
        moved = found - about
        value = pull + by_pull @ moved
        limit = tuning.most_pull * contact.load[at]
        strong = contact.strength + found[1] + found[2 : 2 + k]
        rolling = contact.rolling[at]
        covariance = (by_pull @ P @ by_pull.T) * np.outer(rolling, rolling)
        return (
            np.clip(value, -limit, limit) * rolling,
            covariance + np.diag(np.square(self._rover.load_std * value)),
            np.clip(strong, -tuning.most_strength, tuning.most_strength),
        )
