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
from numpy.typing import NDArray

from wheel_terra_estimator.checks.evidence import Evidence
from wheel_terra_estimator.checks.faults import found
from wheel_terra_estimator.checks.finding import NotChecked, Outcome
from wheel_terra_estimator.checks.series import Channel, Recording
from wheel_terra_estimator.checks.statistics import (
    averaged,
    correlation,
    even_times,
    lag,
    moving_mean,
)
from wheel_terra_estimator.checks.trial import Trial
from wheel_terra_estimator.configuration.configuration import Configuration

FloatArray = NDArray[np.float64]

STEP = 0.05
"""Time between the values that are compared [s]."""
LONGEST = {'imu': 2.0, 'reference': 3.0}
"""Greatest lag that is looked for [s]."""
LEAST_OFFSET = {'imu': 0.3, 'reference': 0.25}
"""Lags below this [s] are those of chassis, soil, jitter and filters of encoders."""
LEAST_PERIODS = 0.5
"""The same in periods of the reference: between its stamps nothing is known."""
LEAST_FIT = {'turns': 0.75, 'starts': 0.3, 'speeds': 0.9}
"""Correlation with the lag taken off, from which it is told [-]."""
FALLS = {'turns': 0.75, 'starts': 0.97, 'speeds': 0.9}
"""Unlike part on the other half with the lag taken off over that without, at most [-]: an
accelerometer is noisy, a slow reference ragged."""
APART = 0.2
"""Lags of two halves or of two kinds of motion that differ by less agree [s]; also 3 deviations."""
SIGMAS = 4.0
BETWEEN = 0.25
"""Part of a period that a lag is not known to, one deviation [-]."""
SLOWEST = 1.5
"""Period of a reference [s] above which nothing is said of its stamps."""
FUTURE = -0.1
"""Arrival less stamp that no message has [s]."""
SMOOTHING = 0.4
"""Speeds and accelerations are averaged over this [s]."""
DRIFT = 6.0
"""Slopes change more slowly than this [s], speeds faster."""


class Lag(NamedTuple):
    """How late the second sensor's stamps are [s], by which motion, and what the trial showed."""

    value: float
    std: float
    by: str
    trial: Trial
    halves: tuple[float, float]

    @property
    def steady(self) -> bool:
        """Whether both halves of the drive show the same."""
        return abs(self.halves[0] - self.halves[1]) < max(APART, 3.0 * self.std)

    def counts(self, least: float) -> bool:
        """Whether it is a lag and stood its trial."""
        return (
            abs(self.value) > max(least, SIGMAS * self.std)
            and self.trial.after < FALLS[self.by] * self.trial.before
        )


def corrected(recording: Recording, configuration: Configuration | None) -> Recording:
    """Return the recording with the stamp offsets of the rover file taken off."""
    if configuration is None:
        return recording
    sensors = configuration.sensors
    changes: dict[str, Any] = {}
    for name, key in (
        ('joints', 'wheel_odometry'),
        ('wheel_odometry', 'wheel_odometry'),
        ('imu', 'imu'),
        ('reference', 'reference'),
        ('sinkage', 'sinkage'),
    ):
        channel = getattr(recording, name)
        offset = round(float(getattr(sensors, f'{key}_stamp_offset')) * 1e9)
        if channel is not None and offset:
            changes[name] = shifted(channel, offset)
    return replace(recording, **changes) if changes else recording


def shifted(channel: Any, offset: int) -> Any:
    """Return a channel with an offset [ns] taken off its stamps; 0 stays no stamp."""
    return replace(channel, stamp=np.where(channel.stamp > 0, channel.stamp - offset, 0))


def check_clocks(evidence: Evidence, figures: dict[str, Any]) -> tuple[list[Outcome], Evidence]:
    """Return which sensor's stamps are off, and the evidence with the reference on the wheels'."""
    outcomes: list[Outcome] = []
    told = _of_imu(evidence, figures), _of_reference(evidence, figures)
    outcomes += [one for one in told if isinstance(one, NotChecked)]
    imu, reference = (None if isinstance(one, NotChecked) else one for one in told)
    late_imu = imu is not None and imu.counts(_least(evidence, 'imu'))
    late_reference = reference is not None and reference.counts(_least(evidence, 'reference'))
    blame = _blamed(evidence, imu, reference, late_imu, late_reference)
    for name, offset in blame.items():
        outcomes.append(_outcome(evidence, name, offset))
    velocity = evidence.reference()
    if late_reference and reference is not None and velocity is not None:
        on_wheels = shifted(velocity, round(reference.value * 1e9))
        evidence = replace(evidence, recording=replace(evidence.recording, reference=on_wheels))
    return outcomes, evidence


