# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Wheel rates: dead channels, units, noise, and the steps of a coarse encoder."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.checks import turning
from wheel_terra_estimator.checks.evidence import (
    LEAST_MOVING_ROWS,
    NO_NOISE,
    Evidence,
    Mask,
    noise_of,
    row_medians,
    since_the_row_before,
)
from wheel_terra_estimator.checks.finding import RATE_UNITS, Outcome, listed, not_checked
from wheel_terra_estimator.checks.reference import (
    LEAST_SLIP,
    NO_SCALE,
    speed_ratios,
    units_of_reference,
)
from wheel_terra_estimator.checks.series import rows_of
from wheel_terra_estimator.checks.statistics import (
    moving_mean,
    robust_std,
    runs,
    spike_height,
    step_of,
)

MOST_COUNT = 0.07  # speed over rim speed of counts (90 in a turn), at most [-]
UNIT_BAND = (0.7, 1.25)  # ratio of speeds over its unit's factor; slip makes it smaller [-]
LEAST_BAND, OUTRUN = 0.4, 1.05  # the same of units that may be counts [-]
TELLING = 0.15  # difference of two units' distances from a ratio that tells them apart [ln]
SAME_SCALE = 0.1  # of rates by speeds and by turns of a rover that rolls [-]
OF_RADII = (0.3, 1.4)  # speed over rim speed of a wrong radius [-]
LEAST_ROLLING_TRACK = 0.9  # effective over stated track of rates in rad/s, at least [-]
LARGE_WHEEL = 0.6  # radius of a wheel whose rim speed is too near to its rate [m]
FROZEN_TIME = 5.0  # a dead rate does not change for so long while others do [s]
NOISE_TIME = 1.0  # noise of a dead encoder is averaged over this [s]
NEXT_TO_NOTHING = 0.05  # its mean rate over that of the others, at most [-]
ENDS, LEAST_ENDS = 0.1, 3  # share of driving at a limit of the rates, and times it is reached
SELDOM_SAME = 0.05  # share of them that repeat the one before, of those that are not rounded [-]
FINE = 50  # different rates of one that is not coarse, at least
SAME_CHANGES = 0.95  # share of the changes of two rates that are the same of one sent twice [-]
LEAST_CHANGES = 30
SHORT_ZERO, MANY_ZEROS = 0.3, 10  # time of zeros between rates of driving [s], and their number
FEW_COUNTS = 0.1  # step of a rate over its usual size of which a zero may be rounded [-]
FEW_ZEROS = 3  # the same of a reference while the wheels show that the rover drives
LIVELY = 0.3  # rate of the others beside which none stands, over the working rate [-]
GOES_ON = 0.25  # turn times track over the speed of the other side of a rover that goes on [-]
SAME_SPEED = 0.05  # speed of a side against the middle in which all roll alike, at most [-]
ONE_SIGN = 0.9  # share of rates of one sign that have none, less the rest [-]
LEAST_ODD, MOST_ODD, ODD = 0.08, 0.35, 3.0  # speed over the others' of a radius; over scatter [ln]
LEAST_COUNTS = 0.2  # speed of a wheel with fewer counts over the others', at least [-]
WILD_FACTOR, WILD_SIGMAS = 1.5, 6.0  # wild change over the greatest and usual value [-]
LEAST_WILD, MOST_WILD = 3, 0.1  # messages with, and share of, single wild values that are reported
LONG_FROZEN_TIME = 10.0  # time that a coarse encoder does not repeat itself [s]
HELD_TORQUE = 1.5  # torque of a held wheel over that of the others, at least [-]
DRIVEN_TORQUE = 0.2  # the same in their sense, of one that is driven and not dragged [-]
NOISE_FACTOR = 5.0
LEAST_NOISE_SHARE = 0.08  # noise of a rate that matters, as a share of the working rate
COUNTING_STD = 1.0 / math.sqrt(6.0)  # of a rate from two counts, in counts
COUNTING_SHARE = 0.2  # of the scatter, from which the counts make it
COUNTING_BEND = math.sqrt(0.6 * math.pi / 2.0)
"""Noise of a rate from two counts, over the mean size of its bend: 2 in 20/6 variances [-]."""
STEP_FACTOR = 1.5  # noise by the steps over the one stated, above which it matters [-]
KEPT = 0.9  # share of repeated rates from which they are rounded, not counted [-]
LEAST_STEP_SHARE = 0.02  # noise by steps that matters, over the working rate [-]
FIELDS = {'rate': 'velocity', 'torque': 'effort'}  # of joint states

