# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Figures of the rover found from a drive: rolling radius, track."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.checks import turning
from wheel_terra_estimator.checks.clocks import SMOOTHED_BY
from wheel_terra_estimator.checks.evidence import Evidence, Mask, acceleration_fits, once
from wheel_terra_estimator.checks.finding import (
    LEAST_TURN_RATE,
    SKID_TRACKS,
    NotChecked,
    Outcome,
    listed,
    not_checked,
)
from wheel_terra_estimator.checks.reference import ASIDE
from wheel_terra_estimator.checks.sinkage import without_stated_errors
from wheel_terra_estimator.checks.statistics import (
    UNIFORM_STD,
    Estimate,
    Trial,
    block_fit,
    confidence,
    correlation,
    probability,
    tried,
)
from wheel_terra_estimator.checks.torque import SOFT_TRACTION, both_ways, thrust
from wheel_terra_estimator.checks.wheel_rates import OF_RADII, rounding

LEAST_RADIUS_ERROR = 0.025  # share by which a radius is wrong before it is a finding [-]
RADIUS_SIGMAS, UNCLEAR_SIGMAS = 4.0, 2.0  # from which it is a finding, or left open [-]
LEAST_UNLIKE = 0.05  # difference of wheels that slip makes none, on one side [-]
OUTRUN_STD = 0.01  # slip that is left open where a rover outruns its wheels [-]
PRIOR_OF_RADIUS = 0.85  # probability that it is the radius, not the scale of the reference [-]
SURE = 0.97  # probability beside its alternative from which a fault is named alone [-]
BESIDE = 0.8  # the same of one that is named with it, at most: neither is written [-]
START_SLIP = 0.15  # part of the accelerations of rims that slip and lags take, one deviation [-]
START_STD = 0.03  # of them by the model, at least [-]
TRACK_STD = 0.02  # deviation that slip leaves in a scale of speed by turns, at least [-]
RESISTANCE = Estimate(0.08, 0.05)  # of firm ground over the weight [-]
SOFT_DEPTH = 0.06  # sinkage over radius above which ground is not taken for firm [-]
MOST_ROUNDING = 0.02  # error of the mean rate by rounding, over the working rate, at most [-]
SLOPE_OF_SLIP = Estimate(0.2, 0.2)  # slip over traction of firm ground [-]
NOT_SEEN = Estimate(0.0, 1e3)  # the same where there are no slopes
LEAST_SEEN = 0.5  # weight of the drive in its own slip [-]
FIRM_DEPTH = Estimate(0.02, 0.015)  # sinkage over radius of firm ground [-]
DEEPEST = 0.3  # the same, beyond which a sensor is rejected (another unit) [-]
LEAST_DEPTHS = 50
LEAST_REFERENCES = 12
LEAST_TRACK_ERROR = 0.08
MOST_HIDDEN = 0.7  # speed over rim speed of slip that torques off zero may hide, at least [-]
MOST_SOFT = 0.93  # the same on soft ground without sinkage readings [-]: slip is 7 % there
MOST_COST = 0.175
"""What loose soil costs over the weight where all may be slip [-]; half of that, a sixteenth."""
UNSEEN_SLIP = 0.035  # slip that widens a track without straight driving, one deviation [-]
STEERED_STD = 0.04  # slip of steered wheels in curves, as a share of the track, one deviation [-]
MOST_UNLIKE = 0.1  # residual in turns of wheels that roll where they are steered, at most [-]
CLEAR_TURN = 0.95  # correlation of gyro and difference of the sides that a turn has [-]


class TriedRatio(NamedTuple):
    """A ratio, and what it left when it was found on one half and tried on the other."""

    ratio: Estimate
    trial: Trial
    alone: bool = True  # nothing else may be it


