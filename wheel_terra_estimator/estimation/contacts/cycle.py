# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What a cycle of the filter knows of wheels and body before its update."""

from __future__ import annotations

from typing import NamedTuple

from wheel_terra_estimator.arrays import Floats
from wheel_terra_estimator.estimation.contacts.loads import LoadState
from wheel_terra_estimator.estimation.contacts.steering import Headings
from wheel_terra_estimator.estimation.inputs.inertial import InertialWindow
from wheel_terra_estimator.estimation.scalars import NAN, known, median

_TOGETHER = 0.5  # least typical rim speed over their magnitude where the sides drive together [-]


class RimSpeeds(NamedTuple):
    """Rim speeds without the share that turning and steering have in them [m/s]; nan = unknown."""

    each: Floats
    typical: float
    """Median of the known ones, so that no single wheel decides; nan = none is known."""

    @classmethod
    def of(cls, rims: Floats, yaw_rate: float, headings: Headings) -> RimSpeeds:
        """Take turning [rad/s] and steering off: the body speed that each wheel asks for."""
        if headings.steered:
            each = tuple([headings.body_speed(i, rim, yaw_rate) for i, rim in enumerate(rims)])
        else:  # each rolls along with the body
            each = tuple(
                [
                    rim - by_yaw_rate * yaw_rate
                    for rim, by_yaw_rate in zip(rims, headings.by_yaw_rate, strict=True)
                ]
            )
        measured = known(each)
        return cls(each, median(measured) if measured else NAN)

    def along(self, least: float) -> bool:
        """Tell whether the wheels drive the body along, faster than `least` [m/s].

        In a turn on the spot the typical speed is what two sides leave: its changes are noise.
        """
        return abs(self.typical) > max(least, _TOGETHER * self.magnitude)

    @property
    def magnitude(self) -> float:
        """Median of the magnitudes of the known ones [m/s]; nan = none is known."""
        measured = known(self.each)
        return median([abs(rim) for rim in measured]) if measured else NAN

    def oppose(self, speed: float) -> bool:
        """Tell whether all wheels turn against a speed of the body [m/s]; in a spin some do not."""
        measured = known(self.each)
        return bool(measured) and all(speed * rim < 0.0 for rim in measured)


class Cycle(NamedTuple):
    """One cycle; tuples have one entry per wheel."""

    time: float  # [s]
    dt: float
    window: InertialWindow
    rims: Floats  # [m/s], nan = unknown
    yaw_compensated: RimSpeeds
    yaw_rate: float  # [rad/s]
    lateral_motion: float  # of the outer wheels over the fastest rim speed [-]
    headings: Headings
    still: bool  # all wheels stand
    torque: Floats  # means since the last cycle [N m], nan = none came
    leaving_angles: Floats  # [rad], nan = unknown
    loads: LoadState
    turns: tuple[bool, ...]
    """Wheels for which the contact models hold: they turn under a load."""
    reference_known: bool  # of late, before this cycle
    demand_change: float  # by how much more the ground asks than at the last cycle [-]
