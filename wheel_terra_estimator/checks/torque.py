# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Drive torques: sign, unit, scale and zero, against weight, slope and each other."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.checks.evidence import (
    EVEN_GROUND_STD,
    LEAST_MOVING_ROWS,
    SETTLING,
    Evidence,
    mounting_yaw,
    once,
)
from wheel_terra_estimator.checks.finding import Finding, NotChecked, Outcome, listed, not_checked
from wheel_terra_estimator.checks.statistics import (
    LEAST_MARGIN,
    Estimate,
    Trial,
    block_fit,
    block_fits,
    confidence,
    moving_mean,
    tried,
)

UPHILL_ENOUGH = -0.02  # specific force along the drive at which a wheel takes power [g]
SIGN_SIGMAS = 4.0
LEAST_RESPONSE = 0.3  # response of a torque to slopes over the others' that shows its sign [-]
ALIKE_LEVELS = 0.5  # least over greatest of torques that drive alike [-]
LEAST_LOOSE = 0.03  # sum of T/r over the weight on loose level ground, at least [-]
MOST_TRACTION = 0.85  # sum of T/r over the weight that no soil gives (tangent of 40 degrees)
UNIT_TRACTION = 15.0  # the same, above which the torque is in N mm
LEAST_TRACTION = 4e-3  # the same, that no ground or drive costs less than
SOFT_TRACTION = 0.25  # level traction above which the soil itself changes what a slope costs
LEAST_SLOPE_STD = 0.25  # scatter of the specific force along the drive that a scale needs [m/s^2]
UP_AND_DOWN = 0.3
"""The same of uphill and of downhill stretches: one way alone the soil may resist more the steeper
the slope [m/s^2]."""
GAIN_MODEL_STD = 0.05  # by resistance that is larger uphill (firm drives of the simulator)
SLOPE_TIME = 2.0  # forces are averaged over this for the slope that shows a sign [s]
SMOOTH_ROWS = 20  # rows over which slopes are averaged
RUTS = 0.3  # half of the difference of resistance one way and back over its mean, one deviation [-]
RUT_TILT = 0.5
"""Tilt of a digging body, nose up, over the square of the level traction, one deviation [rad]: ruts
cost 0.6 sqrt(z/D) of the load (Bekker 1969), depths differ by a third of z over 3.5 radii."""
LEAST_GAIN_ERROR = 0.15
GAIN_SIGMAS = 4.0
ZERO_FACTOR = 6.0
ZERO_SIGMAS = 5.0
SIGN_ROUNDS = 4  # fits of torques without a sign, each with the signs by the one before
LEVEL_SHARE = 1.0 / 3.0  # of the driving, with the least slopes, that shows the resistance [-]
PITCHED = ', or the IMU is pitched: drive a level circle'
ALIKE_ZEROS = 0.6  # scatter of zeros over their mean within which they are one [-]