class _Speeds(NamedTuple):
    """Speeds at the stamps of the reference on the straight (k,) [m/s], and the rows (m,)."""

    rim: FloatArray
    forward: FloatArray
    rows: Mask

    def at(self, evidence: Evidence, values: FloatArray) -> FloatArray:
        """Return values of the wheel odometry there, positive along the drive."""
        reference = evidence.recording.reference
        assert reference is not None
        means = evidence.rim_at(reference, np.nan_to_num(values))
        return means[self.rows] * np.sign(self.rim)

    @property
    def ratio(self) -> Estimate:
        """Speed over rim speed [-]."""
        return block_fit(self.rim[:, None], self.forward)[0]


def _straight_speeds(evidence: Evidence) -> _Speeds | None:
    """Return speeds by the reference and the rims; None without straight, steady stretches."""
    reference = evidence.recording.reference
    if reference is None:
        return None
    rows = evidence.rim_at(reference, evidence.straight.astype(float)) > 0.99
    if rows.sum() < LEAST_REFERENCES:
        return None
    rim = evidence.rim_at(reference, evidence.rim)
    return _Speeds(rim[rows], reference.velocity[rows, 0], rows)


def radius_ratio(evidence: Evidence) -> TriedRatio | NotChecked:
    """Return true over configured radius from straight, steady, firm stretches.

    The reference's velocity is ``v = q (1 - k m) rim`` with the traction m = sum of T/r over the
    weight: q is the ratio of the radii, k the slope of slip over traction. Without torque a ratio
    below 1 cannot be separated from slip.
    """
    reference, facts, figures = evidence.recording.reference, evidence.facts, evidence.figures
    if reference is None:
        return not_checked('radius', 'no_reference')
    if not facts.known:
        return not_checked('radius', 'no_file')
    if 'wheels.rad_per_count' in figures:
        return not_checked('radius', 'counts')
    if rounding(evidence) > MOST_ROUNDING:
        return not_checked('radius', 'rounded')
    speeds = _straight_speeds(evidence)
    if speeds is None:
        return not_checked('radius', 'no_straight')
    plain = speeds.ratio
    figures['rover.speed_over_rim_speed'] = round(plain.value, 4)
    if not OF_RADII[0] < plain.value < OF_RADII[1]:
        return not_checked('radius', 'far_off', ratio=plain.value)
    ratio = _without_slip(evidence, speeds, plain)
    if isinstance(ratio, NotChecked):
        return ratio
    trial = tried(
        lambda part: block_fit(speeds.rim[part, None], speeds.forward[part])[0].value,
        1.0,
        speeds.rim**2,
    )
    return TriedRatio(_referred_to_slip_radius(evidence, ratio), trial)


def _without_slip(evidence: Evidence, speeds: _Speeds, plain: Estimate) -> Estimate | NotChecked:
    """Take the slip off the ratio of the speeds.

    A driven wheel rolls without slip somewhere between no torque (the soil drags it back: it
    skids a little) and no pull (its torque overcomes the resistance: it slips a little). The ratio
    is taken in the middle, half of the way between both is its uncertainty.
    """
    rim, facts = speeds.rim, evidence.facts
    demand = np.zeros(rim.size)
    if evidence.force is not None:
        demand = speeds.at(evidence, evidence.force[:, 0]) / facts.gravity
    if not np.isfinite(evidence.torque).any(axis=0).all():
        if plain.value > 1.0:  # Only a larger radius makes a rover faster than its rolling wheels.
            return Estimate(plain.value, math.hypot(plain.std, OUTRUN_STD))
        return not_checked('radius', 'no_torque')
    traction = speeds.at(evidence, thrust(evidence)) / (facts.mass * facts.gravity)
    costs = float(np.median(traction - demand))
    resistance = _resistance(evidence, costs)
    if isinstance(resistance, NotChecked):
        return resistance
    depth = _depth(evidence).value
    middle = float(np.median(demand)) + resistance.value
    as_slip = (plain.value < 1.0) == (middle >= 0.0)  # downhill wheels skid: faster than the rims
    if as_slip and depth > SOFT_DEPTH:
        return not_checked('radius', 'soft', depth=depth)
    unseen = _depth(evidence) is FIRM_DEPTH and 1.0 - (costs / MOST_COST) ** 4 < plain.value
    if unseen and plain.value < MOST_SOFT and middle >= 0.0:
        return not_checked('radius', 'costly', seen=costs)
    seen = NOT_SEEN
    if demand.any():
        both = block_fit(
            np.column_stack([rim, rim * traction]),
            speeds.forward,
            np.column_stack([rim, rim * demand]),  # noise of the torques is not that of the slopes
        )
        seen = Estimate(-both[1].value / both[0].value, both[1].std)
    # What firm ground does elsewhere is one more observation of the slope.
    weight = SLOPE_OF_SLIP.std**2 / (SLOPE_OF_SLIP.std**2 + seen.std**2)
    slope = max(weight * seen.value + (1.0 - weight) * SLOPE_OF_SLIP.value, 0.0)
    if as_slip and weight < LEAST_SEEN:
        return not_checked('radius', 'no_slopes')
    slip, skid = slope * middle, slope * resistance.value
    value = plain.value / (1.0 - slip) * (1.0 - 0.5 * skid)
    slope_std = math.sqrt(weight) * seen.std
    std = math.hypot(plain.std, slope_std * middle, slope * resistance.std, UNIFORM_STD * skid)
    return Estimate(value, std)


