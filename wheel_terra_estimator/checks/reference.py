# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The reference velocity: frame, unit, jumps, noise and covariance."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.checks import turning
from wheel_terra_estimator.checks.evidence import Evidence, Mask
from wheel_terra_estimator.checks.finding import NotChecked, Outcome
from wheel_terra_estimator.checks.series import VelocitySeries
from wheel_terra_estimator.checks.statistics import (
    bend_noise,
    correlation,
    integrated,
    moving_mean,
    robust_std,
)

LEAST_REFERENCES = 10
ALIKE_BOTH_WAYS = 0.5
"""Slower over faster of the speeds forward and back [-]."""
SELDOM_NEGATIVE = 0.1
"""Share of negative speeds of what has no sign, by noise, at most [-]."""
JUMP_FACTOR = 8.0
"""A velocity that leaves its neighbours by so many times the usual scatter is a jump."""
JUMP_SHARE = 0.005
"""Share of jumps that is a fault of the source, not a single wild reading."""
LEAST_JUMPS = 3
LEAST_NEW = 0.5  # share of readings that differ from the one before: fewer are held values
BEYOND = 2.0
"""Speed over the fastest of the rims that is a jump whatever the wheels do [-]."""
LEAST_JUMP = 0.3
"""A jump is also larger than this share of the speed."""
COVARIANCE_FACTOR = 6.0
"""Ratio of stated to seen standard deviation that makes a covariance a placeholder."""
LEAST_STD = 1e-4
"""Standard deviation [m/s] that is proposed at least."""
AHEAD = 0.3
"""Mean of the rims over the usual size of one, above which the rover goes ahead [-]."""
CLEAR_HEADING = 1.0
"""Turn in which a frame of the world is told from one of the rover [rad]."""
STEADY = 0.9
"""Length of the mean direction of a velocity that keeps to a frame [-]."""
MOST_SLIPPING, WITHOUT_SLIP = 1.0 / 3.0, 0.06
"""Speed over that without slip of a rover that slips much, and error of the ratio without slip."""
LEAST_UNIT_RATIO = 1.3
"""Speed over rim speed below which it may be the radius, not the unit [-]."""
NO_SCALE = 30.0
"""Speed over rim speed that is a unit, however much the rover slips [-]."""
SLIPPING = 0.7
"""Speed over that of the rims in firm ground, at least [-]."""
MOSTLY = 0.4
"""Mean over median rim speed of wheels most of which turn one way [-]."""
CLEAR_SPEED = 5.0
"""Speed over the noise of the reference that a ratio of speeds needs [-]."""
LEAST_ROWS = 5
"""Velocities beside rims that a ratio needs."""
KNOWN_UNITS = {
    'kilometres per hour': 3.6,
    'centimetres per second': 100.0,
    'millimetres per second': 1000.0,
    'knots': 1.9438,
}


