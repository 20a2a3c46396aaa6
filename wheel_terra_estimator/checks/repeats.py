# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Readings of a reference, a torque or a sinkage that stay the same while the wheels turn.

A dead sensor, or a driver that repeats its last value, sends the same number to the last digit for
far longer than the sensor itself ever does.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.checks.evidence import Evidence, Mask, noise_of
from wheel_terra_estimator.checks.finding import Outcome
from wheel_terra_estimator.checks.series import rows_of
from wheel_terra_estimator.checks.statistics import integrated, runs

LEAST_TIME = 5.0  # time of driving in which a reading that stays is frozen [s]
ZERO_TIME = 20.0  # the same of a vector of zeros [s]
LEAST_MESSAGES = 10  # messages in which it stays, at least
LEAST_NOISY = 4  # the same of a reading with noise
LONGER = 10.0  # so many times longer than a reading usually stays [-]
FINE = 50  # different readings of a sensor whose steps are not what makes it stay
MOST_STAYED = 2.0
"""Messages that a reading of few steps usually stays, at most, if its noise spans them."""
LEAST_BESIDE = 30  # other readings from which a sensor is seen to have noise
SELDOM = 0.1  # share of readings that repeat the one before of a sensor with noise [-]
CALM = 0.02  # change of the rates over the working rate that steps of a reading may hide [-]
AT_ONCE = 0.9  # share of a stretch in which no rate without noise changes, at least [-]
LEAST_CHANGES = 30  # changes of rates from which their rhythm is found
LEAST_NOISE = 1e-6  # of the numbers of an orientation that has any [-]
TURNED = 0.5  # turn by the gyro in which an orientation does not stay [rad]
CLEAR_SINKAGE = 0.005  # of the other wheels, beside which none reads 0 all the time [m]


