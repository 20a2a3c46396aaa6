# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Why a wheel is judged as it is, and what is missing, in words."""

from __future__ import annotations

from math import isnan

from wheel_terra_estimator.arrays import Floats
from wheel_terra_estimator.estimation.judgement.slip import WheelSlip
from wheel_terra_estimator.estimation.judgement.stuck.monitor import StuckAssessment

COST = {
    'wheel_odometry': 'no wheel odometry: slip keeps its last value',
    'imu': 'no IMU: loads as on level ground, yaw rate from the wheels, no force balance',
    'acceleration': (
        'no acceleration: no force balance, loads as on level ground or by the orientation'
    ),
    'angular_rate': 'no angular rate: yaw rate from the wheels',
    'orientation': 'no orientation: slope from gyro and specific force',
    'torque': 'no torque: pull from the force balance and the soil model',
    'sinkage': 'no sinkage reading: sinkage from its model',
    'reference': 'no reference velocity: slip from forces and soil model',
}
"""Input that may be missing at a stamp -> that it is, and what that costs."""

NO_RATE, STALLED = 'no wheel rate', 'stalled: torque near its limit, hardly turning'


def reasons_in_words(
    rims: Floats, slips: tuple[WheelSlip, ...], assessment: StuckAssessment
) -> tuple[str, ...]:
    """Return for each wheel why it is judged as it is; `rims` [m/s], nan = unknown."""
    stalled = assessment.stalled or (False,) * len(rims)
    warning = f'; rover: {assessment.reason}' if assessment.stuck and assessment.reason else ''
    words = []
    for rim, stands, wheel in zip(rims, stalled, slips, strict=True):
        if isnan(rim):
            text = NO_RATE
        elif stands:
            text = STALLED
        elif wheel.resting:
            text = 'at rest'
        else:
            text = f'slip {wheel.slip:.2f} +- {wheel.std:.2f}'
        words.append(text + warning)
    return tuple(words)
