# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Process model of sinkage: it relaxes over travel to where the bearing law carries the load."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from wheel_terra_estimator.arrays import BoolArray, FloatArray, Floats
from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.contacts.cycle import Cycle
from wheel_terra_estimator.estimation.contacts.linearisation import smoothed_slopes
from wheel_terra_estimator.estimation.contacts.loads import LEAST_LOAD
from wheel_terra_estimator.estimation.contacts.wheel_models import WheelModels, WheelStates
from wheel_terra_estimator.estimation.filter.ekf import GatedFilter
from wheel_terra_estimator.estimation.filter.initial_state import LOAD_EXPONENT
from wheel_terra_estimator.estimation.filter.state import (
    SHEAR_MODULUS,
    SHEAR_STRENGTH,
    SLIP_SINKAGE,
    SPEED,
    Prediction,
    StateLayout,
)
from wheel_terra_estimator.estimation.rover import Rover
from wheel_terra_estimator.terramechanics.kinematics import slip_of_speed_ratio

# Tuned on simulated drives, seeds 1000 to 1019, where no other source is given.
_RESTING_WALK = 1e-10  # random walk of the sinkage of a wheel that does not turn [m^2/s]
_LIFTED_WALK = 1e-4  # the same of a wheel in the air [m^2/s]
_WALK = 1e-9  # the same of a wheel that rolls, added to the model error [m^2/s]
_SPIN_TRAVEL = 0.1  # share of the slip velocity that counts as travel over new soil [-]
_SPIN_RELAXATION = 0.3  # share of it that counts for the relaxation [-]
_LEAST_CONTACT = 0.02  # length of a contact [m]
_LEAST_SINKAGE = 5e-4  # [m], for contact length and the step on log sinkage
_STEP = -0.02
"""Finite step of v / rim speed and of n1, for the derivatives of the bearing law [-]."""
_STEPS = _STEP * np.eye(2, 3, 1)[:, :, None]
_LONGEST_STEP = 0.7  # change of ln sinkage in one cycle [-]
_RELAXATION_SLOPE = 0.9  # share of the relaxation that acts on the covariance [-]
_LAW_ERROR = 0.05  # error of the bearing law per contact length, over the sinkage [-]
_UNMODELLED_DIGGING = 0.1
"""Deviation of the slip-sinkage over slip velocity times slip, where nothing measures the sinkage
[-]: 0 to 0.1 in four simulators."""
_RATE_TIME = 0.5  # time constant of the published rate [s]
_FIRST_RATE_STD = 1.0  # [m/s], before anything is known


class SinkageState(NamedTuple):
    """Memory of the prediction of the sinkages."""

    slopes: FloatArray
    """(2, n) smoothed derivatives of ln(load carried) by v / rim speed and by n1; nan = none."""
    rate: Floats  # of each wheel [m/s]
    rate_std: Floats
    unmodelled_std: FloatArray
    """(n,) deviation of each sinkage by slip-sinkage that the bearing law does not model [m]; not
    in the covariance of the filter."""


class _Motion(NamedTuple):
    """Motion of turning wheels, in their direction of rolling, (n,) each."""

    speed: FloatArray  # of the ground below [m/s]
    rim: FloatArray  # [m/s]
    by_speed: FloatArray  # derivative of `speed` by that of the body [-]
    dt: float  # [s]


