# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Stamps of wheels, IMU and reference against each other.

Turns are seen by wheels and gyro, starts and stops by wheels, accelerometer and reference. A lag is
found on one half of the drive and tried on the other; which sensor is off follows from the pairs
that agree, or from stamps that lie after their arrival.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.checks.evidence import Evidence
from wheel_terra_estimator.checks.faults import of_offset, untold
from wheel_terra_estimator.checks.finding import NotChecked, Outcome
from wheel_terra_estimator.checks.rover_facts import RoverFacts
from wheel_terra_estimator.checks.series import Channel, Recording, shifted
from wheel_terra_estimator.checks.statistics import (
    Trial,
    averaged,
    correlation,
    even_times,
    halves,
    moving_mean,
    without_drift,
    worst,
)
from wheel_terra_estimator.checks.transport import FUTURE

STEP = 0.05  # time between the values that are compared [s]
LONGEST = {'imu': 2.0, 'reference': 3.0}  # greatest lag that is looked for [s]
IN_A_DRIVE = 15.0  # length of a drive over the greatest lag that it tells [-]
LEAST_OFFSET = 0.2  # lags below this [s] are those of chassis, soil, jitter and filters of encoders
LEAST_FIT = {'turns': 0.75, 'starts': 0.3, 'speeds': 0.9}  # correlation at the lag, at least
FALLS = {'turns': 0.65, 'starts': 0.9, 'speeds': 0.75}  # unlike part with it, at most
LEAST_STD = {'turns': 0.15, 'starts': 0.15, 'speeds': 0.1}  # of chassis and filters [s]
APART = 0.2  # lags of two halves or motions that differ by less agree [s]
SIGMAS, SHARP_SIGMAS = 4.0, 10.0
BETWEEN = 0.25  # part of a period that a lag is not known to, one deviation [-]
SLOWEST = 1.5  # period above which nothing is said of the stamps [s]
SMOOTHED = 1.0  # speeds and turns are averaged over this to share a drive in halves [s]
SMOOTHING = 0.4  # speeds and accelerations are averaged over this [s]


class Lag(NamedTuple):
    """How late the second sensor's stamps are [s], by which motion, on halves, and its trial."""

    value: float
    by: str
    halves: tuple[float, float]
    trial: Trial

    @property
    def std(self) -> float:
        """Deviation by the halves [s]."""
        return max(0.5 * abs(self.halves[0] - self.halves[1]), 0.2 * STEP)

    @property
    def steady(self) -> bool:
        """Whether both halves of the drive show the same."""
        return 2.0 * self.std < APART

    def counts(self, evidence: Evidence, name: str) -> bool:
        """Whether it is a lag of a channel and stood its trial."""
        # Between the stamps of a reference nothing is known: two deviations.
        between = 2.0 * BETWEEN * _channel(evidence, name).period if name == 'reference' else 0.0
        clear = max(LEAST_OFFSET, 1.5 * evidence.period, between, SIGMAS * self.std)
        sharp = abs(self.value) > SHARP_SIGMAS * self.std  # what else is unlike, no stamp mends
        falls = self.trial.after < (1.0 if sharp else FALLS[self.by]) * self.trial.before
        return abs(self.value) > clear and falls

    def of_the_first(self) -> Lag:
        """Return how late the first sensor's stamps are."""
        return self._replace(value=-self.value, halves=(-self.halves[0], -self.halves[1]))


CHANNELS = {
    'joints': 'wheel_odometry',
    'wheel_odometry': 'wheel_odometry',
    'imu': 'imu',
    'reference': 'reference',
    'sinkage': 'sinkage',
}
"""Channel of a recording -> its name in ``sensors.*_stamp_offset``."""


def corrected(recording: Recording, facts: RoverFacts) -> Recording:
    """Return the recording with the stamp offsets of the rover file taken off."""
    changes: dict[str, Any] = {}
    for name, key in CHANNELS.items():
        channel = getattr(recording, name)
        offset = round(float(getattr(facts.sensors, f'{key}_stamp_offset')) * 1e9)
        if channel is not None and offset:
            changes[name] = shifted(channel, offset)
    return replace(recording, **changes) if changes else recording


