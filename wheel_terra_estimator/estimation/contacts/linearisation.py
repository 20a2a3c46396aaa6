# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Torques and pulls of all wheels at the present state, with their rows of the Jacobian."""

from __future__ import annotations

from dataclasses import dataclass
from math import isnan
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.contacts.steering import Headings
from wheel_terra_estimator.estimation.contacts.wheel_models import (
    WheelForces,
    WheelModels,
    WheelState,
)
from wheel_terra_estimator.estimation.filter.state import (
    CENTROID,
    MOUND,
    RUT_SHARE,
    SHEAR_MODULUS,
    SHEAR_RADIUS,
    SHEAR_STRENGTH,
    SPEED,
    StateLayout,
)
from wheel_terra_estimator.estimation.rover import Rover

FloatArray = NDArray[np.float64]
Floats = tuple[float, ...]
_STRENGTH = 2  # column of the strength in the derivatives of `WheelForces`


@dataclass(frozen=True)
class LinearisationTuning:
    """Tuned on simulated drives, seeds 1000 to 1019, where no other source is given."""

    slope_keep: float = 0.9
    """Share of the old derivatives kept in a cycle: they are means over about a second."""
    new_contact: float = 0.15
    """Change of a torque by strength, of load times radius, that is no noise of the state."""
    least_load: float = 1e-3  # [N]: a wheel with less is in the air
    least_rim_over_rest: float = 2.0
    """Rim speed over ``rest_speed`` above which a wheel turns."""


class SlopeState(NamedTuple):
    """Smoothed derivatives of torque and pull of each wheel as in `WheelForces`; None = none."""

    torque: tuple[Floats | None, ...]
    pull: tuple[Floats | None, ...]


class _Contact(NamedTuple):
    """How the state enters the contact of a wheel."""

    wheel: int
    direction: float
    by_speed: float  # v / rim speed by the body's speed [s/m]
    by_shear_radius: float  # v / rim speed by it [-]
    by_sinkage: float  # depth of the contact by the sinkage [-]
    by_rut_share: float  # the same by the share of the rut that stays [m]