def _least(evidence: Evidence, name: str) -> float:
    least = max(LEAST_OFFSET[name], 1.5 * evidence.period)
    if name == 'reference' and (reference := evidence.reference()) is not None:
        least = max(least, LEAST_PERIODS * _period(reference))
    return least


def _blamed(
    evidence: Evidence,
    imu: Lag | None,
    reference: Lag | None,
    late_imu: bool,
    late_reference: bool,
) -> dict[str, Lag]:
    """Return the sensor whose stamps are off: the one that is off against both others."""
    if late_imu and late_reference and imu is not None and reference is not None:
        if abs(imu.value - reference.value) < max(APART, 3.0 * (imu.std + reference.std)):
            return {'wheel_odometry': _against_wheels(imu)}
        return {'imu': imu, 'reference': reference}
    joints = evidence.recording.joints
    wheels_ahead = joints is not None and arrival(joints) < FUTURE
    blamed: dict[str, Lag] = {}
    for name, told, late, other in (
        ('imu', imu, late_imu, reference),
        ('reference', reference, late_reference, imu),
    ):
        if not late or told is None:
            continue
        both = other is not None and abs(other.value - told.value) < abs(other.value)
        if told.value < 0.0 and (both or (other is None and wheels_ahead)):
            blamed['wheel_odometry'] = _against_wheels(told)
        else:
            blamed[name] = told
    return blamed


def _against_wheels(told: Lag) -> Lag:
    first, second = told.halves
    return told._replace(value=-told.value, halves=(-first, -second))


def _outcome(evidence: Evidence, name: str, told: Lag) -> Outcome:
    recording = evidence.recording
    channel = getattr(recording, 'joints' if name == 'wheel_odometry' else name)
    if not told.steady:
        return NotChecked(
            'delay',
            f'{channel.topic}: its stamps run {told.halves[0]:+.2f} s off in the first half of the '
            f'drive and {told.halves[1]:+.2f} s in the second: the clocks drift; synchronise them '
            '(chrony, PTP)',
        )
    configuration = evidence.facts.configuration
    stated = getattr(configuration.sensors, f'{name}_stamp_offset') if configuration else 0.0
    value = told.value + float(stated)
    # Between two messages nothing is known of a change.
    std = math.hypot(told.std, BETWEEN * max(evidence.period, _period(channel)))
    return found(
        f'{name}_offset',
        channel.topic,
        0.97,
        value=round(value, 3),
        std=round(std, 3),
        channel=name,
        offset=value,
        offset_left=told.value,
        against=told.by + told.trial.words('unlike part', ''),
    )


def arrival(channel: Channel) -> float:
    """Return the usual time from stamp to log time [s]."""
    return float(np.median(channel.log_time - channel.stamp)) * 1e-9


def _period(channel: Channel) -> float:
    return float(np.median(np.abs(np.diff(channel.stamp)))) * 1e-9


# Lags of pairs -----------------------------------------------------------------------------------


def _of_imu(evidence: Evidence, figures: dict[str, Any]) -> Lag | NotChecked:
    """Return how late the IMU is after the wheels; turns and accelerations must not contradict."""
    imu, difference = evidence.recording.imu, evidence.side_difference
    if imu is None or evidence.gyro is None:
        return NotChecked('delay', 'IMU against wheels: no IMU')
    time = even_times(evidence.time, STEP)
    at = np.asarray((imu.stamp - evidence.origin) * 1e-9, dtype=np.float64)
    turned = None
    if np.isfinite(difference).any():
        yaw = averaged(at, (imu.rate @ evidence.rotation.T)[:, 2:3], time, 2 * STEP)[:, 0]
        wheels = _even(evidence, difference, time)
        wheels = wheels * np.sign(correlation(wheels, yaw) or 1.0)
        turned = _lag_of(time, wheels, yaw, LONGEST['imu'], 'turns')
    started = None
    if evidence.force is not None and time.size > 2:
        width = round(SMOOTHING / STEP)
        speed = moving_mean(_even(evidence, evidence.rim, time), width)
        forward = averaged(at, (imu.force @ evidence.rotation.T)[:, :1], time, 2 * STEP)[:, 0]
        change = _without_drift(np.gradient(speed, STEP))
        felt = _without_drift(moving_mean(forward, width))
        started = _lag_of(time, change, felt, LONGEST['imu'], 'starts')
    told = [one for one in (turned, started) if one is not None]
    if not told:
        reason = 'IMU against wheels: no clear turns in it; drive a circle'
        return NotChecked('delay', reason)
    best = told[0]
    figures['imu.delay_s'] = round(best.value, 3)
    figures['imu.delay_std_s'] = round(best.std, 3)
    if turned is not None and started is not None and started.steady:
        apart = abs(turned.value - started.value)
        if apart > max(APART, 3.0 * math.hypot(turned.std, started.std)):
            return NotChecked(
                'delay',
                f'IMU against wheels: turns are {turned.value:+.2f} s apart, starts and stops '
                f'{started.value:+.2f} s: no offset of stamps does that',
            )
    return best