class SinkageProcess(Component[SinkageState]):
    """Predicts the sinkage of all wheels, and tracks its rate."""

    def __init__(self, rover: Rover, layout: StateLayout, models: WheelModels) -> None:
        n = rover.wheel_count
        none = np.full((2, n), np.nan)
        super().__init__(SinkageState(none, (0.0,) * n, (_FIRST_RATE_STD,) * n, np.zeros(n)))
        self._rover, self._layout, self._models = rover, layout, models
        self._entries = np.arange(layout.size)[layout.sinkage]

    def predict(self, prediction: Prediction, x: FloatArray, cycle: Cycle) -> float:
        """Add the sinkages to a prediction from a state `x` (size,); return the travel [m]."""
        layout, rims, loads, dt = self._layout, cycle.rims, cycle.loads.load, cycle.dt
        turns = [abs(rim) >= self._rover.rest_speed for rim in rims]  # known ones
        turning = np.array(turns)
        loaded = np.array(loads) > LEAST_LOAD
        walk = np.where(turning, _LIFTED_WALK, _RESTING_WALK)
        prediction.Q[self._entries, self._entries] = walk * dt
        if not any(turns):
            return 0.0
        rim = np.where(turning, rims, 1.0)
        direction, rim = np.where(rim > 0.0, 1.0, -1.0), np.abs(rim)
        speed = direction * cycle.headings.speeds(float(x[SPEED]), cycle.yaw_rate)
        travel = np.abs(speed) + _SPIN_TRAVEL * np.abs(rim - speed)
        relaxes = turning & loaded
        if relaxes.any():
            states = WheelStates(
                speed / rim,
                x[layout.sinkage],
                np.maximum(loads, LEAST_LOAD),
                float(x[SHEAR_STRENGTH]),
                float(x[SHEAR_MODULUS]),
                leaving_angle=cycle.leaving_angles,
                stiffness=x[layout.stiffness],
                slip_sinkage=float(x[SLIP_SINKAGE]),
            )
            by_speed = direction * np.array(cycle.headings.by_speed)
            self._relax(prediction, states, _Motion(speed, rim, by_speed, dt), relaxes)
        return dt * float(travel[turning].sum()) / len(rims)

    def _relax(
        self, prediction: Prediction, states: WheelStates, motion: _Motion, relaxes: BoolArray
    ) -> None:
        """Relax the sinkages of turning wheels under a load."""
        layout, z = self._layout, np.asarray(states.sinkage)
        speed, rim, by_speed, dt = motion
        slip = slip_of_speed_ratio(states.speed_ratio)
        radius = np.array(self._rover.rim_radius)
        floored = np.maximum(z, _LEAST_SINKAGE)
        length = np.maximum(np.sqrt(2.0 * radius * floored), _LEAST_CONTACT)
        travel = (np.abs(speed) + _SPIN_RELAXATION * np.abs(rim - speed)) * dt
        alpha = -np.expm1(-travel / length)
        carried, exponents = self._models.bearing(
            states._replace(
                speed_ratio=states.speed_ratio + _STEPS[0],
                slip_sinkage=states.slip_sinkage + _STEPS[1],
            )
        )
        # One bounded Newton step on ln load over ln sinkage; the relaxation follows it anyway.
        power = exponents[0] + LOAD_EXPONENT
        growth = np.log(states.load / carried[0]) / power
        growth = np.minimum(np.maximum(growth, -_LONGEST_STEP), _LONGEST_STEP)
        target = floored * np.exp(growth)
        sensitivity = alpha * target / power
        raw = np.log(carried[1:] / carried[0]) / _STEP
        slopes = smoothed_slopes(self.state.slopes, raw)
        spun = np.maximum(slip, 0.0) ** 2 * rim * dt
        unmodelled_std = (self.state.unmodelled_std + _UNMODELLED_DIGGING * spun) * np.exp(
            -np.abs(speed) * dt / length
        )
        self.state = self.state._replace(
            slopes=np.where(relaxes, slopes, self.state.slopes),
            unmodelled_std=np.where(relaxes, unmodelled_std, self.state.unmodelled_std),
        )
        noise = (_LAW_ERROR * floored) ** 2 * 2.0 * alpha + _WALK * dt
        zi = self._entries[relaxes]
        ki = zi - layout.sinkage.start + layout.stiffness.start
        prediction.mean[zi] = (z + alpha * (target - z))[relaxes]
        prediction.F[zi, zi] = 1.0 - _RELAXATION_SLOPE * alpha[relaxes]
        prediction.F[zi, ki] = -sensitivity[relaxes]
        prediction.F[zi, SLIP_SINKAGE] = (-sensitivity * slopes[1])[relaxes]
        prediction.F[zi, SPEED] = (-sensitivity * slopes[0] / rim * by_speed)[relaxes]
        prediction.Q[zi, zi] = noise[relaxes]

    def end_cycle(
        self, ekf: GatedFilter, before: FloatArray, unread: Sequence[int], dt: float
    ) -> None:
        """Keep the rate of change since `before`, the (n,) sinkages at the start of the cycle.

        The deviation by unmodelled slip-sinkage is kept for wheels whose sinkage is `unread`.
        """
        unmodelled_std = np.zeros(len(before))
        unmodelled_std[unread] = self.state.unmodelled_std[unread]
        self.state = self.state._replace(unmodelled_std=unmodelled_std)
        if dt <= 0.0:
            return
        part = self._layout.sinkage
        gain = 1.0 - math.exp(-dt / _RATE_TIME)
        change = ((ekf.x[part] - before) / dt).tolist()
        variance = np.diagonal(ekf.P)[part].tolist()
        self.state = self.state._replace(
            rate=tuple([r + gain * (c - r) for r, c in zip(self.state.rate, change, strict=True)]),
            rate_std=tuple([math.sqrt(2.0 * v) for v in variance]),
        )
