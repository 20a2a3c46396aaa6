# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Signs and places of the wheels, by how they turn together with the gyro.

A rolling rover has ``r w_i = v - w_z y_i`` with a track that skidding makes wider. A hypothesis
says which wheels count backwards or go by each other's name; what it leaves unlike between the
wheels, and the share of the gyro's turns that the wheels then do not make, is its residual. It is
named if it is far better than nothing and than every other, on each half of the recording.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.arrays import BoolArray, FloatArray
from wheel_terra_estimator.checks.evidence import (
    LEAST_MOVING_ROWS,
    SLIDES_BACK,
    Evidence,
    accelerometer_signs,
    mounting_yaw,
    once,
    row_medians,
)
from wheel_terra_estimator.checks.finding import (
    LEAST_TURN_RATE,
    SKID_TRACKS,
    Finding,
    Outcome,
    listed,
    not_checked,
)
from wheel_terra_estimator.checks.reference import CLEAR_SPEED, as_fast_as_rims, in_another_frame
from wheel_terra_estimator.checks.rover_facts import RoverFacts, side_of
from wheel_terra_estimator.checks.series import ImuSeries
from wheel_terra_estimator.checks.statistics import (
    LEAST_FALL,
    Trial,
    bend_noise,
    block_fit,
    block_fits,
    confidence,
    correlation,
    halves,
    integrated,
    robust_std,
    worst,
)
from wheel_terra_estimator.checks.torque import Slopes, slope_fit

Mask = BoolArray

TRIAL_ROWS = 1000  # rows, spread over the drive, that hypotheses are compared on
MOST_STEERING = 3.3  # steering angle that no wheel has [rad]
AS_TURNED, STILL = 0.5, 0.3  # share of the turn that a wheel is steered by, or not [-]
LEAST_STEERING_ZERO = math.radians(5.0)  # beyond what wheels slip aside [rad]
LEAST_ACROSS = math.radians(1.0)  # error in turns of two joints that are exchanged [rad]
LEFT_CROSSED = 0.25  # the same with them exchanged back, over that without, at most [-]
LEAST_ASKED = 0.1  # speed aside in turns over that ahead, of a wheel that has to steer [-]
HOLDS_HEADING = 0.5  # range of headings of a rover that is to drive straight, at most [rad]
LEAST_HEADINGS = 1.0  # turn in a drive that is not all on one cross slope [rad]
MOST_WHEELS = 10  # wheels for which all combinations of signs are tried
LEAST_TURNING_ROWS = 40  # rows with a turn by the gyro that the wheels must account for
MOST_LEFT, MOST_LEFT_STEERED = 0.4, 0.2  # residual of a cure; of steered wheels, at most [-]
UNTURNED = 0.5  # weight of turns without an answer of the wheels [-]
SLIP_APART = 0.1  # track over the stated one of wheels that drift apart, no gyro in degrees/s [-]
GOING = 0.4  # speed by the reference over its usual one from which a rover goes on [-]
GOES_ALONG = 0.8  # share of the way that goes with the wheels, less the rest, of right ones [-]
UNDRIVEN = 0.5  # the same of a way by the reference that goes with the wheels, or against them [-]
CLEAR_DIRECTION = 0.8  # cosine of a felt yaw that tells the sense [-]
SAME_SENSE = 0.5  # share of the way by the reference with the wheels, less the rest [-]
SLIDE = ', or the rover slides back'
SOME = ', or some of them do: drive straight'
ALL_WHEELS = ', or all wheels read negative'
SPINS = ', or the rover spins on the spot and hardly turns: drive straight'
DEGREE, NEAR_DEGREES = math.radians(1.0), 0.15  # [rad]; error of a scale that few turns tell [-]
SAME_TURNS, LEAST_SCALE, SCALE_SIGMAS = 0.97, 0.05, 4.0  # correlation, error [-]
IN_DEGREES_BY_WHEELS = (14.3, 250.0)  # gyro over wheels, which skid, if in degrees/s [-]
HEADING_TIME = 3.0  # turns by orientation and gyro are compared over this [s]
LEAST_TURNED = 0.1  # turn in that time, which no rolling of a pitched body is [rad]
LEAST_TURNING = 10.0  # time of turning in which no wheels agree with a gyro by chance [s]
LEAST_CORRELATION = 0.7  # of gyro and wheels, for turns to tell the sides [-]
TIE = 1e-3  # residuals [-] that differ by less are the same
NOISE_FLOOR = 0.02  # residual [-] by which hypotheses must differ at least


