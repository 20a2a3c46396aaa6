# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Drawbar pull of each wheel after the update of a cycle.

The filter learns soil slowly, on purpose. A pull can be corrected at once: it follows from the
torque whatever the strength of the soil, the specific force gives the sum of all pulls, and in a
steady turn their yaw moment balances that of the lateral forces. These corrections stay outside the
state.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from math import isnan
from typing import NamedTuple

import numpy as np

from wheel_terra_estimator.arrays import FloatArray, Floats
from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.contacts.cycle import Cycle
from wheel_terra_estimator.estimation.contacts.linearisation import ContactForces
from wheel_terra_estimator.estimation.contacts.stationary_wheels import MOST_DRAG, StationaryPull
from wheel_terra_estimator.estimation.filter.force_balance import SumOfPulls
from wheel_terra_estimator.estimation.filter.state import SHEAR_STRENGTH, StateLayout
from wheel_terra_estimator.estimation.rover import Rover, SensorFigures
from wheel_terra_estimator.estimation.scalars import TINY, clipped
from wheel_terra_estimator.estimation.sideways import Sideways

# Tuned on simulated drives, seeds 1000 to 1019, where no other source is given.
_GUESS_STD = 0.1  # of the load, where no model holds
_FLOOR_STD = 1e-3  # [N]
_MODEL_STD = 0.01  # of the load
_LEVEL_STD = 0.2  # of the load, where loads are those of level ground
_GAIN_SHARE = 0.5  # of the torques' gain error that the pull takes over
_MOST_TORQUE = 1.2  # of load times radius
_EXCESS_GAIN = 0.2  # smoothing of reading less model, per cycle
_SHRINKAGE = 2.0
"""Noise variances taken off the square of an excess (James and Stein 1961): nothing below its
noise is believed, all of what is far above it."""
_SCRUB_STD = 0.1  # of the load at full lateral motion: pushed sideways


class PullEvidence(NamedTuple):
    """What the pulls of a cycle follow from besides the state of the filter."""

    forces: ContactForces | None
    """Of the turning wheels; None where all stand."""
    total: SumOfPulls | None  # their sum by the accelerometer; None = unknown
    cycle: Cycle
    readings: Floats  # last torque of each wheel [N m], nan = never known
    stationary: Sequence[StationaryPull | None]  # what to expect of a wheel that stands
    sideways: Sideways | None  # lateral forces in a turn, where they are known; None elsewhere
    tilt_std: float  # of the body against the ground, by unmodelled slip-sinkage [rad]


class KnownSum(NamedTuple):
    """A weighted sum of the pulls that is known: a force or a moment."""

    shares: FloatArray  # (n,) weight of each pull in it
    value: float
    variance: float


class PullState(NamedTuple):
    """One entry per wheel."""

    pull: Floats  # [N], what is published
    std: Floats
    model_pull: Floats  # without the correction by the sum: what the loads are worked out from
    torque: Floats  # by sensor or model [N m]
    torque_excess: Floats  # reading less model, smoothed [N m]


