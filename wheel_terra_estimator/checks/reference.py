# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The reference velocity: frame, unit, jumps, noise and covariance."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.checks.evidence import (
    NO_NOISE,
    SLIDES_BACK,
    Evidence,
    Mask,
    noise_of,
    once,
    row_medians,
)
from wheel_terra_estimator.checks.finding import Outcome, not_checked
from wheel_terra_estimator.checks.series import VelocitySeries, nearest
from wheel_terra_estimator.checks.statistics import (
    bend_noise,
    correlation,
    integrated,
    moving_mean,
    robust_std,
    spike_height,
)

LEAST_REFERENCES = 10
ALIKE_BOTH_WAYS = 0.5  # smaller over larger of the speeds, or torques, forward and back [-]
SELDOM_NEGATIVE = 0.1  # share of negative speeds of what has no sign, by noise, at most [-]
AS_FAST = (0.7, 1.3)  # nearly all speeds over rim speeds of a rover that drives back, no slide [-]
ALWAYS_ZERO = 0.9  # share of rates that are 0 to the last digit where a sign is cut off [-]
SHARES_NOISE = 0.3  # of the rates: what differs by less from the wheels has their noise in it [-]
JUMP_FACTOR = 8.0  # a jump over the usual change [-]
JUMP_SHARE = 0.005  # share of jumps that is a fault of the source, not a single wild reading
LEAST_JUMPS = 3
BEYOND = 2.0  # speed over the fastest of the rims that is a jump whatever the wheels do [-]
LEAST_JUMP = 0.3  # A jump is also larger than this share of the speed
COVARIANCE_FACTOR = 6.0  # seen over stated deviation of a placeholder [-]
LEAST_STD = 1e-4  # standard deviation [m/s] that is proposed at least
AHEAD = 0.3  # mean of the rims over the usual size of one, above which the rover goes ahead [-]
CLEAR_HEADING = 1.0  # turn in which a frame of the world is told from one of the rover [rad]
STEADY = 0.9  # length of the mean direction of a velocity that keeps to a frame [-]
ASIDE_SHARE = 0.5  # speed aside over speed of a rover that skids in turns, at most [-]
ASIDE = 'reference.aside_deg'
FAR_ASIDE = math.radians(12.0)  # direction in which 2 % of a speed along x are lost [rad]
MOST_SLIPPING, USUAL_SLIP = 1.0 / 3.0, (0.75, 1.1)
"""Speed over that without slip of a rover that slips much, and of one that slips as usual."""
WITHOUT_SLIP = 0.06  # error of the ratio without slip, beside which no unit asks for much [-]
LEAST_SLIP = 0.8  # share of the ratios of speeds that are below that of the least slip [-]
LEAST_UNIT_RATIO = 1.3  # usual speed over rim speed; below, it may be the radius, not the unit [-]
NO_SCALE = 30.0  # speed over rim speed that is a unit, however much the rover slips [-]
MOSTLY = 0.4  # mean over median rim speed of wheels most of which turn one way [-]
CLEAR_SPEED = 5.0  # speed over the noise of the reference that a ratio of speeds needs [-]
LEAST_ROWS = 5  # velocities beside rims that a ratio needs
KNOWN_UNITS = {
    'kilometres per hour': 3.6,
    'centimetres per second': 100.0,
    'millimetres per second': 1000.0,
    'knots': 1.9438,
    'miles per hour': 2.23694,
}


def _beside_rims(evidence: Evidence) -> tuple[VelocitySeries, FloatArray] | None:
    """Return the reference and the rim speeds at its stamps [m/s]; None where it is too short."""
    reference = evidence.recording.reference
    if reference is None or reference.stamp.size < LEAST_REFERENCES:
        return None
    return reference, np.nan_to_num(evidence.rim_at(reference, evidence.rim))