@dataclass(frozen=True)
class Turning:
    """Rim speeds (k, m) [m/s] and yaw rate (k,) [rad/s] of a stretch, places of the wheels.

    ``lateral`` (m,) [m] is +1 and -1 where the places are not known, zeros where the sides are not.
    """

    speed: FloatArray
    yaw: FloatArray
    lateral: FloatArray
    unbiased: bool  # else a constant yaw rate may be the gyro's
    along: FloatArray  # (k, m) cosine of the steering angles; 1 where not steered
    ahead: FloatArray  # (k,) speed by the reference [m/s]; zeros without one

    def rows(self, part: slice | Mask) -> Turning:
        """Return a part of the stretch."""
        names = 'speed', 'yaw', 'along', 'ahead'
        return replace(self, **{name: getattr(self, name)[part] for name in names})

    @cached_property
    def turns(self) -> Mask:
        """Rows in which the gyro sees a turn."""
        size = np.abs(self.yaw)
        if not self.lateral.any():
            return np.zeros(size.shape, dtype=bool)
        noise = robust_std(np.diff(self.yaw)) / math.sqrt(2.0)
        level = max(4.0 * noise, 0.3 * float(np.quantile(size, 0.98)), LEAST_TURN_RATE)
        return np.asarray(size > level)


class Fix(NamedTuple):
    """A hypothesis: pairs of wheels that go by each other's name, then the sign of each."""

    signs: tuple[int, ...]
    exchanged: tuple[tuple[int, int], ...] = ()

    def order(self, count: int) -> list[int]:
        """Return the column that each of so many wheels has under the hypothesis."""
        order = list(range(count))
        for a, b in self.exchanged:
            order[a], order[b] = b, a
        return order


class Fit(NamedTuple):
    """Residual of a hypothesis [-]; effective track over the stated one, and how well it fits."""

    cost: float
    track: float
    correlation: float

    @property
    def clear_track(self) -> float:
        """The track where gyro and wheels see the same turns, else 0."""
        clear = abs(self.correlation) > LEAST_CORRELATION and self.cost < MOST_LEFT
        return self.track if clear else 0.0


def fits_of(fixes: Sequence[Fix], stretch: Turning) -> list[Fit]:
    """Return how well each of f hypotheses accounts for wheels and gyro."""
    yaw, lateral = stretch.yaw, stretch.lateral
    columns = np.array([fix.order(lateral.size) for fix in fixes])
    signs = np.array([fix.signs for fix in fixes], dtype=float)
    speed = stretch.speed.T[columns].transpose(0, 2, 1) * signs[:, None]  # (f, k, m)
    speed = speed * stretch.along
    track, alike, cost = np.zeros((3, len(fixes)))
    rolling = speed
    if stretch.turns.sum() >= LEAST_TURNING_ROWS:
        left, right = lateral > 0.0, lateral < 0.0
        stated = float(lateral[left].mean() - lateral[right].mean())
        apart = speed[:, :, right].mean(axis=2) - speed[:, :, left].mean(axis=2)
        turned, usual = yaw, np.zeros((len(fixes), 1))
        if not stretch.unbiased:  # the mean turn is that of the wheels
            turned, usual = yaw - yaw.mean(), apart.mean(axis=1, keepdims=True)
            apart = apart - usual
        both, energy = apart @ turned, float(turned @ turned)
        alike = both / np.maximum(np.sqrt(energy * (apart**2).sum(axis=1)), 1e-300)
        track = both / max(energy, 1e-12) / stated
        rims = track[:, None] * turned + usual / stated
        rolling = speed + rims[:, :, None] * lateral
        cost = UNTURNED * (1.0 - alike**2)
    middle = (lateral.size - 1) // 2, lateral.size // 2
    median = np.partition(rolling, middle, axis=2)[:, :, middle].mean(axis=2)
    spread = np.abs(rolling - median[:, :, None]).mean(axis=2)
    size = np.maximum(np.abs(speed).mean(axis=2), 1e-9)
    cost = cost + (spread / size).mean(axis=1)
    way = np.abs(stretch.ahead)
    with_rims = np.abs(np.sign(median) @ stretch.ahead) / max(float(way.sum()), 1e-12)
    cost = cost + UNDRIVEN * (1.0 - np.minimum(with_rims / GOES_ALONG, 1.0)) * way.any()
    return [Fit(*map(float, one)) for one in zip(cost, track, alike, strict=True)]


def compare(stretch: Turning, fixes: Sequence[Fix]) -> tuple[Fix, Fit, Trial]:
    """Return the best of hypotheses, its fit, and its trial on halves beside the best other one.

    The first is that nothing is wrong.
    """
    whole = fits_of(fixes, stretch)
    both = [stretch.rows(half) for half in halves(np.ones(stretch.yaw.size))]
    parts = [[fit.cost for fit in fits_of(fixes, half)] for half in both]
    least = min(fit.cost for fit in whole)
    alike = [i for i, fit in enumerate(whole) if fit.cost < least + TIE]
    # Of two that differ by swapped sides the one that agrees with the gyro is meant.
    best = max(alike, key=lambda i: (whole[i].track > 0.0, -i))
    tracks = [fit.track * whole[best].track for fit in whole]
    others = [i for i in range(1, len(fixes)) if i != best and tracks[i] >= 0.0]
    alternative = min(others, key=lambda i: whole[i].cost, default=None)
    trials = [
        Trial(
            part[0] - NOISE_FLOOR,
            part[best],
            np.inf if alternative is None else part[alternative] - NOISE_FLOOR,
        )
        for part in parts
    ]
    return fixes[best], whole[best], worst(trials)


