# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Wheel rates: signs, sides, exchanged wheels, units, dead channels."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.checks.evidence import LEAST_MOVING_ROWS, Evidence, row_medians
from wheel_terra_estimator.checks.finding import Finding, NotChecked, Outcome
from wheel_terra_estimator.checks.rate_noise import common_step
from wheel_terra_estimator.checks.statistics import (
    block_fit,
    confidence,
    correlation,
    moving_mean,
    robust_std,
)

FloatArray = NDArray[np.float64]

UNITS = {
    'revolutions per minute': 2.0 * math.pi / 60.0,
    'degrees per second': math.pi / 180.0,
    'revolutions per second': 2.0 * math.pi,
}
"""Units that wheel rates come in by mistake: factor to rad/s."""
MOST_COUNT = 0.07
"""Speed over rim speed below which wheels that fit no unit are in counts (90 in a turn) [-]."""
MOST_TRACK = 500.0
"""Effective over geometric track above which wheels are in counts [-]."""
USUAL_TRACK = 2.0
"""The same, of rovers that turn by skidding [-]."""
UNIT_TOLERANCE = 0.35
"""Share by which a speed ratio may lie off a unit's factor (slip makes it smaller)."""
ORDINARY_TRACKS = (0.7, 5.0)
"""Effective over geometric track of rovers that turn by skidding [-]."""
FROZEN_TIME = 5.0
"""A rate that does not change in the last digit for this long [s] while the others do."""
FROZEN_CHANGE = 0.3
"""Change of the other rates meanwhile, as a share of the working rate; steps of coarse encoders are
none."""
LONG_FROZEN_TIME = 10.0
"""The same at a steady speed, where a coarse encoder may repeat itself [s]."""
LEAST_TURN_RATE = 0.02
"""Yaw rate below which sides are not compared [rad/s]."""
CLEAR_SPEED = 5.0
"""Speed over the noise of the reference that a ratio of speeds needs [-]."""
TRIAL_ROWS = 1000
"""Rows, spread over the drive, that signs are tried on."""
MOST_WHEELS = 10
"""Wheels for which all combinations of signs are tried."""
TRACKS = (0.0, 1.0, 1.5, 2.2, 3.2, 5.0)
"""Effective over geometric half track that are tried, each with both signs."""
TRACKS_BLIND = (0.0, 1.0, 2.0, 4.0, 7.0, 12.0, 20.0)
"""Effective half track over wheel radius that are tried without a rover file."""


class _Signs(NamedTuple):
    cost: float
    signs: tuple[int, ...]
    track: float


