# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The reference velocity: frame, unit, delay, jumps, noise and covariance."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.checks.evidence import Evidence
from wheel_terra_estimator.checks.finding import Finding, NotChecked, Outcome
from wheel_terra_estimator.checks.series import VelocitySeries
from wheel_terra_estimator.checks.statistics import (
    averaged,
    correlation,
    even_times,
    lag,
    moving_mean,
    robust_std,
)

FloatArray = NDArray[np.float64]

JUMP_FACTOR = 8.0
"""A velocity that leaves its neighbours by so many times the usual scatter is a jump."""
JUMP_SHARE = 0.005
"""Share of jumps that is a fault of the source, not a single wild reading."""
LEAST_JUMP = 0.3
"""A jump is also larger than this share of the speed."""
LAG_GAIN = 1.15
"""By how much the unlike part has to shrink for a lag to count; a slow reference is ragged."""
LEAST_DELAY = 0.25
"""Delays below this [s] are left to jitter and filters of encoders."""
SLOWEST_FOR_DELAY = 1.5
"""Period of a reference [s] above which nothing is said of its delay."""
LEAST_DELAY_PERIODS = 0.5
"""The same in periods of the reference: between its stamps nothing is known."""
COVARIANCE_FACTOR = 6.0
"""Ratio of stated to seen standard deviation that makes a covariance a placeholder."""
TOO_SMALL_STD = 4.0
"""Seen standard deviation over the stated one from which a variance that changes is too small."""
LEAST_STD = 1e-4
"""Standard deviation [m/s] that is proposed at least."""
LEAST_UNIT_RATIO = 1.3
"""Speed over rim speed below which it may be the radius, not the unit [-]."""
KNOWN_UNITS = {'kilometres per hour': 3.6, 'millimetres per second': 1000.0, 'knots': 1.9438}


def check_reference(evidence: Evidence, figures: dict[str, Any]) -> tuple[list[Outcome], Evidence]:
    """Return what is wrong with the reference, and the evidence with its frame and unit mended."""
    reference = evidence.reference()
    if reference is None:
        reason = 'no reference velocity in it (visual odometry, GNSS)'
        return [NotChecked(kind, reason) for kind in ('delay', 'jumps', 'covariance')], evidence
    if reference.stamp.size < 10:
        return [NotChecked('jumps', 'hardly any reference velocity in it')], evidence
    found: list[Outcome] = []
    frame, evidence = _frame(evidence, reference)
    found += frame
    unit, evidence = _unit(evidence)
    found += unit
    reference = evidence.reference()
    assert reference is not None
    jumps, calm = _jumps(evidence, reference, figures)
    found += jumps
    found += _delay(evidence, replace(reference, velocity=calm), figures)
    found += _covariance(evidence, calm[:, 0], reference, figures)
    return found, evidence


def _frame(evidence: Evidence, reference: VelocitySeries) -> tuple[list[Outcome], Evidence]:
    """Find a velocity that is given in a world frame, or along another axis of the body."""
    forward, side = reference.velocity[:, 0], reference.velocity[:, 1]
    rim = np.nan_to_num(evidence.rim_at(reference.stamp, evidence.rim, 0.3))
    along, across = correlation(rim, forward), correlation(rim, side)
    size = np.hypot(forward, side)
    if not np.any(side) or float(np.median(np.abs(side))) < 0.2 * float(np.median(size)):
        return [], evidence
    rotated = _turning_with_heading(evidence, reference)
    if rotated is not None:
        return [
            Finding(
                kind='mounting',
                topic=reference.topic,
                confidence=0.95,
                words=(
                    'the direction of its velocity turns with the heading: it is given in '
                    'the world '
                    'frame'
                ),
                cure=(
                    'publish twist in child_frame_id base_link (nav_msgs/Odometry), or turn '
                    'it by the '
                    'heading first'
                ),
            )
        ], replace(
            evidence,
            recording=replace(
                evidence.recording,
                reference=replace(
                    reference, velocity=np.column_stack([size * np.sign(rim), 0 * size, 0 * size])
                ),
            ),
        )
    if abs(across) > 0.7 and abs(across) > abs(along):
        angle = math.degrees(math.atan2(across, along))
        turned = np.column_stack([np.sign(across) * side, 0 * side, 0 * side])
        mended = replace(evidence.recording, reference=replace(reference, velocity=turned))
        return [
            Finding(
                kind='mounting',
                topic=reference.topic,
                value=round(angle, 1),
                std=5.0,
                confidence=0.95,
                words='the rover moves along y of its frame, not along x',
                cure=(
                    f'turn twist.linear by {-angle:.0f} degrees about z into base_link (x forward)'
                ),
            )
        ], replace(evidence, recording=mended)
    return [], evidence