def _of_reference(evidence: Evidence, figures: dict[str, Any]) -> Lag | NotChecked:
    """Return how late the reference is after the wheels, by starts and stops."""
    reference = evidence.reference()
    if reference is None or reference.stamp.size < 10:
        return NotChecked('delay', 'no reference velocity in it (visual odometry, GNSS)')
    time = even_times(evidence.time, STEP)
    at = (reference.stamp - evidence.origin) * 1e-9
    order = np.argsort(at, kind='stable')
    period = float(np.median(np.diff(at[order])))
    rim = _even(evidence, evidence.rim, time)
    forward = reference.velocity[order, 0].copy()
    beside = np.stack([forward[:-2], forward[1:-1], forward[2:]])
    forward[1:-1] = np.median(beside, axis=0)  # a single wild reading is none
    speed = np.interp(time, at[order], forward)
    # Between its stamps the reference is a straight line: the rims are smoothed as much.
    for _ in range(2):
        rim = moving_mean(rim, round(min(period, SLOWEST) / STEP))
    if period > SLOWEST or float(np.std(rim)) < 0.1 * float(np.abs(rim).mean() + 1e-9):
        return NotChecked('delay', 'reference: hardly a change of speed in it; stop and go')
    told = _lag_of(time, rim, speed, LONGEST['reference'], 'speeds')
    if told is None:
        return NotChecked('delay', 'reference: does not follow the wheels closely enough')
    figures['reference.delay_s'] = round(told.value, 3)
    figures['reference.delay_std_s'] = round(told.std, 3)
    return told


def _even(evidence: Evidence, values: FloatArray, time: FloatArray) -> FloatArray:
    return averaged(evidence.time, np.nan_to_num(values)[:, None], time, 2 * STEP)[:, 0]


def _without_drift(values: FloatArray) -> FloatArray:
    return np.asarray(values - moving_mean(values, round(DRIFT / STEP)))


def _lag_of(
    time: FloatArray, first: FloatArray, second: FloatArray, limit: float, by: str
) -> Lag | None:
    """Return by how much the second series lags the first; None where they are not alike.

    The halves share the motion evenly, wherever in the drive it is.
    """
    whole = lag(time, first, second, limit)
    if whole is None or whole.fit < LEAST_FIT[by]:
        return None
    busy = np.cumsum((first - first.mean()) ** 2)
    middle = int(np.searchsorted(busy, 0.5 * busy[-1]))
    parts = slice(0, middle), slice(middle, time.size)
    seen = [lag(time[part], first[part], second[part], limit) for part in parts]
    if seen[0] is None or seen[1] is None:
        return None
    a, b = seen[0], seen[1]
    trials = [
        _tried(time[part], first[part], second[part], other.value)
        for part, other in zip(parts, (b, a), strict=True)
    ]
    worst = max(trials, key=lambda t: t.after / max(t.before, 1e-12))
    std = max(whole.std, 0.5 * abs(a.value - b.value))
    return Lag(whole.value, std, by, worst, (a.value, b.value))


def _tried(time: FloatArray, first: FloatArray, second: FloatArray, late: float) -> Trial:
    """Return the unlike part without and with a lag taken off the second series."""
    moved = np.interp(time + late, time, second)
    return Trial(_unlike(first, second), _unlike(first, moved))


def _unlike(first: FloatArray, second: FloatArray) -> float:
    return 1.0 - correlation(first - first.mean(), second - second.mean())