def check_torque(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    """Return faults of the torques."""
    known = np.isfinite(evidence.torque).any(axis=0)
    if not known.any():
        return _not_checked('no_torque'), evidence
    blank = replace(evidence, torque=np.full_like(evidence.torque, np.nan))
    if not np.nan_to_num(evidence.torque).any():
        return [evidence.found('torque_placeholder', 0.99)], blank
    unsigned = [] if evidence.force is None else _unsigned(evidence)
    if unsigned:
        return [*unsigned, *_not_checked('no_sign')], blank
    outcomes, evidence = _signs(evidence)
    if not evidence.facts.known or evidence.force is None:
        return outcomes, evidence
    if not known.all():
        return [*outcomes, *_not_checked('not_all')], evidence
    zeros = torque_zeros(evidence)
    without = evidence
    if zeros is not None:  # a zero looks like a resistance that no soil has, not the other way
        offsets = np.array([zero.value for zero in zeros])
        without = replace(evidence, torque=evidence.torque - offsets)
    scale, without = _scale(without)
    outcomes += scale
    if any(isinstance(o, Finding) for o in scale):
        return outcomes, without
    wrong = _zeros(evidence, zeros)
    if any(isinstance(o, Finding) for o in wrong):
        evidence = without
    return [*outcomes, *_gain(evidence), *wrong], evidence


def _not_checked(why: str, **figures: float) -> list[Outcome]:
    return [not_checked(kind, why, **figures) for kind in ('gain', 'mass')]


def _signs(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    """Return torques of the wrong sign: by what slopes, starts and stops change in them.

    The mean alone is not enough: a wheel with a slightly smaller radius is dragged by the others.
    """
    facts, by_wheel = evidence.facts, responses(evidence)
    if by_wheel is None or _fight(evidence, by_wheel):
        return [not_checked('sign', 'torque_no_change')], evidence
    changes = np.array([response.value for response, _ in by_wheel])
    usual = float(np.median(np.abs(changes)))
    brakes = np.array([-level.value > SIGN_SIGMAS * level.std for _, level in by_wheel])
    agree = all(response.value * level.value > 0.0 for response, level in by_wheel)
    wrong, unsure = [], []
    for i, (response, level) in enumerate(by_wheel):
        # In a turn one side pushes against the other, all its wheels alike.
        beside = np.delete(changes, i)[np.delete(facts.side, i) == facts.side[i]]
        odd = beside.size and response.value * np.median(beside) < 0.0
        clear = response.sigmas_from(0.0) > SIGN_SIGMAS and (odd or brakes[i])
        clear |= brakes[i] and agree
        if response.value < -LEAST_RESPONSE * usual and clear and level.value < 0.0:
            wrong.append(i)
        elif brakes[i]:
            unsure.append(facts.names[i])
    if 2 * brakes.sum() >= brakes.size and all(level.value < 0.0 for _, level in by_wheel):
        wrong, unsure = list(range(brakes.size)), []  # no rover goes on by brakes alone
    why = not_checked('sign', 'torque_unsure', wheels=', '.join(unsure))
    outcomes: list[Outcome] = [why] if unsure else []
    if not wrong:
        return outcomes, evidence
    torque = evidence.torque.copy()
    torque[:, wrong] *= -1.0
    sure = confidence(min(max(one.sigmas_from(0.0) for one in by_wheel[i]) for i in wrong))
    names = ', '.join(facts.names[i] for i in wrong)
    outcomes.append(evidence.found('torque_sign', sure, wheel=names, value=-1.0))
    return outcomes, replace(evidence, torque=torque)


def _fight(evidence: Evidence, measured: list[tuple[Estimate, Estimate]]) -> bool:
    """Return whether wheels may fight one another: torques of both signs nearly cancel.

    On firm ground they do so from the start on: without slopes the signs are then unknown. Those
    of wheels that are reversed are as large as the others.
    """
    facts, levels = evidence.facts, np.array([level.value for _, level in measured])
    rows, sizes = evidence.steady & evidence.unturned, np.abs(levels)
    alike = sizes.min() > ALIKE_LEVELS * sizes.max()
    if alike or not (facts.known and rows.any() and levels.min() < 0.0 < levels.max()):
        return False
    assert evidence.force is not None
    pushed, along = thrust(evidence) * np.sign(evidence.common_rate), evidence.force[:, 0]
    pushed, along = (moving_mean(values, SMOOTH_ROWS)[rows] for values in (pushed, along))
    firm = abs(np.quantile(pushed, 0.25)) < LEAST_LOOSE * facts.mass * facts.gravity
    return bool(firm and np.std(along) < LEAST_SLOPE_STD)


def responses(evidence: Evidence) -> list[tuple[Estimate, Estimate]] | None:
    """Return the response of each torque to the force along the drive, and its level; or None.

    Starts and stops of the wheels show the forward direction of the IMU, else the mean torque does.
    """
    rows, sense = evidence.unturned, np.sign(evidence.common_rate)
    if evidence.force is None or not evidence.enough(rows):
        return None
    yaw = mounting_yaw(evidence)
    width = evidence.rows_in(SETTLING)
    along = moving_mean(evidence.force[:, 0], width)
    design = np.column_stack([along, sense, np.ones(sense.size)])[rows]
    size = np.nan_to_num(np.abs(evidence.rate), nan=evidence.working_rate)
    turns = [moving_mean(one, width) > evidence.rest_rate for one in size.T]
    own = np.where(np.column_stack(turns), evidence.torque, 0.0)  # one that stands takes no power
    table = np.column_stack([moving_mean(np.nan_to_num(t), width) for t in own.T])
    measured = [
        fit[0] for fit in _fits_allowing_for_curve(design, evidence.curve[rows], table[rows])
    ]
    rows = rows & (along * sense > UPHILL_ENOUGH * evidence.facts.gravity)
    if not evidence.enough(rows):
        return None
    way = np.column_stack([sense, np.ones(sense.size)])[rows]
    levels = [fit[0] for fit in _fits_allowing_for_curve(way, evidence.curve[rows], table[rows])]
    if yaw is not None:
        return list(zip(measured, levels, strict=True))
    shares = [one.value * level.value for one, level in zip(measured, levels, strict=True)]
    if sum(shares) * np.median(shares) <= 0.0:
        return None
    forward = math.copysign(1.0, sum(shares))
    measured = [Estimate(forward * response.value, response.std) for response in measured]
    return list(zip(measured, levels, strict=True))


def _fits_allowing_for_curve(
    design: FloatArray, curve: FloatArray, torques: FloatArray
) -> list[list[Estimate]]:
    """Return fits to torques (k, n), whose deviations hold what a slight curve may have made.

    In a curve the sides drive one another, and it may tighten as a slope does.
    """
    plain, beside = (block_fits(d, torques) for d in (design, np.column_stack([design, curve])))
    return [
        [
            Estimate(a.value, math.hypot(a.std, a.value - b.value))
            for a, b in zip(*fits, strict=False)
        ]
        for fits in zip(plain, beside, strict=True)
    ]


def thrust(evidence: Evidence) -> FloatArray:
    """Return the sum of T/r (k,) [N]."""
    return np.asarray(np.nansum(evidence.torque / evidence.facts.radius, axis=1))


def _scale(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    """Check the level of the torques: units and currents."""
    facts, rows = evidence.facts, evidence.straight
    assert evidence.force is not None
    if rows.sum() < LEAST_MOVING_ROWS:
        return [not_checked('gain', 'no_straight')], evidence
    level = (thrust(evidence) - facts.mass * evidence.force[:, 0]) * np.sign(evidence.rim)
    traction = _middle_mean(level[rows]) / (facts.mass * facts.gravity)
    evidence.figures['torque.level_traction'] = round(traction, 4)
    if traction > UNIT_TRACTION:
        finding = evidence.found('torque_unit', 0.97, value=1e-3, traction=traction)
        return [finding], replace(evidence, torque=evidence.torque * 1e-3)
    if not evidence.enough(rows):
        return [not_checked('gain', 'no_straight')], evidence
    size = _middle_mean(np.abs(thrust(evidence)[rows])) / (facts.mass * facts.gravity)
    if traction < LEAST_TRACTION < size:
        return _not_checked('unlike_slopes'), evidence
    open_to = 1.0 + 3.0 * float(facts.sensors.torque_gain_std)
    if size >= LEAST_TRACTION and traction <= MOST_TRACTION * open_to:
        return [], evidence
    seen = traction if size >= LEAST_TRACTION else size
    finding = evidence.found('torque_scale', 0.8, traction=seen)
    return [finding, not_checked('mass', 'no_scale')], evidence


def _middle_mean(values: FloatArray) -> float:
    """Return the mean without the outermost tenths: a median of coarse steps is one of them."""
    low, high = np.quantile(values, (0.1, 0.9))
    return float(np.mean(np.clip(values, low, high)))


class Slopes(NamedTuple):
    """Thrust over mass times specific force: torque gain times true over stated mass; its trial.

    ``scatter`` is that of the specific force along the drive [m/s^2].
    """

    gain: Estimate
    trial: Trial
    scatter: float


def slope_fit(evidence: Evidence) -> Slopes | NotChecked:
    """Return the scale of the torques by slopes, and its trial on halves, or why not."""
    rows = evidence.straight
    if evidence.force is None or not evidence.enough(rows, 3.0):
        return not_checked('gain', 'few_straights')
    # Noise of a regressor makes a slope look flat: both sides are means over the same time.
    along = moving_mean(evidence.force[:, 0], SMOOTH_ROWS)[rows]
    pushed = moving_mean(thrust(evidence), SMOOTH_ROWS)[rows]
    sense = np.sign(evidence.rim[rows])
    down, up = np.quantile(along * sense, (0.05, 0.95))
    scatter = float(np.std(along))
    if scatter < LEAST_SLOPE_STD or max(down, -up) > -UP_AND_DOWN:
        steepest = max(up, -down)
        if steepest <= UP_AND_DOWN:
            return not_checked('gain', 'no_slopes')
        return not_checked('gain', 'one_way', by=math.degrees(steepest / evidence.facts.gravity))
    columns = [evidence.facts.mass * along, sense]
    if (sense > 0).any() and (sense < 0).any():
        columns.append(np.ones(along.size))
    design = np.column_stack(columns)
    trial = tried(
        lambda part: block_fit(design[part], pushed[part])[0].value,
        1.0,
        (along - along.mean()) ** 2,
    )
    return Slopes(block_fit(design, pushed)[0], trial, scatter)


def whole_zeros(evidence: Evidence, left: list[Estimate]) -> list[Estimate]:
    """Return the zeros [N m] of which ``left`` remains behind those stated."""
    errors = evidence.facts.errors.torque
    return [
        Estimate(float(zero + gain * one.value), float(gain) * one.std)
        for one, zero, gain in zip(left, errors.zero, errors.gain, strict=True)
    ]


def torque_gain(evidence: Evidence) -> Slopes | NotChecked:
    """Return the scale of the torques against mass times specific force, model error included."""
    fit = slope_fit(evidence)
    if isinstance(fit, NotChecked):
        return fit
    if fit.gain.value <= 0.0:
        return not_checked('gain', 'unlike_slopes')
    traction = evidence.figures.get('torque.level_traction', 1.0)
    traction = max(traction, traction / fit.gain.value)  # with this scale as well
    if traction > SOFT_TRACTION:
        return not_checked('gain', 'soft', traction=traction)
    if abs(fit.gain.value - 1.0) > LEAST_GAIN_ERROR and not fit.trial.falls:
        return not_checked('gain', 'halves')
    misfit = min(0.5 * fit.trial.after, 1.0)
    # A body that digs in reads uphill where thrust rises: slopes seem to cost less, never more.
    tilt = RUT_TILT * traction**2 * evidence.facts.gravity / fit.scatter
    std = math.hypot(fit.gain.std, GAIN_MODEL_STD, misfit, tilt if fit.gain.value < 1.0 else 0.0)
    return fit._replace(gain=Estimate(fit.gain.value, std))


def _gain(evidence: Evidence) -> list[Outcome]:
    facts, fit = evidence.facts, torque_gain(evidence)
    if isinstance(fit, NotChecked):
        return [fit, replace(fit, kind='mass')]
    gain, std = fit.gain
    evidence.figures['torque.gain'] = round(gain, 4)
    evidence.figures['torque.gain_std'] = round(std, 4)
    if abs(gain - 1.0) < LEAST_GAIN_ERROR:
        return []
    open_yet = facts.sensors.torque_gain_std  # by the rover file
    sigmas = Estimate(gain, math.hypot(std, open_yet)).sigmas_from(1.0)
    if sigmas < GAIN_SIGMAS:
        return _not_checked('left_open', gain=gain, std=std)
    whole = gain * facts.errors.torque.gain
    middle, mass = float(np.mean(whole)), facts.mass * gain
    words = {'gain': gain, 'off': std, 'mass': mass, 'gains': listed(whole, '.3f')}
    words['trial'] = fit.trial.words('gain left', '')
    return [
        evidence.found(
            key, 0.5 * confidence(sigmas), value=value, std=round(value * std / gain, 4), **words
        )
        for key, value in (('torque_gain', round(middle, 4)), ('mass', round(mass, 2)))
    ]


def torque_zeros(evidence: Evidence) -> list[Estimate] | None:
    """Return the zero of each torque from driving both ways on a straight; None without both.

    Ground that resists more one way than back, over the rover's own ruts, looks like a zero.
    """
    fits = both_ways(evidence)
    if fits is None:
        return None
    resists = RUTS * float(np.mean([abs(back.value) for _, back in fits]))
    return [Estimate(zero.value, math.hypot(zero.std, resists)) for zero, _ in fits]


def like_a_pitch(evidence: Evidence, zeros: list[Estimate]) -> bool:
    """Return whether zeros are one in all torques, as by an IMU pitch that no circle showed."""
    known = evidence.figures.get('imu.tilt_std_deg', math.inf) < math.degrees(EVEN_GROUND_STD)
    seen = np.array([zero.value for zero in zeros]) / evidence.facts.radius
    return not known and float(np.ptp(seen)) < ALIKE_ZEROS * abs(float(np.mean(seen)))


class _Ways(NamedTuple):
    """Straight driving both ways (k,): sense, loads by slopes and torques (k, n) [N m], design."""

    sense: FloatArray
    load: FloatArray
    torque: FloatArray
    design: FloatArray
    curve: FloatArray

    def left(self, signed: bool) -> float:
        """Return what zeros, resistance and slopes leave of the torques [N^2 m^2].

        Of those without a sign each has that of the torque that is due: a rover may brake.
        """
        size = np.abs(self.load[:, 0])
        level = np.median(np.abs(self.torque)[size <= np.quantile(size, LEVEL_SHARE)], axis=0)
        sign = 1.0 if signed else np.sign(self.load + self.sense[:, None] * level)
        for _ in range(1 if signed else SIGN_ROUNDS):
            table = self.torque * sign - self.load
            fitted = self.design @ np.linalg.lstsq(self.design, table, rcond=None)[0]
            left = float(np.mean((table - fitted) ** 2))
            sign = np.sign(fitted + self.load)
        return left


@once
def _ways(evidence: Evidence) -> _Ways | None:
    """Return the straight driving; None unless both ways."""
    assert evidence.force is not None
    smooth = moving_mean(evidence.common_rate, evidence.rows_in(SETTLING))
    rows = evidence.straight & (np.abs(smooth) > 0.5 * evidence.working_rate)
    sense = np.sign(smooth[rows])
    if min((sense > 0).sum(), (sense < 0).sum()) < 2 * LEAST_MOVING_ROWS:
        return None
    width, facts = evidence.rows_in(SLOPE_TIME), evidence.facts  # without vibration
    motion = [*evidence.force[:, :2].T, evidence.curve]
    calm = np.column_stack([moving_mean(column, width) for column in motion])[rows]
    slopes, curve = calm[:, :2], calm[:, 2]
    load = np.nan_to_num(facts.mass * slopes[:, :1] * facts.radius / len(facts.names))
    # Residual of slopes along both axes: the IMU may be turned about z.
    slopes = slopes[:, np.std(slopes, axis=0) >= LEAST_SLOPE_STD]
    design = np.column_stack([np.ones(sense.size), sense, slopes])
    return _Ways(sense, load, np.nan_to_num(evidence.torque[rows]), design, curve)


@once
def both_ways(evidence: Evidence) -> list[tuple[Estimate, Estimate]] | None:
    """Return zero and resistance of each torque on a straight; None unless driven both ways."""
    ways = _ways(evidence)
    if ways is None:
        return None
    fits = _fits_allowing_for_curve(ways.design, ways.curve, ways.torque - ways.load)
    return [(fit[0], fit[1]) for fit in fits]


def _unsigned(evidence: Evidence) -> list[Outcome]:
    """Return torques that are never negative although all wheels drive both ways.

    Where a rover backs down a slope they are positive: it brakes. Zeros that are larger than the
    torques make them positive as well: on slopes these then change alike both ways.
    """
    lowest = np.nanquantile(evidence.torque[evidence.moving], 0.02, axis=0)
    ways = _ways(evidence)
    if not (lowest >= 0.0).all() or ways is None:
        return []
    zero, unsigned = (ways.left(signed) for signed in (True, False))
    if unsigned < LEAST_MARGIN * zero:
        return [evidence.found('torque_unsigned', 0.9)]
    assert evidence.force is not None
    uphill = evidence.force[:, 0] * np.sign(evidence.rim) > UPHILL_ENOUGH * evidence.facts.gravity
    drives_back = (evidence.moving & uphill & (evidence.rim < 0.0)).sum() >= LEAST_MOVING_ROWS
    either = drives_back and LEAST_MARGIN * unsigned <= zero
    return [evidence.found('torque_unsigned', 0.5)] if either else []


def _zeros(evidence: Evidence, zeros: list[Estimate] | None) -> list[Outcome]:
    """Return zeros that are off."""
    if zeros is None:
        return [not_checked('zero', 'torque_one_way')]
    facts = evidence.facts
    stated = max(float(facts.sensors.torque_zero_std), 1e-3)
    driving = float(np.nanmedian(np.abs(evidence.torque[evidence.moving])))
    least = max(ZERO_FACTOR * stated, 0.5 * driving)
    wrong = [i for i, z in enumerate(zeros) if abs(z.value) > max(least, ZERO_SIGMAS * z.std)]
    if not wrong:
        return []
    whole = whole_zeros(evidence, zeros)
    pitch = like_a_pitch(evidence, zeros)  # a slope that is none is in all of them
    sure = confidence(min(zeros[i].sigmas_from(0.0) for i in wrong)) * (0.5 if pitch else 1.0)
    details: dict[str, Any] = {'alternative': PITCHED * pitch}
    details['left'] = listed((zeros[i].value for i in wrong), '.2f')
    details['zeros'] = listed((zero.value for zero in whole), '.2f')
    details['wheel'] = ', '.join(facts.names[i] for i in wrong)
    value, std = (round(number, 3) for number in whole[wrong[0]])
    return [evidence.found('torque_zero', sure, value=value, std=std, **details)]