def check_clocks(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    """Return which sensor's stamps are off, and the evidence with the reference on the wheels'."""
    told = {'imu': _of_imu(evidence), 'reference': _of_reference(evidence)}
    outcomes: list[Outcome] = [one for one in told.values() if isinstance(one, NotChecked)]
    lags = {name: one for name, one in told.items() if not isinstance(one, NotChecked)}
    for name, off in _blamed(evidence, lags).items():
        outcomes.append(_outcome(evidence, name, off))
    reference, velocity = lags.get('reference'), evidence.recording.reference
    if reference and velocity is not None and reference.counts(evidence, 'reference'):
        stamp = shifted(velocity, round(reference.value * 1e9)).stamp
        evidence = evidence.with_channel('reference', stamp=stamp)
    return outcomes, evidence


def _blamed(evidence: Evidence, lags: dict[str, Lag]) -> dict[str, Lag]:
    """Return the sensor whose stamps are off: the one that is off against both others."""
    late = {name: told for name, told in lags.items() if told.counts(evidence, name)}
    if len(late) == 2:
        imu, reference = late['imu'], late['reference']
        std = math.hypot(*(_whole_std(evidence, *told) for told in late.items()))
        if abs(imu.value - reference.value) < max(APART, 3.0 * std):
            return {'wheel_odometry': imu.of_the_first()}
        return late
    for name, told in late.items():
        other = next((lag for key, lag in lags.items() if key != name), None)
        if other is not None and other.steady:
            wheels = abs(other.value - told.value) < abs(other.value)
        else:
            wheels = _by_arrival(evidence, name, told.value)
        if wheels:
            return {'wheel_odometry': told.of_the_first()}
    return late


def _by_arrival(evidence: Evidence, name: str, late: float) -> bool:
    """Return whether the wheels' stamps lie off their arrival, not those of one ``late`` [s]."""
    channels = evidence.joints, _channel(evidence, name)
    own, others = (float(np.median(channel.late)) for channel in channels)
    if name == 'reference':  # its age is honest, that of wheels is none, nor is the future
        return abs(own - late) < abs(own) - 0.5 * abs(late) or own < FUTURE < others
    return abs(others) + abs(own - late) < abs(own) + abs(others + late)


def _whole_std(evidence: Evidence, name: str, told: Lag) -> float:
    """Return the deviation of a lag [s]; between two messages nothing is known of a change."""
    between = BETWEEN * max(evidence.period, _channel(evidence, name).period)
    return math.hypot(told.std, between, LEAST_STD[told.by])


def _channel(evidence: Evidence, name: str) -> Channel:
    channel: Channel = getattr(evidence.recording, 'joints' if name == 'wheel_odometry' else name)
    return channel


def _outcome(evidence: Evidence, name: str, told: Lag) -> Outcome:
    channel = _channel(evidence, name)
    if not told.steady:
        off = ' and '.join(f'{late:+.2f} s' for late in told.halves)
        return untold('delay', 'drifts', topic=channel.topic, off=off)
    std = _whole_std(evidence, name, told)
    against = told.by + told.trial.words('unlike part', '')
    told_of = of_offset(name, told.value, std, against, evidence.facts)
    return evidence.found(f'{name}_offset', 0.97, **told_of)


# Lags of pairs -----------------------------------------------------------------------------------


def _of_imu(evidence: Evidence) -> Lag | NotChecked:
    """Return how late the IMU is after the wheels; turns and accelerations must not contradict."""
    imu, difference = evidence.recording.imu, evidence.side_difference
    if imu is None or evidence.gyro is None:
        return untold('delay', 'no_imu')
    if evidence.period > SLOWEST:
        return untold('delay', 'seldom')
    time, at = even_times(evidence.time, STEP), evidence.seconds(imu)
    turned = started = None
    if np.isfinite(difference).any():
        yaw = averaged(at, (imu.rate @ evidence.rotation.T)[:, 2:3], time, 2 * STEP)[:, 0]
        wheels = _even(evidence, difference, time)
        wheels = wheels * np.sign(correlation(wheels, yaw) or 1.0)
        turned = lag_of(time, wheels, time, yaw, 'imu', 'turns')
    if evidence.force is not None and time.size > 2:
        width = round(SMOOTHING / STEP)
        speed = moving_mean(_even(evidence, evidence.rim, time), width)
        forward = averaged(at, (imu.force @ evidence.rotation.T)[:, :1], time, 2 * STEP)[:, 0]
        change = without_drift(np.gradient(speed, STEP), STEP)
        felt = without_drift(moving_mean(forward, width), STEP)
        started = lag_of(time, change, time, felt, 'imu', 'starts')
    best = turned or started
    if best is None:
        return untold('delay', 'no_turns')
    apart = 0.0 if turned is None or started is None else abs(turned.value - started.value)
    if started is not None and started.steady and apart > APART + 3.0 * best.std:
        return untold('delay', 'unlike', apart=apart)
    evidence.figures['imu.delay_s'] = round(best.value, 3)
    return best


def _of_reference(evidence: Evidence) -> Lag | NotChecked:
    """Return how late the reference is after the wheels, by starts and stops."""
    reference = evidence.recording.reference
    if reference is None or reference.stamp.size < 10:
        return untold('delay', 'no_reference')
    time, at = even_times(evidence.time, STEP), evidence.seconds(reference)
    order = np.argsort(at, kind='stable')
    forward, rim = reference.velocity[order, 0], _even(evidence, evidence.rim, time)
    slow = time.size < 2 or float(np.median(np.diff(at[order]))) > SLOWEST
    if slow or float(np.std(rim)) < 0.1 * float(np.abs(rim).mean() + 1e-9):
        return untold('delay', 'no_change')
    told = lag_of(time - STEP, rim, at[order], forward, 'reference', 'speeds')  # means up to then
    if told is None:
        return untold('delay', 'does_not_follow')
    evidence.figures['reference.delay_s'] = round(told.value, 3)
    return told


def _even(evidence: Evidence, values: FloatArray, time: FloatArray) -> FloatArray:
    return averaged(evidence.time, np.nan_to_num(values)[:, None], time, 2 * STEP)[:, 0]


def lag_of(
    time: FloatArray, first: FloatArray, at: FloatArray, second: FloatArray, of: str, by: str
) -> Lag | None:
    """Return by how much the second series lags the first; None where they are not alike.

    The halves share the changes of the motion evenly, wherever in the drive they are.
    """
    limit = min(LONGEST[of], float(time[-1] - time[0]) / IN_A_DRIVE)
    whole = lag(time, first, at, second, limit)
    if whole is None or whole[1] < LEAST_FIT[by]:
        return None
    calm = first if by == 'starts' else np.gradient(moving_mean(first, round(SMOOTHED / STEP)))
    parts = halves(np.interp(at, time, (calm - calm.mean()) ** 2))
    both = [lag(time, first, at[part], second[part], limit) for part in parts]
    if both[0] is None or both[1] is None:
        return None
    late = both[0][0], both[1][0]
    trials = []
    for part, other in zip(parts, late[::-1], strict=True):
        left = [
            1.0 - _fits(np.interp(at[part] - off, time, first)[None], second[part])[0]
            for off in (0.0, other)
        ]
        trials.append(Trial(*left))
    return Lag(whole[0], by, late, worst(trials))


def lag(
    time: FloatArray, first: FloatArray, at: FloatArray, second: FloatArray, limit: float
) -> tuple[float, float] | None:
    """Return how much later a series at ``at`` is than one on an even grid [s], and their fit then.

    The first is read where the second was measured, never the second in between. None: nothing to
    correlate, or it is too short for lags up to ``limit`` [s].
    """
    if time.size < 2 or not at.size or at[-1] - at[0] < 6.0 * limit:
        return None
    step = float(np.median(np.diff(time)))
    reach = max(round(limit / step), 1)
    inner = (at >= time[0] + reach * step) & (at <= time[-1] - reach * step)
    at, second = at[inner], second[inner]
    if at.size < 3 or not first.std() or not second.std():
        return None
    shifts = step * np.arange(-reach, reach + 1)
    fits = _fits(np.interp(at - shifts[:, None], time, first), second)
    peak, offset = int(np.argmax(fits)), 0.0
    if 0 < peak < fits.size - 1:  # top of a parabola through three points
        left, middle, right = fits[peak - 1 : peak + 2]
        bend = left - 2.0 * middle + right
        offset = 0.5 * float(left - right) / float(bend) if bend else 0.0
    return step * (peak + offset - reach), float(fits[peak])


def _fits(table: FloatArray, second: FloatArray) -> FloatArray:
    """Return the correlation of each of (m, k) series with a series (k,)."""
    table = table - table.mean(axis=1, keepdims=True)
    second = second - second.mean()
    energy = (table**2).sum(axis=1) * float(second @ second)
    return np.asarray(table @ second / np.sqrt(np.maximum(energy, 1e-300)))
