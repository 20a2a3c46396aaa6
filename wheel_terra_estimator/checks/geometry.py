# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Figures of the rover that a drive tells: rolling radius, track."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.checks.evidence import Evidence
from wheel_terra_estimator.checks.finding import Finding, NotChecked, Outcome
from wheel_terra_estimator.checks.sinkage import without_stated_errors
from wheel_terra_estimator.checks.statistics import (
    Estimate,
    block_fit,
    confidence,
    correlation,
    robust_std,
)
from wheel_terra_estimator.checks.torque import MOST_TRACTION, thrust

FloatArray = NDArray[np.float64]

LEAST_RADIUS_ERROR = 0.025
"""Share by which a radius is wrong before it is a finding [-]."""
RADIUS_SIGMAS = 4.0
UNIFORM_STD = 1.0 / math.sqrt(12.0)
"""Standard deviation of what lies anywhere in an interval, as a share of its length [-]."""
CREDIBLE_STD = 0.05
"""Deviation of a ratio of radii that is still told [-]."""
FIRM_SLIP = 0.12
"""Slip at the usual traction above which the ground is too soft to tell the radius [-]."""
SLOPE_OF_SLIP = Estimate(0.2, 0.2)
"""Slip over traction of firm ground where the drive does not tell it: mean, deviation [-]."""
FIRM_DEPTH = Estimate(0.02, 0.015)
"""Sinkage over radius of firm ground where no sensor tells it: mean, deviation [-]."""
DEEPEST = 0.3
"""The same, beyond which a sensor is not believed (another unit) [-]."""
LEAST_DEPTHS = 50
LEAST_REFERENCES = 12
LEAST_TRACK_ERROR = 0.08
CLEAR_TURN = 0.95
"""Correlation of gyro and difference of the sides that a turn has [-]."""
LEAST_YAW_RATE = 0.02  # [rad/s]
SKID_TRACK = 0.9
"""Effective over geometric track below which the rover file's track is too large [-]: skidding
makes it larger, never smaller."""


def radius_ratio(evidence: Evidence, figures: dict[str, Any]) -> Estimate | NotChecked:
    """Return true over configured radius from straight, steady, firm stretches.

    The reference's velocity is ``v = q (1 - k m) rim`` with the traction m = sum of T/r over the
    weight: q is the ratio of the radii, k the slope of slip over traction. Without torque a ratio
    below 1 cannot be told from slip.
    """
    reference, facts = evidence.reference(), evidence.facts
    if reference is None:
        return NotChecked('radius', 'no reference velocity in it')
    if not facts.known:
        return NotChecked('radius', 'no rover file')
    if 'wheels.rad_per_count' in figures:
        return NotChecked('radius', 'rates in counts: a radius looks like other counts per turn')
    half = 0.25
    rim = evidence.rim_at(reference.stamp, evidence.rim, half)
    straight = evidence.rim_at(reference.stamp, evidence.straight.astype(float), half)
    forward = reference.velocity[:, 0]
    rows = np.isfinite(rim) & (straight > 0.99) & np.isfinite(forward)
    if rows.sum() < LEAST_REFERENCES:
        return NotChecked('radius', 'no straight, steady stretch with a reference in it')
    rim, forward = rim[rows], forward[rows]
    plain = block_fit(rim[:, None], forward)[0]
    # No estimator is better than the mean of independent readings of the reference.
    noise = robust_std(np.diff(forward, 2)) / math.sqrt(6.0)
    bound = noise / math.sqrt(max(float(rim @ rim), 1e-12))
    figures['rover.radius_bound_by_reference_m'] = round(bound * float(np.mean(facts.radius)), 5)
    figures['rover.speed_over_rim_speed'] = round(plain.value, 4)
    if not np.isfinite(evidence.torque).any() or not np.any(np.nan_to_num(evidence.torque)):
        return _without_torque(evidence, plain)
    traction = evidence.rim_at(reference.stamp, np.nan_to_num(thrust(evidence)), half)[rows]
    sense, weight = np.sign(rim), facts.mass * facts.gravity
    demand = np.zeros(rim.size)
    if evidence.force is not None:
        along = evidence.rim_at(reference.stamp, evidence.force[:, 0], half)[rows]
        demand = along * sense / facts.gravity
    speeds = _Speeds(rim, forward, traction * sense / weight, demand)
    ratio = _with_torque(speeds, plain, figures)
    return ratio if isinstance(ratio, NotChecked) else _referred_to_slip_radius(evidence, ratio)


