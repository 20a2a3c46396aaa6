# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Why a wheel is judged as it is, and what is missing, in words."""

from __future__ import annotations

from math import isnan

from wheel_terra_estimator.arrays import Floats
from wheel_terra_estimator.estimation.judgement.slip import WheelSlip
from wheel_terra_estimator.estimation.judgement.stuck.monitor import StuckAssessment

COST = {
    'wheel_odometry': 'no wheel odometry: slip held',
    'imu': 'no IMU: loads of level ground, turning from the wheels, no balance of forces',
    'acceleration': (
        'no acceleration: no balance of forces, loads of level ground or by the orientation'
    ),
    'angular_rate': 'no angular rate: turning from the wheels',
    'orientation': 'no orientation: slope from gyro and specific force',
    'torque': 'no torque: pull from the balance of forces and the soil model',
    'sinkage': 'no sinkage: held by its model',
    'reference': 'no reference velocity: slip from forces and soil model',
}
"""Input that may be missing at a stamp -> that it is, and what that costs."""


def reasons_in_words(
    rims: Floats, slips: tuple[WheelSlip, ...], assessment: StuckAssessment
) -> tuple[str, ...]:
    """Return for each wheel why it is judged as it is; `rims` [m/s], nan = unknown."""
    stalled = assessment.stalled or (False,) * len(rims)
    warning = f'; rover: {assessment.reason}' if assessment.stuck and assessment.reason else ''
    words = []
    for rim, stands, wheel in zip(rims, stalled, slips, strict=True):
        if isnan(rim):
            text = 'no wheel rate'
        elif stands:
            text = 'stalled: torque near its limit, hardly turning'
        elif wheel.resting:
            text = 'at rest'
        else:
            text = f'slip {wheel.slip:.2f} +- {wheel.std:.2f}'
        words.append(text + warning)
    return tuple(words)