def _turning_with_heading(evidence: Evidence, reference: VelocitySeries) -> float | None:
    if evidence.gyro is None:
        return None
    step = np.diff(evidence.time, prepend=evidence.time[0])
    bias = np.median(evidence.gyro[evidence.at_rest, 2]) if evidence.at_rest.any() else 0.0
    heading = np.cumsum((evidence.gyro[:, 2] - bias) * step)
    at = (reference.stamp - evidence.origin) * 1e-9
    psi = np.interp(at, evidence.time, heading)
    rim = np.nan_to_num(evidence.rim_at(reference.stamp, evidence.rim, 0.3))
    moving = np.abs(rim) > 0.3 * np.quantile(np.abs(rim), 0.9)
    if moving.sum() < 20 or np.ptp(psi[moving]) < 1.0:
        return None
    velocity = (reference.velocity[:, 0] + 1j * reference.velocity[:, 1])[moving]
    direction = velocity * np.sign(rim[moving]) / np.maximum(np.abs(velocity), 1e-9)
    fixed = abs(direction.mean())
    turning = abs((direction * np.exp(-1j * psi[moving])).mean())
    return turning if turning > 0.9 and turning > fixed + 0.1 else None


def _unit(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    reference = evidence.reference()
    assert reference is not None
    if not evidence.facts.known:
        return [], evidence
    rim = np.abs(evidence.rim_at(reference.stamp, evidence.rim, 0.3))
    speed = np.abs(reference.velocity[:, 0])
    rows = np.isfinite(rim) & (rim > 0.4 * np.nanquantile(rim, 0.9)) & (rim > 0.0)
    if rows.sum() < 8:
        return [], evidence
    ratio = float(np.median(speed[rows] / rim[rows]))
    for unit, factor in KNOWN_UNITS.items():
        if max(0.55 * factor, LEAST_UNIT_RATIO) < ratio < 1.25 * factor:
            mended = replace(reference, velocity=reference.velocity / factor)
            outcome = Finding(
                kind='unit',
                topic=reference.topic,
                value=1.0 / factor,
                confidence=0.9,
                words=f'linear.x is {ratio:.3g} times the rim speed: it is in {unit}',
                cure=f'multiply twist.linear by {1.0 / factor:.5g} in its driver (m/s, REP 103)',
            )
            return [outcome], replace(
                evidence, recording=replace(evidence.recording, reference=mended)
            )
    return [], evidence


def _jumps(
    evidence: Evidence, reference: VelocitySeries, figures: dict[str, Any]
) -> tuple[list[Outcome], FloatArray]:
    """Return a finding for wild velocities, and the velocities with these made calm."""
    velocity = reference.velocity.copy()
    forward = velocity[:, 0]
    if forward.size < 10:
        return [], velocity
    beside = np.median(np.stack([forward[:-4], forward[1:-3], forward[3:-1], forward[4:]]), axis=0)
    off = forward[2:-2] - beside
    usual = max(robust_std(off), 1e-6)
    speed = float(np.quantile(np.abs(forward), 0.8))
    wild = np.abs(off) > max(JUMP_FACTOR * usual, LEAST_JUMP * speed)
    # Starts and stops are no jumps: the wheels change as well.
    rim = evidence.rim_at(reference.stamp, np.abs(evidence.rim), 2.0 * _period(reference))
    least = evidence.rim_at(reference.stamp, evidence.steady.astype(float), _period(reference))
    resting = evidence.rim_at(reference.stamp, evidence.at_rest.astype(float), _period(reference))
    calm = (np.nan_to_num(least) > 0.99) | (np.nan_to_num(resting) > 0.99)
    wild &= calm[2:-2] & np.isfinite(rim[2:-2])
    share = float(np.mean(wild))
    figures['reference.jumps_share'] = round(share, 4)
    velocity[2:-2, 0] = np.where(wild, beside, forward[2:-2])
    if share < JUMP_SHARE or wild.sum() < 3:
        return [], velocity
    return [
        Finding(
            kind='jumps',
            topic=reference.topic,
            confidence=0.97,
            words=(
                f'{wild.sum()} velocities ({100 * share:.1f} %) leave their neighbours by up to '
                f'{np.abs(off).max():.2g} m/s'
            ),
            cure=(
                'use the filtered velocity of the receiver in place of differences of raw '
                'positions, '
                'and leave out what has no solution'
            ),
        )
    ], velocity


def _period(reference: VelocitySeries) -> float:
    return float(np.median(np.abs(np.diff(reference.stamp)))) * 1e-9


def _delay(evidence: Evidence, reference: VelocitySeries, figures: dict[str, Any]) -> list[Outcome]:
    step = 0.05
    time = even_times(evidence.time, step)
    at = (reference.stamp - evidence.origin) * 1e-9
    order = np.argsort(at, kind='stable')
    period = float(np.median(np.diff(at[order])))
    rim = averaged(evidence.time, np.nan_to_num(evidence.rim)[:, None], time, 2 * step)[:, 0]
    speed = np.interp(time, at[order], reference.velocity[order, 0])
    # Between its stamps the reference is a straight line: the rims are smoothed as much.
    for _ in range(2):
        rim = moving_mean(rim, round(min(period, SLOWEST_FOR_DELAY) / step))
    if period > SLOWEST_FOR_DELAY or float(np.std(rim)) < 0.1 * float(np.abs(rim).mean() + 1e-9):
        return [NotChecked('delay', 'reference: hardly a change of speed in it; stop and go')]
    found = lag(time, rim, speed, 3.0)
    if found is None or found.fit < 0.9:
        return [NotChecked('delay', 'reference: does not follow the wheels closely enough')]
    figures['reference.delay_s'] = round(float(found.value), 3)
    figures['reference.delay_std_s'] = round(found.std, 3)
    if abs(found.value) < max(
        LEAST_DELAY, LEAST_DELAY_PERIODS * period, 3.0 * found.std
    ) or not found.clear(LAG_GAIN):
        return []
    return [
        Finding(
            kind='delay',
            topic=reference.topic,
            value=round(found.value, 3),
            std=round(found.std, 3),
            confidence=0.97,
            words=(
                f'its velocity comes {found.value:+.2f} s after that of the wheels, by the stamps'
            ),
            cure=(
                f'take {found.value:.2f} s off the stamps of the reference: stamp the moment '
                'of the '
                'picture or measurement, not of the result (or the wheels late, if it is negative)'
            ),
        )
    ]


def _covariance(
    evidence: Evidence, forward: FloatArray, reference: VelocitySeries, figures: dict[str, Any]
) -> list[Outcome]:
    """Compare the stated variance with the scatter of the velocity."""
    noise = _scatter(forward)
    figures['reference.noise_m_s'] = float(f'{noise:.3g}')
    stated = reference.variance[np.isfinite(reference.variance)]
    usual = math.sqrt(max(float(np.median(stated)), 0.0)) if stated.size else 0.0
    figures['reference.stated_std_m_s'] = float(f'{usual:.3g}')
    constant = bool(np.ptp(stated) == 0.0) if stated.size else True
    parameter = 'sensors.reference_std'

    def finding(kind: str, std: float, words: str, cure: str) -> list[Outcome]:
        return [
            Finding(
                kind=kind,
                topic=reference.topic,
                parameter=parameter,
                value=float(f'{std:.2g}'),
                confidence=0.9,
                words=words,
                cure=cure,
            )
        ]

    if usual == 0.0:
        configuration = evidence.facts.configuration
        if configuration is not None and evidence.facts.stated(parameter):
            usual = configuration.sensors.reference_std
            if usual / COVARIANCE_FACTOR < noise < COVARIANCE_FACTOR * usual:
                return []  # the rover file decides, and says what is seen
        if configuration is None or noise < COVARIANCE_FACTOR * configuration.sensors.reference_std:
            words = 'states no variance (0): the rover file decides'
        else:
            words = f'states no variance (0) and scatters by {noise:.2g} m/s'
    elif constant and (usual > COVARIANCE_FACTOR * noise or usual * COVARIANCE_FACTOR < noise):
        words = f'states {usual:.2g} m/s, always the same, and scatters by {noise:.2g} m/s'
    elif noise > TOO_SMALL_STD * usual:
        return finding(
            'noise',
            noise,
            f'velocity scatters by {noise:.2g} m/s and states {usual:.2g} m/s',
            f'state the variance {noise**2:.2g} in twist.covariance[0] '
            f'({parameter}: {noise:.2g} where it states none)',
        )
    else:
        return []
    std = max(noise, LEAST_STD)
    return finding(
        'covariance',
        std,
        f'covariance is a placeholder: it {words}',
        f'{parameter}: {std:.2g} and twist.covariance[0] = 0, or the true '
        f'variance ({std**2:.2g}) there',
    )


def _scatter(forward: FloatArray) -> float:
    bend = np.diff(forward, 2) / math.sqrt(6.0)
    return robust_std(bend)