def _referred_to_slip_radius(evidence: Evidence, ratio: Estimate) -> Estimate:
    """Take off the slip at which a wheel in soil rolls.

    The soil shears at r + lambda h, between rim and lug tips, and over the contact from the front
    angle t1 on its speed is v cos t, not v: shear vanishes in the mean at a slip of
    (1 - lambda) h/(r + h) - t1^2/6, with t1^2/6 = z/(3 r). Where neither is known, lambda lies
    anywhere in 0 to 1 and z/r is that of firm ground.
    """
    configuration = evidence.facts.configuration
    assert configuration is not None
    wheels = configuration.wheels
    lugs = float(np.mean(wheels.lug_height / evidence.facts.radius))
    stated = configuration.effects.get('lug_shear_radius', {}).get('lam')
    shear = Estimate(0.5, UNIFORM_STD) if stated is None else Estimate(float(stated), 0.0)
    depth = _depth(evidence)
    tip = 0.0 if configuration.slip_radius == 'rim' else 1.0
    slip = (tip - shear.value) * lugs - depth.value / 3.0
    std = math.hypot(shear.std * lugs, depth.std / 3.0)
    return Estimate(ratio.value * (1.0 + slip), math.hypot(ratio.std, std))


def _depth(evidence: Evidence) -> Estimate:
    """Return sinkage over radius on the straight."""
    series, configuration = evidence.recording.sinkage, evidence.facts.configuration
    assert configuration is not None
    radius = float(np.mean(configuration.wheels.radius))
    if series is not None and series.stamp.size:
        straight = evidence.rim_at(series.stamp, evidence.straight.astype(float), 0.25) > 0.99
        names = [name for name in series.names if name in configuration.wheels.names]
        columns = [series.names.index(name) for name in names]
        rows = without_stated_errors(configuration, names, series.sinkage[straight][:, columns])
        if np.isfinite(rows).sum() >= LEAST_DEPTHS:
            sensors = configuration.sensors
            depth = float(np.nanmedian(rows)) / radius
            std = max(float(sensors.sinkage_zero_std), float(sensors.sinkage_std) / 2.0) / radius
            if depth < DEEPEST:
                return Estimate(max(depth, 0.0), std)
    return FIRM_DEPTH


class _Speeds(NamedTuple):
    """Speeds at the stamps of the reference (k,) [m/s]; traction and demand over the weight [-]."""

    rim: FloatArray
    forward: FloatArray
    traction: FloatArray
    demand: FloatArray


def _with_torque(
    speeds: _Speeds, plain: Estimate, figures: dict[str, Any]
) -> Estimate | NotChecked:
    """Take the slip off the ratio of the speeds.

    A driven wheel rolls without slip somewhere between no torque (the soil drags it back: it
    skids a little) and no pull (its torque overcomes the resistance: it slips a little). The ratio
    is taken in the middle, half of the way between both is its uncertainty.
    """
    rim, forward, traction = speeds.rim, speeds.forward, speeds.traction
    if float(np.median(np.abs(traction))) > MOST_TRACTION:
        return NotChecked('radius', 'torques have no credible scale')
    both = block_fit(np.column_stack([rim, rim * traction]), forward)
    # What firm ground does elsewhere is one more observation of the slope.
    told = Estimate(-both[1].value / both[0].value, both[1].std)
    weight = SLOPE_OF_SLIP.std**2 / (SLOPE_OF_SLIP.std**2 + told.std**2)
    slope = weight * told.value + (1.0 - weight) * SLOPE_OF_SLIP.value
    middle = float(np.median(traction))
    slip = slope * middle
    figures['rover.slip_of_ground'] = round(slip, 4)
    if slip > FIRM_SLIP:
        return NotChecked('radius', f'soft ground (slip about {slip:.2f}); drive on firm ground')
    no_torque = plain.value / (1.0 - slip)
    resistance = slope * max(float(np.median(traction - speeds.demand)), 0.0)
    value = no_torque * (1.0 - 0.5 * resistance)
    slope_std = math.sqrt(weight) * told.std
    std = math.hypot(plain.std, slope_std * middle, UNIFORM_STD * resistance)
    if std > CREDIBLE_STD:
        return NotChecked('radius', 'slip not told from radius; drive up and down a firm slope')
    return Estimate(value, std)


def _without_torque(evidence: Evidence, plain: Estimate) -> Estimate | NotChecked:
    if plain.value > 1.0:
        return plain  # nothing but a larger radius makes a rover outrun its rolling wheels
    if plain.value > 1.0 - LEAST_RADIUS_ERROR:
        return Estimate(plain.value, math.hypot(plain.std, 0.5 * LEAST_RADIUS_ERROR))
    return NotChecked(
        'radius', f'no torque: a speed of {plain.value:.3f} of the rims may be slip; drive on firm'
    )


