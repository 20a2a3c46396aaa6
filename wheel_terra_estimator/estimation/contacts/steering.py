# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Where the wheels head, and how fast each moves along its heading.

A hub at (x, y) of a body that moves with v along, v_y across and turns with w moves with
(v - w y, v_y + w x); along a heading d that is::

    v_i = (v - w y) cos d + (v_y + w x) sin d

and across it::

    u_i = -(v - w y) sin d + (v_y + w x) cos d

No sensor reads v_y. Wheels resist being pushed sideways, so it is taken as what makes the sum of
u_i^2 least: v_y = sum(((v - w y) sin d - w x cos d) cos d) / sum(cos^2 d). It is 0 at an axle
that does not steer where the others follow Ackermann's geometry, and v tan d where all wheels
steer alike. So v_i and u_i are linear in v and w, with gains that follow from the angles alone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from math import isnan
from typing import NamedTuple

import numpy as np

from wheel_terra_estimator.arrays import FloatArray, Floats
from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.rover import Rover

_LEAST_SQUARE = 1e-3  # mean of cos^2 d: all wheels across


class Headings(NamedTuple):
    """Gains of the wheels' own speeds; one entry per wheel."""

    by_speed: Floats  # of v_i by v [-]
    by_yaw_rate: Floats  # of v_i by w [m]
    along: Floats  # cos d: share of a pull that acts along the body
    across: Floats  # sin d
    side_by_speed: Floats  # of u_i by v [-]
    side_by_yaw_rate: Floats  # of u_i by w [m]

    def speeds(self, speed: float, yaw_rate: float) -> FloatArray:
        """Return the ground speed of each wheel along its heading, (n,) [m/s]."""
        return np.array(self.by_speed) * speed + np.array(self.by_yaw_rate) * yaw_rate

    def body_speed(self, wheel: int, rim: float, yaw_rate: float) -> float:
        """Return the body speed that comes nearest to a wheel's rolling [m/s]; nan as its rim.

        Wheels resist being pushed sideways as they do slip along, so it is the v that makes
        (v_i - rim)^2 + u_i^2 least; v itself where the wheel rolls without slip in any direction.
        """
        along, across = self.by_speed[wheel], self.side_by_speed[wheel]
        rolled = rim - self.by_yaw_rate[wheel] * yaw_rate
        pushed = self.side_by_yaw_rate[wheel] * yaw_rate
        return (along * rolled - across * pushed) / (along * along + across * across)

    def yaw_rate(self, rims: Floats) -> float:
        """Return the yaw rate at which wheels would roll, by least squares [rad/s]; 0: unknown."""
        aa = ab = bb = along = across = 0.0
        for a, b, rim in zip(self.by_speed, self.by_yaw_rate, rims, strict=True):
            if not isnan(rim):
                aa += a * a
                ab += a * b
                bb += b * b
                along += a * rim
                across += b * rim
        determinant = aa * bb - ab * ab
        if determinant <= _LEAST_SQUARE * max(aa * bb, _LEAST_SQUARE):
            return 0.0
        return (aa * across - ab * along) / determinant

    def side_speeds(self, speed: float, yaw_rate: float) -> list[float]:
        """Return how fast each wheel is pushed sideways [m/s]."""
        return [
            by_speed * speed + by_yaw_rate * yaw_rate
            for by_speed, by_yaw_rate in zip(self.side_by_speed, self.side_by_yaw_rate, strict=True)
        ]


def headings(rover: Rover, angles: Sequence[float]) -> Headings:
    """Return the headings of wheels at steering angles [rad], positive left."""
    sine, cosine = [math.sin(a) for a in angles], [math.cos(a) for a in angles]
    x, y = rover.longitudinal, rover.lateral
    square = max(sum(c * c for c in cosine), _LEAST_SQUARE * len(angles))
    # v_y = drift v + arm w
    drift = sum(s * c for s, c in zip(sine, cosine, strict=True)) / square
    arm = -sum(c * (b * s + a * c) for s, c, a, b in zip(sine, cosine, x, y, strict=True)) / square
    wheels = list(zip(sine, cosine, x, y, strict=True))
    return Headings(
        by_speed=tuple([c + drift * s for s, c, _, _ in wheels]),
        by_yaw_rate=tuple([(arm + a) * s - b * c for s, c, a, b in wheels]),
        along=tuple(cosine),
        across=tuple(sine),
        side_by_speed=tuple([drift * c - s for s, c, _, _ in wheels]),
        side_by_yaw_rate=tuple([(arm + a) * c + b * s for s, c, a, b in wheels]),
    )


class SteeringState(NamedTuple):
    """Newest angles [rad], and what follows from them."""

    angles: Floats
    headings: Headings


class Steering(Component[SteeringState]):
    """Keeps the newest steering angles; wheels head straight until one was read."""

    def __init__(self, rover: Rover) -> None:
        straight = (0.0,) * rover.wheel_count
        super().__init__(SteeringState(straight, headings(rover, straight)))
        self._rover = rover

    def update(self, steering: FloatArray) -> None:
        """Take angles (n,) [rad]; wheels that are nan keep theirs."""
        angles = tuple(
            [
                old if isnan(new) else new
                for new, old in zip(steering.tolist(), self.state.angles, strict=True)
            ]
        )
        if angles != self.state.angles:
            self.state = SteeringState(angles, headings(self._rover, angles))