def check_sense(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    """Return a reference or rates that are positive both ways, and the evidence mended."""
    reference = evidence.recording.reference
    if reference is None or reference.stamp.size < LEAST_REFERENCES:
        return [], evidence
    rim = np.nan_to_num(evidence.rim_at(reference.stamp, evidence.rim))
    forward = reference.velocity[:, 0]
    least = 0.4 * float(np.quantile(np.abs(forward), 0.9))
    # A position has no sign either, and is no speed.
    if _without_sign(forward, rim) and np.median(np.abs(forward)) < BEYOND * np.abs(rim).max():
        velocity = reference.velocity * np.where(rim < 0.0, -1.0, 1.0)[:, None]
        mended = evidence.with_channel('reference', velocity=velocity)
        return [evidence.found('reference_unsigned', 0.95)], mended
    both = min(np.mean(forward > least), np.mean(forward < -least)) > SELDOM_NEGATIVE
    if both and not _sideways(reference) and _without_sign(rim, forward):
        calm = moving_mean(forward, LEAST_ROWS)
        sense = np.sign(np.interp(evidence.time, evidence.seconds(reference), calm))
        mended = evidence.with_rate(evidence.rate * sense[:, None])
        return [evidence.found('rates_unsigned', 0.95)], mended
    return [], evidence


def _sideways(reference: VelocitySeries) -> bool:
    """Return whether a velocity is not that along x of the rover alone."""
    forward, side = reference.velocity[:, 0], np.abs(reference.velocity[:, 1])
    return bool(np.quantile(side, 0.9) > 0.2 * np.median(np.hypot(forward, side)))


def _without_sign(speed: FloatArray, other: FloatArray) -> bool:
    """Return whether one speed is positive and much the same whichever way the other goes."""
    least = 0.4 * float(np.quantile(np.abs(other), 0.9))
    ways = [speed[other > least], speed[other < -least]]
    if min(way.size for way in ways) < LEAST_ROWS:
        return False
    usual = [float(np.median(way)) for way in ways]
    against = [float(np.mean(way < 0.0)) for way in ways]
    return min(usual) > ALIKE_BOTH_WAYS * max(usual) and max(against) <= SELDOM_NEGATIVE


def check_frame(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    """Return a reference in another frame or unit, and the evidence with that mended."""
    reference = evidence.recording.reference
    if reference is None or reference.stamp.size < LEAST_REFERENCES:
        return [], evidence
    frame, evidence = _frame(evidence, reference)
    unit, evidence = _unit(evidence)
    return [*frame, *unit], evidence


def _frame(evidence: Evidence, reference: VelocitySeries) -> tuple[list[Outcome], Evidence]:
    """Find a velocity that is given in a world frame, or along another axis of the body."""
    forward, side = reference.velocity[:, 0], reference.velocity[:, 1]
    rim = np.nan_to_num(evidence.rim_at(reference.stamp, evidence.rim))
    size = np.hypot(forward, side)
    if not _sideways(reference):
        return [], evidence

    def along_x(speed: FloatArray) -> Evidence:
        velocity = np.column_stack([speed, 0.0 * speed, 0.0 * speed])
        return evidence.with_channel('reference', velocity=velocity)

    kept = _kept_direction(evidence, reference, rim)
    clear = kept.turn > CLEAR_HEADING
    if clear and kept.in_world > max(STEADY, 0.5 * (1.0 + kept.in_body)):
        return [evidence.found('reference_world', 0.95)], along_x(size * np.sign(rim))
    if kept.in_body < STEADY:
        reason = 'reference: its direction keeps neither to the rover nor to the world'
        return [NotChecked('mounting', reason)], evidence
    along, across = correlation(rim, forward), correlation(rim, side)
    if abs(across) > 0.7 and abs(across) > abs(along):
        angle = math.degrees(math.atan2(float(rim @ side), float(rim @ forward)))
        told: dict[str, Any] = {'value': round(angle, 1), 'std': 5.0, 'turn': -angle, 'rival': ''}
        sure = 0.95
        if not clear or kept.in_body < 0.5 * (1.0 + kept.in_world):
            told['rival'], sure = ', or is given in the world frame: drive a circle', 0.6
        return [evidence.found('reference_axis', sure, **told)], along_x(np.sign(across) * side)
    return [], evidence


class _KeptDirection(NamedTuple):
    """How steadily a velocity keeps to the rover and to the world [-], and how far that turned."""

    in_body: float
    in_world: float
    turn: float  # [rad]


def _kept_direction(
    evidence: Evidence, reference: VelocitySeries, rim: FloatArray
) -> _KeptDirection:
    heading = integrated(evidence.time, evidence.yaw)
    psi = np.interp(evidence.seconds(reference), evidence.time, heading)
    moving = np.abs(rim) > 0.3 * np.quantile(np.abs(rim), 0.9)
    if moving.sum() < LEAST_ROWS:
        return _KeptDirection(1.0, 0.0, 0.0)
    velocity = (reference.velocity[:, 0] + 1j * reference.velocity[:, 1])[moving]
    direction = velocity * np.sign(rim[moving]) / np.maximum(np.abs(velocity), 1e-9)
    in_world = abs((direction * np.exp(-1j * psi[moving])).mean())
    return _KeptDirection(abs(direction.mean()), in_world, float(np.ptp(psi[moving])))


def ahead(evidence: Evidence, series: VelocitySeries, share: float) -> tuple[FloatArray, Mask]:
    """Return rim speeds at the stamps of velocities, and the rows in which the rover goes ahead.

    In turns on the spot the mean of the rims is next to nothing.
    """
    typical = evidence.common_rate * float(np.nanmean(evidence.radius))
    rim = np.abs(evidence.rim_at(series.stamp, typical))
    usual = float(np.nanquantile(rim, 0.9)) if np.isfinite(rim).any() else 0.0
    least = AHEAD * evidence.working_rate * float(np.nanmean(evidence.facts.radius))
    mean = np.abs(evidence.rim_at(series.stamp, evidence.rim))
    rows = (rim > max(share * usual, least, 1e-9)) & (mean > MOSTLY * rim)
    return rim, rows & np.isfinite(series.velocity[:, :2]).all(axis=1)


def _unit(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    reference = evidence.recording.reference
    assert reference is not None
    if not evidence.facts.known:
        return [], evidence
    rim, rows = ahead(evidence, reference, 0.4)
    if rows.sum() < LEAST_ROWS:
        return [], evidence
    sense = np.sign(evidence.rim_at(reference.stamp[rows], evidence.rim))
    if hardly_moves(reference.velocity[:, 0], rows):
        return [], evidence
    ratio = float(np.median(sense * reference.velocity[rows, 0] / rim[rows]))
    fitting = reference_units(ratio)
    near = {unit: f for unit, f in fitting.items() if abs(ratio / f - 1.0) < WITHOUT_SLIP}
    if len(fitting) > 1 and not near:  # which of them, the slip hides
        reason = f'{ratio:.3g} times the rim speed: {" or ".join(fitting)}, or its scale'
        return [NotChecked('unit', f'reference: {reason}; drive on firm ground')], evidence
    fitting = near or fitting
    for unit, factor in fitting.items():
        told = {'value': 1.0 / factor, 'ratio': ratio, 'unit': unit}
        mended = evidence.with_channel(
            'reference',
            velocity=reference.velocity / factor,
            variance=reference.variance / factor**2,
        )
        track = turning.track_ratio(evidence)
        either = [] if track and turning.ordinary_track(track) else either_unit(evidence, ratio)
        return either or [evidence.found('reference_unit', 0.9, **told)], mended
    return [], evidence


def hardly_moves(speed: FloatArray, rows: Mask) -> bool:
    """Return whether a speed (k,) is little more than its noise in some rows: no unit is told."""
    return float(np.quantile(np.abs(speed[rows]), 0.8)) < CLEAR_SPEED * bend_noise(speed)


def either_unit(evidence: Evidence, ratio: float | None) -> list[Outcome]:
    """Return that rates in m/s of the rim or a reference of another unit give a ratio of speeds."""
    radius, fitting = float(np.nanmean(evidence.facts.radius)), reference_units(ratio or 0.0)
    if not fitting or ratio is None or not SLIPPING < ratio * radius < 1.25:
        return []
    unit, factor = next(iter(fitting.items()))
    of_rims, how = 'metres per second of the rim', 'reference, or that is in ' + unit
    return [
        evidence.found('rate_unit', 0.45, value=1.0 / radius, unit=of_rims, how=how),
        evidence.found('reference_unit', 0.45, value=1.0 / factor, ratio=ratio, unit=unit),
    ]


def reference_units(ratio: float) -> dict[str, float]:
    """Return the units of a reference that a ratio of speeds may come from."""
    return {
        unit: factor
        for unit, factor in KNOWN_UNITS.items()
        if max(min(MOST_SLIPPING * factor, NO_SCALE), LEAST_UNIT_RATIO) < ratio < 1.25 * factor
    }


def check_jumps(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    """Return velocities that leave their neighbours, and the evidence with these made calm."""
    reference = evidence.recording.reference
    if reference is None or reference.stamp.size < LEAST_REFERENCES:
        return [NotChecked('jumps', 'hardly any reference velocity in it')], evidence
    forward = reference.velocity[:, 0]
    beside = np.median(np.stack([forward[:-4], forward[1:-3], forward[3:-1], forward[4:]]), axis=0)
    off = forward[2:-2] - beside
    speed = float(np.quantile(np.abs(forward), 0.8))
    wild = np.abs(off) > max(JUMP_FACTOR * max(robust_std(off), 1e-6), LEAST_JUMP * speed)
    # Starts and stops are no jumps: the wheels change as well.
    around = 1.5 * reference.period
    calm = [
        np.nan_to_num(evidence.rim_at(reference.stamp, rows.astype(float), around)) > 0.99
        for rows in (evidence.steady, evidence.at_rest)
    ]
    if evidence.facts.known:
        fastest = max(speed, float(np.quantile(np.abs(evidence.rim), 0.99)))
        calm.append(np.abs(forward) > BEYOND * fastest)
    wild &= np.any(calm, axis=0)[2:-2]
    if not wild.any():
        return [], evidence
    velocity = reference.velocity.copy()
    velocity[2:-2, 0] = np.where(wild, beside, forward[2:-2])
    mended, share = evidence.with_channel('reference', velocity=velocity), float(np.mean(wild))
    if share < JUMP_SHARE or wild.sum() < LEAST_JUMPS:
        return [], mended
    told = {'count': int(wild.sum()), 'share': 100.0 * share, 'most': float(np.abs(off).max())}
    return [evidence.found('jumps', 0.97, **told)], mended


def check_covariance(evidence: Evidence) -> list[Outcome]:
    """Compare the stated variance with the scatter of the velocity."""
    reference = evidence.recording.reference
    if reference is None:
        return [NotChecked('covariance', 'no reference velocity in it (visual odometry, GNSS)')]
    forward = reference.velocity[:, 0]
    if reference.stamp.size < LEAST_REFERENCES or not np.ptp(forward):
        return []  # no reading of a speed
    # A log at a higher rate holds each value until the next: only new ones scatter.
    new = np.append(True, np.diff(forward) != 0.0)
    if np.mean(new) >= LEAST_NEW or new.sum() < LEAST_REFERENCES:
        new[:] = True
    forward = forward[new]
    rim = np.nan_to_num(evidence.rim_at(reference.stamp[new], evidence.rim))
    if evidence.facts.known and np.median(np.abs(forward)) > BEYOND * np.abs(rim).max():
        return []  # in another unit
    noise = min(bend_noise(forward), bend_noise(forward - rim))  # wheels start and stop as well
    evidence.figures['reference.noise_m_s'] = float(f'{noise:.3g}')
    stated = reference.variance[np.isfinite(reference.variance)]
    usual = math.sqrt(max(float(np.median(stated)), 0.0)) if stated.size else 0.0
    evidence.figures['reference.stated_std_m_s'] = float(f'{usual:.3g}')
    constant = bool(np.ptp(stated) == 0.0) if stated.size else True
    configuration, told = evidence.facts.configuration, {'noise': noise, 'variance': noise**2}
    if usual == 0.0:
        own = configuration.sensors.reference_std if configuration is not None else None
        if own is not None and own / COVARIANCE_FACTOR < noise < COVARIANCE_FACTOR * own:
            return []  # the rover file decides, and says what is seen
        words = 'states no variance (0): the rover file decides'
        if own is not None and noise > COVARIANCE_FACTOR * own:
            words = f'states no variance (0) and scatters by {noise:.2g} m/s'
    elif constant and (usual > COVARIANCE_FACTOR * noise or usual * COVARIANCE_FACTOR < noise):
        words = f'states {usual:.2g} m/s, always the same, and scatters by {noise:.2g} m/s'
    elif noise > COVARIANCE_FACTOR * usual:
        value = float(f'{noise:.2g}')
        return [evidence.found('reference_noise', 0.9, value=value, stated=usual, **told)]
    else:
        return []
    noise = max(noise, LEAST_STD)
    told = {'noise': noise, 'variance': noise**2}
    return [evidence.found('covariance', 0.9, value=float(f'{noise:.2g}'), how=words, **told)]
