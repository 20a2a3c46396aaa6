# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Stamps of wheels, IMU and reference against each other.

Turns are seen by wheels and gyro, starts and stops by wheels, accelerometer and reference. A lag is
found on one half of the drive and tried on the other; which sensor is off follows from the pairs
that agree, or from stamps that lie after their arrival.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any, NamedTuple

import numpy as np

from wheel_terra_estimator.arrays import FloatArray, IntArray
from wheel_terra_estimator.checks.evidence import Evidence
from wheel_terra_estimator.checks.finding import (
    LEAST_TURN_RATE,
    NotChecked,
    Outcome,
    found,
    not_checked,
    of_offset,
)
from wheel_terra_estimator.checks.rover_facts import RoverFacts
from wheel_terra_estimator.checks.series import (
    Channel,
    Recording,
    Series,
    of_one_wheel,
    rows_of,
    shifted,
)
from wheel_terra_estimator.checks.statistics import (
    Trial,
    averaged,
    correlation,
    even_times,
    halves,
    moving_mean,
    robust_std,
    without_drift,
    worst,
)

STEP = 0.05  # time between the values that are compared [s]
LONGEST = {'turns': 2.0, 'starts': 2.0, 'speeds': 3.0}  # greatest lag that is looked for [s]
IN_A_DRIVE = 15.0  # length of a drive over the greatest lag found from it [-]
LEAST_OFFSET = 0.2  # lags below this [s] are those of chassis, soil, jitter and filters of encoders
LEAST_FIT = {'turns': 0.75, 'starts': 0.3, 'speeds': 0.9}  # correlation at the lag, at least
BY_LOG = 'log time'
SMOOTHED_BY = 'reference.smoothed_s'  # figure: such a velocity shows no scale
SMOOTH = 0.02  # unlike part that a lag leaves of speeds that are made smooth, beside noise [-]
FALLS = {'turns': 0.65, 'starts': 0.9, 'speeds': 0.75}  # unlike part, at most
LEAST_STD = {'turns': 0.15, 'starts': 0.15, 'speeds': 0.1, BY_LOG: 0.5}
"""Deviation of a lag by chassis and filters; log time leaves the age of a velocity open [s]."""
CHASSIS_SIGMAS = 2.5  # of these, up to which a lag may be theirs (a Husky turns 0.28 s late)
AGREEING_LAGS = 0.2  # lags of two halves or motions that differ by less agree [s]
SIGMAS, SHARP_SIGMAS = 4.0, 10.0
SHARP_FALLS = 0.9  # unlike part of a lag that both halves show alike, at most [-]
BETWEEN = 0.25  # part of a period that a lag is not known to, one deviation [-]
MANY = 60  # references from which it is averaged over starts and stops
SLOWEST = 1.5  # period above which stamps are not checked [s]
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
        return 2.0 * self.std < AGREEING_LAGS

    def counts(self, evidence: Evidence, name: str) -> bool:
        """Whether it is a lag of a channel and stood its trial."""
        # Uncertainty between the stamps of a reference; it averages out over many of them.
        reference = _channel(evidence, name) if name == 'reference' else None
        between = BETWEEN * reference.period if reference is not None else 0.0
        between *= SIGMAS if reference is not None and reference.stamp.size < MANY else 2.0
        clear = max(LEAST_OFFSET, evidence.period, between, SIGMAS * self.std)
        sharp = abs(self.value) > SHARP_SIGMAS * self.std  # what else is unlike, no stamp mends
        falls = self.trial.after < (SHARP_FALLS if sharp else FALLS[self.by]) * self.trial.before
        return abs(self.value) > clear and falls

    def of_the_first(self) -> Lag:
        """Return how late the first sensor's stamps are."""
        return self._replace(value=-self.value, halves=(-self.halves[0], -self.halves[1]))


STAMPED = ('joints', 'wheel_odometry', 'imu', 'reference', 'sinkage')
"""Channels of a recording whose stamps have an offset."""


def corrected(recording: Recording, facts: RoverFacts) -> Recording:
    """Return the channels that hold a message, with the stamp offsets of the rover file off."""
    changes: dict[str, Any] = {}
    for name in STAMPED:
        channel, key = getattr(recording, name), 'wheel_odometry' if name == 'joints' else name
        offset = round(float(getattr(facts.sensors, f'{key}_stamp_offset')) * 1e9)
        if channel is not None and not channel.stamp.size:
            changes[name] = None
        elif channel is not None and offset:
            changes[name] = shifted(channel, offset)
    return replace(recording, **changes) if changes else recording


