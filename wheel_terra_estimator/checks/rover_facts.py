# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Facts of the rover before its recording is checked: a rover file, or typical values."""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.sensor_errors import SensorErrors

_LEFT = re.compile(r'(^|[^a-z])(left|l|fl|ml|rl|lf|lm|lr|bl|lb)([^a-z]|$)')
_RIGHT = re.compile(r'(^|[^a-z])(right|r|fr|mr|rr|rf|rm|br|rb)([^a-z]|$)')
_FRONT = re.compile(r'front|(^|[^a-z])(f[lr]?|[lr]f)([^a-z]|$)')
_MIDDLE = re.compile(r'mid|cent(re|er)|(^|[^a-z])(m[lr]?|[lr]m)([^a-z]|$)')
_WHEEL = re.compile(r'wheel|drive|traction')
_NUMBER = re.compile(r'\d{1,3}')
_CAMEL = re.compile(r'(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])')


@dataclass(frozen=True)
class RoverFacts:
    """The rover as the checks see it; arrays are (n,) in the order of ``names``.

    ``side`` is +1 on the left, -1 on the right, 0 unknown. Without a rover file (not ``known``)
    radius, mass and track are nan, and the configuration is that of the defaults.
    """

    configuration: Configuration
    known: bool
    names: tuple[str, ...]
    side: FloatArray
    lateral: FloatArray  # y [m]
    radius: FloatArray  # that the slip refers to [m]
    direction: FloatArray
    mass: float
    gravity: float

    @property
    def sensors(self) -> Any:
        """Stated figures of the sensors."""
        return self.configuration.sensors

    @cached_property
    def errors(self) -> SensorErrors:
        """Stated zeros and gains."""
        return SensorErrors(self.configuration)

    @cached_property
    def mounting(self) -> FloatArray:
        """Stated (3, 3) rotation from the IMU's frame into ``base_link``."""
        angles = [
            getattr(self.sensors, f'imu_mounting_{axis}') for axis in ('roll', 'pitch', 'yaw')
        ]
        return np.asarray(Rotation.from_euler('xyz', angles).as_matrix())

    def named(self, which: Any) -> str:
        """Return the wheels that are picked (n,), in words."""
        return ', '.join(itertools.compress(self.names, which))

    def has_sides(self) -> bool:
        """Return whether wheels on both sides are known."""
        return bool((self.side > 0).any() and (self.side < 0).any())


def from_configuration(configuration: Configuration) -> RoverFacts:
    """Return the facts of a rover file."""
    wheels = configuration.wheels
    return RoverFacts(
        configuration=configuration,
        known=True,
        names=wheels.names,
        side=np.sign(wheels.y),
        lateral=wheels.y,
        radius=wheels.slip_radius,
        direction=wheels.direction.astype(float),
        mass=configuration.rover.mass,
        gravity=configuration.rover.gravity,
    )


def from_names(joints: Sequence[str]) -> RoverFacts:
    """Return what the names of joints suggest: which are wheels, and where they are."""
    names = wheel_names(joints)
    count = len(names)
    nowhere: dict[str, Any] = {'rover.suspension': 'shares'}  # rigid needs places
    nowhere['wheels.names'] = [f'wheel_{i}' for i in range(max(count, 1))]
    return RoverFacts(
        configuration=reader.from_parameters(nowhere, complete=False),
        known=False,
        names=names,
        side=np.array([side_of(name) for name in names], dtype=float),
        lateral=np.full(count, np.nan),
        radius=np.full(count, np.nan),
        direction=np.ones(count),
        mass=np.nan,
        gravity=9.80665,
    )


def wheel_names(joints: Sequence[str]) -> tuple[str, ...]:
    """Return the joints that are wheels by their names, front to rear, left before right."""
    driven = [n for n in joints if 'steer' not in n.lower()]
    wheels = [n for n in driven if _WHEEL.search(n.lower())]
    wheels = wheels or [n for n in driven if side_of(n)] or list(joints)
    return tuple(sorted(wheels, key=place))


def in_words(name: str) -> str:
    """Return the name of a joint in lower case, its words separated: ``frontLeft``: front_left."""
    return _CAMEL.sub('_', name).lower()


def side_of(name: str) -> int:
    """Return +1 for a name of the left side, -1 for the right, 0 where it has no side."""
    low = in_words(name)
    left, right = bool(_LEFT.search(low)), bool(_RIGHT.search(low))
    return int(left) - int(right)


def place(name: str) -> tuple[int, int, int]:
    """Return what orders names front to rear, left before right: row, number, side."""
    low = in_words(name)
    row = 0 if _FRONT.search(low) else 1 if _MIDDLE.search(low) else 2
    number = _NUMBER.search(low)
    return row, int(number.group()) if number else 0, -side_of(name)