def check_repeats(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    """Return readings that stay the same while driving, and the evidence without these."""
    outcomes = list[Outcome]()
    for check in (_sinkage, _reference, _imu, _joints, _held) if evidence.moving.any() else ():
        found, evidence = check(evidence)
        outcomes += found
    return outcomes, evidence


def _held(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    """Return rates and torques, or velocities, that are sent on a timer, and these once each."""
    outcomes, reference = list[Outcome](), evidence.recording.reference
    values = np.nan_to_num(np.hstack([evidence.rate, evidence.torque]))
    times = _times_sent(values, evidence.moving)
    if times > 1.0:
        details = {'times': times, 'period': times * evidence.period}
        outcomes.append(evidence.found('rates_held', 0.95, **details))
        new = np.append(True, np.any(np.diff(values, axis=0) != 0.0, axis=1))
        evidence = evidence.rows(new | ~evidence.moving)
    if reference is None:
        return outcomes, evidence
    driven = np.interp(evidence.seconds(reference), evidence.time, evidence.moving) > 0.5
    times = _times_sent(reference.velocity, driven)
    if times > 1.0:
        details = {'times': times, 'period': times * reference.period}
        outcomes.append(evidence.found('reference_held', 0.95, **details))
        new = np.append(True, np.diff(reference.velocity[:, 0]) != 0.0)
        evidence = evidence.with_reference(rows_of(reference, new))
    return outcomes, evidence


def _times_sent(values: FloatArray, driven: Mask) -> float:
    """Return how many messages in a row hold the same (k, p) values; 1: one, or no such number."""
    changes = np.any(np.diff(values, axis=0) != 0.0, axis=1) & driven[1:]
    steps = np.diff(np.flatnonzero(changes))
    times = float(np.median(steps)) if steps.size >= LEAST_CHANGES else 1.0
    return times if times >= 2.0 and np.mean(np.abs(steps - times) <= 1.0) >= AT_ONCE else 1.0


def _reference(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    reference = evidence.recording.reference
    if reference is None:
        return [], evidence
    if not reference.velocity.any():
        if float(evidence.moving.sum()) * evidence.period <= LEAST_TIME:
            return [], evidence
        return [evidence.found('reference_zero', 0.9)], evidence.with_reference(None)
    dead = stays(evidence, evidence.seconds(reference), reference.velocity)
    if dead is None:
        return [], evidence
    left = None if dead.rows.all() else rows_of(reference, ~dead.rows)
    finding = evidence.found('reference_frozen', 0.97, how=dead.how)
    return [finding], evidence.with_reference(left)


def _imu(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    """Return what of an IMU stays the same, and the evidence without it.

    On an even straight an orientation without noise may stay, in a turn it does not.
    """
    outcomes, imu, left = list[Outcome](), evidence.recording.imu, dict[str, None]()
    if imu is None:
        return [], evidence
    at, heading = evidence.seconds(imu), integrated(evidence.time, evidence.yaw)
    for name, field, readings in (
        ('force', 'linear_acceleration', imu.force),
        ('gyro', 'angular_velocity', imu.rate),
    ):
        if getattr(evidence, name) is not None and (dead := stays(evidence, at, readings)):
            outcomes.append(evidence.found('sensor_frozen', 0.97, how=f'{field} {dead.how}'))
            left[name] = None
    dead = stays(evidence, at, imu.orientation)
    noisy = dead and max(map(noise_of, imu.orientation[~dead.rows].T)) > LEAST_NOISE
    if dead and (noisy or np.ptp(np.interp(at[dead.rows], evidence.time, heading)) > TURNED):
        outcomes.append(evidence.found('sensor_frozen', 0.97, how=f'orientation {dead.how}'))
        evidence = evidence.with_channel('imu', orientation=math.nan * imu.orientation)
    return outcomes, replace(evidence, **left)  # type: ignore[arg-type]


def _joints(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    """Return wheels whose rate or torque stays the same, and the evidence without these."""
    names = evidence.facts.names
    rates, rate = _by_wheel(evidence, 'rate_frozen', names, evidence.time, evidence.rate)
    torques, torque = _by_wheel(evidence, 'torque_frozen', names, evidence.time, evidence.torque)
    return rates + torques, replace(evidence, rate=rate, torque=torque)


def _sinkage(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    """Return wheels whose sinkage stays the same, and the evidence without that."""
    sinkage = evidence.recording.sinkage
    if sinkage is None:
        return [], evidence
    at = evidence.seconds(sinkage)
    outcomes, left = _by_wheel(evidence, 'sinkage_frozen', sinkage.names, at, sinkage.sinkage)
    return outcomes, evidence.with_channel('sinkage', sinkage=left) if outcomes else evidence


def _by_wheel(
    evidence: Evidence, fault: str, names: Sequence[str], time: FloatArray, table: FloatArray
) -> tuple[list[Outcome], FloatArray]:
    """Return wheels whose readings (k, n) stay the same, and the readings without these."""
    size, left, dead = np.abs(table), table.copy(), dict[str, Stays]()
    greatest = float(np.nanmax(size, initial=0.0))
    for i, name in enumerate(names):
        still = stays(evidence, time, table[:, i : i + 1])
        if still is None:
            continue
        if fault == 'sinkage_frozen':  # 0 is right on firm ground
            others = np.nan_to_num(np.nanmedian(np.delete(size, i, axis=1), axis=0))
            counts = still.value != 0.0 or float(np.median(others)) > CLEAR_SINKAGE
        else:  # else a wheel that stands, or a drive at its limit
            alive = still.value == 0.0 and fault == 'rate_frozen'
            counts = abs(still.value) < greatest and not alive
        if counts:
            dead[name], left[still.rows, i] = still, np.nan
    if not dead:
        return [], left
    idle = fault == 'torque_frozen' and not any(still.value for still in dead.values())
    how = next(iter(dead.values())).how + (', or it is not driven' if idle else '')
    sure = 0.5 if idle else 0.97
    return [evidence.found(fault, sure, wheel=', '.join(dead), how=how)], left


class Stays(NamedTuple):
    """Where a reading stays: rows (k,), the longest time [s], its number (nan: of a vector)."""

    rows: Mask
    longest: float
    value: float

    @property
    def how(self) -> str:
        """In words."""
        if self.rows.all():
            same = 'is the same' if math.isnan(self.value) else f'is {self.value:g}'
            return f'{same} in every message while the wheels turn'
        return f'stays identical to the last digit for up to {self.longest:.1f} s of driving'


def stays(evidence: Evidence, time: FloatArray, values: FloatArray) -> Stays | None:
    """Return where readings (k, p) at times (k,) [s] stay, all p of a row; None: nowhere.

    A sensor may well read 0 for a while: a zero counts where nothing else is ever read, or for long
    of a vector that never repeats itself otherwise.
    """
    known = np.isfinite(values).all(axis=1)
    if known.sum() < LEAST_MESSAGES:
        return None
    at, readings = time[known], values[known]
    driving = np.interp(at, evidence.time, evidence.moving)
    speed = np.interp(at, evidence.time, np.abs(evidence.common_rate))
    same = (np.diff(readings, axis=0) == 0.0).all(axis=1)
    rows, longest, value = np.zeros(time.size, dtype=bool), 0.0, 0.0
    period = float(np.median(np.abs(np.diff(at))))
    for first, last in runs(same):
        share = float(driving[first:last].mean())
        lasts = share * (last - first) * period  # a gap is none
        beside = np.delete(same, np.s_[first:last])
        noisy = beside.size > LEAST_BESIDE and np.mean(beside) < SELDOM
        live = not readings[first].any() and bool(readings.any())
        live = live and not (noisy and values.shape[1] > 1 and lasts > ZERO_TIME)
        if live or lasts < LEAST_TIME:
            continue
        if np.interp(at[first:last], evidence.time, evidence.exactly_even).mean() > AT_ONCE:
            continue
        # One with steps shows no change of a speed that hardly changes.
        steps = beside.size > LEAST_BESIDE and not noisy
        if steps and np.ptp(speed[first:last]) < CALM * evidence.working_rate:
            continue
        others = np.delete(readings, np.s_[first : last + 1], axis=0)
        coarse = others.any() and max(np.unique(c).size for c in others.T) < min(
            FINE, len(others) // 2
        )
        lengths = np.diff(np.flatnonzero(~beside))
        usual = np.quantile(lengths, 0.9) if lengths.size >= LEAST_MESSAGES else 1.0
        lively = lengths.size >= LEAST_MESSAGES and usual <= MOST_STAYED
        needed = LEAST_NOISY if noisy else max(LEAST_MESSAGES, LONGER * usual)
        if (coarse and not lively) or share * (last - first) < needed:
            continue
        rows[np.flatnonzero(known)[first : last + 1]] = True
        if lasts > longest:
            longest, value = lasts, float(readings[first, 0]) if values.shape[1] == 1 else math.nan
    return Stays(rows, longest, value) if longest else None