def check_unsigned(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    """Return rates that are positive both ways, whatever their signs, and the evidence mended."""
    there = _beside_rims(evidence)
    if there is None:
        return [], evidence
    reference, rim = there
    forward = reference.velocity[:, 0]
    if hardly_moves(forward, np.abs(rim) >= 0.4 * np.quantile(np.abs(rim), 0.9)):
        return [], evidence  # wheels that spin on the spot
    mean = moving_mean(forward, LEAST_ROWS)  # noise about 0 is no motion
    least = 0.4 * float(np.quantile(np.abs(mean), 0.9))
    ahead, back = (mean > least).sum(), (mean < -least).sum()
    both = min(ahead, back) > SELDOM_NEGATIVE * (ahead + back)
    speed = np.interp(evidence.time, evidence.seconds(reference), mean)
    cut = _cut_off(evidence, speed > least, speed < -least)
    share = -mean[mean < -least] / np.maximum(rim[mean < -least], 1e-9)
    unsigned = cut or (_without_sign(rim, mean) and not _slides(evidence, speed < -least, share))
    if not both or _sideways(reference) or not unsigned:
        return [], evidence
    if _direction(evidence, reference, rim)[1]:  # back in the world, not by the rover
        return [], evidence
    # In turns the sides may be unlike; of what was cut off at 0 nothing is known.
    unknown = (evidence.moving & ~evidence.unturned)[:, None]
    if cut:
        goes_back = speed < -CLEAR_SPEED * bend_noise(forward)
        unknown = unknown | (evidence.rate == 0.0) & goes_back[:, None]
    rate = np.where(unknown, np.nan, evidence.rate * np.sign(speed)[:, None])
    finding = evidence.found('rates_unsigned', 0.95, other='reference goes')
    return [finding], replace(evidence, rate=rate)


def _slides(evidence: Evidence, back: Mask, share: FloatArray) -> bool:
    """Whether a rover that goes back may slide down a slope, however its IMU is turned.

    One that drives down it goes as fast as its wheels: ``share`` of their speed (k,) [-].
    """
    rows = evidence.moving & back
    if evidence.force is None or not rows.any():
        return False
    steep = float(np.median(np.linalg.norm(evidence.force[rows, :2], axis=1)))
    low, high = np.quantile(share, (0.1, 0.9))
    driven = evidence.facts.known and AS_FAST[0] < low and high < AS_FAST[1]
    return steep > SLIDES_BACK * evidence.facts.gravity and not driven


def check_sense(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    """Return a reference that is positive both ways, and the evidence with its sense."""
    there = _beside_rims(evidence)
    if there is None:
        return [], evidence
    reference, rim = there
    forward = reference.velocity[:, 0]
    # A position has no sign either, and is no speed.
    position = np.median(np.abs(forward)) >= BEYOND * np.abs(rim).max()
    if position or not _without_sign(forward, rim):
        return [], evidence
    velocity = reference.velocity * np.where(rim < 0.0, -1.0, 1.0)[:, None]
    mended = evidence.with_channel('reference', velocity=velocity)
    return [evidence.found('reference_unsigned', 0.95)], mended


def _sideways(reference: VelocitySeries) -> bool:
    """Return whether a velocity is not that along x of the rover alone."""
    forward, side = reference.velocity[:, 0], np.abs(reference.velocity[:, 1])
    return bool(np.quantile(side, 0.9) > ASIDE_SHARE * np.quantile(np.hypot(forward, side), 0.9))


def _cut_off(evidence: Evidence, forth: Mask, back: Mask) -> bool:
    """Return whether rates are 0 to the last digit where the torques drive the rover back.

    Those of a rover that is towed or slides back on locked wheels do not.
    """
    if min(forth.sum(), back.sum()) < LEAST_ROWS:
        return False
    drive, zero = np.nansum(evidence.torque, axis=1), evidence.rate == 0.0
    if zero[back].mean() < ALWAYS_ZERO or zero[forth].mean() > 1.0 - ALWAYS_ZERO:
        return False
    return bool(np.median(drive[back]) / np.median(drive[forth]) < -ALIKE_BOTH_WAYS)


def _without_sign(speed: FloatArray, other: FloatArray) -> bool:
    """Return whether one speed is positive and much the same whichever way the other goes."""
    least = 0.4 * float(np.quantile(np.abs(other), 0.9))
    ways = [speed[other > least], speed[other < -least]]
    if min(way.size for way in ways) < LEAST_ROWS:
        return False
    usual = [float(np.median(way)) for way in ways]
    against = [float(np.mean(way < 0.0)) for way in ways]
    return min(usual) > ALIKE_BOTH_WAYS * max(usual) and max(against) <= SELDOM_NEGATIVE


def check_source(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    """Return a reference that has the noise of the wheel rates in it, and the evidence without it.

    A velocity of another source differs from the wheels by their noise, at the least.
    """
    reference = evidence.recording.reference
    if reference is None:
        return [], evidence
    rim = nearest(evidence.joints.stamp, evidence.rim, reference.stamp)
    rows = np.abs(rim) > AHEAD * np.nanquantile(np.abs(rim), 0.9)
    if rows.sum() < LEAST_REFERENCES:
        return [], evidence
    forward = reference.velocity[rows, 0]
    between = np.interp(evidence.seconds(reference), evidence.time, evidence.rim)
    scale = float(np.median(forward / rim[rows]))
    left = min(robust_std(forward - scale * one[rows]) for one in (rim, between))
    noise = abs(scale) * noise_of(evidence.rim[evidence.moving])
    if not NO_NOISE * float(np.median(np.abs(forward))) < noise > left / SHARES_NOISE:
        return [], evidence
    return [evidence.found('reference_wheels', 0.95)], evidence.with_reference(None)


def check_frame(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    """Return a reference in another frame, and the evidence with that mended.

    One that is given in a world frame keeps its direction there.
    """
    there = _beside_rims(evidence)
    if there is None:
        return [], evidence
    reference, rim = there
    direction, in_world = _direction(evidence, reference, rim)
    if math.isnan(abs(direction)):
        return [], evidence
    velocity = reference.velocity[:, 0] + 1j * reference.velocity[:, 1]
    if in_world:
        along = np.column_stack([np.abs(velocity) * np.sign(rim), 0.0 * rim, 0.0 * rim])
        mended = evidence.with_channel('reference', velocity=along)
        return [evidence.found('reference_world', 0.95)], mended
    if abs(direction) < STEADY:
        unclear: list[Outcome] = [not_checked('mounting', 'reference_frame')]
        return unclear if _sideways(reference) else [], evidence
    aside = float(np.angle(direction))  # whatever jumps there are
    if abs(aside) < FAR_ASIDE:
        return [], evidence
    angle = math.degrees(aside)
    if not reference.points_aside:  # a rover that keeps to a cross slope may slide aside on it
        evidence.figures[ASIDE] = round(angle, 1)  # and tells no unit, no radius
        return [not_checked('mounting', 'reference_aside', angle=angle)], evidence
    turned = velocity * np.exp(-1j * aside)
    mended = evidence.with_channel(
        'reference', velocity=np.column_stack([turned.real, turned.imag, 0.0 * rim])
    )
    return [evidence.found('reference_turned', 0.5, value=angle, angle=angle)], mended


@once
def in_another_frame(evidence: Evidence) -> bool:
    """Return whether there is a reference, and not along x of the rover."""
    there, reference = _beside_rims(evidence), evidence.recording.reference
    aside = reference is not None and reference.points_aside
    return aside or (there is not None and _direction(evidence, *there)[1])


def _direction(
    evidence: Evidence, reference: VelocitySeries, rim: FloatArray
) -> tuple[complex, bool]:
    """Return the mean direction of a velocity along the wheels, nan where these hardly turn.

    And whether it turns with the heading, as in a frame of the world.
    """
    moving = np.abs(rim) > 0.3 * np.quantile(np.abs(rim), 0.9)
    if moving.sum() < LEAST_ROWS:
        return math.nan, False
    velocity = reference.velocity[:, 0] + 1j * reference.velocity[:, 1]
    direction = (velocity * np.sign(rim) / np.maximum(np.abs(velocity), 1e-9))[moving]
    heading = integrated(evidence.time, evidence.yaw)
    psi = np.interp(evidence.seconds(reference), evidence.time, heading)[moving]
    in_body, in_world = abs(direction.mean()), abs((direction * np.exp(-1j * psi)).mean())
    turns = np.ptp(psi) > CLEAR_HEADING and in_world > max(STEADY, 0.5 * (1.0 + in_body))
    return complex(direction.mean()), bool(turns)


def speed_ratios(evidence: Evidence) -> FloatArray | None:
    """Return reference speeds over rim speeds where the rover goes ahead; None: they tell no unit.

    In turns on the spot the mean of the rims is next to nothing.
    """
    reference = evidence.recording.reference
    if reference is None:
        return None
    rim = np.abs(evidence.rim_at(reference, row_medians(evidence.speed)))
    usual = float(np.nanquantile(rim, 0.9)) if np.isfinite(rim).any() else 0.0
    least = AHEAD * evidence.working_rate * float(np.nanmean(evidence.facts.radius))
    mean = np.abs(evidence.rim_at(reference, evidence.rim))
    rows = (rim > max(0.4 * usual, least, 1e-9)) & (mean > MOSTLY * rim)
    speed = np.linalg.norm(reference.velocity[:, :2], axis=1)
    if rows.sum() < LEAST_ROWS:
        return None
    if hardly_moves(speed, rows):
        return None  # stuck, not another unit
    if correlation(np.nan_to_num(rim), np.nan_to_num(speed)) < 0.8:
        return None
    return np.asarray(speed[rows] / rim[rows])


def as_fast_as_rims(evidence: Evidence, scale: float) -> bool:
    """Return whether a reference goes as many times as fast as the rims, and not as they do."""
    ratios = speed_ratios(evidence)
    ratio = 1.0 if ratios is None else float(np.quantile(ratios, LEAST_SLIP))
    return abs(ratio / scale - 1.0) < WITHOUT_SLIP < abs(ratio - 1.0)


def check_reference_unit(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    """Return the units that a reference may be in, and the evidence mended where it is one."""
    there = _beside_rims(evidence)
    if there is None or not evidence.facts.known or ASIDE in evidence.figures:
        return [], evidence
    reference, ratios = there[0], speed_ratios(evidence)
    if ratios is None or np.median(ratios) < LEAST_UNIT_RATIO:
        return [], evidence
    ratio = float(np.quantile(ratios, LEAST_SLIP))
    fitting = units_of_reference(ratio, (MOST_SLIPPING, 1.25))
    if any(abs(ratio * one['value'] - 1.0) < WITHOUT_SLIP for one in fitting.values()):
        least, most = USUAL_SLIP
        fitting = {u: one for u, one in fitting.items() if least < ratio * one['value'] < most}
    findings: list[Outcome] = [
        evidence.found('reference_unit', 0.9 / len(fitting), **one) for one in fitting.values()
    ]
    if len(findings) != 1:  # the slip hides which of several it is
        return findings, evidence
    (one,) = fitting.values()
    velocity, variance = reference.velocity * one['value'], reference.variance * one['value'] ** 2
    return findings, evidence.with_channel('reference', velocity=velocity, variance=variance)


def units_of_reference(ratio: float, band: tuple[float, float]) -> dict[str, dict[str, Any]]:
    """Return what to tell of each unit of a speed that is so many times that of the rims.

    ``band``: least and most speed over rim speed that the slip leaves.
    """
    return {
        unit: {'value': 1.0 / factor, 'ratio': ratio, 'unit': unit}
        for unit, factor in KNOWN_UNITS.items()
        if min(band[0], NO_SCALE / factor) < ratio / factor < band[1]
    }


def hardly_moves(speed: FloatArray, rows: Mask) -> bool:
    """Return whether a speed (k,) is little more than its noise in some rows: no unit is told."""
    return float(np.quantile(np.abs(speed[rows]), 0.8)) < CLEAR_SPEED * bend_noise(speed)


def check_jumps(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    """Return velocities that leave their neighbours, and the evidence with these made calm."""
    reference = evidence.recording.reference
    if reference is None or reference.stamp.size < LEAST_REFERENCES:
        return [not_checked('jumps', 'few')], evidence
    forward, at = reference.velocity[:, 0], evidence.seconds(reference)
    off, speed = spike_height(forward[:, None])[:, 0], float(np.quantile(np.abs(forward), 0.8))
    usual = max(robust_std(np.diff(forward)), 1e-6)
    wild = off > max(JUMP_FACTOR * usual, LEAST_JUMP * speed)
    if not wild.any():
        return [], evidence
    velocity = reference.velocity.copy()
    velocity[wild, 0] = np.interp(at[wild], at[~wild], forward[~wild])
    mended, share = evidence.with_channel('reference', velocity=velocity), float(np.mean(wild))
    if share < JUMP_SHARE or wild.sum() < LEAST_JUMPS:
        return [], mended
    details = {'count': int(wild.sum()), 'share': 100.0 * share, 'most': float(np.abs(off).max())}
    return [evidence.found('jumps', 0.97, **details)], mended


def check_covariance(evidence: Evidence) -> list[Outcome]:
    """Compare the stated variance with the scatter of the velocity."""
    reference = evidence.recording.reference
    if reference is None:
        return [not_checked('covariance', 'no_reference')]
    forward = reference.velocity[:, 0]
    if reference.stamp.size < LEAST_REFERENCES or not np.ptp(forward):
        return []  # no reading of a speed
    rim = np.nan_to_num(evidence.rim_at(reference, evidence.rim))
    if evidence.facts.known and np.quantile(np.abs(forward), 0.8) > BEYOND * np.abs(rim).max():
        return []  # in another unit
    noise = min(bend_noise(forward), bend_noise(forward - rim))  # wheels start and stop as well
    evidence.figures['reference.noise_m_s'] = float(f'{noise:.3g}')
    stated = reference.variance[np.isfinite(reference.variance)]
    usual = math.sqrt(max(float(np.median(stated)), 0.0)) if stated.size else 0.0
    evidence.figures['reference.stated_std_m_s'] = float(f'{usual:.3g}')
    if stated.size and np.ptp(stated) and noise < COVARIANCE_FACTOR * usual:
        return []  # what changes is no placeholder
    own = evidence.facts.sensors.reference_std if evidence.facts.known else 0.0
    expected = usual or float(own)  # what the estimator goes by
    # Errors wander: what is stated may well be more than the scatter, but not more than the speed.
    usual_speed = float(np.quantile(np.abs(forward), 0.9))
    moves = noise < 2.0 * bend_noise(rim)  # what starts and stops make is no noise
    if expected and (moves or noise / COVARIANCE_FACTOR <= expected) and expected <= usual_speed:
        return []
    noise = max(noise, LEAST_STD)
    details = {'noise': noise, 'variance': noise**2, 'stated': usual}
    return [evidence.found('covariance', 0.9, value=float(f'{noise:.2g}'), **details)]