def exchanges(stretch: Turning) -> list[Fix]:
    """Return nothing, and every left wheel exchanged with a right one; two wheels are the sides.

    Wheels that are steered otherwise turn faster: front and rear ones may be exchanged as well.
    """
    count = stretch.lateral.size
    left, right = (np.flatnonzero(s * stretch.lateral > 0.0).tolist() for s in (1.0, -1.0))
    pairings = [(pair,) for pair in itertools.product(left, right) if count > 2]
    if np.ptp(stretch.along, axis=1).max(initial=0.0) > 0.0:
        rows = [list(itertools.combinations(side, 2)) for side in (left, right)]
        pairings += [(pair,) for side in rows for pair in side] + list(zip(*rows, strict=False))
    return [Fix((1,) * count), *(Fix((1,) * count, tuple(pairs)) for pairs in pairings)]


# In a recording ----------------------------------------------------------------------------------


def stretch_of(evidence: Evidence, there: NDArray[np.intp], rows: Mask) -> Turning:
    """Return the turning of some wheels in some rows."""
    facts, keep = evidence.facts, np.flatnonzero(rows)
    if keep.size > TRIAL_ROWS:
        keep = keep[np.linspace(0, keep.size - 1, TRIAL_ROWS).astype(int)]
    lateral = (facts.lateral if facts.known else facts.side)[there]
    sides = (lateral > 0.0).any() and (lateral < 0.0).any()
    if evidence.gyro is None or not sides:
        lateral = np.zeros(there.size)
    speed = (evidence.rate * evidence.radius)[keep][:, there]
    along = np.cos(np.nan_to_num(evidence.steering[keep][:, there]))
    reference, ahead = evidence.recording.reference, np.zeros(keep.size)
    if reference is not None and not in_another_frame(evidence):
        forward = np.nan_to_num(reference.velocity[:, 0])
        ahead = np.interp(evidence.time[keep], evidence.seconds(reference), forward)
        least = max(GOING * np.quantile(np.abs(ahead), 0.9), CLEAR_SPEED * bend_noise(forward))
        ahead[np.abs(ahead) < least] = 0.0
    return Turning(speed, evidence.yaw[keep], lateral, evidence.rested, along, ahead)


def _known(evidence: Evidence) -> tuple[NDArray[np.intp], Mask]:
    """Return the wheels that are there, and the moving rows in which all of them are."""
    there = np.flatnonzero(np.isfinite(evidence.rate).any(axis=0))
    return there, evidence.moving & np.isfinite(evidence.rate[:, there]).all(axis=1)


class _Chosen(NamedTuple):
    """What the wheels say: signs (n,), track (0: no turns), exchanged wheels, trial, certainty."""

    signs: FloatArray
    track: float = 0.0
    exchanged: tuple[tuple[int, int], ...] = ()
    trial: str = ''
    sure: float = 0.99


