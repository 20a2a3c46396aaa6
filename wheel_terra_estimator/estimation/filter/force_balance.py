# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Row of the update from the balance of forces: mass times specific force is the sum of pulls."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.contacts.cycle import Cycle
from wheel_terra_estimator.estimation.contacts.linearisation import ContactForces
from wheel_terra_estimator.estimation.contacts.stationary_wheels import StationaryPull
from wheel_terra_estimator.estimation.filter.consistency import smoothed_nis
from wheel_terra_estimator.estimation.filter.ekf import GatedFilter, Row, chi_square_gate
from wheel_terra_estimator.estimation.filter.state import StateLayout
from wheel_terra_estimator.estimation.rover import Rover, SensorFigures

# Tuned on simulated drives, seeds 1000 to 1019.
_WEIGHT_STD = 0.005  # error by curvature, ruts and mass, over the weight [-]
_GROUND_STD = 0.04  # noise per cycle over the weight [-]; beyond it is vibration, not ground
_SIDE_SHARE = 0.5
"""Deviation of the side force of a steered wheel over its load [-] (friction angle of sand); its
component along the body grows with the sine of the steering angle."""
_MODEL_SHARE = 0.1  # pull error over the load at a relative deviation of 1 of the shear model [-]


class SumOfPulls(NamedTuple):
    """Sum of the pulls by the accelerometer (mass times specific force)."""

    along: float  # for a body parallel to the ground [N]
    weight: float  # [N]; a tilt of the body by its ruts takes `weight` times it off `along`
    variance: float  # [N^2]
    vibration: float  # part of the variance that is independent from cycle to cycle [N^2]


class ForceBalance(Component['float | None']):
    """Turns the balance of forces along the ground into a row of the update.

    Keeps the running mean of its NIS, None = no reading yet.
    """

    def __init__(
        self,
        configuration: Configuration,
        rover: Rover,
        sensors: SensorFigures,
        layout: StateLayout,
    ) -> None:
        super().__init__(None)
        self._gate = float(configuration.filter.gate)
        self._rover, self._sensors, self._layout = rover, sensors, layout

    def sum_of_pulls(self, cycle: Cycle, curvature: float) -> SumOfPulls:
        """Return the sum of the pulls by the mean specific force of a cycle.

        On curved ground (slope per travel, [rad/m]) the wheels' own slopes differ from the body's.
        """
        rover, sensors, window = self._rover, self._sensors, cycle.window
        force = window.mean_force()
        weight = rover.mass * force[2]
        uphill = curvature * sum(
            w * x for w, x in zip(cycle.loads.load, rover.longitudinal, strict=True)
        )
        std = window.stated.specific_force_std or sensors.specific_force_std
        noise = std**2 / window.readings
        if window.duration > 0.0:
            noise = max(noise, window.noise_density / window.duration)
        noise *= rover.mass**2
        lasting = (rover.mass * sensors.specific_force_bias_std) ** 2 + (_WEIGHT_STD * weight) ** 2
        vibration = max(noise - (_GROUND_STD * rover.mass * rover.gravity) ** 2, 0.0)
        return SumOfPulls(rover.mass * force[0] + uphill, weight, noise + lasting, vibration)

    def update(
        self,
        ekf: GatedFilter,
        forces: ContactForces,
        total: SumOfPulls,
        cycle: Cycle,
        *,
        stationary: Sequence[StationaryPull | None],
        model_variance: float,
        repeats: float,
    ) -> Row:
        """Return the row of a cycle; `forces` are evaluated at the present state of the filter.

        `stationary` has None for a wheel that turns; `model_variance` is the relative variance of
        the shear model [-]; the errors of `repeats` cycles are one and the same (same ground).
        """
        headings, loads = cycle.headings, cycle.loads.load
        jacobian = np.array(headings.along) @ forces.pull_rows
        pull_sum = added_variance = 0.0
        for i, (load, standing) in enumerate(zip(loads, stationary, strict=True)):
            along, side = headings.along[i], headings.across[i] * _SIDE_SHARE * load
            added_variance += side * side
            if standing is None:
                pull_sum += along * float(forces.pull[i])
                added_variance += model_variance * (_MODEL_SHARE * load) ** 2
                added_variance += float(forces.pull_noise[i]) ** 2
            else:
                pull_sum += along * standing.expected
                added_variance += standing.std**2
        tilt = rut_tilt(self._rover, self._layout, ekf.x)
        for i, gain in enumerate(self._rover.rut_tilt):
            # Specific force along the ground: f_x - f_z * tilt (body pitched up by the ruts).
            jacobian[self._layout.sinkage.start + i] += total.weight * gain
        residual = total.along - (pull_sum + total.weight * tilt)
        variance = repeats * (total.variance - total.vibration) + total.vibration + added_variance
        expected = float(jacobian @ ekf.P @ jacobian) + variance
        self.state = smoothed_nis(self.state, residual * residual / expected)
        gate = chi_square_gate(residual, expected, self._gate)
        return Row(residual, jacobian, variance + gate)


def rut_tilt(rover: Rover, layout: StateLayout, mean: FloatArray) -> float:
    """Return the nose-up pitch of the body against the ground by unequal ruts [rad]."""
    sinkage = mean[layout.sinkage].tolist()
    return sum(gain * z for gain, z in zip(rover.rut_tilt, sinkage, strict=True))
