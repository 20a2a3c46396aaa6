# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Drive torques: sign, unit, scale and zero, against weight, slope and each other."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.checks.evidence import LEAST_MOVING_ROWS, Evidence, row_medians
from wheel_terra_estimator.checks.faults import found, listed
from wheel_terra_estimator.checks.finding import Finding, NotChecked, Outcome
from wheel_terra_estimator.checks.statistics import (
    Estimate,
    block_fit,
    confidence,
    correlation,
    moving_mean,
)
from wheel_terra_estimator.checks.trial import Trial, tried
from wheel_terra_estimator.estimation.sensor_errors import SensorErrors

FloatArray = NDArray[np.float64]

UPHILL_ENOUGH = -0.02
"""Specific force along the drive, in g, above which a driven wheel takes power."""
ALIKE = 0.3
"""Correlation of the changes of two torques that have the same sign [-]."""
WRONG_SIGN = -0.4
"""Correlation of torque and rate below which the sign is wrong."""
MOST_TRACTION = 0.85
"""Sum of T/r over the weight that no soil gives on the level (tangent of 40 degrees)."""
UNIT_TRACTION = 30.0
"""The same, above which the torque is in N mm."""
LEAST_TRACTION = 1e-3
SOFT_TRACTION = 0.25
"""Level traction above which the soil itself changes what a slope costs."""
LEAST_SLOPE_STD = 0.25
"""Scatter of the specific force along the drive that a scale needs [m/s^2]."""
GAIN_MODEL_STD = 0.05
"""What rolling resistance, larger uphill, adds to the scale (firm drives of the simulator)."""
SMOOTH_ROWS = 20
"""Rows over which slopes are averaged."""
AXES_APART = math.radians(20.0)
"""No heading by the torques is told where the slopes vary along another axis than it [rad]."""
LEAST_BACK_ROWS = 10
"""Rows of wheels turning back in the air that tell zero and friction apart."""
LEAST_GAIN_ERROR = 0.15
ZERO_FACTOR = 6.0


def check_torque(evidence: Evidence, figures: dict[str, Any]) -> tuple[list[Outcome], Evidence]:
    """Return what is wrong with the torques."""
    facts, joints = evidence.facts, evidence.recording.joints
    assert joints is not None
    kinds = ('gain', 'mass')
    if not np.isfinite(evidence.torque).any():
        return [NotChecked(kind, 'no torque in it (effort is empty or nan)') for kind in kinds], (
            evidence
        )
    if not np.nan_to_num(evidence.torque).any():
        blank = evidence.with_rate(evidence.rate, np.full_like(evidence.torque, np.nan))
        return [found('torque_placeholder', joints.topic, 0.99)], blank
    outcomes, evidence = _signs(evidence)
    if not facts.known or evidence.force is None:
        return outcomes, evidence
    if not np.isfinite(evidence.torque).any(axis=0).all():
        reason = 'a wheel without torque: the sum is not known'
        return [*outcomes, *(NotChecked(kind, reason) for kind in kinds)], evidence
    zeros = torque_zeros(evidence)
    without = evidence
    if zeros is not None:  # a zero looks like a resistance that no soil has, not the other way
        table = evidence.torque - np.array([zero.value for zero in zeros])
        without = evidence.with_rate(evidence.rate, table)
    scale, without = _scale(without, figures)
    if any(isinstance(o, Finding) for o in scale):
        return [*outcomes, *scale], without
    outcomes += scale
    wrong = _zeros(evidence, zeros, figures)
    if any(isinstance(o, Finding) for o in wrong) and zeros is not None:
        evidence = without
    return [*outcomes, *_gain(evidence, figures), *wrong], evidence


