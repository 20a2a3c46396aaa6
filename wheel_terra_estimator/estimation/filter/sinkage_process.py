# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""How each sinkage goes on: it relaxes over travel to where the bearing law carries the load."""

from __future__ import annotations

import math
from dataclasses import dataclass
from math import isnan
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.contacts.linearisation import smoothed_slopes
from wheel_terra_estimator.estimation.contacts.steering import Headings
from wheel_terra_estimator.estimation.contacts.wheel_models import WheelModels, WheelState
from wheel_terra_estimator.estimation.filter.ekf import GatedFilter
from wheel_terra_estimator.estimation.filter.prediction import Prediction
from wheel_terra_estimator.estimation.filter.state import (
    SHEAR_MODULUS,
    SHEAR_STRENGTH,
    SLIP_SINKAGE,
    SPEED,
    StateLayout,
)
from wheel_terra_estimator.estimation.rover import Rover
from wheel_terra_estimator.estimation.scalars import clipped, gain_of
from wheel_terra_estimator.terramechanics.kinematics import slip_of_speed_ratio
from wheel_terra_estimator.terramechanics.maths import ScalarMaths

FloatArray = NDArray[np.float64]
Floats = tuple[float, ...]


@dataclass(frozen=True)
class SinkageTuning:
    """Tuned on simulated drives, seeds 1000 to 1019, where no other source is given."""

    resting_walk: float = 1e-10  # of a wheel that does not turn [m^2/s]
    lifted_walk: float = 1e-4  # of a wheel in the air [m^2/s]
    walk: float = 1e-9  # [m^2/s]
    least_load: float = 1e-3  # [N]: less is in the air
    spin_travel: float = 0.1  # of the slip velocity that counts as travel over new soil
    spin_relaxation: float = 0.3  # of it that counts for the relaxation
    least_contact: float = 0.02  # length of a contact [m]
    least_contact_sinkage: float = 1e-3  # [m]
    least_sinkage: float = 5e-4  # [m], for the step on log sinkage
    ratio_step: float = 0.02  # of v / rim speed, for the derivative of the bearing law
    pressure_power: float = 0.5
    """Load goes with z^(N + 1/2): pressure with z^N, length of the contact with its root."""
    longest_step: float = 0.7  # ln of the sinkage in one cycle
    relaxation_slope: float = 0.9  # of the relaxation that acts on the covariance
    least_memory: float = 0.05  # of the sinkage in the covariance
    law_share: float = 0.5
    """Of the slip that the bearing law would see in the sinkage, without reference: its errors (n0,
    n1, the zero of the sensor) stay the same all the way, readings do not average them out."""
    law_error: float = 0.05  # of the sinkage per contact length
    digging: float = 0.05  # of the slip velocity times slip
    slope_keep: float = 0.9  # smoothing of the derivatives over about a second of cycles
    rate_time: float = 0.5  # time constant of the published rate [s]
    first_rate_std: float = 1.0  # [m/s], before anything is known


class SinkageState(NamedTuple):
    """One entry per wheel."""

    slopes: tuple[tuple[float, ...] | None, ...]
    """Smoothed derivatives of ln(load carried) by v / rim speed and by n1; None = none."""
    rate: Floats  # [m/s]
    rate_std: Floats


class _Step(NamedTuple):
    """One wheel's relaxation in a cycle."""

    mean: float
    noise: float
    memory: float = 1.0
    by_stiffness: float = 0.0
    by_slip_sinkage: float = 0.0
    by_speed: float = 0.0


