# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A map of a drive: where the rover was, and what the ground was like there.

The position is reckoned in the plane from the estimated velocity along the reported heading, else
by the estimated yaw rate; the height from the reported pitch.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass

import numpy as np

from wheel_terra_estimator.arrays import FloatArray, IntArray
from wheel_terra_estimator.bags.history import ThinnedRows
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.estimates import EstimateSet, SlipClass
from wheel_terra_estimator.estimation.measurements import InertialReading, Measurement, heading_of

SPACING = 0.02  # way between two points of a track [m]
PAUSE = 1.0
"""Time after which a point is added without way [s]; also the longest step that is reckoned on."""
ATTITUDE_PERIOD = 0.05  # time between two attitudes that are kept [s]
MOST_POINTS = 200_000
"""Points that are kept: 4 km without a gap; of a longer drive every second, fourth ... one."""
_SECOND = 1e-9  # of a nanosecond

COLUMNS = {
    'time': 's',
    'x': 'm',
    'y': 'm',
    'z': 'm',
    'heading': 'rad',
    'distance': 'm',
    'forward_velocity': 'm/s',
    'slip': '-',
    'slip_std': '-',
    'slip_class': '',
    'sinkage': 'm',
    'pull_margin': 'N',
    'soil_strength': '-',
    'soil_stiffness': '-',
    'stuck_probability': '-',
    'stuck': '',
}
"""Columns of a track and their units, see `Track`."""


@dataclass(frozen=True)
class Track:
    """Points along a drive, (k,) each.

    ``values`` by the names of `COLUMNS`: position [m] and heading [rad] from the first point;
    ``distance`` travelled; medians of slip and its deviation over the wheels; the
    worst known class of a wheel (255: none is known); greatest sinkage; sum of the pull margins;
    learned shear strength and bearing modulus over those stated (1: as stated); the probability of
    an entrapment and whether the warning ran.
    """

    stamp: IntArray  # [ns]
    values: dict[str, FloatArray]
    source: str  # of the position, in words


class TrackRecorder:
    """Collects a track from sets and attitudes; soil learned is compared with soil configured."""

    def __init__(self, configuration: Configuration) -> None:
        soil = configuration.soil
        self._tangent = math.tan(float(soil.friction_angle))
        moduli = {
            'soil.frictional_modulus': float(soil.frictional_modulus),
            'soil.cohesive_modulus': float(soil.cohesive_modulus),
        }
        # Both are learned by one factor; either may be 0.
        self._modulus = max(moduli.items(), key=lambda item: abs(item[1]))
        self._attitude_stamps: list[int] = []
        self._attitudes: list[tuple[float, float]] = []  # heading [rad], sine of the climb
        self._rows = ThinnedRows(MOST_POINTS)
        self._origin = self._stamp = self._noted = 0
        self._place = [0.0, 0.0, 0.0]
        self._heading = self._distance = self._next = 0.0

    def hear(self, measurement: Measurement) -> None:
        """Take the attitude out of a measurement that has one."""
        if not isinstance(measurement, InertialReading) or measurement.orientation is None:
            return
        stamps = self._attitude_stamps
        if not stamps or measurement.stamp - stamps[-1] >= ATTITUDE_PERIOD / _SECOND:
            stamps.append(measurement.stamp)
            x, y, z, w = measurement.orientation.tolist()
            heading = float(heading_of(measurement.orientation))
            self._attitudes.append((heading, -2.0 * (w * y - x * z)))

    def add(self, estimates: EstimateSet) -> None:
        """Go on to a set."""
        first = not self._origin
        step = 0.0 if first else (estimates.stamp - self._stamp) * _SECOND
        if first:
            self._origin = estimates.stamp
        self._stamp = estimates.stamp
        if not 0.0 <= step <= PAUSE:
            step = 0.0  # a pause, or a clock that steps back: the path between is unknown
        way = estimates.forward_velocity * step
        latest = bisect_right(self._attitude_stamps, estimates.stamp) - 1
        if latest >= 0 and (estimates.stamp - self._attitude_stamps[latest]) * _SECOND <= PAUSE:
            self._heading, climb = self._attitudes[latest]
        else:
            self._heading, climb = self._heading + estimates.yaw_rate * step, 0.0
        level = way * math.sqrt(max(1.0 - climb * climb, 0.0))
        self._place[0] += level * math.cos(self._heading)
        self._place[1] += level * math.sin(self._heading)
        self._place[2] += way * climb
        self._distance += abs(way)
        since = abs(estimates.stamp - self._noted) * _SECOND
        if first or self._distance >= self._next or since >= PAUSE:
            self._noted = estimates.stamp
            self._next = self._distance + SPACING
            self._rows.add(estimates.stamp, self._row(estimates))

    def track(self) -> Track:
        """Return the track."""
        columns = self._rows.values(len(COLUMNS)).T
        yaw = 'orientation' if self._attitudes else 'yaw rate'
        return Track(
            self._rows.stamps(),
            dict(zip(COLUMNS, columns, strict=True)),
            f'dead reckoning from estimated velocity and {yaw}',
        )

    def _row(self, estimates: EstimateSet) -> FloatArray:
        soil = dict(zip(estimates.soil_names, estimates.soil.tolist(), strict=True))
        known = estimates.slip_class[estimates.slip_class != SlipClass.UNKNOWN]
        return np.array(
            [
                (estimates.stamp - self._origin) * _SECOND,
                *self._place,
                self._heading,
                self._distance,
                estimates.forward_velocity,
                np.median(estimates.slip),
                np.median(estimates.slip_std),
                known.max() if known.size else SlipClass.UNKNOWN,
                estimates.sinkage.max(),
                estimates.pull_margin.sum(),
                math.tan(math.radians(soil['soil.friction_angle_deg'])) / self._tangent,
                soil[self._modulus[0]] / self._modulus[1],
                estimates.stuck_probability.max(),
                float(estimates.stuck),
            ]
        )