# Dead channels -----------------------------------------------------------------------------------


def check_limits(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    """Return rates that end at a number, again and again or of several wheels, and what is left."""
    rate, noisy = np.abs(evidence.rate), NO_NOISE * evidence.working_rate
    most = np.nanmax(rate, axis=0, initial=0.0)
    at = rate == most
    for index, ends in enumerate(at.T):
        below, free = rate[~ends, index], evidence.rate[~ends, index]
        often = len(runs(ends)) >= LEAST_ENDS or (most == most[index]).sum() > 1
        often &= bool(ends.sum() > ENDS * evidence.moving.sum())
        below = below[below > 0.0]  # that are not rounded
        fine = np.unique(below).size > FINE
        fine &= bool(np.mean(np.diff(below) == 0.0) < SELDOM_SAME)
        at[:, index] &= often and fine and noise_of(free) > noisy
    if not at.any():
        return [], evidence
    details = {'wheel': evidence.facts.named(at.any(axis=0)), 'most': float(np.nanmax(rate[at]))}
    details['long'] = float(at.any(axis=1).sum()) * evidence.period
    return [evidence.found('rate_limit', 0.95, **details)], evidence.rows(~at.any(axis=1))


def check_dead_wheels(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    """Return wheels whose rate is frozen; they are left out of what follows."""
    moving = evidence.moving
    if moving.sum() < LEAST_MOVING_ROWS or evidence.rate.shape[1] < 2:
        return [], evidence
    rate, dead = evidence.rate.copy(), dict[str, float]()
    for index, name in enumerate(evidence.facts.names):
        if longest := _stands(evidence, index):
            dead[name] = longest
            rate[:, index] = np.nan
    if not dead:
        return [], evidence
    how = f'does not follow the others for up to {max(dead.values()):.1f} s of driving'
    told = bool(np.isfinite(evidence.torque).any())  # else it may as well stand
    how += '' if told else ', or it stands: no torque tells'
    finding = evidence.found('rate_frozen', 0.97 if told else 0.5, wheel=', '.join(dead), how=how)
    return [finding], replace(evidence, rate=rate)


def _stands(evidence: Evidence, index: int) -> float:
    """Return how long a rate is 0, or its mean, while the others turn and no torque holds it."""
    own, others = evidence.rate[:, index], np.delete(evidence.rate, index, axis=1)
    side = evidence.facts.side == evidence.facts.side[index]
    between = evidence.facts.has_sides() and evidence.facts.side[index] == 0.0
    # Between the sides a wheel stands in a turn on the spot.
    usual = row_medians(others if between else np.abs(others))
    busy = np.abs(usual) > LIVELY * evidence.working_rate
    straight, zero = np.zeros(own.size, dtype=bool), own == 0.0
    if evidence.facts.has_sides() and not between:
        turned = np.abs(evidence.yaw) * float(np.ptp(evidence.facts.lateral))
        straight = turned < GOES_ON * row_medians(np.abs(evidence.speed[:, ~side]))
        along = others
        if side.sum() > 1:  # which the rover may turn about
            busy &= ~(evidence.rate[:, side] == 0.0).all(axis=1) | straight
            along = np.delete(evidence.rate, index, axis=1)[:, np.delete(side, index)]
        else:  # which alone it may turn about
            busy &= straight
        mean = np.abs(moving_mean(np.nan_to_num(own), evidence.rows_in(NOISE_TIME)))
        small = np.isfinite(own) & (mean < NEXT_TO_NOTHING * np.abs(row_medians(along)))
        zero |= small & (side.sum() > 1 or evidence.gyro is not None)
    longest = 0.0
    for start, end in runs(zero | ~busy):
        rows = np.flatnonzero(busy[start:end]) + start
        judged = rows[straight[rows]]  # in turns the sides push against each other
        needed = FROZEN_TIME if (own[rows] == 0.0).all() else LONG_FROZEN_TIME
        if rows.size * evidence.period > needed and not _held(
            evidence, index, judged if judged.size else rows
        ):
            longest = max(longest, rows.size * evidence.period)
    return longest


def _held(evidence: Evidence, index: int, rows: Any) -> bool:
    """Return whether the torque says that a wheel stands: stalled, or not driven.

    A torque of exactly 0 says nothing.
    """
    rate = np.delete(evidence.rate[rows], index, axis=1)
    drive = evidence.torque[rows] * np.sign(row_medians(rate))[:, None]
    own, others = drive[:, index], np.delete(drive, index, axis=1)
    if not np.isfinite(own).any() or not np.isfinite(others).any():
        return False
    typical = max(float(np.nanmedian(np.abs(others))), 1e-9)
    stalled = np.nanmedian(np.abs(own)) > HELD_TORQUE * typical
    driven = np.nanmedian(own) * np.sign(np.nanmedian(others)) > DRIVEN_TORQUE * typical
    return bool(stalled or (not driven and own.any()))


def check_zeros(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    """Return zeros between readings at speed, at which no wheel and no rover stands for an instant.

    Zeros of a reference may last for any time while the wheels drive.
    """
    outcomes, zero = list[Outcome](), evidence.rate == 0.0
    size = np.abs(evidence.rate)
    fast = size > LIVELY * np.nanquantile(size, 0.9, axis=0)
    interval = since_the_row_before(evidence.time)
    for column, rate, drives in zip(zero.T, evidence.rate.T, fast.T, strict=True):
        short = _sudden(column, drives, evidence.time, SHORT_ZERO + evidence.period)
        step = rate_step(rate, interval)  # of few counts one comes and goes
        fine = step < FEW_COUNTS * np.nanquantile(np.abs(rate), 0.9)
        column &= short & (len(runs(short)) >= MANY_ZEROS and fine)
    together = zero.all(axis=1)
    if (zero[~together].sum(axis=0) > together.sum()).sum() > 1:
        zero[:] = False  # each at its own time: no count came between two readings
    reference = evidence.recording.reference
    if reference is not None:
        size, at = np.linalg.norm(reference.velocity, axis=1), evidence.seconds(reference)
        drives = np.interp(at, evidence.time, evidence.moving) == 1.0
        lost = _sudden((size == 0.0) & drives, size > LIVELY * np.quantile(size, 0.9), at)
        if len(runs(lost)) >= FEW_ZEROS:
            outcomes.append(evidence.found('reference_zeros', 0.95, count=int(lost.sum())))
            evidence = evidence.with_reference(rows_of(reference, ~lost))
    if not zero.any():
        return outcomes, evidence
    wheels = zero.any(axis=0)
    details = {'wheel': evidence.facts.named(wheels), 'count': int(zero.any(axis=1).sum())}
    outcomes.append(evidence.found('rate_zeros', 0.95, **details))
    if wheels.all():
        return outcomes, evidence.rows(~zero.all(axis=1))
    return outcomes, replace(evidence, rate=np.where(zero, np.nan, evidence.rate))


def _sudden(zero: Mask, fast: Mask, time: FloatArray, longest: float = math.inf) -> Mask:
    """Return the zeros (k,) between two readings at speed, for no longer [s]."""
    sudden = np.zeros(zero.size, dtype=bool)
    for first, last in runs(zero):
        between = first > 0 and last < zero.size and fast[first - 1] and fast[last]
        sudden[first:last] = between and time[last] - time[first - 1] < longest
    return sudden


def check_copies(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    """Return wheels that read what another one does, and the evidence without these.

    All wheels of a side may hang on one encoder, if those of the other side do.
    """
    outcomes, mended, rim = list[Outcome](), dict[str, Any](), np.abs(evidence.rim)
    turns = np.abs(evidence.yaw) * np.ptp(evidence.facts.lateral) > GOES_ON * rim
    for name, field in FIELDS.items():
        table = getattr(evidence, name)
        change = np.abs(np.diff(table[evidence.moving], axis=0))  # whatever their signs
        moves = np.nan_to_num(change) != 0.0
        both = moves[:, :, None] | moves[:, None, :]
        alike = ((change[:, :, None] == change[:, None, :]) & both).sum(axis=0)
        alike *= evidence.facts.side[:, None] ** 2 + evidence.facts.side**2 > 0.0  # no tail axle
        same = (alike > np.maximum(SAME_CHANGES * both.sum(axis=0), LEAST_CHANGES)).sum(axis=1)
        fine = [_measured(one[np.isfinite(one)]) for one in table[evidence.moving].T]
        copies, there = (same > 1) & fine, np.isfinite(table).any(axis=0)
        alone = int((same == 1).sum())  # wheels that change as none other does
        every = copies.all() and (turns & evidence.moving).sum() > LEAST_CHANGES
        if copies.any() and (alone > (not there.all()) or (every and same.min() == same.size)):
            details = {'field': field, 'wheel': evidence.facts.named(copies)}
            outcomes.append(evidence.found('copied', 0.95, **details))
            mended[name] = np.where(copies, np.nan, table)
    return outcomes, replace(evidence, **mended) if mended else evidence


def _measured(values: FloatArray) -> bool:
    """Return whether values are not rounded and have noise, unlike those of a simulator."""
    if values.size < FINE or step_of(values):
        return False
    return noise_of(values) > NO_NOISE * float(np.quantile(np.abs(values), 0.9))


def check_wild(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    """Return single rates and torques that leave the ones before and after; left out from here."""
    outcomes, mended = list[Outcome](), dict[str, Any]()
    for name, field in FIELDS.items():
        table = getattr(evidence, name)
        size, off = np.abs(table[evidence.moving]), spike_height(table)
        usual = np.nanquantile(size, 1.0 - MOST_WILD, axis=0)
        noise = np.array([robust_std(column) for column in np.diff(table, axis=0).T])
        wild = off > np.fmax(WILD_FACTOR * usual, WILD_SIGMAS * noise)
        # To break away or turn back takes a large torque for an instant.
        counted = wild if name == 'rate' else wild & evidence.steady[:, None]
        if counted.any(axis=1).sum() >= LEAST_WILD and wild.sum() < MOST_WILD * wild.size:
            wheels = evidence.facts.named(wild.any(axis=0))
            details = {'field': field, 'count': int(wild.sum()), 'most': float(off[wild].max())}
            outcomes.append(evidence.found('wild', 0.97, wheel=wheels, **details))
            mended[name] = np.where(wild, np.nan, table)
    return outcomes, replace(evidence, **mended) if mended else evidence


def check_scales(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    """Return wheels without a sign, or faster or slower than all others all along, made alike."""
    facts, speed = evidence.facts, np.abs(evidence.speed)
    middle = row_medians(speed)
    rows = evidence.steady & (middle > 0.5 * evidence.working_rate * np.nanmean(evidence.radius))
    if evidence.gyro is not None:
        rows &= np.abs(evidence.yaw) * np.abs(facts.lateral).max() < SAME_SPEED * middle
    few = rows.sum() < 2 * LEAST_MOVING_ROWS or speed.shape[1] < 3
    if few or not facts.known:
        return [], evidence
    level = np.nanmedian(speed[rows], axis=0)
    times = level / np.nanmin(level)
    for unit, factor in RATE_UNITS.items():
        most = max(factor, 1.0 / factor)
        fast, slow = (np.abs(times - one) < SAME_SCALE * one for one in (most, 1.0))
        if fast.any() and (fast | slow | np.isnan(times)).all():
            wrong = fast if factor < 1.0 else slow
            details = {'value': factor, 'unit': unit, 'how': 'straight ahead, by the other wheels'}
            finding = evidence.found('rate_unit', 0.9, wheel=facts.named(wrong), **details)
            return [finding], replace(evidence, rate=evidence.rate * np.where(wrong, factor, 1.0))
    sense = np.where(speed > LIVELY * middle[:, None], np.sign(evidence.speed), 0.0)
    common, outcomes = np.sign(row_medians(sense)), list[Outcome]()
    ways = [rows & (common == way) for way in (1.0, -1.0)]
    unlike = [np.nanmean(sense[way], axis=0) for way in ways]
    unsigned = np.minimum(*np.abs(unlike)) * np.sign(unlike[0] * unlike[1]) > ONE_SIGN
    if unsigned.any() and min(way.sum() for way in ways) >= LEAST_MOVING_ROWS:
        wheels = facts.named(unsigned)
        outcomes.append(
            evidence.found('rates_unsigned', 0.95, wheel=wheels, other='other wheels go')
        )
        signed = np.abs(evidence.rate) * common[:, None]
        evidence = replace(evidence, rate=np.where(unsigned, signed, evidence.rate))
    ratio = speed[rows] / middle[rows, None]
    ratios = [np.nanmedian(part, axis=0) for part in (ratio, *np.array_split(ratio, 2))]
    whole, first, second = (np.log(np.maximum(part, 1e-3)) for part in ratios)
    rate, rolling = evidence.rate.copy(), facts.radius.copy()
    for i, name in enumerate(facts.names):
        apart = abs(first[i] - second[i])  # nan: it was not there in both halves
        beside = max(float(np.nanmax(np.abs(np.delete(whole, i)))), apart)
        small = abs(whole[i]) <= max(LEAST_ODD, ODD * beside) or whole[i] < math.log(LEAST_COUNTS)
        if small or not math.isfinite(apart):
            continue
        times = math.exp(whole[i])
        details = {'times': times, 'by': 1.0 / times}
        if abs(whole[i]) > MOST_ODD:  # no wheel is so much larger
            outcomes.append(evidence.found('wheel_counts', 0.95, wheel=name, **details))
            rate[:, i] /= times
            continue
        rolling[i] /= times
        radii = facts.configuration.wheels.radius + rolling - facts.radius  # lugs stay
        details |= {'value': round(float(radii[i]), 5), 'std': round(float(radii[i]) * beside, 5)}
        sure = 0.9 if beside < LEAST_ODD / ODD else 0.5  # what is written is right to 3 %
        finding = evidence.found('wheel_scale', sure, wheel=name, radii=listed(radii), **details)
        outcomes.append(finding)
    if not outcomes:
        return [], evidence
    return outcomes, replace(evidence, rate=rate, facts=replace(facts, radius=rolling))


# Units -------------------------------------------------------------------------------------------


def check_unit(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    """Return the unit of the rates where speeds or turns tell it is not rad/s."""
    facts = evidence.facts
    if not facts.known:
        return [not_checked('unit', 'no_radius')], evidence
    ratios, how = speed_ratios(evidence), 'speed of the reference'
    ratio = None if ratios is None else float(np.quantile(ratios, LEAST_SLIP))
    how += f', or is that of a motor before a gear of {1.0 / ratio:.3g}' if ratio else ''
    track = turning.track_ratio(evidence)
    if ratio is None and track is None:
        return [not_checked('unit', 'no_speed')], evidence
    turns = track is not None and abs(track) > LEAST_ROLLING_TRACK  # as rad/s do
    radius, known = float(np.nanmean(facts.radius)), dict(RATE_UNITS)
    if not turns and radius < LARGE_WHEEL:  # else too near to rad/s
        known['metres per second of the rim'] = 1.0 / radius
    units = _fitting_units(ratio, track, known)
    of_reference = {} if track is not None else units_of_reference(ratio or 0.0, UNIT_BAND)
    if units and of_reference:  # no turn tells which of both it is
        sure = 0.97 / (len(units) + len(of_reference))
        findings, evidence = _unit_findings(evidence, units, how, sure * len(units))
        findings += [evidence.found('reference_unit', sure, **one) for one in of_reference.values()]
        return findings, replace(evidence, rate=evidence.rate * math.nan)
    scaled = ratio is not None and ratio > MOST_COUNT and not OF_RADII[0] < ratio < OF_RADII[1]
    if ratio and track and scaled and not units and abs(ratio * track - 1.0) < SAME_SCALE:
        units, how = {f'rad/s before a gear of {track:.3g}': 1.0 / track}, 'speeds and turns'
    doubtful = False  # no unit with a usual slip, and perhaps counts
    if ratio is not None and ratio < MOST_COUNT and units:
        doubtful = not UNIT_BAND[0] < ratio / min(units.values()) < OUTRUN
    if units and not doubtful:
        return _unit_findings(evidence, units, how if ratio else 'turns seen by the gyro')
    if ratio is None or not 0.0 < ratio < MOST_COUNT:
        return [], evidence
    evidence.figures['wheels.rad_per_count'] = value = float(f'{ratio:.4g}')
    details = {'times': 1.0 / ratio, 'counts': 2.0 * math.pi / ratio, 'how': how}
    finding = evidence.found('rate_counts', 0.45 if units else 0.9, value=value, **details)
    perhaps, _ = _unit_findings(evidence, units, how, 0.45)
    return [*perhaps, finding], replace(evidence, rate=evidence.rate * ratio)


def _fitting_units(
    ratio: float | None, track: float | None, known: dict[str, float]
) -> dict[str, float]:
    """Return the units that a ratio of speeds and the track of the turns may come from."""
    usual = track is not None and turning.ordinary_track(track)
    units = {}
    for unit, factor in known.items():
        by_turn = track is not None and turning.ordinary_track(track * factor)
        fits = by_turn and not usual
        if ratio is not None:
            least = LEAST_BAND if ratio < MOST_COUNT else UNIT_BAND[0]
            both = fits and ratio / factor > NO_SCALE  # the reference is in another unit as well
            fits = least < ratio / factor < UNIT_BAND[1]
            fits = both or (fits and (track is None or by_turn or not usual))
        if fits:
            units[unit] = factor
    if ratio is None or not units:
        return units
    off = {unit: abs(math.log(ratio / factor)) for unit, factor in units.items()}
    return {unit: units[unit] for unit in units if off[unit] < min(off.values()) + TELLING}


def _unit_findings(
    evidence: Evidence, units: dict[str, float], how: str, sure: float = 0.97
) -> tuple[list[Outcome], Evidence]:
    """Return the units that rates may be in; rates stay unknown where there are several."""
    findings: list[Outcome] = [
        evidence.found('rate_unit', sure / len(units), value=factor, unit=unit, how=how)
        for unit, factor in units.items()
    ]
    factor = math.nan if len(units) != 1 else next(iter(units.values()))
    return findings, replace(evidence, rate=evidence.rate * factor)


# Noise -------------------------------------------------------------------------------------------


def check_noise(evidence: Evidence) -> list[Outcome]:
    """Compare the noise and the steps of the rates with what the rover file states."""
    facts, rows = evidence.facts, evidence.moving
    if not facts.known or rows.sum() < 60:
        return []
    stated = float(facts.sensors.wheel_rate_std)
    interval, noise, by_steps = since_the_row_before(evidence.time)[rows], [], []
    for rate in evidence.rate.T:
        bend = np.diff(rate, 2)[rows[1:-1]] / math.sqrt(6.0)
        bend = bend[np.isfinite(bend)]
        enough = bend.size > 50
        by_steps.append(rate_step(rate[rows], interval) * COUNTING_STD if enough else 0.0)
        noise.append(robust_std(bend) if enough else 0.0)
        if by_steps[-1] > COUNTING_SHARE * noise[-1]:
            noise[-1] = max(by_steps[-1], COUNTING_BEND * float(np.abs(bend).mean()))
    figures, working = evidence.figures, evidence.working_rate
    figures['wheels.rate_noise_rad_s'] = float(f'{np.median(noise):.3g}')
    if np.median(by_steps):
        figures['wheels.rate_step_rad_s'] = float(f'{np.median(by_steps) / COUNTING_STD:.3g}')
    coarse = np.array(by_steps) > max(STEP_FACTOR * stated, LEAST_STEP_SHARE * working)
    noisy = np.array(noise) > max(NOISE_FACTOR * stated, LEAST_NOISE_SHARE * working)
    # Nor does any rate count beside a noise that is stated as larger than the rates themselves.
    noisy |= min(noise) > 0.0 and stated > max(working, NOISE_FACTOR * max(noise))
    if not (coarse | noisy).any():
        return []
    key, wrong = ('rate_steps', coarse) if coarse.any() else ('rate_noise', noisy)
    seen = float(np.median(np.array(noise)[wrong]))
    step, period = float(np.median(np.array(by_steps)[wrong])) / COUNTING_STD, evidence.period
    details: dict[str, Any] = {'noise': seen, 'stated': stated, 'step': step, 'period': period}
    details |= {'share': 100.0 * step / max(working, 1e-9)}
    details |= {'counts': 2.0 * math.pi / max(step * period, 1e-9)}
    wheel = None if 2 * wrong.sum() > wrong.size else evidence.facts.named(wrong)
    return [evidence.found(key, 0.95, wheel=wheel, value=float(f'{seen:.2g}'), **details)]


def rounding(evidence: Evidence) -> float:
    """Return by how much the mean of the rates may be off, over the working rate [-].

    Counts of an encoder come and go, so that their mean is right; a rate that a driver rounds is
    the same all along.
    """
    rate, time = evidence.rate[evidence.moving], evidence.time[evidence.moving]
    change = np.diff(rate, axis=0)
    change = change[np.isfinite(change)]
    if evidence.working_rate <= 0.0 or not change.size or np.mean(change == 0.0) < KEPT:
        return 0.0
    step = np.median([rate_step(column, since_the_row_before(time)) for column in rate.T])
    return 0.5 * float(step) / evidence.working_rate


def rate_step(rate: FloatArray, interval: FloatArray) -> float:
    """Return the step of rates (k,) that are multiples of one number [rad/s]; 0 for none.

    Counts over unequal intervals (k,) [s] are multiples of an angle, not of a rate.
    """
    known = np.isfinite(rate) & (interval > 0.0)
    rate, interval = rate[known], interval[known]
    usual = float(np.median(interval)) if interval.size else 1.0
    for values in (rate, rate * interval / usual):
        step = step_of(values)
        if step:
            return step
    return 0.0