class SinkageProcess(Component[SinkageState]):
    """Predicts the sinkage of all wheels; keeps its rate.

    Parameters
    ----------
    rover, layout, models
        Constants of the rover, layout of the state, wheel models.
    leaving_angle_std : float
        Of a measured leaving angle as it is used, smoothed [rad].
    """

    def __init__(
        self,
        rover: Rover,
        layout: StateLayout,
        models: WheelModels,
        leaving_angle_std: float,
        tuning: SinkageTuning = SinkageTuning(),
    ) -> None:
        n = rover.wheel_count
        super().__init__(SinkageState((None,) * n, (0.0,) * n, (tuning.first_rate_std,) * n))
        self._rover, self._layout, self._models, self._tuning = rover, layout, models, tuning
        self._leaving_angle_std = leaving_angle_std

    def forget_slopes(self) -> None:
        """Take the derivatives anew: the wheels stand."""
        self.state = self.state._replace(slopes=(None,) * self._rover.wheel_count)

    def predict(
        self,
        prediction: Prediction,
        x: FloatArray,
        dt: float,
        *,
        rims: Floats,
        loads: Floats,
        yaw_rate: float,
        headings: Headings,
        leaving_angles: Floats,
        reference_known: bool,
    ) -> float:
        """Add the sinkages to a prediction from a state `x` over `dt` [s]; return the travel [m].

        Parameters
        ----------
        prediction : Prediction
            Is changed.
        x : numpy.ndarray
            (size,) state before.
        dt : float
            [s].
        rims, loads, leaving_angles : tuple of float
            Of each wheel [m/s], [N], [rad]; nan = unknown.
        yaw_rate : float
            [rad/s].
        headings : Headings
            Of the wheels.
        reference_known : bool
            Whether a reference velocity tells the slip.
        """
        tuning, layout = self._tuning, self._layout
        share = 1.0 if reference_known else tuning.law_share
        travels = []
        slopes = list(self.state.slopes)
        entries = x.tolist()
        body, strength, modulus = entries[SPEED], entries[SHEAR_STRENGTH], entries[SHEAR_MODULUS]
        slip_sinkage, stiffness = entries[SLIP_SINKAGE], entries[layout.stiffness]
        for i, rim in enumerate(rims):
            zi = layout.sinkage.start + i
            if isnan(rim) or abs(rim) < self._rover.rest_speed:
                prediction.Q[zi, zi] = tuning.resting_walk * dt
                continue
            direction = 1.0 if rim > 0.0 else -1.0
            speed = direction * headings.speed(i, body, yaw_rate)
            rim = abs(rim)
            travels.append(abs(speed) + tuning.spin_travel * abs(rim - speed))
            if loads[i] <= tuning.least_load:
                prediction.Q[zi, zi] = tuning.lifted_walk * dt
                continue
            wheel = WheelState(
                speed / rim,
                entries[zi],
                loads[i],
                strength,
                modulus,
                leaving_angle=leaving_angles[i],
                stiffness=stiffness[i],
                slip_sinkage=slip_sinkage,
            )
            step, slopes[i] = self._relaxed(i, wheel, speed, rim, dt)
            prediction.mean[zi] = step.mean
            prediction.F[zi, zi] = step.memory
            prediction.F[zi, layout.stiffness.start + i] = step.by_stiffness
            prediction.F[zi, SLIP_SINKAGE] = step.by_slip_sinkage
            by_speed = step.by_speed * direction * headings.by_speed[i]
            prediction.F[zi, SPEED] = share * by_speed
            prediction.Q[zi, zi] = step.noise
        self.state = self.state._replace(slopes=tuple(slopes))
        return dt * math.fsum(travels) / len(rims) if travels else 0.0

    def end_cycle(self, ekf: GatedFilter, before: FloatArray, dt: float) -> None:
        """Keep the rate of change since `before`, the (n,) sinkages at the start of the cycle."""
        if dt <= 0.0:
            return
        part = self._layout.sinkage
        gain = 1.0 - math.exp(-dt / self._tuning.rate_time)
        change = ((ekf.mean[part] - before) / dt).tolist()
        variance = np.diagonal(ekf.covariance)[part].tolist()
        self.state = self.state._replace(
            rate=tuple([r + gain * (c - r) for r, c in zip(self.state.rate, change, strict=True)]),
            rate_std=tuple([math.sqrt(2.0 * v) for v in variance]),
        )

    def _relaxed(
        self, i: int, wheel: WheelState, speed: float, rim: float, dt: float
    ) -> tuple[_Step, tuple[float, ...]]:
        """Return the relaxation of a turning wheel and its smoothed derivatives."""
        tuning = self._tuning
        ratio, z, load = wheel.speed_ratio, wheel.sinkage, wheel.load
        slip = slip_of_speed_ratio(ratio, ScalarMaths)
        radius = self._rover.rim_radius[i]
        length = max(
            math.sqrt(2.0 * radius * max(z, tuning.least_contact_sinkage)), tuning.least_contact
        )
        travel = (abs(speed) + tuning.spin_relaxation * abs(rim - speed)) * dt
        alpha = gain_of(travel, length)
        bearing, slower = self._models.bearing_and_slower(i, wheel, tuning.ratio_step)
        # One Newton step on log load over log sinkage, bounded: relaxation does the rest.
        power = bearing.exponent + tuning.pressure_power
        growth = clipped(
            math.log(load / bearing.load) / power, -tuning.longest_step, tuning.longest_step
        )
        z_floor = max(z, tuning.least_sinkage)
        target = z_floor * math.exp(growth)
        sensitivity = alpha * target / power
        raw = (
            math.log(bearing.load / slower.load) / tuning.ratio_step,
            abs(slip) * bearing.log_depth,
        )
        slopes = smoothed_slopes(self.state.slopes[i], raw, tuning.slope_keep)
        by_ratio, by_slip_sinkage = slopes
        # What the law does not know: a share of the sinkage per contact length, and digging.
        digging = tuning.digging * max(slip, 0.0) ** 2 * rim * dt
        noise = (tuning.law_error * z_floor) ** 2 * 2.0 * alpha + digging**2 + tuning.walk * dt
        if not isnan(wheel.leaving_angle):
            angle = wheel.leaving_angle - self._leaving_angle_std
            there = self._models.bearing(i, wheel._replace(leaving_angle=angle))
            noise += (sensitivity * math.log(bearing.load / there.load)) ** 2
        step = _Step(
            z + alpha * (target - z),
            noise,
            memory=max(1.0 - alpha * tuning.relaxation_slope, tuning.least_memory),
            by_stiffness=-sensitivity,
            by_slip_sinkage=-sensitivity * by_slip_sinkage,
            by_speed=-sensitivity * by_ratio / rim,
        )
        return step, slopes
