# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Kinematics, loads and torques of one filter cycle, inputs of its prediction and update."""

from __future__ import annotations

from typing import NamedTuple

from wheel_terra_estimator.arrays import FloatArray, Floats
from wheel_terra_estimator.estimation.contacts.loads import LoadState
from wheel_terra_estimator.estimation.contacts.steering import Headings
from wheel_terra_estimator.estimation.inputs.inertial import InertialWindow
from wheel_terra_estimator.estimation.scalars import NAN, known, median

TURN = 0.1
"""Lateral motion (see `Cycle`) from which wheels differ by the turn of the rover [-]."""
_TOGETHER = 0.5  # least typical rim speed over their magnitude where the sides drive together [-]


class RimSpeeds(NamedTuple):
    """Rim speeds with yaw rate and steering compensated [m/s]; nan = unknown."""

    each: Floats
    typical: float
    """Median of the known ones, so that no single wheel decides; nan = none is known."""
    magnitude: float  # median of their magnitudes

    @classmethod
    def of(cls, rims: Floats, yaw_rate: float, headings: Headings) -> RimSpeeds:
        """Compensate yaw rate [rad/s] and steering: the body speed that fits each rim speed."""
        each = tuple([headings.body_speed(i, rim, yaw_rate) for i, rim in enumerate(rims)])
        measured = known(each) or [NAN]
        return cls(each, median(measured), median([abs(rim) for rim in measured]))

    def along(self, least: float) -> bool:
        """Return whether both sides drive the same way, faster than `least` [m/s].

        In a turn on the spot the sides nearly cancel: the typical speed is mostly noise.
        """
        return abs(self.typical) > max(least, _TOGETHER * self.magnitude)

    def oppose(self, speed: float) -> bool:
        """Return whether all wheels turn against a body speed [m/s]; in a spot turn some do not."""
        measured = known(self.each)
        return bool(measured) and all(speed * rim < 0.0 for rim in measured)


class Cycle(NamedTuple):
    """One cycle; tuples have one entry per wheel."""

    time: float  # [s]
    dt: float
    window: InertialWindow
    rims: Floats  # [m/s], nan = unknown
    rim_noise: Floats  # deviation of each as white noise from cycle to cycle [m/s]
    yaw_compensated: RimSpeeds
    yaw_rate: float  # [rad/s]
    lateral_motion: float  # of the outer wheels over the fastest rim speed [-]
    headings: Headings
    still: bool  # all wheels stand
    torque: Floats  # means since the last cycle [N m], nan = no reading
    leaving_angles: FloatArray | None  # [rad], nan = unknown; None = no wheel's is known
    loads: LoadState
    turns: tuple[bool, ...]
    """Wheels for which the contact models hold: they turn under a load."""
    reference_known: bool  # a recent reference showed the slip before this cycle
    demand_change: float  # change of the required traction coefficient since the last cycle [-]