class Pulls(Component[PullState]):
    """Computes pulls, torques and deviations of all wheels.

    The `loads` on level ground [N] are the deviations of the pulls before anything is known.
    """

    def __init__(
        self, rover: Rover, sensors: SensorFigures, layout: StateLayout, loads: Floats
    ) -> None:
        zero = (0.0,) * rover.wheel_count
        super().__init__(PullState(zero, loads, zero, zero, zero))
        self._rover, self._sensors, self._sinkage = rover, sensors, layout.sinkage
        self._load_std = rover.load_std * sum(loads) / rover.wheel_count  # [N]

    def update(
        self, mean: FloatArray, covariance: FloatArray, evidence: PullEvidence, *, tilt: float
    ) -> None:
        """Work out the pulls of a cycle from mean (size,) and covariance after its update.

        `tilt` is that of the body against the ground by its ruts [rad].
        """
        forces, total, cycle, readings, stationary, sideways, tilt_std = evidence
        loads, lateral_motion = cycle.loads, cycle.lateral_motion
        state, share = self.state, loads.slope_share
        n = self._rover.wheel_count
        pull, std = [0.0] * n, [0.0] * n
        torque, excess = list(state.torque), list(state.torque_excess)
        own = [0.0] * n  # variances that no other wheel shares
        joint = np.zeros((n, n))
        scrub = [(_SCRUB_STD * lateral_motion * load) ** 2 for load in loads.load]
        if forces is not None:
            pulls, torques = [moved.tolist() for moved in forces.moved_to(mean)]
            joint = forces.pull_rows @ covariance @ forces.pull_rows.T
            shared = joint.diagonal().tolist()
            pull_by_strength = forces.pull_rows[:, SHEAR_STRENGTH].tolist()
            torque_by_strength = forces.torque_rows[:, SHEAR_STRENGTH].tolist()
            noises = forces.pull_noise.tolist()
            zeros = self._pull_of_sinkage_zero(forces)
            # At the slip of a noisy rim speed the model is off by as much in each cycle anew.
            gain = 1.0 if forces.blurred else _EXCESS_GAIN
        for i, load in enumerate(loads.load):
            if not cycle.turns[i]:
                # Where all wheels stand, static friction carries its share of the slope.
                standing = stationary[i]
                pull[i] = standing.expected if standing else load * share
                torque[i] = pull[i] * self._rover.rim_radius[i]
                guess = standing.std if standing and isnan(readings[i]) else _GUESS_STD * load
                std[i] = guess if loads.force_known else load
                std[i] += self._load_std * abs(share) + _FLOOR_STD
                own[i] = std[i] ** 2
            else:
                if not isnan(readings[i]):  # torque residual, smoothed
                    excess[i] += gain * (readings[i] - torques[i] - excess[i])
                beyond = self._believed(excess[i], readings[i])
                if beyond and torque_by_strength[i]:
                    torques[i] += beyond
                    pulls[i] += beyond * pull_by_strength[i] / torque_by_strength[i]
                # An extrapolation to first order may overshoot: no soil gives more than the load.
                pull[i] = clipped(pulls[i], -load, load)
                most = _MOST_TORQUE * load * self._rover.shear_radius[i]
                torque[i] = clipped(torques[i], -most, most)
                own[i] = self._own_variance(
                    i, pull[i], torque[i], load, level=not loads.force_known
                )
                own[i] += noises[i] ** 2 + zeros[i] ** 2
                all_variances = max(shared[i], 0.0) + own[i] + scrub[i] + (tilt_std * load) ** 2
                std[i] = math.sqrt(all_variances)
        model_pull = tuple(pull)
        if forces is not None:
            sums = self._known(cycle, total, sideways, tilt)
            if sums:
                joint.flat[:: n + 1] += np.array(own) + scrub
                pull = distributed(np.array(pull), joint, sums, loads.load)
        self.state = PullState(tuple(pull), tuple(std), model_pull, tuple(torque), tuple(excess))

    def _known(
        self, cycle: Cycle, total: SumOfPulls | None, sideways: Sideways | None, tilt: float
    ) -> list[KnownSum]:
        """Return what is known of the pulls together.

        In a steady turn the vertical moments of pulls and lateral forces cancel about the centre of
        gravity.
        """
        along, across = np.array(cycle.headings.along), np.array(cycle.headings.across)
        known = []
        if total is not None:
            known.append(KnownSum(along, total.along - total.weight * tilt, total.variance))
        if sideways is not None:
            rover = self._rover
            x = np.array(rover.longitudinal) - rover.centre_of_gravity[0]
            y = np.array(rover.lateral) - rover.centre_of_gravity[1]
            arms = x * along + y * across
            stds = arms * sideways.force_std
            moment = -float(arms @ sideways.force)
            known.append(KnownSum(x * across - y * along, moment, float(stds @ stds)))
        return known

    def _own_variance(
        self, i: int, pull: float, torque: float, load: float, *, level: bool
    ) -> float:
        """Return the variance of a turning wheel's pull that no other wheel shares [N^2]."""
        sensors, radius = self._sensors, self._rover.shear_radius[i]
        return (
            (self._load_std * pull / max(load, TINY)) ** 2
            + (sensors.torque_zero_std / radius) ** 2
            + (_GAIN_SHARE * sensors.torque_gain_std * torque / radius) ** 2
            + (_MODEL_STD * load) ** 2
            + (_LEVEL_STD * load if level else 0.0) ** 2
        )

    def _pull_of_sinkage_zero(self, forces: ContactForces) -> list[float]:
        """Return the deviations of the pulls by the zeros of sinkage sensors [N].

        The torque is measured: strength makes up for what a wrong sinkage does to it.
        """
        by_torque = forces.pull_rows[:, SHEAR_STRENGTH] / np.where(
            forces.torque_rows[:, SHEAR_STRENGTH], forces.torque_rows[:, SHEAR_STRENGTH], np.inf
        )
        rows = forces.pull_rows - by_torque[:, None] * forces.torque_rows
        by_sinkage: list[float] = rows[:, self._sinkage].diagonal().tolist()
        return [self._sensors.sinkage_zero_std * slope for slope in by_sinkage]

    def _believed(self, excess: float, reading: float) -> float:
        """Return the part of the excess that the sensor's errors do not explain [N m]."""
        if isnan(reading):
            return 0.0
        sensors = self._sensors
        noise = (
            _EXCESS_GAIN / 2.0 * sensors.torque_std**2
            + sensors.torque_zero_std**2
            + (sensors.torque_gain_std * reading) ** 2
        )
        square = max(excess * excess, TINY)
        believed = max(1.0 - _SHRINKAGE * noise / square, 0.0)
        return excess * believed


def distributed(
    pull: FloatArray, errors: FloatArray, known: Sequence[KnownSum], loads: Floats
) -> list[float]:
    """Return the pulls (n,) [N] with the residuals of known sums distributed.

    `errors` (n, n) is their covariance [N^2]. The deviations of single pulls stay: a sum says
    nothing of the differences between wheels.
    """
    for shares, value, variance in known:
        column = errors @ shares
        gain = column / (shares @ column + variance)
        pull = pull + gain * (value - shares @ pull)
        errors = errors - gain[:, None] * column
    return [
        clipped(f, -MOST_DRAG * load, load) for f, load in zip(pull.tolist(), loads, strict=True)
    ]
