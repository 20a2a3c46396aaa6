# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What the messages of an IMU state of its noise, where no file does."""

from __future__ import annotations

import math
from collections.abc import Container
from typing import NamedTuple

from wheel_terra_estimator.estimation.measurements import InertialVariance

_Range = tuple[float, float]

KEYS = ('sensors.specific_force_std', 'sensors.angular_rate_std', 'sensors.orientation_std_deg')
"""Where a file states each entry of `StatedNoise`."""
_CREDIBLE: tuple[_Range, ...] = ((5e-5, 5.0), (1e-5, 0.3), (1e-4, 0.1))
"""Least and greatest deviation of each that is no placeholder.

Specific force [m/s^2]: a tactical-grade accelerometer resolves 7 micro-g in 1 Hz (Safran MS1002
datasheet, 2016); rovers vibrate with up to 3 m/s^2. Angular rate [rad/s]: a fibre-optic gyro of
0.012 deg/sqrt(h) at 10 Hz; sixty times the 0.005 of a common one. Orientation [rad]: 0.006 deg, as
of survey-grade systems; 6 deg, beyond which an inclination says nothing of the ground.
"""


def credible(variance: InertialVariance) -> InertialVariance:
    """Return the variances without placeholders: 0 stands for what no sensor has."""
    kept = [
        value if least**2 <= value <= most**2 else 0.0
        for value, (least, most) in zip(variance, _CREDIBLE, strict=True)
    ]
    return InertialVariance(*kept)


class StatedNoise(NamedTuple):
    """Standard deviations that count in place of the defaults; 0 = that of ``sensors.*`` counts."""

    specific_force_std: float = 0.0  # [m/s^2], per message
    angular_rate_std: float = 0.0  # [rad/s], per message
    orientation_std: float = 0.0  # roll and pitch [rad]

    def completed(self, variance: InertialVariance, given: Container[str]) -> StatedNoise:
        """Return it with what a message states and neither a file nor a message before it did.

        `variance` holds no placeholders; `given` are the keys that a file states.
        """
        stds = list(self)
        for i, key in enumerate(KEYS):
            if not stds[i] and key not in given:
                stds[i] = math.sqrt(variance[i])
        return StatedNoise(*stds)


NOTHING_STATED = StatedNoise()
