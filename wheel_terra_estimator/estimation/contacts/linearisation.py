# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Torques and pulls of all wheels at the present state, with their rows of the Jacobian."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wheel_terra_estimator.arrays import BoolArray, FloatArray, Floats
from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.contacts.cycle import Cycle
from wheel_terra_estimator.estimation.contacts.loads import LEAST_LOAD
from wheel_terra_estimator.estimation.contacts.wheel_models import (
    STEPPED,
    STRENGTH,
    WheelForces,
    WheelModels,
    WheelStates,
)
from wheel_terra_estimator.estimation.filter.state import (
    CENTROID,
    RUT_SHARE,
    SHEAR_MODULUS,
    SHEAR_STRENGTH,
    SPEED,
    StateLayout,
)
from wheel_terra_estimator.estimation.rover import Rover

# Tuned on simulated drives, seeds 1000 to 1019, where no other source is given.
_SLOPE_KEEP = 0.9
"""Share of the old derivatives kept in a cycle [-]: they are means over about a second."""
_NEW_CONTACT = 0.15
"""Change of d torque / d ln strength, over load times radius [-], beyond the noise of the state:
the wheel has come free or has locked."""
_MOST_BLUR = 0.05
"""Noise of a torque by that of its rim speed, over load times radius [-], above which torques do
not tell the soil: a strength fitted at slips that are mostly noise tends to zero (errors in
variables, Fuller 1987)."""
_LEAST_RIM_OVER_REST = 2.0
"""Rim speed over ``rest_speed`` above which a wheel turns."""


