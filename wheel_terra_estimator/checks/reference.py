# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The reference velocity: frame, unit, jumps, noise and covariance."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.checks.evidence import Evidence
from wheel_terra_estimator.checks.faults import found
from wheel_terra_estimator.checks.finding import Finding, NotChecked, Outcome
from wheel_terra_estimator.checks.series import VelocitySeries
from wheel_terra_estimator.checks.statistics import correlation, robust_std

FloatArray = NDArray[np.float64]

LEAST_REFERENCES = 10
JUMP_FACTOR = 8.0
"""A velocity that leaves its neighbours by so many times the usual scatter is a jump."""
JUMP_SHARE = 0.005
"""Share of jumps that is a fault of the source, not a single wild reading."""
LEAST_JUMP = 0.3
"""A jump is also larger than this share of the speed."""
COVARIANCE_FACTOR = 6.0
"""Ratio of stated to seen standard deviation that makes a covariance a placeholder."""
TOO_SMALL_STD = 4.0
"""Seen standard deviation over the stated one from which a variance that changes is too small."""
LEAST_STD = 1e-4
"""Standard deviation [m/s] that is proposed at least."""
AHEAD = 0.5
"""Mean of the rims over the usual size of one, above which the rover goes ahead [-]."""
LEAST_UNIT_RATIO = 1.3
"""Speed over rim speed below which it may be the radius, not the unit [-]."""
KNOWN_UNITS = {'kilometres per hour': 3.6, 'millimetres per second': 1000.0, 'knots': 1.9438}


def check_frame(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    """Return a reference in another frame or unit, and the evidence with that mended."""
    reference = evidence.reference()
    if reference is None or reference.stamp.size < LEAST_REFERENCES:
        return [], evidence
    frame, evidence = _frame(evidence, reference)
    unit, evidence = _unit(evidence)
    return [*frame, *unit], evidence


def check_quality(evidence: Evidence, figures: dict[str, Any]) -> list[Outcome]:
    """Return jumps of the reference, and what is wrong with its variance."""
    reference = evidence.reference()
    if reference is None:
        reason = 'no reference velocity in it (visual odometry, GNSS)'
        return [NotChecked(kind, reason) for kind in ('jumps', 'covariance')]
    if reference.stamp.size < LEAST_REFERENCES:
        return [NotChecked('jumps', 'hardly any reference velocity in it')]
    jumps, calm = _jumps(evidence, reference, figures)
    return [*jumps, *_covariance(evidence, calm[:, 0], reference, figures)]


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
        return [found('reference_world', reference.topic, 0.95)], replace(
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
        finding = found(
            'reference_axis', reference.topic, 0.95, value=round(angle, 1), std=5.0, turn=-angle
        )
        return [finding], replace(evidence, recording=mended)
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
    # In turns on the spot the mean of the rims is next to nothing.
    least = AHEAD * evidence.working_rate * float(np.nanmean(evidence.facts.radius))
    rows = np.isfinite(rim) & (rim > max(0.4 * float(np.nanquantile(rim, 0.9)), least, 1e-9))
    if rows.sum() < 8:
        return [], evidence
    ratio = float(np.median(speed[rows] / rim[rows]))
    for unit, factor in KNOWN_UNITS.items():
        if max(0.55 * factor, LEAST_UNIT_RATIO) < ratio < 1.25 * factor:
            mended = replace(reference, velocity=reference.velocity / factor)
            outcome = found(
                'reference_unit',
                reference.topic,
                0.9,
                value=1.0 / factor,
                ratio=ratio,
                unit=unit,
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
    finding = found(
        'jumps',
        reference.topic,
        0.97,
        count=int(wild.sum()),
        share=100.0 * share,
        most=float(np.abs(off).max()),
    )
    return [finding], velocity


def _period(reference: VelocitySeries) -> float:
    return float(np.median(np.abs(np.diff(reference.stamp)))) * 1e-9


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
        return [_noise_of('reference_noise', reference, noise, stated=usual)]
    else:
        return []
    return [_noise_of('covariance', reference, max(noise, LEAST_STD), how=words)]


def _noise_of(key: str, reference: VelocitySeries, noise: float, **figures: Any) -> Finding:
    value = float(f'{noise:.2g}')
    return found(key, reference.topic, 0.9, value=value, noise=noise, variance=noise**2, **figures)


def _scatter(forward: FloatArray) -> float:
    bend = np.diff(forward, 2) / math.sqrt(6.0)
    return robust_std(bend)