def check_steering_unit(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    """Return steering angles in degrees, and the evidence with these in radians."""
    most = float(np.nanmax(np.abs(evidence.steering), initial=0.0))
    if most <= MOST_STEERING:
        return [], evidence
    finding = evidence.found('steering_degrees', 0.97, value=math.radians(1.0), most=most)
    return [finding], replace(evidence, steering=np.radians(evidence.steering))


def check_steering(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    """Return wheels that are not steered as the rover turns, and the evidence without them."""
    facts, track = evidence.facts, track_ratio(evidence)
    if not np.isfinite(evidence.steering).any():
        return [], evidence
    gain, zero, error = _steered_as_turned(evidence)
    still, order = np.abs(gain) < STILL, sides_exchanged(facts)
    ahead = np.nan_to_num(evidence.steering[evidence.unturned])
    # One angle that is published for two wheels is off in turns alone.
    stays = (np.median(ahead, axis=0) if ahead.size else 0.0) * zero > 0.5 * zero**2
    turned = bool((gain > AS_TURNED).any())
    wrong = stays & (np.abs(zero) > LEAST_STEERING_ZERO) & turned
    wrong |= still & ~still[order] & turned  # both of an axle may be held straight
    # Of joints that are exchanged the inner one turns too little, to either side.
    crossed = _steered_as_turned(replace(evidence, steering=evidence.steering[:, order])).error
    by_axle, exchanged = (one + one[order] for one in (error, crossed))
    wrong |= (by_axle > 2.0 * LEAST_ACROSS) & (exchanged < LEFT_CROSSED * by_axle)
    if track is not None and track > 0.0:
        wrong |= gain < -AS_TURNED
    if not wrong.any():
        return [not_checked('frozen', 'steering')] * bool(still.any() and not turned), evidence
    details = {'wheel': facts.named(wrong), 'share': listed(100.0 * gain[wrong], '.0f')}
    details['degrees'] = listed(np.degrees(zero[wrong]), '.0f')
    details = {key: text.replace('nan', '?') for key, text in details.items()}
    left = replace(evidence, steering=np.where(wrong, np.nan, evidence.steering))
    return [evidence.found('steering_angle', 0.9, **details)], left


class _Steered(NamedTuple):
    """Steering of each wheel beside the turns; nan where the angles or the drive tell none."""

    gain: FloatArray  # share of its turn by the gyro that it is steered by [-]
    zero: FloatArray  # [rad]
    error: FloatArray  # typical one in turns [rad]


def _steered_as_turned(evidence: Evidence) -> _Steered:
    """Compare the steering of each wheel with the turn by the gyro.

    Without slip a wheel moves aside with ``v_y + w_z x``, where a wheel that does not steer does
    not.
    """
    x, steering = evidence.facts.configuration.wheels.x, evidence.steering
    steered = np.isfinite(steering).any(axis=0)
    told = _Steered(*np.full((3, x.size), np.nan))
    rows, heading = evidence.moving, integrated(evidence.time, evidence.yaw)
    if evidence.turning.sum() < LEAST_TURNING_ROWS:
        return told
    # On one heading a slide down a cross slope looks like zeros of the angles.
    one_way = np.ptp(heading) < LEAST_HEADINGS
    speed = evidence.speed[rows]
    by_angle = speed * np.tan(np.nan_to_num(evidence.steering[rows]))
    others = ~steered if not steered.all() else steered
    yaws = (np.roll(evidence.yaw, by)[rows, None] for by in (0, 1))  # of another noise
    aside, beside = (
        np.nanmedian((by_angle * steered - yaw * x)[:, others], axis=1, keepdims=True) + yaw * x
        for yaw in yaws
    )
    for i in np.flatnonzero(steered & np.isfinite(evidence.rate).any(axis=0)):
        known = np.isfinite(aside[:, i]) & np.isfinite(beside[:, i]) & np.isfinite(speed[:, i])
        seen, ahead = by_angle[known, i], speed[known, i]
        design, other = (np.column_stack([one[known, i], ahead]) for one in (aside, beside))
        share, off = block_fit(design, seen, other)
        asked = np.quantile(np.abs(design[:, 0]), 0.9) > LEAST_ASKED * np.abs(ahead).mean()
        turns = evidence.turning[rows][known]
        off_aside = np.median(np.abs(seen - design[:, 0])[turns])
        told.error[i] = off_aside / np.median(np.abs(ahead)[turns])
        if asked and share.std < 0.5 * STILL:
            told.gain[i], told.zero[i] = share.value, 0.0 if one_way else math.atan(off.value)
    return told


def check_axes(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    """Return x and y in each other's place by the sides in the names, and the evidence mended."""
    facts, wheels = evidence.facts, evidence.facts.configuration.wheels
    if not facts.known:
        return [], evidence
    sides = np.array([side_of(name) for name in facts.names])
    if not (sides * wheels.x > 0.0).all() or (sides * wheels.y > 0.0).all():
        return [], evidence
    turned = replace(facts, lateral=wheels.x, side=np.sign(wheels.x))
    places = {'wheels.x': wheels.y.tolist(), 'wheels.y': wheels.x.tolist()}
    turned = replace(turned, configuration=facts.configuration.replace(places))
    details = {'x': listed(wheels.y, '.3f'), 'y': listed(wheels.x, '.3f')}
    unknown = np.full_like(evidence.steering, np.nan)  # where a wheel has to point is open as well
    found = evidence.found('axes', 0.9, **details)
    return [found], replace(evidence, facts=turned, steering=unknown)


def check_signs(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    """Return wheels that count backwards or are exchanged, sides or a reference that are."""
    facts = evidence.facts
    there, rows = _known(evidence)
    if rows.sum() < LEAST_MOVING_ROWS:
        kinds = ('sign', 'swapped_sides', 'exchanged_wheels')
        return [not_checked(kind, 'hardly_moves') for kind in kinds], evidence
    outcomes: list[Outcome] = []
    chosen = _chosen(evidence)
    signs, turn, mended = chosen.signs, chosen.track, evidence
    if turn < 0.0 and np.ptp(integrated(evidence.time, evidence.yaw)) < HOLDS_HEADING:
        turn = 0.0  # wheels may counter what the soil turns the rover by
    if chosen.exchanged:
        finding, mended = _exchanged(evidence, chosen)
        outcomes.append(finding)
    if not turn:
        why = 'no_turn' if facts.known else 'no_places'
        outcomes += [not_checked(kind, why) for kind in ('swapped_sides', 'exchanged_wheels')]
    agreement = _direction(mended, signs)
    blame = _blame(agreement, 2 * int(np.sum(signs[there] < 0.0)) >= there.size, turn)
    slides = agreement[0] is not None and agreement[0] < 0.0 and _climbs(evidence, rows)
    if blame == 'wheels':
        signs, turn = -signs, -turn
        mixed = agreement[0] is None and evidence.recording.reference is not None
        if slides or mixed:
            trial = f'{chosen.trial}{SLIDE if slides else SOME}'
            chosen = chosen._replace(sure=0.5 * chosen.sure, trial=trial)
    signs = np.where(np.isfinite(evidence.rate).any(axis=0), signs, 1.0)
    one_side = facts.has_sides() and not np.ptp(signs * facts.side)
    if one_side and not turn and agreement == (None, None):
        chosen = chosen._replace(sure=0.5 * chosen.sure, trial=f'{chosen.trial}{SPINS}')
    if (signs < 0.0).any():
        finding, mended = _backwards(evidence, mended, signs, chosen)
        outcomes.append(finding)
    if turn < 0.0 and not SKID_TRACKS[0] > -turn > SLIP_APART:
        swaps, mended = _swapped(mended, ALL_WHEELS if agreement == (None, None) else '')
        outcomes += swaps
    if blame == 'reference' and evidence.recording.reference is not None:
        alone = bool(turn) or agreement[1] is not None
        sure, others = (confidence(3.0), '') if alone else (0.5, ALL_WHEELS)
        if slides:
            sure, others = 0.5 * sure, f'{others}{SLIDE}'
        finding = evidence.found('reference_reversed', sure, value=-1.0, alternative=others)
        outcomes.append(finding)
        velocity = -evidence.recording.reference.velocity
        mended = mended.with_channel('reference', velocity=velocity)
    return outcomes, mended


def _chosen(evidence: Evidence) -> _Chosen:
    """Return the hypothesis that stood its trial, or that nothing is wrong."""
    there, rows = _known(evidence)
    signs, count = np.ones(len(evidence.facts.names)), there.size
    if not 2 <= count <= MOST_WHEELS or rows.sum() < LEAST_MOVING_ROWS:
        return _Chosen(signs)
    stretch = stretch_of(evidence, there, rows)
    signed = [Fix((1, *those)) for those in itertools.product((1, -1), repeat=count - 1)]
    best, fit, trial = compare(stretch, [*signed, *exchanges(stretch)[1:]])
    if not trial.falls and count > 2 and stretch.turns.sum() >= 2 * LEAST_TURNING_ROWS:
        turns = replace(stretch, ahead=0.0 * stretch.ahead).rows(stretch.turns)
        again = compare(turns, exchanges(stretch))  # they show in turns alone
        best, fit, trial = again if again[2].falls else (best, fit, trial)
    # Nothing is clearly better than what the rover file says, or good enough.
    steered = np.isfinite(evidence.steering).any()
    most = MOST_LEFT_STEERED if steered else MOST_LEFT
    no_turns = bool(best.exchanged) and abs(fit.track) < SKID_TRACKS[0]  # but slip, by far
    if not trial.falls or trial.after > most or no_turns:
        stated = fits_of([Fix((1,) * count)], stretch)[0]
        # Beside one that fits the drive far better it tells no sides either.
        return _Chosen(signs, stated.clear_track * (fit.cost > LEAST_FALL * stated.cost))
    turn = fit.clear_track
    signs[there] = best.signs
    facts = evidence.facts
    apart = facts.has_sides() and not np.ptp(signs * facts.side)
    if evidence.gyro is None and apart and not stretch.ahead.any():
        return _Chosen(np.ones(signs.size))  # it may be a turn on the spot
    doubled = 2 * int(np.sum(signs < 0.0))
    if doubled > count or (doubled == count and turn < 0.0):
        signs, turn = -signs, -turn  # the pair with fewer reversed wheels is meant
    words = trial.words('wheels apart', 'of their speed')
    words += '' if trial.passes else ', or others do: drive straight'
    exchanged = tuple((int(there[a]), int(there[b])) for a, b in best.exchanged)
    return _Chosen(signs, turn, exchanged, words, 0.99 if trial.passes else 0.5)


def turns_upright(evidence: Evidence) -> float:
    """Return how well gyro and wheels agree in turns: 1 upright, -1 upside down, 0 unknown [-].

    Whatever wheels are exchanged or count backwards: where half do, the reference tells which.
    """
    if evidence.gyro is None:
        return 0.0
    chosen = _chosen(evidence)
    signs = chosen.signs
    if not signs.sum():
        signs = signs * np.sign(_direction(evidence, signs)[0] or 0.0)
    order = Fix((), chosen.exchanged).order(signs.size)
    difference = replace(evidence, rate=evidence.rate[:, order] * signs).side_difference
    rows = evidence.turning & np.isfinite(difference)
    if rows.sum() * evidence.period < LEAST_TURNING:
        return 0.0
    return correlation(evidence.gyro[rows, 2], difference[rows])


def against_reference(evidence: Evidence) -> bool:
    """Return whether the wheels, beside those that alone count backwards, run against it."""
    signs = _chosen(evidence).signs
    return bool(signs.sum()) and (_direction(evidence, signs)[0] or 0.0) < 0.0


_Agreement: TypeAlias = 'tuple[float | None, float | None]'


def _blame(agreement: _Agreement, half_reversed: bool, turn: float) -> str:
    """Return what runs backwards: the wheels beyond the signs that were found, the reference, ''.

    ``half_reversed``: half of the wheels or more have a negative sign; ``turn``: track by the
    turns, negative where they run against the gyro, 0 without turns.
    """
    reference, force = agreement
    against_force = force is not None and force < 0.0
    if reference is None:
        return 'wheels' if turn < 0.0 and against_force else ''
    if reference >= 0.0:
        return ''
    # Wheels or reference are backwards: with the turns on their side it is not the wheels.
    others = half_reversed and turn <= 0.0  # it is the other half that counts backwards
    return 'wheels' if others or turn < 0.0 or (not turn and against_force) else 'reference'


def _direction(evidence: Evidence, signs: FloatArray) -> _Agreement:
    """Return how the common speed agrees with reference and specific force; None: not told."""
    speed = row_medians(np.nan_to_num(evidence.rate) * signs)
    reference, by_reference, by_force = evidence.recording.reference, None, None
    if reference is not None and not in_another_frame(evidence):
        sense = np.sign(np.nan_to_num(evidence.rim_at(reference, speed)))
        forward = np.nan_to_num(reference.velocity[:, 0])  # the faster, the more it tells
        most = 2.0 * float(np.median(np.abs(forward[sense != 0.0]))) if sense.any() else 0.0
        forward = np.clip(forward, -most, most)  # but for jumps
        fit = float(sense @ forward) / max(float(np.abs(forward).sum()), 1e-12)
        by_reference = fit if abs(fit) > SAME_SENSE else None
    signed = replace(evidence, rate=evidence.rate * signs, torque=evidence.torque * signs)
    yaw = mounting_yaw(signed)
    if yaw is not None and abs(math.cos(yaw.value)) > CLEAR_DIRECTION:
        by_force = math.cos(yaw.value)
    if by_force is None and evidence.facts.known and np.nansum(signed.torque * signed.rate) > 0.0:
        slopes = slope_fit(signed)  # torques that carry the rover up or down them
        if isinstance(slopes, Slopes) and slopes.gain.sigmas_from(0.0) > SCALE_SIGMAS:
            by_force = float(np.sign(slopes.gain.value))
    return by_reference, by_force


def _climbs(evidence: Evidence, rows: Mask) -> bool:
    """Whether the wheels drive uphill, so steeply that a rover may slide back on them."""
    if evidence.force is None:
        return False
    ahead = np.median(evidence.force[rows, 0] * np.sign(evidence.rim[rows]))
    return bool(ahead > SLIDES_BACK * evidence.facts.gravity)


def _backwards(
    evidence: Evidence, mended: Evidence, signs: FloatArray, chosen: _Chosen
) -> tuple[Finding, Evidence]:
    facts = evidence.facts
    details: dict[str, Any] = {'trial': chosen.trial, 'wheel': facts.named(signs < 0.0)}
    details['directions'] = listed(facts.direction * signs, '.0f')
    value = float(-facts.direction[signs < 0.0][0])
    finding = evidence.found('backwards', chosen.sure, value=value, **details)
    return finding, replace(mended, rate=mended.rate * signs, torque=mended.torque * signs)


def _swapped(evidence: Evidence, others: str) -> tuple[list[Outcome], Evidence]:
    """Return what makes the wheels turn against the gyro, its sign or swapped sides, and it mended.

    Curves are felt and rovers are steered as the gyro says where it is right; ``others``: what else
    it may be where nothing tells, in words.
    """
    facts, (against, sense) = evidence.facts, _sense_of_gyro(evidence)
    if sense < 0 and evidence.gyro is not None:
        details = {'value': -1.0, 'axis': 'z', 'against': f'wheels and {against}'}
        mended = replace(evidence, gyro=evidence.gyro * [1.0, 1.0, -1.0])
        return [evidence.found('gyro_reversed', 0.9, **details)], mended
    mended = replace(evidence, facts=replace(facts, side=-facts.side, lateral=-facts.lateral))
    order = sides_exchanged(facts)
    if np.isfinite(evidence.steering).any():  # steering joints are named as before, or with it
        both = mended, replace(mended, steering=mended.steering[:, order])

        def held_against(one: Evidence) -> tuple[bool, float]:
            return bool((_steered_as_turned(one).gain < -AS_TURNED).any()), left_in_turns(one)

        mended = min(both, key=held_against)
    sides = evidence.found(
        'swapped_sides',
        0.97 if sense else 0.5,
        alternative='' if sense else f', or the gyro is positive to the right{others}',
        names=', '.join(facts.names[i] for i in order),
    )
    if sense:
        return [sides], mended
    against = f'the wheels, or left and right wheels are swapped{others}'
    gyro_off = evidence.found('gyro_reversed', 0.5, value=-1.0, axis='z', against=against)
    return [sides, gyro_off], mended


def _sense_of_gyro(evidence: Evidence) -> tuple[str, int]:
    """Return what beside the wheels tells the sense of the gyro; 1 as it has it, -1 not, 0 ''."""
    imu = evidence.recording.imu
    assert imu is not None
    starts, curves = accelerometer_signs(evidence)
    curves = max(curves, 0) if starts < 1 else curves  # else the IMU may be turned round
    if curves:
        return 'curves', curves
    if oriented := _turns_as_oriented(evidence, imu):
        return 'orientation', oriented
    # The yaw rate of a reference may be made of the wheels or of the gyro: it tells neither.
    gain = _steered_as_turned(evidence).gain
    senses = set(np.sign(gain[np.abs(gain) > AS_TURNED]).astype(int).tolist())
    return ('steering', senses.pop()) if len(senses) == 1 else ('', 0)


def _heading_of_reference(evidence: Evidence) -> FloatArray | None:
    """Return the heading by the yaw rate of the reference (k,) [rad]; None where there is none."""
    reference = evidence.recording.reference
    if reference is None or reference.stamp.size < 2:
        return None
    at, rate = evidence.seconds(reference), np.nan_to_num(reference.yaw_rate)
    return integrated(evidence.time, np.interp(evidence.time, at, rate))


def _turns(evidence: Evidence, heading: FloatArray) -> FloatArray:
    """Return by how much a heading (k,) changes over `HEADING_TIME` [rad], gaps left out."""
    rows = evidence.rows_in(HEADING_TIME)
    whole = evidence.time[rows:] - evidence.time[:-rows] < 2.0 * HEADING_TIME
    return np.asarray((heading[rows:] - heading[:-rows])[whole])


def _most(turns: FloatArray) -> float:
    """Return the size of the larger of some turns [rad]; 0 without any."""
    return float(np.quantile(np.abs(turns), 0.95)) if turns.size else 0.0


def _turns_as_oriented(evidence: Evidence, imu: ImuSeries, least: float = 0.0) -> int:
    """Return 1 where the gyro turns as its orientation does, -1 against it, 0 for not clear.

    It has to turn by ``least`` [rad] in a while.
    """
    heading = _heading(evidence, imu)
    if heading is None:
        return 0
    seen = _turns(evidence, heading)
    alike = correlation(seen, _turns(evidence, integrated(evidence.time, evidence.yaw)))
    clear = _most(seen) >= least and abs(alike) > LEAST_CORRELATION
    return int(np.sign(alike)) * clear


def _heading(evidence: Evidence, imu: ImuSeries) -> FloatArray | None:
    """Return the turn about the body's z by the orientation (k,) [rad]; None where there is none.

    On a slope the heading turns faster than the body does about its z, or slower.
    """
    known = np.isfinite(imu.orientation).all(axis=1)
    if known.mean() < 0.9:
        return None
    before, after = imu.orientation[known][:-1], imu.orientation[known][1:]
    turn = before[:, 3:] * after[:, :3] - after[:, 3:] * before[:, :3]
    turn -= np.cross(before[:, :3], after[:, :3])
    about = 2.0 * np.arctan(turn @ evidence.rotation[2] / (before * after).sum(axis=1))
    heading = np.cumsum(np.nan_to_num(np.append(0.0, about)))
    return np.asarray(np.interp(evidence.time, evidence.seconds(imu)[known], heading))


def check_gyro_scale(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    """Return a gyro whose turns have another scale than heading or reference say, and it mended."""
    imu = evidence.recording.imu
    if imu is None or evidence.gyro is None:
        return [], evidence
    if _turns_as_oriented(evidence, imu, LEAST_TURNED) < 0:
        told = (track_ratio(evidence) or 0.0) > 0.0  # the gyro turns as the wheels do here
        how = (
            f'it turns against {"gyro and wheels" if told else "the gyro, or the gyro is reversed"}'
        )
        return [evidence.found('orientation', 0.97 if told else 0.5, how=how)], evidence
    axes = (*evidence.gyro[:, :2].T, evidence.yaw)
    aside, across, gyro = (_turns(evidence, integrated(evidence.time, axis)) for axis in axes)
    headings = {
        'orientation': _heading(evidence, imu),
        'twist.angular': _heading_of_reference(evidence),
    }
    for name, other in headings.items():
        if other is None:
            continue
        seen = _turns(evidence, other)
        # A turn that stays the same shows no scale: it may as well be a bias.
        alike = correlation(gyro - gyro.mean(), seen - seen.mean()) if seen.size else 0.0
        if _most(seen) < LEAST_TURNED or alike < SAME_TURNS:
            continue
        # Noise of either flattens the fit to it; a tilted one has a part of the turns on x and y.
        one = np.ones(seen.size)
        cure, both = block_fit(np.column_stack([gyro, one]), seen)[0], np.column_stack([seen, one])
        parts = [fit[0].value for fit in block_fits(both, np.column_stack([aside, across, gyro]))]
        off = min((cure.value - 1.0, 1.0 / math.hypot(*parts) - 1.0), key=abs)
        scaled = abs(off) > max(LEAST_SCALE, SCALE_SIGMAS * cure.std)
        # Turns of a reference whose speeds have the same scale are its error.
        if scaled and (name == 'orientation' or not as_fast_as_rims(evidence, cure.value)):
            details = {'times': 1.0 / cure.value, 'against': name}
            finding = evidence.found('gyro_scale', 0.9, value=cure.value, std=cure.std, **details)
            times = np.array([1.0, 1.0, cure.value])
            if not 0.5 < cure.value < 2.0:  # another unit, of all axes
                times[:] = cure.value
            if abs(cure.value / DEGREE - 1.0) < NEAR_DEGREES:
                how = f'turning by {name}'
                finding = evidence.found('gyro_degrees', 0.95, value=DEGREE, **details, how=how)
                times[:] = DEGREE
            evidence = evidence.with_channel('imu', rate=imu.rate * times)
            return [finding], replace(evidence, gyro=evidence.gyro * times)
    return [], evidence


def sides_exchanged(facts: RoverFacts) -> list[int]:
    """Return the wheels in order, each left one in the place of the right one beside it."""
    order, forward = list(range(len(facts.names))), facts.configuration.wheels.x
    left, right = (
        sorted(np.flatnonzero(facts.side == side).tolist(), key=lambda i: -float(forward[i]))
        for side in (1.0, -1.0)
    )
    for i, j in zip(left, right, strict=False):
        order[i], order[j] = order[j], order[i]
    return order


def _exchanged(evidence: Evidence, chosen: _Chosen) -> tuple[Finding, Evidence]:
    names = evidence.facts.names
    order = Fix((), chosen.exchanged).order(len(names))
    wheels = ', '.join(names[i] for pair in chosen.exchanged for i in pair)
    details = {'wheel': wheels, 'trial': chosen.trial}
    details['names'] = ', '.join(names[i] for i in order)
    finding = evidence.found('exchanged', min(chosen.sure, 0.95), **details)
    rate, torque = evidence.rate[:, order], evidence.torque[:, order]
    return finding, replace(evidence, rate=rate, torque=torque)


def check_gyro_unit(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    """Return a gyro in degrees per second, told by the turns of the wheels.

    It turns faster than about a side that stands: what is slower may be sides that slip apart.
    """
    imu, facts = evidence.recording.imu, evidence.facts
    if imu is None or evidence.gyro is None or not facts.known or not facts.has_sides():
        return [], evidence
    ratio = track_ratio(evidence)
    if ratio is None:
        return [not_checked('unit', 'gyro_no_turn')], evidence
    times = 1.0 / abs(ratio)
    scaled = IN_DEGREES_BY_WHEELS[0] < times < IN_DEGREES_BY_WHEELS[1]
    moving = evidence.moving
    turned = np.quantile(np.abs(evidence.yaw[moving]), 0.95) * np.ptp(facts.lateral)
    slips = turned < np.nanquantile(np.abs(evidence.speed[moving]), 0.95)
    if not scaled or slips:
        return [], evidence
    words = {'times': times, 'how': 'turning of the wheels'}
    finding = evidence.found('gyro_degrees', 0.95, value=math.radians(1.0), **words)
    mended = evidence.with_channel('imu', rate=np.radians(imu.rate))
    return [finding], replace(mended, gyro=np.radians(evidence.gyro))


def _as_stated(evidence: Evidence, within: Mask) -> Fit | None:
    """Return how well the rover file accounts for wheels and gyro; None for too few rows."""
    there, rows = _known(evidence)
    rows = rows & within
    if rows.sum() < LEAST_TURNING_ROWS:
        return None
    return fits_of([Fix((1,) * there.size)], stretch_of(evidence, there, rows))[0]


@once
def track_ratio(evidence: Evidence) -> float | None:
    """Return effective over stated track from the turns; None without turns."""
    fit = _as_stated(evidence, evidence.moving)
    return fit.clear_track or None if fit is not None else None


def gyro_unit_known(evidence: Evidence) -> bool:
    """Return whether turns of the wheels or of an orientation say what the gyro counts in."""
    if track_ratio(evidence) is not None:
        return True
    imu = evidence.recording.imu
    return imu is not None and _turns_as_oriented(evidence, imu, LEAST_TURNED) != 0


def skids(evidence: Evidence) -> bool:
    """Return whether wheels do not roll as the track says in turns: several rows not steered."""
    wheels = evidence.facts.configuration.wheels
    if not evidence.facts.known:
        return True
    known = np.isfinite(evidence.steering).all(axis=0)
    fixed = wheels.x[~known]
    unknown = bool((np.array(wheels.steered) & ~known).any())
    return unknown or float(np.ptp(fixed)) > 0.3 * float(np.ptp(wheels.y)) if fixed.size else False


def left_in_turns(evidence: Evidence) -> float:
    """Return the residual of the wheels in turns [-]; 0 without any."""
    fit = _as_stated(evidence, evidence.turning)
    return fit.cost if fit is not None else 0.0


def ordinary_track(ratio: float) -> bool:
    """Return whether a rover may turn so, skidding or not."""
    return SKID_TRACKS[0] < abs(ratio) < SKID_TRACKS[1]