class ContactForces(NamedTuple):
    """Torque and pull of the turning wheels in the body's signs; zero for the others."""

    state: FloatArray  # (size,) at which they were evaluated
    pull: FloatArray  # (n,) [N]
    torque: FloatArray  # (n,) [N m]
    pull_rows: FloatArray  # (n, size) Jacobian
    torque_rows: FloatArray  # (n, size)
    pull_noise: FloatArray  # (n,) deviation by errors of rim speed and leaving angle [N]
    torque_noise: FloatArray  # (n,) [N m]
    blurred: bool
    """Whether the noise of the rim speeds hides how the torque depends on soil."""

    def moved_to(self, state: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return pulls and torques at another state, to first order."""
        moved = state - self.state
        return self.pull + self.pull_rows @ moved, self.torque + self.torque_rows @ moved


class Linearisation(Component[FloatArray]):
    """Evaluates the wheel models once per cycle, with smoothed derivatives.

    Its memory: smoothed derivatives of torque and pull as in `WheelForces`, (2, 5, n); nan = none.
    `leaving_angle_std` is the deviation of a measured leaving angle after smoothing [rad].

    Notes
    -----
    Torque and pull are curved within the uncertainty of the state. A derivative taken at the noisy
    estimate is correlated with the error of that estimate: slip is biased to the flat side of the
    curve, and strength and K drift along T(s) = const to their bounds. A smoothed derivative is not
    (docs/estimation/design.md).
    """

    def __init__(
        self, rover: Rover, layout: StateLayout, models: WheelModels, leaving_angle_std: float
    ) -> None:
        super().__init__(np.full((2, len(STEPPED), rover.wheel_count), np.nan))
        self._rover, self._layout, self._models = rover, layout, models
        self._leaving_angle_std = leaving_angle_std

    def update(self, x: FloatArray, cycle: Cycle, ruts: Floats) -> ContactForces:
        """Return the forces of the wheels that turn at a state `x` (size,).

        `ruts` are the depths of the ruts that the wheels meet [m].
        """
        turns, headings, loads = cycle.turns, cycle.headings, cycle.loads.load
        layout, n = self._layout, self._rover.wheel_count
        rows = np.zeros((2, n, layout.size))
        if not any(turns):
            nothing = np.zeros(n)
            return ContactForces(x, nothing, nothing, rows[0], rows[1], nothing, nothing, False)
        turning = np.array(turns)
        rim, load, rut = np.where(turning, cycle.rims, 1.0), np.array(loads), np.array(ruts)
        direction, rim = np.where(rim > 0.0, 1.0, -1.0), np.abs(rim)
        rut_share = float(x[RUT_SHARE])
        met = _met(x, layout, rut)
        speed = direction * headings.speeds(float(x[SPEED]), cycle.yaw_rate)
        states = contact_states(x, layout, load, rut)._replace(
            speed_ratio=speed / rim,
            rim_speed=rim,
            leaving_angle=cycle.leaving_angles,
        )
        forces = self._models.forces(states)
        torque_noise, pull_noise = self._noise_of_angle(states, forces, turning)
        moment = load * np.array(self._rover.shear_radius)
        self.state = self.smoothed(forces, moment, turning)
        by_ratio, by_depth, by_strength, by_modulus, by_centroid = self.state[::-1].transpose(
            1, 0, 2
        )
        wheels = np.arange(n)
        # Changes of pull and torque by one deviation of the rim speed, at the same ground speed.
        by_rim = np.where(turning, by_ratio * (speed / rim**2 * cycle.rim_noise), 0.0)
        pull_noise, torque_noise = np.hypot([pull_noise, torque_noise], by_rim)
        blurred = bool(np.median(np.abs(by_rim[1, turning]) / moment[turning]) > _MOST_BLUR)
        # The ratio is that of the direction of rolling: the two signs cancel.
        rows[:, :, SPEED] = by_ratio * (np.array(headings.by_speed) / rim)
        by_sinkage = np.where(met < rut, 1.0 - rut_share, 1.0)
        rows[:, wheels, layout.sinkage.start + wheels] = by_depth * (direction * by_sinkage)
        rows[:, :, RUT_SHARE] = by_depth * (direction * -met)
        rows[:, :, SHEAR_STRENGTH] = by_strength * direction
        rows[:, wheels, layout.shear_error.start + wheels] = by_strength * direction
        rows[:, :, SHEAR_MODULUS] = by_modulus * direction
        rows[:, :, CENTROID] = by_centroid * direction
        rows[:, ~turning] = 0.0
        pull, torque = np.where(turning, direction * [forces.pull, forces.torque], 0.0)
        return ContactForces(x, pull, torque, rows[0], rows[1], pull_noise, torque_noise, blurred)

    def _noise_of_angle(
        self, states: WheelStates, forces: WheelForces, turning: BoolArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the change of torques and pulls by one deviation of the leaving angles, (n,)."""
        nothing = np.zeros(len(turning))
        if states.leaving_angle is None:
            return nothing, nothing
        measured = turning & ~np.isnan(states.leaving_angle)
        angle = states.leaving_angle - self._leaving_angle_std
        torque, pull = self._models.torque_and_pull(states._replace(leaving_angle=angle))
        return (
            np.where(measured, np.abs(torque - forces.torque), 0.0),
            np.where(measured, np.abs(pull - forces.pull), 0.0),
        )

    def smoothed(self, forces: WheelForces, moment: FloatArray, turning: BoolArray) -> FloatArray:
        """Return the smoothed derivatives; `moment`: load times radius of each wheel [N m]."""
        old, new = self.state, np.array([forces.d_torque, forces.d_pull])
        slopes = smoothed_slopes(old, new)
        # A wheel that comes free or locks has new derivatives at once.
        change = np.abs(new[0, STRENGTH] - old[0, STRENGTH])
        other = change > _NEW_CONTACT * moment
        slopes[:, 1:] = np.where(other, new[:, 1:], slopes[:, 1:])
        return np.where(turning, slopes, old)


def contact_states(
    x: FloatArray, layout: StateLayout, loads: FloatArray | Floats, ruts: FloatArray | Floats
) -> WheelStates:
    """Return the state of wheels at no slip, in the ruts that they meet [m]; arguments are (n,)."""
    return WheelStates(
        speed_ratio=1.0,
        sinkage=x[layout.sinkage] - float(x[RUT_SHARE]) * _met(x, layout, ruts),
        load=np.asarray(loads),
        strength=x[SHEAR_STRENGTH] + x[layout.shear_error],
        shear_modulus=float(x[SHEAR_MODULUS]),
        centroid=float(x[CENTROID]),
    )


def _met(x: FloatArray, layout: StateLayout, ruts: FloatArray | Floats) -> FloatArray:
    """Return the ruts that wheels stand in (n,) [m]: none is deeper than the wheel's sinkage."""
    return np.minimum(ruts, np.maximum(x[layout.sinkage], 0.0))


def turning_wheels(rover: Rover, rims: Floats, loads: Floats) -> tuple[bool, ...]:
    """Return for which wheels the contact models hold: they turn under a load."""
    least = _LEAST_RIM_OVER_REST * rover.rest_speed
    return tuple(
        abs(rim) >= least and load >= LEAST_LOAD for rim, load in zip(rims, loads, strict=True)
    )


def smoothed_slopes(old: FloatArray, new: FloatArray) -> FloatArray:
    """Return derivatives smoothed with those of the cycle before; nan = none."""
    return np.where(np.isnan(old), new, _SLOPE_KEEP * old + (1.0 - _SLOPE_KEEP) * new)