def check_radius(evidence: Evidence, figures: dict[str, Any]) -> list[Outcome]:
    """Return a rolling radius that is not the one of the rover file."""
    ratio = radius_ratio(evidence, figures)
    if isinstance(ratio, NotChecked):
        return [ratio]
    facts, joints = evidence.facts, evidence.recording.joints
    assert joints is not None and facts.configuration is not None
    rolling = float(np.mean(facts.radius)) * ratio.value
    figures['rover.rolling_radius_m'] = round(rolling, 5)
    figures['rover.rolling_radius_std_m'] = round(float(np.mean(facts.radius)) * ratio.std, 5)
    sigmas = ratio.sigmas_from(1.0)
    if abs(ratio.value - 1.0) < LEAST_RADIUS_ERROR or sigmas < RADIUS_SIGMAS:
        return []
    rims = facts.radius * ratio.value - (facts.radius - facts.configuration.wheels.radius)
    listed = ', '.join(f'{radius:.4f}' for radius in rims)
    return [
        Finding(
            kind='radius',
            topic=joints.topic,
            parameter='wheels.radius',
            value=round(float(np.mean(rims)), 5),
            std=round(float(np.mean(facts.radius)) * ratio.std, 5),
            confidence=confidence(sigmas),
            words=(
                f'the rover runs {ratio.value:.3f} +- {ratio.std:.3f} of what its rims say on the '
                'straight'
            ),
            cure=f'wheels.radius: [{listed}]',
        )
    ]


def skids(evidence: Evidence) -> bool:
    """Return whether the rover has to skid to turn: wheels in several rows that do not steer."""
    configuration = evidence.facts.configuration
    if configuration is None:
        return True
    wheels = configuration.wheels
    steered = any(getattr(wheels, 'steering_joints', ()) or ())
    track = float(np.ptp(wheels.y))
    return not steered and float(np.ptp(wheels.x)) > 0.3 * track


def stated_track(evidence: Evidence) -> float:
    """Return the distance of the sides as the rover file has it [m]."""
    lateral, side = evidence.facts.lateral, evidence.facts.side
    return float(lateral[side > 0].mean() - lateral[side < 0].mean())


def track_ratio(evidence: Evidence) -> Estimate | NotChecked:
    """Return effective over configured track from the gyro and the difference of the sides."""
    facts, difference = evidence.facts, evidence.side_difference
    if evidence.gyro is None or not facts.known or not facts.has_sides():
        return NotChecked('track', 'no IMU, or sides not known')
    yaw = evidence.gyro[:, 2]
    rows = evidence.turning & np.isfinite(difference)
    bias = np.median(yaw[evidence.at_rest]) if evidence.at_rest.sum() > 20 else 0.0
    clear = rows.sum() > 60 and correlation((yaw - bias)[rows], difference[rows]) > CLEAR_TURN
    if not clear or float(np.quantile(np.abs(yaw), 0.95)) < LEAST_YAW_RATE:
        return NotChecked('track', 'no clear turn in it; drive a circle both ways')
    track = stated_track(evidence)
    slope = block_fit((yaw[rows] - bias)[:, None], difference[rows])[0]
    return Estimate(float(slope.value / track), float(slope.std / abs(track)))


def check_track(evidence: Evidence, figures: dict[str, Any]) -> list[Outcome]:
    """Return a track that the turns contradict."""
    if 'wheels.rad_per_count' in figures:
        return [NotChecked('track', 'rates in counts: a track looks like other counts per turn')]
    ratio = track_ratio(evidence)
    if isinstance(ratio, NotChecked):
        return [ratio]
    figures['rover.effective_over_stated_track'] = round(float(ratio.value), 3)
    figures['rover.effective_over_stated_track_std'] = round(float(ratio.std), 3)
    stated = stated_track(evidence)
    figures['rover.effective_track_m'] = round(float(ratio.value) * stated, 4)
    skidding = skids(evidence)
    reference = evidence.reference()
    slip_free = reference is not None and 'rover.speed_over_rim_speed' in figures
    if skidding and ratio.value > SKID_TRACK:
        return [
            NotChecked(
                'track',
                f'the wheels skid in turns as if the track were {ratio.value * stated:.3f} +- '
                f'{ratio.std * stated:.3f} m ({ratio.value:.2f} of the stated one); how much of '
                'that is skid no recording tells: measure it with a tape',
            )
        ]
    if ratio.sigmas_from(1.0) < 4.0 or abs(ratio.value - 1.0) < LEAST_TRACK_ERROR:
        return []
    if not slip_free and not skidding:
        ratio = Estimate(ratio.value, math.hypot(ratio.std, 0.03))
    joints = evidence.recording.joints
    assert joints is not None
    facts, track = evidence.facts, stated
    listed = ', '.join(f'{y * ratio.value:.3f}' for y in facts.lateral)
    return [
        Finding(
            kind='track',
            topic=joints.topic,
            parameter='wheels.y',
            value=round(track * ratio.value, 4),
            std=round(track * ratio.std, 4),
            confidence=confidence(ratio.sigmas_from(1.0)),
            words=(
                f'turns need a track of {ratio.value:.3f} +- {ratio.std:.3f} of the stated '
                f'{track:.3f} m'
            ),
            cure=f'wheels.y: [{listed}]',
        )
    ]