def _resistance(evidence: Evidence, seen: float) -> Estimate | NotChecked:
    """Return the rolling resistance over the weight by the torques, beside that of firm ground.

    Zeros of the torques look like it; a torque above that of firm ground is not counted as slip.
    """
    facts, sensors = evidence.facts, evidence.facts.sensors
    arm = len(facts.names) / float(np.mean(facts.radius)) / (facts.mass * facts.gravity)
    std = math.hypot(float(sensors.torque_zero_std) * arm, float(sensors.torque_gain_std) * seen)
    unlike = abs(seen - RESISTANCE.value) > 3.0 * math.hypot(std, RESISTANCE.std)
    if unlike or seen > SOFT_TRACTION:
        return not_checked('radius', 'costly', seen=seen)
    share = RESISTANCE.std**2 / (RESISTANCE.std**2 + std**2)
    value = share * seen + (1.0 - share) * RESISTANCE.value
    return Estimate(max(value, 0.0), math.sqrt(share) * std)


def _referred_to_slip_radius(evidence: Evidence, ratio: Estimate) -> Estimate:
    """Take off the slip at which a wheel in soil rolls.

    The soil shears at r + lambda h, between rim and lug tips, and over the contact from the front
    angle t1 on its speed is v cos t, not v: shear vanishes in the mean at a slip of
    (1 - lambda) h/(r + h) - t1^2/6, with t1^2/6 = z/(3 r). Where neither is known, lambda lies
    anywhere in 0 to 1 and z/r is that of firm ground. Depth counts for nothing to twice as much:
    soil yields along the contact as well.
    """
    configuration = evidence.facts.configuration
    lugs = float(np.mean(configuration.wheels.lug_height / evidence.facts.radius))
    stated = configuration.effects.get('lug_shear_radius', {}).get('lam')
    shear = Estimate(0.5, UNIFORM_STD) if stated is None else Estimate(float(stated), 0.0)
    depth = _depth(evidence)
    tip = 0.0 if configuration.slip_radius == 'rim' else 1.0
    slip = (tip - shear.value) * lugs - depth.value / 3.0
    std = math.hypot(shear.std * lugs, depth.std / 3.0, UNIFORM_STD * 2.0 * depth.value / 3.0)
    return Estimate(ratio.value * (1.0 + slip), math.hypot(ratio.std, std))