class ContactForces(NamedTuple):
    """Torque and pull of the turning wheels in the body's signs; zero for the others."""

    state: FloatArray  # (size,) at which they were worked out
    pull: FloatArray  # (n,) [N]
    torque: FloatArray  # (n,) [N m]
    pull_rows: FloatArray  # (n, size)
    torque_rows: FloatArray  # (n, size)
    pull_noise: FloatArray  # (n,) [N]: what the error of a measured leaving angle makes of it
    torque_noise: FloatArray  # (n,) [N m]

    def moved_to(self, state: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return pulls and torques at another state, to first order."""
        moved = state - self.state
        return self.pull + self.pull_rows @ moved, self.torque + self.torque_rows @ moved


class Linearisation(Component[SlopeState]):
    """Evaluates the wheel models once per cycle, with smoothed derivatives.

    Parameters
    ----------
    rover, layout, models
        Constants of the rover, layout of the state, wheel models.
    leaving_angle_std : float
        Of a measured leaving angle as it is used, smoothed [rad].

    Notes
    -----
    The curves bend within the uncertainty of the state. A slope taken at the noisy estimate is
    correlated with its error, which pulls the slip to the flat side and lets strength and K run
    along T(s) = const to their bounds; a smoothed one is not (docs/estimation/design.md).
    """

    def __init__(
        self,
        rover: Rover,
        layout: StateLayout,
        models: WheelModels,
        leaving_angle_std: float,
        tuning: LinearisationTuning = LinearisationTuning(),
    ) -> None:
        none = (None,) * rover.wheel_count
        super().__init__(SlopeState(none, none))
        self._rover, self._layout, self._models, self._tuning = rover, layout, models, tuning
        self._leaving_angle_std = leaving_angle_std
        self.least_load = tuning.least_load

    def turning(self, rims: Floats, loads: Floats) -> tuple[bool, ...]:
        """Say for which wheels the contact models hold: they turn under a load."""
        tuning = self._tuning
        least = tuning.least_rim_over_rest * self._rover.rest_speed
        return tuple(
            abs(rim) >= least and load >= tuning.least_load
            for rim, load in zip(rims, loads, strict=True)
        )

    def update(
        self,
        x: FloatArray,
        *,
        turns: tuple[bool, ...],
        yaw_rate: float,
        headings: Headings,
        rims: Floats,
        loads: Floats,
        leaving_angles: Floats,
        ruts: Floats,
    ) -> ContactForces:
        """Work out the forces of the wheels that turn at a state `x` (size,).

        Parameters
        ----------
        x : numpy.ndarray
            (size,) state.
        turns : tuple of bool
            Wheels for which the models hold, see `turning`.
        yaw_rate : float
            [rad/s].
        headings : Headings
            Of the wheels.
        rims, loads, leaving_angles : tuple of float
            Of each wheel [m/s], [N], [rad]; nan = unknown.
        ruts : tuple of float
            That each wheel meets [m].
        """
        rover, layout = self._rover, self._layout
        pull, torque, pull_noise, torque_noise = np.zeros((4, rover.wheel_count))
        rows = np.zeros((2, rover.wheel_count, layout.size))
        torque_slopes, pull_slopes = list(self.state.torque), list(self.state.pull)
        entries = x.tolist()
        speed, strength, modulus = entries[SPEED], entries[SHEAR_STRENGTH], entries[SHEAR_MODULUS]
        centroid, mound, rut_share = entries[CENTROID], entries[MOUND], entries[RUT_SHARE]
        sheared = 1.0 - entries[SHEAR_RADIUS]
        sinkage, error = entries[layout.sinkage], entries[layout.shear_error]
        for i in range(rover.wheel_count):
            if not turns[i]:
                continue
            rim = abs(rims[i])
            direction = 1.0 if rims[i] > 0.0 else -1.0
            # No wheel stands higher than the rut that it meets.
            rut = min(ruts[i], max(sinkage[i], 0.0))
            wheel = WheelState(
                speed_ratio=sheared * direction * headings.speed(i, speed, yaw_rate) / rim,
                sinkage=sinkage[i] - rut_share * rut,
                load=loads[i],
                strength=strength + error[i],
                shear_modulus=modulus,
                centroid=centroid,
                mound=mound,
                rim_speed=rim,
                leaving_angle=leaving_angles[i],
            )
            forces = self._models.forces(i, wheel)
            if not isnan(wheel.leaving_angle):
                torque_noise[i], pull_noise[i] = self._noise_of_angle(i, wheel, forces)
            pull[i], torque[i] = direction * forces.pull, direction * forces.torque
            moment = loads[i] * rover.shear_radius[i]
            torque_slopes[i], pull_slopes[i] = by_torque, by_pull = self.smoothed(
                torque_slopes[i], pull_slopes[i], forces, moment
            )
            by_speed = sheared * headings.by_speed[i] / rim
            by_radius = -wheel.speed_ratio / sheared
            by_sinkage = 1.0 - rut_share if rut < ruts[i] else 1.0
            contact = _Contact(i, direction, by_speed, by_radius, by_sinkage, -rut)
            self._fill(rows[0, i], contact, by_pull)
            self._fill(rows[1, i], contact, by_torque)
        self.state = SlopeState(tuple(torque_slopes), tuple(pull_slopes))
        return ContactForces(x.copy(), pull, torque, rows[0], rows[1], pull_noise, torque_noise)

    def _noise_of_angle(
        self, wheel: int, state: WheelState, forces: WheelForces
    ) -> tuple[float, float]:
        """Return what one deviation of the leaving angle makes of torque and pull."""
        angle = state.leaving_angle - self._leaving_angle_std
        there = self._models.forces(wheel, state._replace(leaving_angle=angle))
        return abs(there.torque - forces.torque), abs(there.pull - forces.pull)

    def smoothed(
        self,
        old_torque: Floats | None,
        old_pull: Floats | None,
        forces: WheelForces,
        moment: float,
    ) -> tuple[Floats, Floats]:
        """Return the smoothed derivatives of torque and pull; `moment`: load times radius [N m]."""
        tuning = self._tuning
        if old_torque is None or old_pull is None:
            return forces.d_torque, forces.d_pull
        torque = smoothed_slopes(old_torque, forces.d_torque, tuning.slope_keep)
        pull = smoothed_slopes(old_pull, forces.d_pull, tuning.slope_keep)
        change = abs(forces.d_torque[_STRENGTH] - old_torque[_STRENGTH])
        if change > tuning.new_contact * moment:
            # A wheel that comes free or locks is another contact at once.
            return (torque[0], *forces.d_torque[1:]), (pull[0], *forces.d_pull[1:])
        return torque, pull

    def _fill(self, row: FloatArray, contact: _Contact, slopes: Floats) -> None:
        """Write the derivatives of a wheel's force into its row of the Jacobian."""
        layout, (wheel, direction) = self._layout, contact[:2]
        by_ratio, by_depth, by_strength, by_modulus, by_centroid, by_mound = slopes
        # The ratio is that of the direction of rolling: the two signs cancel.
        row[SPEED] = by_ratio * contact.by_speed
        row[layout.sinkage.start + wheel] = direction * by_depth * contact.by_sinkage
        row[SHEAR_STRENGTH] = row[layout.shear_error.start + wheel] = direction * by_strength
        row[SHEAR_MODULUS] = direction * by_modulus
        row[CENTROID] = direction * by_centroid
        row[MOUND] = direction * by_mound
        row[RUT_SHARE] = direction * by_depth * contact.by_rut_share
        row[SHEAR_RADIUS] = direction * by_ratio * contact.by_shear_radius


def smoothed_slopes(old: Floats | None, new: Floats, keep: float) -> Floats:
    """Return derivatives of which the share `keep` is that of the cycle before."""
    if old is None:
        return new
    gain = 1.0 - keep
    return tuple([keep * a + gain * b for a, b in zip(old, new, strict=True)])