def _signs(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    joints, facts = evidence.recording.joints, evidence.facts
    assert joints is not None
    rows = evidence.moving.copy()
    if evidence.force is not None:
        along = evidence.force[:, 0] * np.sign(evidence.common_rate) / facts.gravity
        rows &= along > UPHILL_ENOUGH
    if rows.sum() < LEAST_MOVING_ROWS:
        return [NotChecked('sign', 'torque: no stretch on the level or uphill')], evidence
    driven, rates = evidence.torque[rows], evidence.rate[rows]
    fits = [_sign_fit(driven, rates[:, i], i) for i in range(len(facts.names))]
    wrong = [(i, fit) for i, (fit, _) in enumerate(fits) if fit < WRONG_SIGN]
    if len(wrong) < len(fits):  # one way only: what goes with the other wheels is a zero
        wrong = [(i, fit) for i, fit in wrong if not fits[i][1] > ALIKE]
    torque = evidence.torque.copy()
    torque[:, [i for i, _ in wrong]] *= -1.0
    if not wrong:
        return [], evidence
    sure = confidence(4.0 * min(abs(fit) for _, fit in wrong))
    names = ', '.join(facts.names[i] for i, _ in wrong)
    finding = found('torque_sign', joints.topic, sure, wheel=names, value=-1.0)
    return [finding], evidence.with_rate(evidence.rate, torque)


def _sign_fit(torque: FloatArray, rate: FloatArray, index: int) -> tuple[float, float]:
    """Return the correlations of a torque with the rate, and with the torques of other wheels.

    A zero is taken off where both ways tell it; the second, of changes alone, is nan then.
    """
    own, others = torque[:, index], row_medians(np.delete(torque, index, axis=1))
    if min(int((rate > 0.0).sum()), int((rate < 0.0).sum())) > LEAST_MOVING_ROWS:
        middle = 0.5 * (np.nanmean(own[rate > 0.0]) + np.nanmean(own[rate < 0.0]))
        return correlation(own - middle, rate), math.nan
    return correlation(own, rate), correlation(own - np.nanmean(own), others - others.mean())


def thrust(evidence: Evidence) -> FloatArray:
    """Return the sum of T/r (k,) [N]."""
    return np.asarray(np.nansum(evidence.torque / evidence.facts.radius, axis=1))


def _scale(evidence: Evidence, figures: dict[str, Any]) -> tuple[list[Outcome], Evidence]:
    """Judge the level of the torques: units and currents."""
    facts, joints = evidence.facts, evidence.recording.joints
    assert joints is not None and evidence.force is not None
    rows = evidence.straight
    if rows.sum() < LEAST_MOVING_ROWS:
        reason = (
            'torque: no straight, steady stretch in it: wheels push against each other in turns'
        )
        return [NotChecked('gain', reason)], evidence
    weight = facts.mass * facts.gravity
    forward = np.sign(evidence.rim[rows])
    level = (thrust(evidence)[rows] - facts.mass * evidence.force[rows, 0]) * forward
    traction = float(np.median(level)) / weight
    figures['torque.level_traction'] = round(traction, 4)
    if traction > UNIT_TRACTION:
        outcome = found('torque_unit', joints.topic, 0.97, value=1e-3, traction=traction)
        return [outcome], evidence.with_rate(evidence.rate, evidence.torque * 1e-3)
    if traction > MOST_TRACTION or traction < LEAST_TRACTION:
        return [
            _off_scale(evidence, traction),
            NotChecked('mass', 'torques have no credible scale'),
        ], evidence
    return [], evidence


def _off_scale(evidence: Evidence, traction: float) -> Finding:
    joints = evidence.recording.joints
    assert joints is not None
    fit = _slope_fit(evidence)
    gain, value, std = '...', None, None
    if fit is not None and fit.value > 0.0:
        whole = whole_gain(evidence, fit.value)
        gain = ', '.join(f'{one:.3g}' for one in whole)
        value, std = float(np.mean(whole)), float(np.mean(whole)) * fit.std / fit.value
    figures: dict[str, Any] = {'value': value, 'std': std, 'traction': traction, 'gains': gain}
    return found('torque_scale', joints.topic, 0.8, **figures)


def _slope_fit(evidence: Evidence) -> Estimate | None:
    """Return thrust over mass times specific force: torque gain times true over stated mass."""
    fitted = _slope_rows(evidence)
    return None if fitted is None else block_fit(*fitted)[0]


def _slope_rows(evidence: Evidence) -> tuple[FloatArray, FloatArray] | None:
    """Return columns of a fit of the thrust [N], and the thrust; None without slopes."""
    assert evidence.force is not None
    rows = evidence.straight
    if rows.sum() < 3 * LEAST_MOVING_ROWS:
        return None
    # Noise of a regressor makes a slope look flat: both sides are means over the same time.
    along = moving_mean(evidence.force[:, 0], SMOOTH_ROWS)[rows]
    pushed = moving_mean(thrust(evidence), SMOOTH_ROWS)[rows]
    if float(np.std(along)) < LEAST_SLOPE_STD:
        return None
    sense = np.sign(evidence.rim[rows])
    columns = [evidence.facts.mass * along, sense]
    if (sense > 0).any() and (sense < 0).any():
        columns.append(np.ones(along.size))
    return np.column_stack(columns), pushed


def _gain_trial(evidence: Evidence) -> Trial | None:
    """Try a scale of the torques, found on one half of the slopes, on the other."""
    fitted = _slope_rows(evidence)
    if fitted is None:
        return None
    design, pushed = fitted
    return tried(
        lambda rows: block_fit(design[rows], pushed[rows])[0].value,
        1.0,
        (design[:, 0] - design[:, 0].mean()) ** 2,
    )


def _smooth(values: FloatArray) -> FloatArray:
    width = min(SMOOTH_ROWS, values.size)
    return np.asarray(np.convolve(values, np.ones(width) / width, mode='valid'))


def whole_gain(evidence: Evidence, left: float) -> FloatArray:
    """Return the gains (n,) of which a factor ``left`` remains behind those stated."""
    configuration = evidence.facts.configuration
    stated = 1.0 if configuration is None else SensorErrors(configuration).torque.gain
    return np.full(len(evidence.facts.names), left) * stated


def whole_zeros(evidence: Evidence, left: list[Estimate]) -> list[Estimate]:
    """Return the zeros [N m] of which ``left`` remains behind those stated."""
    configuration = evidence.facts.configuration
    if configuration is None:
        return left
    errors = SensorErrors(configuration).torque
    return [
        Estimate(float(zero + gain * one.value), float(gain) * one.std)
        for one, zero, gain in zip(left, errors.zero, errors.gain, strict=True)
    ]


def torque_gain(evidence: Evidence, figures: dict[str, Any]) -> Estimate | NotChecked:
    """Return the scale of the torques against mass times specific force, model error included."""
    fit = _slope_fit(evidence)
    if fit is None:
        return NotChecked('gain', 'torque: no slopes in it; drive up and down 5 to 10 degrees')
    traction = figures.get('torque.level_traction', 1.0)
    if traction > SOFT_TRACTION:
        return NotChecked(
            'gain', f'torque: soft ground (it costs {traction:.2f} of the weight); drive on firm'
        )
    trial = _gain_trial(evidence)
    if abs(fit.value - 1.0) > LEAST_GAIN_ERROR and not (trial and trial.falls):
        return NotChecked(
            'gain',
            'torque: its scale by one half of the drive does not fit the slopes of the other',
        )
    return Estimate(fit.value, math.hypot(fit.std, GAIN_MODEL_STD))


def _gain(evidence: Evidence, figures: dict[str, Any]) -> list[Outcome]:
    joints, facts = evidence.recording.joints, evidence.facts
    assert joints is not None and facts.configuration is not None
    gain = torque_gain(evidence, figures)
    if isinstance(gain, NotChecked):
        return [gain, NotChecked('mass', gain.reason)]
    figures['torque.gain'] = round(gain.value, 4)
    figures['torque.gain_std'] = round(gain.std, 4)
    stated = facts.configuration.sensors.torque_gain_std
    sigmas = abs(gain.value - 1.0) / math.hypot(gain.std, stated)
    if abs(gain.value - 1.0) < LEAST_GAIN_ERROR or gain.value <= 0.0:
        return []
    if sigmas < 3.0:
        reason = f'torque: {gain.value:.2f} is within what the rover file leaves open ({stated:g})'
        return [NotChecked('gain', reason), NotChecked('mass', reason)]
    trial = _gain_trial(evidence)
    assert trial is not None
    whole = whole_gain(evidence, gain.value)
    middle = float(np.mean(whole))
    mass = facts.mass * gain.value
    sure = 0.5 * confidence(sigmas)
    told: dict[str, Any] = {
        'gain': gain.value,
        'off': gain.std,
        'mass': mass,
        'gains': listed(whole, '.3f'),
        'trial': trial.words('gain left', ''),
    }
    told_std = round(middle * gain.std / gain.value, 4)
    return [
        found(
            'torque_gain',
            joints.topic,
            sure,
            value=round(middle, 4),
            std=told_std,
            **told,
        ),
        found(
            'mass',
            joints.topic,
            sure,
            value=round(mass, 2),
            std=round(facts.mass * gain.std, 2),
            **told,
        ),
    ]


def torque_zeros(evidence: Evidence) -> list[Estimate] | None:
    """Return the zero of each torque from driving both ways on a straight; None without both."""
    assert evidence.force is not None
    rows = evidence.straight
    sense = np.sign(evidence.common_rate[rows])
    if min((sense > 0).sum(), (sense < 0).sum()) < 2 * LEAST_MOVING_ROWS:
        return None
    design = np.column_stack([np.ones(sense.size), sense, evidence.force[rows, 0]])
    if float(np.std(_smooth(evidence.force[rows, 0]))) < LEAST_SLOPE_STD:
        design = design[:, :2]
    return [
        block_fit(design, np.nan_to_num(evidence.torque[rows, i]))[0]
        for i in range(len(evidence.facts.names))
    ]


def drive_friction(evidence: Evidence) -> Estimate | NotChecked:
    """Return the torque that a wheel takes in the air, mean of the wheels [N m].

    On the ground rolling resistance looks the same.
    """
    rows = evidence.in_air
    if rows.sum() < LEAST_MOVING_ROWS:
        reason = 'drive friction: let the wheels turn in the air for ten seconds, both ways'
        return NotChecked('zero', reason)
    sense = np.sign(evidence.rate[rows])
    ways = (sense > 0).any(axis=1).sum(), (sense < 0).any(axis=1).sum()
    both = min(ways) > LEAST_BACK_ROWS
    wheels = []
    for i in range(len(evidence.facts.names)):
        design = np.column_stack([sense[:, i], np.ones(sense.shape[0])][: 2 if both else 1])
        wheels.append(block_fit(design, np.nan_to_num(evidence.torque[rows, i]))[0])
    mean = float(np.mean([wheel.value for wheel in wheels]))
    scatter = float(np.std([wheel.value for wheel in wheels])) / math.sqrt(len(wheels))
    zero = 0.0
    if not both and evidence.facts.configuration is not None:
        zero = float(evidence.facts.configuration.sensors.torque_zero_std)
    noise = max(wheel.std for wheel in wheels)
    return Estimate(mean, math.hypot(scatter, zero / math.sqrt(len(wheels)), noise))


def _zeros(
    evidence: Evidence, zeros: list[Estimate] | None, figures: dict[str, Any]
) -> list[Outcome]:
    joints, facts = evidence.recording.joints, evidence.facts
    assert joints is not None and facts.configuration is not None
    stated = max(float(facts.configuration.sensors.torque_zero_std), 1e-3)
    driving = float(np.nanmedian(np.abs(evidence.torque[evidence.moving])))
    rest = evidence.at_rest
    where = 'driving both ways'
    if zeros is None:
        if rest.sum() < LEAST_MOVING_ROWS:
            reason = 'torque: neither standstill nor both ways in it; stand still, drive back'
            return [NotChecked('zero', reason)]
        # Standing wheels are wound up against each other; only an odd one out is told.
        level = np.nanmedian(evidence.torque[rest], axis=0)
        middle = float(np.nanmedian(level))
        spread = 1.5 * float(np.nanmedian(np.abs(level - middle)))
        zeros = [Estimate(float(value - middle), max(spread, stated)) for value in level]
        where = 'standing'
    figures['torque.zero_N_m'] = [round(zero.value, 3) for zero in zeros]
    wrong = []
    for name, zero in zip(facts.names, zeros, strict=True):
        limit = max(ZERO_FACTOR * stated, 0.5 * driving, 5.0 * zero.std)
        if abs(zero.value) > limit:
            wrong.append((name, zero))
    whole = dict(zip(facts.names, whole_zeros(evidence, zeros), strict=True))
    if not wrong:
        return []
    first = whole[wrong[0][0]]
    level = figures.get('torque.level_traction', 0.0)
    doubt = level > SOFT_TRACTION  # with another scale every zero is another
    return [
        found(
            'torque_zero',
            joints.topic,
            confidence(min(zero.sigmas_from(0.0) for _, zero in wrong)) * (0.5 if doubt else 1.0),
            wheel=', '.join(name for name, _ in wrong),
            value=round(first.value, 3),
            std=round(first.std, 3),
            left=', '.join(f'{zero.value:.2f}' for _, zero in wrong),
            where=where,
            rival=', or the torques have another scale' if doubt else '',
            zeros=listed((zero.value for zero in whole.values()), '.2f'),
        )
    ]


def heading_of_torque(evidence: Evidence) -> Estimate | None:
    """Return the direction in the IMU's horizontal plane in which slopes cost torque [rad].

    Zero where the IMU's x axis points forward. None without slopes.
    """
    if evidence.force is None or not np.isfinite(evidence.torque).any():
        return None
    rows = evidence.straight
    if rows.sum() < 3 * LEAST_MOVING_ROWS:
        return None
    horizontal = evidence.force[rows, :2]
    if max(float(np.std(_smooth(column))) for column in horizontal.T) < LEAST_SLOPE_STD:
        return None
    sense = np.sign(evidence.rim[rows])
    along, across = block_fit(np.column_stack([horizontal, sense]), thrust(evidence)[rows])[:2]
    size = math.hypot(along.value, across.value)
    if size < 4.0 * max(along.std, across.std):
        return None
    if not 0.5 < size / evidence.facts.mass < 2.0:
        return None  # the soil's own resistance is at work, not the slope
    heading = Estimate(math.atan2(across.value, along.value), max(along.std, across.std) / size)
    apart = abs((heading.value - _axis_of(horizontal) + 0.5 * math.pi) % math.pi - 0.5 * math.pi)
    return heading if apart < AXES_APART else None


def _axis_of(horizontal: FloatArray) -> float:
    """Return the direction in which the slope (k, 2) varies most [rad], either way round."""
    along, across = (_smooth(column) for column in horizontal.T)
    (xx, xy), (_, yy) = np.cov(along, across)
    return 0.5 * math.atan2(2.0 * xy, xx - yy)