def _depth(evidence: Evidence) -> Estimate:
    """Return sinkage over radius on the straight."""
    series, facts = evidence.recording.sinkage, evidence.facts
    if series is None:
        return FIRM_DEPTH
    straight = evidence.rim_at(series, evidence.straight.astype(float)) > 0.99
    _, rows = without_stated_errors(facts, series)
    known = rows[straight][np.isfinite(rows[straight])]
    if known.size < LEAST_DEPTHS or not np.ptp(known):
        return FIRM_DEPTH
    radius = float(np.mean(facts.configuration.wheels.radius))
    depth = float(np.median(known)) / radius
    std = max(float(facts.sensors.sinkage_zero_std), facts.sensors.sinkage_std / 2.0) / radius
    return Estimate(max(depth, 0.0), std) if depth < DEEPEST else FIRM_DEPTH


def check_radius(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    """Return a radius or a reference of another scale, and the evidence with that mended."""
    if ASIDE in evidence.figures:
        return [], evidence
    if late := evidence.figures.get(SMOOTHED_BY):
        return [not_checked('gain', 'smooth', late=late)], evidence
    found_ratio = radius_ratio(evidence)
    if isinstance(found_ratio, NotChecked):
        return [found_ratio], evidence
    (ratio, trial, _), facts = found_ratio, evidence.facts
    radius = float(np.mean(facts.radius))
    evidence.figures['rover.rolling_radius_m'] = round(radius * ratio.value, 5)
    evidence.figures['rover.rolling_radius_std_m'] = round(radius * ratio.std, 5)
    sigmas, (sides, wheels) = ratio.sigmas_from(1.0), _unlike(evidence)
    # A side that is off by u moves the mean by u/2, one wheel of n by u/n: else all are.
    off_by = abs(ratio.value - 1.0)
    of_one = 0.5 * facts.side.size * off_by
    if sides > max(LEAST_UNLIKE, off_by) or wheels > max(LEAST_UNLIKE, of_one):
        return [not_checked('radius', 'one_wheel', unlike=100.0 * max(sides, wheels))], evidence
    if off_by < LEAST_RADIUS_ERROR or sigmas < UNCLEAR_SIGMAS:
        return [], evidence
    if sigmas < RADIUS_SIGMAS:
        return [not_checked('radius', 'unclear', ratio=ratio.value, std=ratio.std)], evidence
    if not trial.falls:
        return [not_checked('radius', 'halves')], evidence
    scale, stated = ratio.value, facts.configuration.wheels
    rims = facts.radius * scale - (stated.slip_radius - stated.radius)  # lugs stay
    share = _share_of_radius(evidence, ratio)
    soft = MOST_SOFT < ratio.value < 1.0 and _depth(evidence) is FIRM_DEPTH
    unsure = evidence.force is None or both_ways(evidence) is None
    slips = soft or (unsure and MOST_HIDDEN < ratio.value < 1.0)
    sure = confidence(sigmas) * (0.5 if slips else 1.0)
    evidence.figures['rover.radius_ratio'] = round(ratio.value, 4)
    words: dict[str, Any] = {'ratio': ratio.value, 'off': ratio.std}
    words['trial'] = trial.words('error', 'of the speed')
    alone = max(share, 1.0 - share) > SURE
    if not alone:
        words['alternative'] = ': wrong wheel radius, or wrong scale of the reference'
        hides = 'soft ground causes' if soft else 'torque zeros hide'
        words['alternative'] += f', or {hides} slip' if slips else ''
        words['separate'] = '; drive ten metres along a tape: which of the two shows ten?'
        share = min(max(share, 1.0 - BESIDE), BESIDE)
    off = radius * ratio.std
    of_rims = {'value': round(float(np.mean(rims)), 5), 'std': round(off, 5), 'radii': listed(rims)}
    times, std = round(1.0 / ratio.value, 4), round(ratio.std / ratio.value**2, 4)
    found: list[Outcome] = [
        evidence.found('radius', share * sure, **of_rims, **words),
        evidence.found('reference_scale', (1.0 - share) * sure, value=times, std=std, **words),
    ]
    if not alone:
        return found, replace(evidence, likelier_radius=ratio.value if share > 0.5 else 1.0)
    if share < 0.5:
        return found[1:], evidence
    return found[:1], replace(evidence, facts=replace(facts, radius=facts.radius * scale))


def _unlike(evidence: Evidence) -> tuple[float, float]:
    """Return by how much speeds differ on the straight: of the sides, and of wheels beside that.

    Half-way between the sides are the wheels on the centre line: else one of the three is odd.
    """
    rows = evidence.straight
    shares = evidence.speed[rows] / evidence.rim[rows, None]
    usual, side = np.nanmedian(shares, axis=0), evidence.facts.side
    left, right, middle = (usual[(side == s) & np.isfinite(usual)] for s in (1.0, -1.0, 0.0))
    if not left.size or not right.size:
        return 0.0, 0.0
    turned = stated_track(evidence) * evidence.yaw
    asymmetry = np.nanmedian((evidence.side_difference - turned)[rows] / evidence.rim[rows])
    threes = [sorted((left.mean(), right.mean(), one)) for one in middle]
    odd = [low - 2.0 * between + high for low, between, high in threes]
    return abs(float(asymmetry)), float(np.abs([np.ptp(left), np.ptp(right), *odd]).max())


def _share_of_radius(evidence: Evidence, ratio: Estimate) -> float:
    """Return the probability that a ratio of speeds is the radius, not the scale of the reference.

    Where the rover need not skid to turn, the gyro knows the scale of the rims; the accelerometer
    knows it by brisk starts.
    """
    odds = math.log(PRIOR_OF_RADIUS / (1.0 - PRIOR_OF_RADIUS))
    gain, off = (evidence.figures.get(f'torque.gain{end}', math.nan) for end in ('', '_std'))
    # The torque over the radius is what slopes ask for; a track of the rims is what they turn by.
    pairs = [(Estimate(gain, off), ratio.value)]
    turns = None if turning.skids(evidence) else measured_track(evidence)
    if isinstance(turns, TriedRatio):
        std = math.hypot(turns.ratio.std, TRACK_STD, ratio.std)
        rolling = 1.0 / evidence.figures['rover.speed_over_rim_speed']
        pairs.append((Estimate(turns.ratio.value, std), rolling))
    apart = [(seen.sigmas_from(1.0), seen.sigmas_from(by_radius)) for seen, by_radius in pairs]
    if fits := acceleration_fits(evidence):
        apart.append((_of_starts(fits[0], 1.0), _of_starts(fits[0], ratio.value)))
    for of_scale, of_radius in apart:
        if min(of_scale, of_radius) < 1.0:  # else it is off as well
            odds += 0.5 * (of_scale**2 - of_radius**2)
    return probability(odds)


def _of_starts(seen: Estimate, scale: float) -> float:
    """Return how far accelerations, over those of the rims, are from a scale of these [sigmas].

    Rims that slip in starts and stops take a part of it; a rover never outruns them so far.
    """
    slip = 1.0 - seen.value / scale
    return abs(slip) / (START_SLIP if slip > 0.0 else math.hypot(seen.std / scale, START_STD))


def stated_track(evidence: Evidence) -> float:
    """Return the distance of the sides as the rover file has it [m]."""
    lateral, side = evidence.facts.lateral, evidence.facts.side
    return float(lateral[side > 0].mean() - lateral[side < 0].mean())


@once
def measured_track(evidence: Evidence) -> TriedRatio | NotChecked:
    """Return effective over configured track from the gyro and the difference of the sides."""
    facts, difference = evidence.facts, evidence.side_difference
    if evidence.gyro is None or not facts.known or not facts.has_sides():
        return not_checked('track', 'no_sides')
    rows = evidence.turning
    yaw, difference = evidence.yaw[rows], difference[rows]
    clear = rows.sum() > 60 and correlation(yaw, difference) > CLEAR_TURN
    if not clear or float(np.quantile(np.abs(evidence.gyro[:, 2]), 0.95)) < LEAST_TURN_RATE:
        return not_checked('track', 'no_turn')
    track = stated_track(evidence)

    bias = [np.ones(yaw.size)] * (not evidence.rested)
    before = np.roll(evidence.yaw, 1)[rows]  # the same turns, of another noise
    turns, others = (np.column_stack([one, *bias]) for one in (yaw, before))

    def fitted(part: slice) -> Estimate:
        slope = block_fit(turns[part], difference[part], others[part])[0]
        return Estimate(slope.value / track, slope.std / abs(track))

    ratio = fitted(slice(None))
    if np.isfinite(evidence.steering).any():  # they slip in both directions in curves
        ratio = Estimate(ratio.value, math.hypot(ratio.std, STEERED_STD * ratio.value))
    trial = tried(lambda part: fitted(part).value, 1.0, yaw**2)
    if abs(ratio.value - 1.0) > LEAST_TRACK_ERROR and not trial.falls:
        return not_checked('track', 'halves')
    return TriedRatio(ratio, trial)


def rolling_track(evidence: Evidence) -> TriedRatio | NotChecked:
    """Return the track ratio of a rover that does not skid, where no slip may be it.

    Slip and a wrong radius widen the track of the turns as they slow the straights.
    """
    track = measured_track(evidence)
    if isinstance(track, NotChecked):
        return track
    unlike = max(_unlike(evidence))
    if unlike > LEAST_UNLIKE:
        return not_checked('radius', 'one_wheel', unlike=100.0 * unlike)
    soft = evidence.figures.get('torque.level_traction', 0.0) > SOFT_TRACTION
    if soft or _depth(evidence).value > SOFT_DEPTH or turning.left_in_turns(evidence) > MOST_UNLIKE:
        return not_checked('track', 'slip_in_turns')
    speeds, ratio = _straight_speeds(evidence), track.ratio
    slip = UNSEEN_SLIP if speeds is None else speeds.ratio.value - 1.0
    seen = Estimate(ratio.value, math.hypot(ratio.std, slip))
    return TriedRatio(seen, track.trial, alone=speeds is not None)


def check_track(evidence: Evidence) -> list[Outcome]:
    """Return a track that the turns contradict."""
    figures = evidence.figures
    if 'wheels.rad_per_count' in figures:
        return [not_checked('track', 'counts')]
    if rounding(evidence) > MOST_ROUNDING:
        return [not_checked('track', 'rounded')]
    track = measured_track(evidence)
    if isinstance(track, NotChecked):
        return [track]
    ratio, trial, stated = track.ratio, track.trial, stated_track(evidence)
    times = ratio.value * evidence.likelier_radius
    figures['rover.effective_over_stated_track'] = round(times, 3)
    figures['rover.effective_track_m'] = round(times * stated, 4)
    if times > SKID_TRACKS[1] and ratio.sigmas_from(SKID_TRACKS[1]) > RADIUS_SIGMAS:
        return [evidence.found('places', 0.8, ratio=times, stated=stated)]
    if turning.skids(evidence):
        return [not_checked('track', 'skids', track=times * stated)]
    rolling = rolling_track(evidence)
    if isinstance(rolling, NotChecked):
        return [NotChecked(kind, rolling.reason) for kind in ('track', 'radius')]
    ratio, alone = rolling.ratio, rolling.alone
    if ratio.sigmas_from(1.0) < 4.0 or abs(ratio.value - 1.0) < LEAST_TRACK_ERROR:
        return []
    sure = confidence(ratio.sigmas_from(1.0))
    alternative, separate = ', or the gyro has a scale error', '; measure it with a tape'
    if not alone:
        alternative = ', or the radius is wrong, or the wheels slip'
        separate += ', or drive straight with a reference'
    words: dict[str, Any] = {'alternative': alternative, 'separate': separate, 'stated': stated}
    words |= {'ratio': ratio.value, 'off': ratio.std, 'trial': trial.words('error', 'of the track')}
    value, std = round(stated * ratio.value, 4), round(stated * ratio.std, 4)
    lateral = listed(evidence.facts.configuration.wheels.y * ratio.value, '.3f')
    sure = 0.9 * sure if alone else 0.5
    return [evidence.found('track', sure, value=value, std=std, lateral=lateral, **words)]
