# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Drawbar pull of each wheel: the strength that gives its torque, and the pull that goes with it.

With slip, sinkage and load given, the closed form gives torque and pull for a shear strength. The
strength that gives the measured torque is found wheel by wheel; so the pull hangs on the torque,
and hardly on the slip.
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
from wheel_terra_estimator.estimation.scalars import clipped

FloatArray = NDArray[np.float64]
_RATIO, _SINKAGE, _STRENGTH = 0, 1, 2  # places in the derivatives of `WheelModels.forces`


@dataclass(frozen=True)
class PullTuning:
    """Deviations of the model, shares of the load."""

    own_std: float = 0.015  # of one wheel
    common_std: float = 0.06  # of all wheels together: mound, bulldozing, lugs
    guess_std: float = 0.1  # where no torque tells
    scrub_std: float = 0.3  # at full sideways motion
    gain_share: float = 0.5  # of the torques' gain error that the pull takes over
    most_strength: float = 1.2  # of its logarithm
    steps: int = 3  # of Newton's method in a cycle, at most
    near: float = 0.05  # step of ln strength that needs no further one
    floor_share: float = 0.03
    """Of load times radius: derivative of the torque by ln strength below which it tells little."""
    most_pull: float = 1.0  # of the load


class SumOfPulls(NamedTuple):
    """What the specific force says of the pulls together."""

    along: float  # [N]
    variance: float  # [N^2]


class WheelPulls(NamedTuple):
    """One entry per wheel."""

    pull: FloatArray  # [N]
    std: FloatArray  # [N]
    strength: FloatArray  # ln of the factor that gives the torque
    nis: float = math.nan  # of the sum that the specific force says, squared over its variance


class Contact(NamedTuple):
    """What is known of all wheels, (n,) each."""

    speed_ratio: FloatArray  # v/(r w) in the direction of rolling
    ratio_std: FloatArray
    sinkage: FloatArray  # [m]
    sinkage_std: FloatArray
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

    def pulls(
        self,
        contact: Contact,
        before: FloatArray,
        guess: FloatArray,
        total: SumOfPulls | None,
        along: FloatArray,
    ) -> WheelPulls:
        """Return the pulls of a cycle.

        Parameters
        ----------
        contact : Contact
            Of all wheels.
        before : numpy.ndarray
            (n,) strengths of the last cycle.
        guess : numpy.ndarray
            (n,) pull over load of wheels that do not turn or have no torque [-].
        total : SumOfPulls or None
            Of all wheels; None = not known.
        along : numpy.ndarray
            (n,) cosine of the steering angles: share of a pull that counts in the sum.
        """
        tuning = self._tuning
        pull = guess * contact.load
        std = tuning.guess_std * contact.load
        strength = before.copy()
        for i in range(len(pull)):
            if contact.rolling[i] and contact.load[i] > 0.0 and not math.isnan(contact.torque[i]):
                found, deviation, strength[i] = self._pull(i, contact, float(before[i]))
                pull[i] = found * contact.rolling[i]
                std[i] = deviation
        std = np.hypot(std, tuning.scrub_std * contact.sideways * contact.load)
        common = tuning.common_std * contact.load
        joint = np.diag(std**2) + np.outer(common, common)
        nis = math.nan
        if total is not None:
            shares = joint @ along
            variance = float(along @ shares) + total.variance
            lacking = total.along - float(along @ pull)
            nis, gain = lacking**2 / variance, shares / variance
            pull = pull + gain * lacking
            joint = joint - np.outer(gain, shares)
        return WheelPulls(pull, np.sqrt(np.maximum(np.diagonal(joint), 0.0)), strength, nis)

    def _pull(self, i: int, contact: Contact, strength: float) -> tuple[float, float, float]:
        """Return pull and deviation [N] in the direction of rolling, and ln strength."""
        tuning, sensors = self._tuning, self._sensors
        load, torque = float(contact.load[i]), float(contact.torque[i])
        state = WheelState(
            float(contact.speed_ratio[i]),
            float(contact.sinkage[i]),
            load,
            strength,
            0.0,
            leaving_angle=contact.leaving_angle[i],
        )
        most, floor = tuning.most_strength, tuning.floor_share * load * self._rover.rim_radius[i]
        for _ in range(tuning.steps):
            forces = self._models.forces(i, state)
            by_strength, lacking = forces.d_torque[_STRENGTH], torque - forces.torque
            # Damped where the torque hardly hangs on the strength: a wheel that rolls freely.
            inverse = by_strength / (by_strength**2 + floor**2)
            strength = clipped(state.strength + lacking * inverse, -most, most)
            if abs(strength - state.strength) < tuning.near:
                break
            state = state._replace(strength=strength)
        by_torque = forces.d_pull[_STRENGTH] * inverse
        pull = forces.pull + by_torque * lacking
        pull = clipped(pull, -tuning.most_pull * load, tuning.most_pull * load)
        by_ratio, by_sinkage = (
            forces.d_pull[k] - by_torque * forces.d_torque[k] for k in (_RATIO, _SINKAGE)
        )
        variance = (
            (tuning.own_std * load) ** 2
            + (by_torque * sensors.torque_zero_std) ** 2
            + (tuning.gain_share * by_torque * sensors.torque_gain_std * torque) ** 2
            + (by_ratio * float(contact.ratio_std[i])) ** 2
            + (by_sinkage * float(contact.sinkage_std[i])) ** 2
            + (self._rover.load_std * pull) ** 2
        )
        return pull, min(math.sqrt(variance), load), strength
