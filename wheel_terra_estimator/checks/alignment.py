# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""IMU against wheels: unit of the gyro, yaw of the mounting, clocks."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.checks.evidence import Evidence
from wheel_terra_estimator.checks.finding import Finding, NotChecked, Outcome
from wheel_terra_estimator.checks.imu import mounting_finding, yaw_mounting
from wheel_terra_estimator.checks.statistics import (
    Estimate,
    averaged,
    block_fit,
    correlation,
    even_times,
    lag,
)
from wheel_terra_estimator.checks.torque import heading_of_torque

FloatArray = NDArray[np.float64]

LEAST_YAW = math.radians(25.0)
"""Yaw of the mounting below which starts, stops and slopes do not tell it [rad]."""
YAW_SIGMAS = 4.0
GYRO_DEGREES = (0.004, 0.07)
"""Effective over stated track that a gyro in degrees per second gives [-]."""
LAG_GAIN = 1.5
"""By how much the unlike part has to shrink for a lag to count."""
LEAST_DELAY = 0.3
"""Delays below this [s] are those of chassis, soil and filters of encoders."""


def check_gyro_unit(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    """Return a gyro in degrees per second, told by the turns of the wheels."""
    imu, facts = evidence.recording.imu, evidence.facts
    if imu is None or evidence.gyro is None or not facts.known or not facts.has_sides():
        return [], evidence
    yaw, difference = evidence.gyro[:, 2], evidence.side_difference
    rows = evidence.moving & np.isfinite(difference)
    if rows.sum() < 60 or abs(correlation(yaw[rows], difference[rows])) < 0.7:
        return [NotChecked('unit', 'gyro: no clear turn in it; drive a circle')], evidence
    track = facts.lateral[facts.side > 0].mean() - facts.lateral[facts.side < 0].mean()
    ratio = block_fit(yaw[rows][:, None], difference[rows])[0].value / track
    if not GYRO_DEGREES[0] < abs(ratio) < GYRO_DEGREES[1]:
        return [], evidence
    outcome = Finding(
        kind='unit',
        topic=imu.topic,
        value=math.pi / 180.0,
        confidence=0.95,
        words=(
            f'angular_velocity.z is {1.0 / abs(ratio):.0f} times what the wheels allow: '
            'degrees per '
            'second'
        ),
        cure='multiply angular_velocity by 0.0174533 in the driver (rad/s, REP 103)',
    )
    mended = replace(imu, rate=np.radians(imu.rate))
    recording = replace(evidence.recording, imu=mended)
    return [outcome], replace(evidence, recording=recording, gyro=np.radians(evidence.gyro))


def yaw_of_imu(evidence: Evidence) -> Estimate | None:
    """Return the yaw of the IMU in ``base_link`` from starts and stops, curves and slopes [rad]."""
    told = [e for e in (yaw_mounting(evidence), heading_of_torque(evidence)) if e is not None]
    return min(told, key=lambda estimate: estimate.std) if told else None


def check_yaw(evidence: Evidence, figures: dict[str, Any]) -> tuple[list[Outcome], FloatArray]:
    """Return an IMU whose x axis does not point forward, and the rotation that puts it right."""
    seen = yaw_of_imu(evidence)
    if seen is None:
        reason = 'yaw of the IMU: neither lively starts and stops nor slopes in it'
        return [NotChecked('mounting', reason)], evidence.rotation
    figures['imu.yaw_deg'] = round(math.degrees(seen.value), 2)
    figures['imu.yaw_std_deg'] = round(math.degrees(seen.std), 2)
    if abs(seen.value) < LEAST_YAW or seen.sigmas_from(0.0) < YAW_SIGMAS:
        return [], evidence.rotation
    angle = -seen.value
    quarter = round(angle / (math.pi / 2.0)) * math.pi / 2.0
    if abs(angle - quarter) < 2.5 * max(seen.std, math.radians(4.0)):
        angle = quarter
    cosine, sine = math.cos(angle), math.sin(angle)
    turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    rotation = turn @ evidence.rotation
    words = (
        f'forward acceleration and slopes show {math.degrees(seen.value):.0f} +- '
        f'{math.degrees(seen.std):.0f} degrees off its x axis'
    )
    std = math.degrees(seen.std)
    return [mounting_finding(evidence, rotation, std, 0.97, words)], rotation


def check_clock(evidence: Evidence, figures: dict[str, Any]) -> list[Outcome]:
    """Return how late the wheels are against the IMU, by the turns."""
    imu = evidence.recording.imu
    difference = evidence.side_difference
    if imu is None or evidence.gyro is None or not np.isfinite(difference).any():
        return [NotChecked('delay', 'IMU against wheels: no IMU, or sides not known')]
    step = 0.05
    time = even_times(evidence.time, step)
    at = np.asarray((imu.stamp - evidence.origin) * 1e-9, dtype=np.float64)
    yaw = averaged(at, (imu.rate @ evidence.rotation.T)[:, 2:3], time, 2 * step)[:, 0]
    wheels = averaged(evidence.time, np.nan_to_num(difference)[:, None], time, 2 * step)[:, 0]
    found = lag(time, wheels * np.sign(correlation(wheels, yaw) or 1.0), yaw, 2.0)
    if found is None or found.fit < 0.75:
        return [NotChecked('delay', 'IMU against wheels: no clear turns in it; drive a circle')]
    figures['imu.delay_s'] = round(float(found.value), 3)
    figures['imu.delay_std_s'] = round(found.std, 3)
    limit = max(LEAST_DELAY, 1.5 * evidence.period, 5.0 * found.std)
    if abs(found.value) < limit or not found.clear(LAG_GAIN):
        return []
    return [
        Finding(
            kind='delay',
            topic=imu.topic,
            value=round(found.value, 3),
            std=round(found.std, 3),
            confidence=0.95,
            words=f'sees turns {found.value:+.2f} s after the wheels, by the stamps',
            cure=(
                f'take {found.value:.2f} s off the stamps of the IMU (or put them on those of the '
                'wheels): synchronise the clocks'
            ),
        )
    ]
