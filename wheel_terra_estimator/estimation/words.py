# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Why a wheel is judged as it is, and what is missing, in words."""

from __future__ import annotations

from math import isnan
from typing import NamedTuple

from wheel_terra_estimator.arrays import Floats
from wheel_terra_estimator.estimation.judgement.slip import WheelSlip
from wheel_terra_estimator.estimation.judgement.stuck.monitor import StuckAssessment


class MissingInputs(NamedTuple):
    """Which inputs are missing at a stamp."""

    wheel_odometry: bool
    imu: bool
    acceleration: bool
    angular_rate: bool
    orientation: bool
    torque: bool
    sinkage: bool
    reference: bool


_COST = (
    'no wheel odometry: slip held',
    'no IMU: loads of level ground, turning from the wheels, no balance of forces',
    'no acceleration: no balance of forces, loads of level ground or by the orientation',
    'no angular rate: turning from the wheels',
    'no orientation: slope from gyro and specific force',
    'no torque: pull from the balance of forces and the soil model',
    'no sinkage: held by its model',
    'no reference velocity: slip from forces and soil model',
)
"""What each of `MissingInputs` costs."""


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
            text = 'stalled: torque near its limit, hardly turning while others turn'
        elif wheel.resting:
            text = 'at rest'
        else:
            text = f'slip {wheel.slip:.2f} +- {wheel.std:.2f}'
        words.append(text + warning)
    return tuple(words)


def faults_in_words(missing: MissingInputs) -> dict[str, str]:
    """Return what is missing, and what that costs."""
    return {
        name: words
        for name, absent, words in zip(MissingInputs._fields, missing, _COST, strict=True)
        if absent
    }