def check_dead_wheels(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    """Return wheels whose rate is frozen; they are left out of what follows."""
    found: list[Outcome] = []
    rate = evidence.rate
    moving = evidence.moving
    working = evidence.working_rate
    mended = rate.copy()
    if moving.sum() < LEAST_MOVING_ROWS or rate.shape[1] < 2:
        return [], evidence
    joints = evidence.recording.joints
    assert joints is not None
    change = max(FROZEN_CHANGE * working, 1.5 * common_step(rate[moving], evidence.time[moving]))
    for index, name in enumerate(evidence.facts.names):
        own = rate[:, index]
        others = np.delete(rate, index, axis=1)
        longest = 0.0
        for start, end in _runs(own):
            if evidence.time[end] - evidence.time[start] < FROZEN_TIME:
                continue
            there = np.abs(others[start : end + 1])
            if own[start] == 0.0:
                lively = np.nanmedian(there) > 0.5 * working
            else:
                beside = np.nanmedian(others[start : end + 1], axis=1)
                changes = np.mean(np.diff(others[start : end + 1], axis=0) != 0.0)
                lasting = evidence.time[end] - evidence.time[start] > LONG_FROZEN_TIME
                lively = np.ptp(beside) > change or (lasting and changes > 0.5)
            if lively:
                longest = max(longest, float(evidence.time[end] - evidence.time[start]))
        repeats = np.mean(np.diff(own[moving]) == 0.0)
        beside = np.mean(np.diff(others[moving], axis=0) == 0.0)
        if longest > 0.0 or (repeats > 0.6 and beside < 0.2):
            words = (
                f'does not change for up to {longest:.1f} s while the other wheels do'
                if longest > 0.0
                else f'repeats its last value in {100 * repeats:.0f} % of the messages'
            )
            found.append(
                Finding(
                    kind='frozen',
                    topic=joints.topic,
                    wheel=name,
                    parameter='wheels.names',
                    confidence=0.97,
                    words=words,
                    cure=(
                        f'look at encoder and cable of {name}; publish nan, or leave it out of the '
                        'message, while it is dead'
                    ),
                )
            )
            mended[:, index] = np.nan
    return found, evidence.with_rate(mended) if found else evidence


def _runs(values: FloatArray) -> list[tuple[int, int]]:
    """Return (first, last) row of each stretch in which a value does not change."""
    same = np.concatenate([[False], np.diff(values) == 0.0, [False]])
    edges = np.flatnonzero(np.diff(same.astype(int)))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def check_unit(evidence: Evidence, figures: dict[str, Any]) -> tuple[list[Outcome], Evidence]:
    """Return the unit of the rates where speeds or turns tell it is not rad/s."""
    facts, joints = evidence.facts, evidence.recording.joints
    assert joints is not None
    if not facts.known:
        return [NotChecked('unit', 'wheel rates: no radius without a rover file')], evidence
    ratio = _speed_ratio(evidence)
    how = 'speed of the reference'
    if ratio is None and evidence.recording.wheel_odometry is not None:
        ratio = _odometry_ratio(evidence)
        how = f'speed of {evidence.recording.wheel_odometry.topic}'
    track = _track_ratio(evidence)
    if ratio is not None:
        figures['wheels.speed_over_rim_speed'] = round(ratio, 4)
    if ratio is None and track is None:
        if evidence.working_rate * float(np.nanmean(facts.radius)) > 15.0:
            ratio, how = math.pi / 30.0, 'rim speed above 15 m/s'
        else:
            reason = 'wheel rates: neither reference nor turn in it; drive a circle'
            return [NotChecked('unit', reason)], evidence
    for unit, factor in UNITS.items():
        by_speed = ratio is not None and abs(math.log(ratio / factor)) < UNIT_TOLERANCE
        by_turn = track is not None and (
            ORDINARY_TRACKS[0] < abs(track) * factor < ORDINARY_TRACKS[1] * 1.6
        )
        ordinary = track is not None and ORDINARY_TRACKS[0] < abs(track) < ORDINARY_TRACKS[1] * 1.6
        if (by_speed and (track is None or by_turn or not ordinary)) or (
            ratio is None and by_turn and not ordinary
        ):
            outcome = Finding(
                kind='unit',
                topic=joints.topic,
                value=factor,
                confidence=0.97,
                words=f'velocity is in {unit} ({how if ratio else "turns seen by the gyro"})',
                cure=f'multiply velocity by {factor:.6g} in the driver (rad/s, REP 103)',
            )
            return [outcome], evidence.with_rate(evidence.rate * factor)
    if ratio is not None and 0.0 < ratio < MOST_COUNT:
        figures['wheels.rad_per_count'] = float(f'{ratio:.4g}')
        return _counts(evidence, ratio, how)
    if ratio is None and track is not None and abs(track) > MOST_TRACK:
        usual = USUAL_TRACK / abs(track)  # told to a factor of two: turns skid
        figures['wheels.rad_per_count'] = float(f'{usual:.1g}')
        return _counts(evidence, usual, 'gyro in turns')
    return [], evidence


def _counts(evidence: Evidence, ratio: float, how: str) -> tuple[list[Outcome], Evidence]:
    joints = evidence.recording.joints
    assert joints is not None
    outcome = Finding(
        kind='unit',
        topic=joints.topic,
        value=float(f'{ratio:.3g}'),
        confidence=0.9,
        words=(
            f'velocity is {1.0 / ratio:.0f} times what the {how} allows: counts of an encoder per '
            f'second, about {2.0 * math.pi / ratio:.0f} in a turn of the wheel?'
        ),
        cure=(
            f'multiply velocity by 2 pi / counts per turn (about {ratio:.3g}) in the driver '
            '(rad/s, REP 103)'
        ),
    )
    return [outcome], evidence.with_rate(evidence.rate * ratio)


def _speed_ratio(evidence: Evidence) -> float | None:
    """Return the upper end of reference speed over rim speed: that of the least slip."""
    reference = evidence.reference()
    if reference is None:
        return None
    rim = evidence.rim_at(reference.stamp, np.abs(evidence.rim), 0.3)
    speed = np.linalg.norm(reference.velocity[:, :2], axis=1)
    working = np.nanquantile(rim, 0.9) if np.isfinite(rim).any() else 0.0
    rows = (rim > 0.4 * working) & np.isfinite(speed)
    if working <= 0.0 or rows.sum() < 8:
        return None
    noise = robust_std(np.diff(reference.velocity[:, 0], 2)) / math.sqrt(6.0)
    if float(np.quantile(speed[rows], 0.8)) < CLEAR_SPEED * noise:
        return None  # hardly moves: stuck, not another unit
    if correlation(np.nan_to_num(rim), np.nan_to_num(speed)) < 0.8:
        return None
    return float(np.quantile(speed[rows] / rim[rows], 0.8))


def _odometry_ratio(evidence: Evidence) -> float | None:
    odometry = evidence.recording.wheel_odometry
    assert odometry is not None
    rim = evidence.rim_at(odometry.stamp, np.abs(evidence.rim), 0.2)
    speed = np.abs(odometry.velocity[:, 0])
    rows = np.isfinite(rim) & (rim > 0.3 * np.nanquantile(rim, 0.9)) & (rim > 0.0)
    return float(np.median(speed[rows] / rim[rows])) if rows.sum() > 8 else None


def _track_ratio(evidence: Evidence) -> float | None:
    """Return effective over geometric track from the turns; None without turns."""
    facts, difference = evidence.facts, evidence.side_difference
    rows = _turning_rows(evidence)
    if rows.sum() < 40 or evidence.gyro is None or not facts.has_sides():
        return None
    track = facts.lateral[facts.side > 0].mean() - facts.lateral[facts.side < 0].mean()
    yaw = evidence.gyro[rows, 2]
    if abs(correlation(yaw, difference[rows])) < 0.7 or not track:
        return None
    slope = block_fit(yaw[:, None], difference[rows])[0].value
    return float(slope / track)


def _turning_rows(evidence: Evidence) -> NDArray[np.bool_]:
    if evidence.gyro is None:
        return np.zeros(evidence.time.size, dtype=bool)
    yaw = np.abs(evidence.gyro[:, 2])
    noise = robust_std(np.diff(evidence.gyro[:, 2])) / math.sqrt(2.0)
    difference = evidence.side_difference
    return np.asarray(
        evidence.moving
        & np.isfinite(difference)
        & (yaw > max(4.0 * noise, 0.3 * float(np.quantile(yaw, 0.98)), LEAST_TURN_RATE))
    )


def check_signs(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    """Return wheels that count backwards, sides that are swapped, a reference that is reversed."""
    facts, joints = evidence.facts, evidence.recording.joints
    assert joints is not None
    there = np.flatnonzero(np.isfinite(evidence.rate).any(axis=0))
    rows = evidence.moving & np.isfinite(evidence.rate[:, there]).all(axis=1)
    if rows.sum() < LEAST_MOVING_ROWS or not there.size:
        return [NotChecked('sign', 'the rover hardly moves in it; drive straight')], evidence
    turns = _turning_rows(evidence)
    chosen = _best_signs(evidence, there, rows)
    found: list[Outcome] = []
    if chosen is None or chosen.track == 0.0:
        reason = 'no turn in it, or no IMU: left and right not checked; drive a circle both ways'
        if not facts.known:
            reason = 'left and right need the places of the wheels: a rover file (wheel-terra init)'
        found += [NotChecked(kind, reason) for kind in ('swapped_sides', 'exchanged_wheels')]
    signs, turn = np.ones(len(facts.names)), 0.0
    if chosen is not None:
        signs[there], turn = chosen.signs, chosen.track
    told = _told_direction(evidence, signs)
    blame = _blame(told, 2 * int(np.sum(signs[there] < 0.0)) >= there.size, turn)
    if blame.unsure:
        found.append(_all_backwards(evidence, 0.4))
    if blame.wheels:
        signs, turn = -signs, -turn
    backwards = [i for i in there if signs[i] < 0.0]
    mended = evidence
    if backwards:
        found += [_backwards(evidence, int(i), signs) for i in backwards]
        mended = evidence.with_rate(evidence.rate * signs)
    if turn < 0.0:
        found += _swapped(evidence)
        mended = replace(mended, facts=replace(facts, side=-facts.side, lateral=-facts.lateral))
    if blame.reference:
        sure = confidence(3.0) if turn or told.force is not None else 0.5
        finding, mended = _reversed_reference(mended, sure)
        found.append(finding)
    if turn >= 0.0:
        exchanged, mended = _exchanged(mended, turns)
        found += exchanged
    return found, mended


def _reversed_reference(evidence: Evidence, sure: float) -> tuple[Finding, Evidence]:
    reference = evidence.reference()
    assert reference is not None
    finding = Finding(
        kind='sign',
        topic=reference.topic,
        value=-1.0,
        confidence=sure,
        words='linear.x runs against the wheels',
        cure='negate twist.linear.x in its driver, or turn its frame into base_link',
    )
    turned = replace(reference, velocity=-reference.velocity)
    return finding, replace(evidence, recording=replace(evidence.recording, reference=turned))


class _Told(NamedTuple):
    """Agreement of the common speed with the reference and with the specific force; None: none."""

    reference: float | None
    force: float | None


class _Blame(NamedTuple):
    """What runs backwards, where wheels, turns, reference and specific force do not agree."""

    wheels: bool = False  # all of them, beyond the signs that were found
    reference: bool = False
    unsure: bool = False


def _blame(told: _Told, half_reversed: bool, turn: float) -> _Blame:
    """Return what runs backwards.

    Parameters
    ----------
    told : _Told
        Agreement of the common speed with the others.
    half_reversed : bool
        Whether half of the wheels or more have a negative sign.
    turn : float
        Track that the turns tell, negative where they run against the gyro, 0 without turns.
    """
    if told.reference is None:
        return _Blame(wheels=turn < 0.0 and told.force is not None and told.force < 0.0)
    if told.reference >= 0.0:
        return _Blame()
    # Wheels or reference are backwards: with the turns on their side it is not the wheels.
    if half_reversed:
        return _Blame(wheels=True)  # the other half counts backwards
    if turn:
        return _Blame(wheels=turn < 0.0, reference=turn > 0.0)
    if told.force is not None:
        return _Blame(wheels=told.force < 0.0, reference=told.force >= 0.0)
    return _Blame(reference=True, unsure=True)


def _told_direction(evidence: Evidence, signs: FloatArray) -> _Told:
    speed = row_medians(np.nan_to_num(evidence.rate) * signs)
    reference = evidence.reference()
    by_reference = by_force = None
    if reference is not None:
        at = evidence.rim_at(reference.stamp, speed, 0.3)
        fit = correlation(np.nan_to_num(at), reference.velocity[:, 0])
        by_reference = fit if abs(fit) > 0.5 else None
    if evidence.force is not None and evidence.time.size > 100:
        width = max(round(0.4 / evidence.period), 1)
        change = np.gradient(moving_mean(speed, width), evidence.period)
        force = moving_mean(evidence.force[:, 0], width)
        force = force - moving_mean(force, 10 * width)
        parts = np.array(
            [
                float(a @ b)
                for a, b in zip(np.array_split(change, 10), np.array_split(force, 10), strict=True)
            ]
        )
        spread = float(np.sqrt(np.sum((parts - parts.mean()) ** 2)))
        fit = correlation(change, force)
        if abs(parts.sum()) > 3.0 * spread and abs(fit) > 0.15:
            by_force = fit
    return _Told(by_reference, by_force)


def _best_signs(
    evidence: Evidence, there: NDArray[np.intp], rows: NDArray[np.bool_]
) -> _Signs | None:
    """Try all signs of the wheels with turns of either sense; None where nothing is clearly best.

    A rolling rover has ``r w_i = v - w_z y_i``: after the turn is taken off, all rims run alike.
    The track is that of the skid, larger than the geometric one.
    """
    facts = evidence.facts
    if there.size < 2 or there.size > MOST_WHEELS:
        return None
    radius = np.where(np.isfinite(facts.radius), facts.radius, 1.0)[there]
    speed = (evidence.rate[:, there] * radius)[rows]
    yaw = evidence.gyro[rows, 2] if evidence.gyro is not None else np.zeros(rows.sum())
    lateral = facts.lateral[there] if facts.known else facts.side[there]
    tracks: tuple[float, ...] = TRACKS if facts.known else TRACKS_BLIND
    if not facts.has_sides() or not np.isfinite(lateral).all():
        lateral, tracks = np.zeros(there.size), (0.0,)
    if speed.shape[0] > TRIAL_ROWS:
        keep = np.linspace(0, speed.shape[0] - 1, TRIAL_ROWS).astype(int)
        speed, yaw = speed[keep], yaw[keep]
    size = np.maximum(np.abs(speed).mean(axis=1), 1e-9)
    turns = [t * s for t in tracks for s in (1.0, -1.0) if t or s > 0.0]
    trials = []
    for signs in itertools.product((1, -1), repeat=there.size - 1):
        flipped = speed * (1, *signs)
        for turn in turns:
            rolling = flipped + yaw[:, None] * lateral * turn
            spread = np.abs(rolling - np.median(rolling, axis=1)[:, None]).mean(axis=1)
            trials.append(_Signs(float(np.mean(spread / size)), (1, *signs), turn))
    best = min(trials, key=lambda t: t.cost)
    # With (signs, turn) goes (-signs, -turn): the pair with fewer reversed wheels is meant.
    reversed_wheels = sum(s < 0 for s in best.signs)
    half = reversed_wheels == there.size / 2.0
    if reversed_wheels > there.size / 2.0 or (half and best.track < 0.0):
        best = _Signs(best.cost, tuple(-s for s in best.signs), -best.track)
    straight = next(t for t in trials if t.signs == (1,) * there.size and t.track == 0.0)
    as_told = min(
        (t for t in trials if t.signs == (1,) * there.size and t.track >= 0.0),
        key=lambda t: t.cost,
    )
    if best.cost > 0.8 * as_told.cost - 0.01:
        # Nothing is clearly better than what the rover file says.
        sides = as_told.track if as_told.cost < 0.8 * straight.cost - 0.01 else 0.0
        return _Signs(as_told.cost, as_told.signs, sides)
    unturned = min((t for t in trials if t.track == 0.0 and _alike(t, best)), key=lambda t: t.cost)
    if best.cost > 0.8 * unturned.cost - 0.01:
        best = _Signs(best.cost, best.signs, 0.0)  # the turns say nothing about the sides
    return best


def _alike(first: _Signs, second: _Signs) -> bool:
    return first.signs in (second.signs, tuple(-s for s in second.signs))


def _direction_cure(evidence: Evidence, signs: FloatArray) -> str:
    listed = ', '.join(
        f'{int(d * s)}' for d, s in zip(evidence.facts.direction, signs, strict=True)
    )
    return f'wheels.direction: [{listed}]'


def _backwards(evidence: Evidence, index: int, signs: FloatArray) -> Finding:
    facts, joints = evidence.facts, evidence.recording.joints
    assert joints is not None
    torque, rate = evidence.torque[:, index], evidence.rate[:, index]
    cure = _direction_cure(evidence, signs)
    moving = evidence.moving
    if np.isfinite(torque).any() and correlation(torque[moving], rate[moving]) < -0.3:
        cure += ' and negate effort in the driver (it has the right sign as it is)'
    return Finding(
        kind='sign',
        topic=joints.topic,
        wheel=facts.names[index],
        parameter='wheels.direction',
        value=float(-facts.direction[index]),
        confidence=0.99,
        words='counts backwards when the rover drives forward',
        cure=cure,
    )


def _all_backwards(evidence: Evidence, sure: float) -> Finding:
    joints = evidence.recording.joints
    assert joints is not None
    return Finding(
        kind='sign',
        topic=joints.topic,
        parameter='wheels.direction',
        value=-1.0,
        confidence=sure,
        words='all wheels may count backwards: they run against the reference',
        cure=_direction_cure(evidence, -np.ones(len(evidence.facts.names))),
    )


def _swapped(evidence: Evidence) -> list[Outcome]:
    """Return what makes the wheels turn against the gyro: swapped sides or a reversed gyro."""
    joints, imu = evidence.recording.joints, evidence.recording.imu
    assert joints is not None and imu is not None
    facts = evidence.facts
    orientation_told = bool(np.isfinite(imu.orientation).all(axis=1).mean() > 0.9)
    names = ', '.join(facts.names)
    mirrored = ', '.join(f'{-y:g}' for y in facts.lateral)
    sides = Finding(
        kind='swapped_sides',
        topic=joints.topic,
        parameter='wheels.names',
        confidence=0.97 if orientation_told else 0.5,
        words=(
            'left and right wheels turn against the gyro: the sides are swapped'
            + ('' if orientation_told else ', or the gyro counts yaw to the right')
        ),
        cure=(
            f'exchange left and right in wheels.names: [{names}]'
            + (f', or wheels.y: [{mirrored}]' if facts.known else '')
        ),
    )
    if orientation_told:
        return [sides]
    gyro = Finding(
        kind='sign',
        topic=imu.topic,
        value=-1.0,
        confidence=0.5,
        words='angular_velocity.z turns against the wheels, or left and right wheels are swapped',
        cure='negate angular_velocity.z in the driver (REP 103: positive to the left)',
    )
    return [sides, gyro]


def _exchanged(evidence: Evidence, turns: NDArray[np.bool_]) -> tuple[list[Outcome], Evidence]:
    """Return a left and a right wheel that go by each other's name."""
    facts, joints = evidence.facts, evidence.recording.joints
    assert joints is not None
    if turns.sum() < 40 or evidence.gyro is None or not facts.has_sides():
        return [], evidence
    radius = np.where(np.isfinite(facts.radius), facts.radius, 1.0)
    speed = np.nan_to_num(evidence.rate * radius)
    yaw = evidence.gyro[:, 2]
    slopes = np.full(len(facts.names), np.nan)
    design = np.column_stack([yaw[turns], np.ones(turns.sum())])
    middle = 0.5 * (speed.max(axis=1) + speed.min(axis=1))
    for index in range(slopes.size):
        if np.isfinite(evidence.rate[:, index]).any():
            fit = block_fit(design, (speed[:, index] - middle)[turns])[0]
            if fit.sigmas_from(0.0) > 4.0:
                slopes[index] = -np.sign(fit.value)
    wrong = [i for i in range(slopes.size) if slopes[i] * facts.side[i] < 0.0]
    left = [i for i in wrong if facts.side[i] > 0.0]
    right = [i for i in wrong if facts.side[i] < 0.0]
    if not left or not right or len(wrong) > slopes.size / 2.0:
        return [], evidence
    names = list(facts.names)
    found: list[Outcome] = []
    rate, torque = evidence.rate.copy(), evidence.torque.copy()
    for a, b in zip(left, right, strict=False):
        names[a], names[b] = names[b], names[a]
        rate[:, [a, b]], torque[:, [a, b]] = rate[:, [b, a]], torque[:, [b, a]]
    listed = ', '.join(names)
    for a, b in zip(left, right, strict=False):
        for one, other in ((a, b), (b, a)):
            found.append(
                Finding(
                    kind='exchanged_wheels',
                    topic=joints.topic,
                    wheel=facts.names[one],
                    parameter='wheels.names',
                    confidence=0.95,
                    words=f'turns like a wheel of the other side, as {facts.names[other]} does',
                    cure=f'wheels.names: [{listed}]',
                )
            )
    return found, evidence.with_rate(rate, torque)