def check_clocks(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    """Return which sensor's stamps are off, and the evidence with the reference on the wheels'."""
    found = {'imu': _of_imu(evidence), 'reference': _of_reference(evidence)}
    by_log = _moved(evidence, 'imu') - _moved(evidence, 'joints')
    if by_log and isinstance(found['imu'], NotChecked):
        found['imu'] = _lag_by_log(by_log)
    outcomes: list[Outcome] = [one for one in found.values() if isinstance(one, NotChecked)]
    lags = {name: one for name, one in found.items() if not isinstance(one, NotChecked)}
    late = _late_channels(evidence, lags)
    for name, off in late.items():
        if abs(off.value) <= MOST_OFFSET:  # else another clock
            outcomes.append(_outcome(evidence, name, off, 'imu' in lags))
    for name, lag in lags.items():
        if not late and abs(lag.value) > LEAST_OFFSET:
            topic = _channel(evidence, name).topic
            outcomes.append(not_checked('delay', 'open', topic=topic, off=lag.value))
    outcomes += _too_late(evidence, {name: off.value for name, off in late.items()})
    reference, velocity = lags.get('reference'), evidence.recording.reference
    if reference and velocity is not None and reference.counts(evidence, 'reference'):
        left = reference.value + _moved(evidence, 'joints')
        stamp = shifted(velocity, round(left * 1e9)).stamp
        evidence = evidence.with_channel('reference', stamp=stamp)
        forward = velocity.velocity[:, 0]
        noise = 0.5 * robust_std(np.diff(forward)) ** 2 / max(float(np.var(forward)), 1e-12)
        if not reference.steady or reference.trial.after - noise > SMOOTH:
            evidence.figures[SMOOTHED_BY] = round(reference.value, 2)
    return outcomes, evidence


def _too_late(evidence: Evidence, off: dict[str, float]) -> list[Outcome]:
    """Return inputs that the estimator gets too late, but for those whose stamps are ``off``."""
    own = _late(evidence, 'joints', NEARLY_ALL) + off.get('wheel_odometry', 0.0)
    outcomes, history = list[Outcome](), evidence.facts.configuration.history
    for name in ('imu', 'sinkage', 'reference'):
        if name in off:
            continue
        late = _late(evidence, name, NEARLY_ALL) - own
        if history < late < MOST_LATE:
            topic, value = _channel(evidence, name).topic, float(math.ceil(1.5 * late))
            finding = found('too_late', topic, 0.9, value=value, late=late, history=history)
            outcomes.append(finding)
    return outcomes


def _moved(evidence: Evidence, name: str) -> float:
    """Return the correction of the stamps of a channel by log time [s]."""
    return evidence.recording.moved.get(name, 0.0)


def _late(evidence: Evidence, name: str, share: float = 0.5) -> float:
    """Return the log time less stamp of a channel as it was sent [s]; nan: not known.

    That of a ``share`` of its messages is smaller.
    """
    channel: Channel | None = getattr(evidence.recording, name)
    if channel is None or not channel.late.size:
        return math.nan
    return float(np.quantile(channel.late, share)) - _moved(evidence, name)


def _lag_by_log(late: float) -> Lag:
    return Lag(late, BY_LOG, (late, late), Trial(1.0, 0.0))


def _late_channels(evidence: Evidence, lags: dict[str, Lag]) -> dict[str, Lag]:
    """Return the sensor whose stamps are off: the one that is off against both others."""
    late = {name: lag for name, lag in lags.items() if lag.counts(evidence, name)}
    if len(late) == 2:
        imu, reference = late['imu'], late['reference']
        std = math.hypot(*(_whole_std(evidence, *lag) for lag in late.items()))
        if abs(imu.value - reference.value) < max(AGREEING_LAGS, 3.0 * std):
            return {'wheel_odometry': min(imu, reference, key=lambda lag: lag.std).of_the_first()}
        return late
    for name, lag in late.items():
        other = next((lag for key, lag in lags.items() if key != name), None)
        off = 0.0 if other is None else abs(other.value) - abs(other.value - lag.value)
        if other is not None and other.steady and abs(off) > 2.0 * LEAST_STD[other.by]:
            wheels = off > 0.0
        else:
            wheels = _by_arrival(evidence, name, lag)
        if wheels:
            return {'wheel_odometry': lag.of_the_first()}
    return late


def _by_arrival(evidence: Evidence, name: str, lag: Lag) -> bool:
    """Return whether the wheels' stamps lie off their arrival, not those of another channel."""
    own, others, late = _late(evidence, 'joints'), _late(evidence, name), lag.value
    # One of them would come before it was measured.
    least = FUTURE - math.hypot(lag.std, LEAST_STD[lag.by])
    impossible = others > 0.0 and others + late < least, own > 0.0 and own - late < least
    if any(impossible):
        return impossible[0]
    if name == 'reference':  # its age is real; that of wheels is not, nor are future stamps
        return abs(own - late) < abs(own) - 0.5 * abs(late) or own < FUTURE < others
    return abs(others) + abs(own - late) < abs(own) + abs(others + late)


def _whole_std(evidence: Evidence, name: str, lag: Lag) -> float:
    """Return the deviation of a lag [s], with the time between two messages."""
    between = BETWEEN * max(evidence.period, _channel(evidence, name).period)
    return math.hypot(lag.std, between, LEAST_STD[lag.by])


def _channel(evidence: Evidence, name: str) -> Channel:
    channel: Channel = getattr(evidence.recording, 'joints' if name == 'wheel_odometry' else name)
    return channel


def _outcome(evidence: Evidence, name: str, lag: Lag, by_imu: bool) -> Outcome:
    channel = _channel(evidence, name)
    if not lag.steady:
        off = ' and '.join(f'{late:+.2f} s' for late in lag.halves)
        return not_checked('delay', 'drifts', topic=channel.topic, off=off)
    std = _whole_std(evidence, name, lag)
    in_future = lag.value > 0.0 and float(np.median(channel.late)) < FUTURE
    against, sure, alternative = lag.by + lag.trial.words('unlike part', ''), 0.97, ''
    if lag.by == BY_LOG:
        against = 'log time: two clocks'
        if -LONGEST_WAY < lag.value < 0.0:
            alternative = ', or its messages come late'
    elif abs(lag.value) < CHASSIS_SIGMAS * LEAST_STD[lag.by] and not in_future:
        alternative = ', or chassis, soil or filters lag so much'
    elif name == 'reference' and lag.value < 0.0 and not by_imu:
        alternative = ', or those of the wheels are too late: drive circles'
    if alternative:
        against, sure = f'{against}{alternative}', 0.5
    details = of_offset(name, lag.value, std, against, evidence.facts)
    return evidence.found(f'{name}_offset', sure, **details)


# Lags of pairs -----------------------------------------------------------------------------------


def _of_imu(evidence: Evidence) -> Lag | NotChecked:
    """Return how late the IMU is after the wheels; turns and accelerations must not contradict."""
    imu, difference = evidence.recording.imu, evidence.side_difference
    if imu is None or evidence.gyro is None:
        return not_checked('delay', 'no_imu')
    if evidence.period > SLOWEST:
        return not_checked('delay', 'seldom')
    time, at = even_times(evidence.time, STEP), evidence.seconds(imu)
    by_log = _moved(evidence, 'imu') - _moved(evidence, 'joints')
    near = max(SMOOTHING, 2.0 * imu.period)  # what lies in a gap between two readings is neither's
    readings = (np.searchsorted(np.sort(at), time + by) for by in (near, -near))
    there = np.subtract(*readings) > 0

    def after(first: FloatArray, second: FloatArray, by: str) -> Lag | None:
        sent, seen = (time + by_log)[there], second[there]
        around = [lag_of(time, first, sent, seen, by, log) for log in {by_log, 0.0}]
        return min(filter(None, around), key=lambda one: one.trial.after, default=None)

    turned = started = None
    if np.isfinite(difference).any():
        yaw = averaged(at, (imu.rate @ evidence.rotation.T)[:, 2:3], time, 2 * STEP)[:, 0]
        wheels = _even(evidence, difference, time)
        # As the gyro was mended; at no lag the motion may well look reversed.
        yaw = yaw * np.sign(correlation(_even(evidence, evidence.gyro[:, 2], time), yaw) or 1.0)
        turns = np.abs(moving_mean(yaw - np.median(yaw), round(SMOOTHED / STEP)))
        if np.quantile(turns, 0.98) > LEAST_TURN_RATE:  # else a body rocks, or a driver corrects
            turned = after(wheels, yaw, 'turns')
    if evidence.force is not None and time.size > 2:
        width = round(SMOOTHING / STEP)
        speed = moving_mean(_even(evidence, evidence.rim, time), width)
        forward = averaged(at, (imu.force @ evidence.rotation.T)[:, :1], time, 2 * STEP)[:, 0]
        change = without_drift(np.gradient(speed, STEP), STEP)
        felt = without_drift(moving_mean(forward, width), STEP)
        started = after(change, felt, 'starts')
    best = turned or started
    if best is None:
        return not_checked('delay', 'no_turns', limit=round(_longest('turns', time), 1))
    apart = 0.0 if turned is None or started is None else abs(turned.value - started.value)
    if started is not None and started.steady and apart > AGREEING_LAGS + 3.0 * best.std:
        return not_checked('delay', 'unlike', apart=apart)
    evidence.figures['imu.delay_s'] = round(best.value, 3)
    return best


def _of_reference(evidence: Evidence) -> Lag | NotChecked:
    """Return how late the reference is after the wheels, by starts and stops."""
    reference = evidence.recording.reference
    if reference is None or reference.stamp.size < 10:
        return not_checked('delay', 'no_reference')
    time, at = even_times(evidence.time, STEP), evidence.seconds(reference)
    order = np.argsort(at, kind='stable')
    forward, rim = reference.velocity[order, 0], _even(evidence, evidence.rim, time)
    slow = time.size < 2 or float(np.median(np.diff(at[order]))) > SLOWEST
    if slow or float(np.std(rim)) < 0.1 * float(np.abs(rim).mean() + 1e-9):
        return not_checked('delay', 'no_change')

    def around(near: float) -> Lag | None:  # means are those up to a time
        sent = at[order] - _moved(evidence, 'joints')
        return lag_of(time - STEP, rim, sent, forward, 'speeds', near)

    own, wheels = _late(evidence, 'reference'), _late(evidence, 'joints')
    by_log = wheels - own
    lag = around(0.0) or (around(by_log) if abs(by_log) > CLOCK_DIFFERENCE else None)
    if lag is None and own < -CLOCK_DIFFERENCE < wheels:  # the future, whatever the speeds are
        lag = _lag_by_log(by_log)
    if lag is None:
        return not_checked('delay', 'does_not_follow', limit=LONGEST['speeds'])
    evidence.figures['reference.delay_s'] = round(lag.value, 3)
    return lag


def _even(evidence: Evidence, values: FloatArray, time: FloatArray) -> FloatArray:
    return averaged(evidence.time, np.nan_to_num(values)[:, None], time, 2 * STEP)[:, 0]


def _longest(by: str, time: FloatArray) -> float:
    """Return the greatest lag that is looked for in a drive [s]."""
    return min(LONGEST[by], float(time[-1] - time[0]) / IN_A_DRIVE)


def lag_of(
    time: FloatArray, first: FloatArray, at: FloatArray, second: FloatArray, by: str, log: float
) -> Lag | None:
    """Return by how much the second series lags the first; None where they are not alike.

    Lags are looked for around ``log`` [s], as given by log time where it is far from 0.
    The halves share the changes of the motion evenly, wherever in the drive they are.
    """
    limit = _longest(by, time)
    at = at - log
    lag = lags(time, first, at, second, limit)
    whole = lag(slice(0, at.size))
    if whole is None or whole[1] < LEAST_FIT[by]:
        return None
    calm = first if by == 'starts' else np.gradient(moving_mean(first, round(SMOOTHED / STEP)))
    parts = halves(np.interp(at, time, (calm - calm.mean()) ** 2))
    both = [lag(part) for part in parts]
    if both[0] is None or both[1] is None:
        return None
    late = both[0][0], both[1][0]
    trials = []
    for part, other in zip(parts, late[::-1], strict=True):
        left = [
            1.0 - _fits(np.interp(at[part] - off, time, first)[None], second[part])[0]
            for off in (-log, other)
        ]
        trials.append(Trial(*left))
    return Lag(log + whole[0], by, (log + late[0], log + late[1]), worst(trials))


def lags(
    time: FloatArray, first: FloatArray, at: FloatArray, second: FloatArray, limit: float
) -> Callable[[slice], tuple[float, float] | None]:
    """Return a function of rows: lag of a series at ``at`` behind one on an even grid [s], and fit.

    The first is interpolated where the second was measured, never the second in between. None:
    nothing to correlate, too short for lags up to ``limit`` [s], or a lag beyond it.
    """
    if time.size < 2:
        return lambda _: None
    step = float(np.median(np.diff(time)))
    reach = max(round(limit / step), 1)
    inner = (at >= time[0] + reach * step) & (at <= time[-1] - reach * step)
    known, shifts = np.flatnonzero(inner), step * np.arange(-reach, reach + 1)
    table = np.interp(at[known] - shifts[:, None], time, first)

    def lag(part: slice) -> tuple[float, float] | None:
        there, rows = at[part], slice(*np.searchsorted(known, (part.start, part.stop)))
        values = second[known[rows]]
        short = not there.size or there[-1] - there[0] < 6.0 * limit
        if short or values.size < 3 or not first.std() or not values.std():
            return None
        fits = _fits(table[:, rows], values)
        peak = int(np.argmax(fits))
        if not 0 < peak < fits.size - 1:
            return None
        left, middle, right = fits[peak - 1 : peak + 2]  # top of a parabola
        bend = left - 2.0 * middle + right
        offset = 0.5 * float(left - right) / float(bend) if bend else 0.0
        return step * (peak + offset - reach), float(fits[peak])

    return lag


def _fits(table: FloatArray, second: FloatArray) -> FloatArray:
    """Return the correlation of each of (m, k) series with a series (k,)."""
    table = table - table.mean(axis=1, keepdims=True)
    second = second - second.mean()
    energy = (table**2).sum(axis=1) * float(second @ second)
    return np.asarray(table @ second / np.sqrt(np.maximum(energy, 1e-300)))


# Stamps against arrival ---------------------------------------------------------------------------

CHECKED = {'joints': 'rate', 'imu': 'force', 'sinkage': 'sinkage', 'reference': 'velocity'}
"""Channels and what they measure."""
PERIODS = (2e-4, 5.0)  # between messages of wheel rates [s]
USUAL_PERIODS = (2e-3, 2.0)  # the same in the right unit [s]
TIME_UNITS = (
    ('milliseconds', 's', 1e-3),
    ('s', 'milliseconds', 1e3),
    ('microseconds', 's', 1e-6),
    ('nanoseconds', 's', 1e-9),
)
"""Unit of times, the one that they were taken for, and the first over the second [-]."""
LONGEST_SILENCE = 5.0  # of an input at an end of a recording in which others come [s]
LONGEST_GAP = 0.5  # of wheel odometry or IMU that leaves the estimator no blind spot [s]
GAP_PERIODS = 6.0  # A gap also has to be longer than so many periods
GAP_SHARE = 0.05  # share of missing messages of a stuttering channel
PAUSE = 5.0  # between bursts, over the median step, at least [-]
IN_PAUSES = 0.8  # share of the time that passes between bursts, at least [-]
LEAST_BURSTS, LEAST_IN_A_BURST = 10, 3
READ_AT_ONCE, READ_SHARE = 2e6, 0.1  # step within a burst [ns], over the period: less than this
LONGEST_WAIT = 2.0  # for a burst, over the median; beyond it is a pause, or a step of the clock
SHORT = 0.1  # share of the steps between messages that are shorter than a usual short one [-]
IN_A_ROW = 0.2  # share of the steps over which two messages or more are lost, at least [-]
SEVERAL = 10  # messages over which a period is taken where stamps jitter
OFF_PERIOD, REGULAR = 0.2, 0.6
"""Distance of a step from a multiple of the period, as a share of it, and the share of steps nearer
than that (0.4 by chance) below which stamps jitter [-]."""
BACKWARD_SHARE = 0.05  # share of stamps before that of an earlier arrival, at most [-]
FAR_BACK = 1.0  # A stamp that goes back by more than this [s] is out of order by itself
MOST_STEPS = 5  # of a clock that is set; more are of another kind and stay
FUTURE = -0.1  # arrival less stamp that no message has [s]
MOST_OFFSET = 1e4  # offset that a rover file may state, either way [s]
ARRIVAL_STD = 0.05  # difference of arrivals of two sensors, one deviation [s]
NEARLY_ALL = 0.9  # share of the messages of an input that must not be too late [-]
MOST_LATE = 40.0  # beyond which a longer history is no remedy [s]
QUARTERS, UNEVEN = 4, 0.5  # parts of a drive; unlike gains of a drift over their mean, at most [-]
CLOCK_DIFFERENCE = 1.0  # of log time less stamp of two topics, at most [s]
LONGEST_WAY = 10.0  # of a message into the log [s]


def check_time_unit(recording: Recording) -> tuple[list[Outcome], Recording]:
    """Return a log whose times were taken for another unit, and the recording with them right."""
    joints = recording.joints
    if joints is None or joints.stamp.size < SEVERAL:
        return [], recording
    # The mean as well: a buffer may be read in bursts, and a recorder may pause.
    kinds = np.median, np.mean
    periods = [
        1e-9 * f(np.abs(np.diff(at))) for f in kinds for at in (joints.stamp, joints.log_time)
    ]
    if not (max(periods) < PERIODS[0] or min(periods) > PERIODS[1]):
        return [], recording  # where one of both clocks is right it is the other's fault
    for unit, taken, times in TIME_UNITS:
        if USUAL_PERIODS[0] < joints.period * times < USUAL_PERIODS[1]:
            words: dict[str, Any] = {'period': joints.period, 'now': taken, 'right': unit}
            heard = {n: one for n in CHECKED if (one := getattr(recording, n)) is not None}
            mended = {n: _paced(one, joints.stamp[0], times) for n, one in heard.items()}
            outcome = found('time_unit', joints.topic, 0.97, value=times, **words)
            return [outcome], replace(recording, **mended, heard={})
    return [], recording


def _paced(channel: Series, origin: int, times: float) -> Series:
    """Return a channel whose time runs so many times as fast from an origin [ns] on."""
    both = {name: getattr(channel, name) - origin for name in ('stamp', 'log_time')}
    paced = {k: origin + np.round(at * times).astype(np.int64) for k, at in both.items()}
    return replace(channel, **paced)


def check_publishers(recording: Recording) -> tuple[list[Outcome], Recording]:
    """Return topics that a second publisher sends nothing but 0 on, and them without these.

    Its messages have the stamps of others, which measured.
    """
    outcomes, mended = list[Outcome](), dict[str, Any]()
    for name, field in CHECKED.items():
        if (channel := getattr(recording, name)) is None:
            continue
        live = np.nan_to_num(getattr(channel, field)).any(axis=1)
        twin = (np.diff(channel.stamp) == 0) & (channel.stamp[1:] > 0)
        beside = np.append(False, twin & live[:-1]) | np.append(twin & live[1:], False)
        blank = ~live & beside
        if blank.any() and np.mean(blank) > BACKWARD_SHARE:
            outcomes.append(found('two_publishers', channel.topic, 0.97, count=int(blank.sum())))
            mended[name] = rows_of(channel, ~blank)
    return outcomes, replace(recording, **mended)


def check_transport(
    recording: Recording, facts: RoverFacts, figures: dict[str, Any]
) -> tuple[list[Outcome], Recording]:
    """Return faults of the stamps, and the recording with them corrected by log time."""
    outcomes = _silent(recording)
    late, shifts, steps = dict[str, float](), dict[str, float](), dict[str, float]()
    mended: dict[str, Any] = {}
    quarters = dict[str, list[float]]()  # usual log time less stamp in parts of the drive [s]
    for name in CHECKED:
        channel = getattr(recording, name)
        if channel is None or channel.stamp.size < 3:
            continue
        one = of_one_wheel(channel, facts.names)
        if one is channel and (even := _evenly(channel)) is not None:
            wait = 1e-9 * float(np.abs(even.stamp - channel.stamp).max())
            if wait > LEAST_OFFSET:
                how = f'they come in bursts, stamped up to {wait:.2g} s late when they are read'
                outcomes.append(found('order', channel.topic, 0.99, how=how))
            mended[name] = channel = one = even
        aged = name not in ('joints', 'imu')  # references and sinkages, fused late
        order, jumps = _order(one, aged), _steps(channel, aged)
        step = float(jumps[np.argmax(np.abs(jumps))])
        outcomes += order
        if order:
            mended[name] = _in_order(channel)
        elif step:
            steps[channel.topic] = step
            if np.count_nonzero(jumps) <= MOST_STEPS:
                mended[name] = shifted(channel, np.round(1e9 * np.cumsum(jumps)).astype(np.int64))
        else:
            outcomes += _drop_outs(name, one, figures)
        if channel.late.size and not step:
            parts = np.array_split(channel.late, min(QUARTERS, channel.late.size))
            by_time = [float(np.median(part)) for part in parts]
            late[name], shifts[name] = float(np.median(channel.late)), by_time[0] - by_time[-1]
            quarters[name] = by_time
    for name, by_time in quarters.items():
        if name not in ('joints', 'imu') and min(by_time) > FUTURE:
            continue  # its age is real
        others = [one for other, one in quarters.items() if other != name]
        if drift := _drift(by_time, others):
            channel = mended.get(name, getattr(recording, name))
            how = f'its stamps drift by {drift:+.2g} s over the drive against their arrival'
            outcomes.append(found('order', channel.topic, 0.97, how=how))
            share = np.linspace(0.0, 1.0, channel.stamp.size)
            mended[name] = shifted(channel, np.round(1e9 * drift * share).astype(np.int64))
            late[name], shifts[name] = by_time[0], 0.0
    if steps:  # of one clock, whatever it stamps
        topic, *rest = steps
        how = f'they step by {steps[topic]:+.3g} s against their arrival'
        how += f', as do those of {", ".join(rest)}: a clock was set' if rest else ''
        outcomes.append(found('order', topic, 0.99, how=how))
    if 'joints' not in late:
        return outcomes, replace(recording, **mended)
    assert recording.joints is not None
    if max(shifts.values()) - min(shifts.values()) > CLOCK_DIFFERENCE:  # no offset mends that
        name = max(shifts, key=lambda one: abs(shifts[one]))
        how = (
            f'its stamps shift by {shifts[name]:.2g} s against log time: a clock was set or drifts'
        )
        topic = getattr(recording, name).topic
        return [*outcomes, found('order', topic, 0.97, how=how)], replace(recording, **mended)
    off, recording = _clocks(replace(recording, **mended), late, facts)
    return outcomes + off, recording


def _clocks(
    recording: Recording, late: dict[str, float], facts: RoverFacts
) -> tuple[list[Outcome], Recording]:
    """Return channels of another clock, and the recording on one; ``late``: arrival less stamp."""
    outcomes, mended = list[Outcome](), dict[str, Any]()
    off, moved, joints = {}, dict[str, float](), late['joints']
    if abs(joints - late.get('imu', joints)) > CLOCK_DIFFERENCE:
        # Stamps lie near their arrival: those that are farther off are wrong.
        by_wheels = abs(joints) > abs(late['imu'])
        off = {'joints': joints - late['imu']} if by_wheels else {'imu': late['imu'] - joints}
    for name in ('sinkage', 'reference'):  # their age is real
        ahead = name == 'sinkage' and late.get(name, 0.0) < FUTURE < joints
        if ahead or abs(late.get(name, joints) - joints) > MOST_OFFSET:
            off[name] = late[name] - joints
    for key, value in off.items():
        channel = getattr(recording, key)
        if abs(value) > MOST_OFFSET:
            how = f'its stamps lie {abs(value):.3g} s off: another clock, such as time since boot'
            outcomes.append(found('order', channel.topic, 0.99, how=how))
            continue
        mended[key] = shifted(channel, round(-value * 1e9))
        if key != 'sinkage':  # the rest follows from the motions
            moved[key] = -value
            continue
        std = math.hypot(robust_std(channel.late), ARRIVAL_STD)
        words = of_offset(key, -value, std, 'log time: two clocks', facts)
        outcomes.append(found(f'{key}_offset', channel.topic, 0.999, **words))
    return outcomes, replace(recording, **mended, moved=moved)


def _evenly(channel: Channel) -> Channel | None:
    """Return messages that were read in bursts spread evenly up to their ends; None: no bursts."""
    stamp = channel.stamp
    ends = _bursts(stamp)
    if ends is None:
        return None
    count, wait = np.median(np.diff(ends)), np.median(np.diff(stamp[ends]))
    # Up to the end of each burst, and over no pause or step that is longer than others.
    waits = np.minimum(np.diff(stamp[ends], prepend=stamp[ends[0]] - wait), LONGEST_WAIT * wait)
    period = waits / np.diff(ends, prepend=ends[0] - count)
    row = np.arange(stamp.size)
    end = np.minimum(np.searchsorted(ends, row), ends.size - 1)
    late = np.round(period[end] * (ends[end] - row) + stamp - stamp[ends[end]]).astype(np.int64)
    return replace(channel, stamp=stamp - late, log_time=channel.log_time - late)


def _bursts(stamp: IntArray) -> IntArray | None:
    """Return the last message of each burst of stamps (k,) [ns]; None: no bursts.

    A buffer is read in no time, and as many messages come as time has passed.
    """
    step = np.diff(stamp)
    ends = np.flatnonzero(step > PAUSE * np.median(step))
    if step.min() < 0 or ends.size < LEAST_BURSTS or step[ends].sum() < IN_PAUSES * step.sum():
        return None
    count = np.diff(ends)
    period = np.diff(stamp[ends]) / count
    regular = robust_std(period) < OFF_PERIOD * np.median(period)
    regular &= np.median(step) < min(READ_AT_ONCE, READ_SHARE * float(np.median(period)))
    return ends if regular and np.median(count) >= LEAST_IN_A_BURST else None


def _drift(late: list[float], others: list[list[float]]) -> float:
    """Return by how much stamps gain evenly on their arrival over a drive [s]; 0 for not at all.

    ``late``, ``others``: log time less stamp [s] of each quarter. Where all gain alike the logger's
    clock does.
    """
    compared = [one for one in others if len(one) == QUARTERS]
    if len(late) < QUARTERS or not compared:
        return 0.0
    gain, beside = -np.diff(late), -np.diff(np.median(compared, axis=0))
    drift, without = (float(one.sum()) * QUARTERS / (QUARTERS - 1) for one in (gain, gain - beside))
    even = np.ptp(gain) < UNEVEN * abs(float(gain.mean()))
    return drift if even and min(abs(drift), abs(without)) > LEAST_OFFSET else 0.0


def _steps(channel: Channel, aged: bool) -> FloatArray:
    """Return the steps (k,) before stamps that messages do not arrive by [s]; 0 for none.

    Those behind a step are all later than those before it, or all less late; one far back is out of
    order by itself, unless the channel may be ``aged``.
    """
    stamped = channel.stamp > 0
    step, arrival = (np.diff(at[stamped]) * 1e-9 for at in (channel.stamp, channel.log_time))
    off = step - arrival
    far = (np.abs(off) > LEAST_OFFSET) & ((step < 0.0) | (arrival < 0.5 * step))
    late = (channel.log_time - channel.stamp)[stamped] * 1e-9
    for row in np.flatnonzero(far) + 1:
        before, after = late[:row][-SEVERAL:], late[row:][:SEVERAL]
        stays = before.min() > after.max() or before.max() < after.min()
        stays &= min(before.size, after.size) == SEVERAL
        far[row - 1] = stays or (abs(off[row - 1]) > FAR_BACK and not aged)
    steps = np.zeros(stamped.size)
    steps[np.flatnonzero(stamped)[1:]] = far * off
    return steps


def _order(channel: Channel, aged: bool) -> list[Outcome]:
    stamped = channel.stamp > 0
    zero = float(np.mean(~stamped))
    step = np.diff(channel.stamp[stamped]) * 1e-9
    forward = step[step > 0]
    period = float(np.median(forward)) if forward.size else 0.0
    back = float(np.mean(step < -period)) if step.size else 0.0
    repeated = float(np.mean(step == 0.0)) if step.size else 0.0
    words = []
    if zero > 0.01:
        words.append(f'{100 * zero:.0f} % of the stamps are 0 or negative')
    if back > BACKWARD_SHARE and not aged:
        words.append(
            f'{100 * back:.1f} % of the stamps go back, by up to {-min(step.min(), 0.0):.2g} s'
        )
    if repeated > BACKWARD_SHARE:
        words.append(f'{100 * repeated:.0f} % of the stamps repeat the one before')
    if not words:
        return []
    return [found('order', channel.topic, 0.99, how='; '.join(words))]


def _in_order(channel: Channel) -> Channel:
    """Return the messages in the order of their stamps, without copies of the one before."""
    channel = rows_of(channel, np.argsort(channel.stamp, kind='stable'))
    same = np.diff(channel.stamp) == 0
    for part in fields(channel):
        values = getattr(channel, part.name)
        if part.name != 'log_time' and isinstance(values, np.ndarray):
            table = values.reshape(len(values), -1)
            equal = (table[1:] == table[:-1]) | (np.isnan(table[1:]) & np.isnan(table[:-1]))
            same &= equal.all(axis=1)
    return rows_of(channel, np.append(True, ~same))


def _silent(recording: Recording) -> list[Outcome]:
    """Return inputs that end before others do, and wheel rates or an IMU that begin after them."""
    heard, sent = dict[str, tuple[float, float]](), dict[str, tuple[float, float]]()
    for name in CHECKED:
        if (channel := getattr(recording, name)) is not None:
            end = recording.heard.get(channel.topic, int(channel.log_time.max()))
            first, last = int(channel.log_time.min()) * 1e-9, end * 1e-9
            late = float(np.median(channel.late)) if channel.late.size else 0.0
            way = late if 0.0 < late < LONGEST_WAY else 0.0
            heard[name], sent[name] = (first, last), (first - way, last - way)
    # By log time and by stamp: a message may come late, or its stamp be off.
    spans = [
        (one, min(first for first, _ in one.values()), max(last for _, last in one.values()))
        for one in (heard, sent)
        if one
    ]
    outcomes: list[Outcome] = []
    for name, (first, last) in heard.items():
        late = min(one[name][0] - begin for one, begin, _ in spans)
        ended = min(end - one[name][1] for one, _, end in spans)
        late = late if name in ('joints', 'imu') else 0.0
        for where, silence in (('first', late), ('last', ended)):
            channel = getattr(recording, name)
            usual = (last - first) / max(channel.log_time.size - 1, 1)
            if silence > max(LONGEST_SILENCE, GAP_PERIODS * usual):
                outcomes.append(found('silent', channel.topic, 0.99, where=where, silence=silence))
    return outcomes


def _drop_outs(name: str, channel: Channel, figures: dict[str, Any]) -> list[Outcome]:
    stamps = channel.ascending * 1e-9
    if stamps.size <= SEVERAL:
        return []
    step = np.diff(stamps)
    usual, short = np.quantile(step, (0.5, SHORT)).tolist()
    # Where most are lost at random, a quarter are two or more in a row; a coarse clock has none.
    random = name in ('joints', 'imu') and np.mean(step > 2.5 * short) > IN_A_ROW
    for period in (usual, short) if random else (usual,):
        off = np.abs(step / period - np.round(step / period))
        if np.mean(off < OFF_PERIOD) >= REGULAR:
            break
    else:  # Stamps that jitter: the differences of neighbours are not the period.
        period = float(np.median(stamps[SEVERAL:] - stamps[:-SEVERAL])) / SEVERAL
    figures[f'{name}.rate_hz'] = round(1.0 / period, 3) if period > 0.0 else None
    gaps = step[step > max(LONGEST_GAP, GAP_PERIODS * period)]
    lost = float(np.sum(step[step > 1.7 * period] / period - 1.0))
    missing = min(lost, max((stamps[-1] - stamps[0]) / period + 1.0 - stamps.size, 0.0))
    missing /= stamps.size + missing
    # Cameras lose single readings as a matter of course; the estimator needs neither all the time.
    if not gaps.size and not (name in ('joints', 'imu') and missing > GAP_SHARE):
        return []
    details: dict[str, Any] = {'gaps': gaps.size, 'longest': float(step.max()), 'period': period}
    return [found('drop_outs', channel.topic, 0.99, missing=100.0 * missing, **details)]
