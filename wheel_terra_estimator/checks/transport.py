# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Stamps and arrival: drop-outs, order, clocks that differ."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.checks.faults import found, of_offset
from wheel_terra_estimator.checks.finding import Outcome
from wheel_terra_estimator.checks.rover_facts import RoverFacts
from wheel_terra_estimator.checks.series import (
    Channel,
    JointSeries,
    Recording,
    SinkageSeries,
    rows_of,
    shifted,
)
from wheel_terra_estimator.checks.statistics import robust_std

LONGEST_GAP = 0.5  # of wheel odometry or IMU that leaves the estimator no blind spot [s]
GAP_PERIODS = 6.0  # A gap also has to be longer than so many periods
GAP_SHARE = 0.05  # share of missing messages of a stuttering channel
IN_MOST = 0.6  # share of messages with a wheel below which others hold other wheels [-]
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
CLOCK_DIFFERENCE = 1.0  # of log time less stamp of two topics, at most [s]


def check_transport(
    recording: Recording, facts: RoverFacts, figures: dict[str, Any]
) -> tuple[list[Outcome], Recording]:
    """Return what is wrong with the stamps, and the recording with that mended by log time."""
    outcomes: list[Outcome] = []
    late, shifts, steps = dict[str, float](), dict[str, float](), dict[str, float]()
    mended: dict[str, Any] = {}
    for name in ('joints', 'imu', 'sinkage', 'reference'):
        channel = getattr(recording, name)
        if channel is None or channel.stamp.size < 3:
            continue
        most_back = BACKWARD_SHARE if name in ('joints', 'imu') else 1.0  # others are fused late
        order, jumps = _order(channel, most_back), _steps(channel)
        step = float(jumps[np.argmax(np.abs(jumps))])
        outcomes += order
        if step and not order:
            steps[channel.topic] = step
            if np.count_nonzero(jumps) <= MOST_STEPS:
                mended[name] = shifted(channel, np.round(1e9 * np.cumsum(jumps)).astype(np.int64))
        elif not order:
            outcomes += _drop_outs(name, _of_one_wheel(channel, facts), figures)
        if channel.late.size and not step:
            ends = np.array_split(channel.late, 4)[:: 3 if channel.late.size > 3 else 1]
            late[name] = float(np.median(channel.late))
            shifts[name] = float(np.median(ends[0]) - np.median(ends[-1]))
    if steps:  # of one clock, whatever it stamps
        topic, *rest = steps
        how = f'they step by {steps[topic]:+.3g} s against their arrival'
        how += f', as those of {", ".join(rest)} do: a clock was set' if rest else ''
        outcomes.append(found('order', topic, 0.99, how=how))
    if 'joints' not in late:
        return outcomes, replace(recording, **mended)
    assert recording.joints is not None
    if max(shifts.values()) - min(shifts.values()) > CLOCK_DIFFERENCE:  # no offset mends that
        name = max(shifts, key=lambda one: abs(shifts[one]))
        how = f'its stamps shift by {shifts[name]:.2g} s against log time: a clock set, or drifting'
        topic = getattr(recording, name).topic
        return [*outcomes, found('order', topic, 0.97, how=how)], replace(recording, **mended)
    off, joints = {}, late['joints']
    if abs(joints - late.get('imu', joints)) > CLOCK_DIFFERENCE:
        # Stamps lie near their arrival: those that are farther off are wrong.
        by_wheels = abs(joints) > abs(late['imu'])
        off = {'joints': joints - late['imu']} if by_wheels else {'imu': late['imu'] - joints}
    for name in ('sinkage', 'reference'):  # their age is honest
        ahead = name == 'sinkage' and late.get(name, 0.0) < FUTURE < joints
        if ahead or abs(late.get(name, joints) - joints) > MOST_OFFSET:
            off[name] = late[name] - joints
    for key, value in off.items():
        channel, name = getattr(recording, key), 'wheel_odometry' if key == 'joints' else key
        if abs(value) > MOST_OFFSET:
            how = f'its stamps lie {abs(value):.3g} s off: another clock, such as time since start'
            outcomes.append(found('order', channel.topic, 0.99, how=how))
            continue
        std = math.hypot(robust_std(channel.late), robust_std(recording.joints.late), ARRIVAL_STD)
        words = of_offset(name, -value, std, 'log time: two clocks', facts)
        outcomes.append(found(f'{name}_offset', channel.topic, 0.999, **words))
        mended[key] = shifted(channel, round(-value * 1e9))
    return outcomes, replace(recording, **mended)


def _steps(channel: Channel) -> FloatArray:
    """Return the steps (k,) before stamps that messages do not arrive by [s]; 0 for none."""
    stamped = channel.stamp > 0
    step, arrival = (np.diff(at[stamped]) * 1e-9 for at in (channel.stamp, channel.log_time))
    far = (step < -FAR_BACK) | ((step > FAR_BACK) & (arrival < 0.5 * step))
    steps = np.zeros(stamped.size)
    steps[np.flatnonzero(stamped)[1:]] = np.where(far, step - arrival, 0.0)
    return steps


def _order(channel: Channel, most_back: float) -> list[Outcome]:
    stamped = channel.stamp > 0
    zero = float(np.mean(~stamped))
    step = np.diff(channel.stamp[stamped]) * 1e-9
    forward = step[step > 0]
    period = float(np.median(forward)) if forward.size else 0.0
    back = float(np.mean(step < -period)) if step.size else 0.0
    again = (step == 0.0) & _of_one_joint(channel)[stamped][1:]
    repeated = float(np.mean(again)) if step.size else 0.0
    words = []
    if zero > 0.01:
        words.append(f'{100 * zero:.0f} % of the stamps are 0 or negative')
    if back > most_back:
        words.append(
            f'{100 * back:.1f} % of the stamps go back, by up to {-min(step.min(), 0.0):.2g} s'
        )
    if repeated > BACKWARD_SHARE:
        words.append(f'{100 * repeated:.0f} % of the stamps repeat the one before')
    if not words:
        return []
    return [found('order', channel.topic, 0.99, how='; '.join(words))]


def _of_one_joint(channel: Channel) -> NDArray[np.bool_]:
    """Return which messages (k,) hold a joint that the one before holds too.

    Drives that send a message each, all of one instant, repeat no stamp.
    """
    if not isinstance(channel, JointSeries | SinkageSeries):
        return np.ones(channel.stamp.size, dtype=bool)
    there = _there(channel)
    return np.r_[True, np.any(there[1:] & there[:-1], axis=1)]


def _there(channel: JointSeries | SinkageSeries) -> NDArray[np.bool_]:
    return np.isfinite(channel.rate if isinstance(channel, JointSeries) else channel.sinkage)


def _of_one_wheel(channel: Channel, facts: RoverFacts) -> Channel:
    """Return the messages of the wheel that is told most often, where they hold one or few each."""
    if not isinstance(channel, JointSeries | SinkageSeries):
        return channel
    there = _there(channel)[:, [name in facts.names for name in channel.names]]
    if not there.any():
        return channel
    one = there[:, np.argmax(there.sum(axis=0))]
    return rows_of(channel, one) if one.mean() < IN_MOST else channel


def _drop_outs(name: str, channel: Channel, figures: dict[str, Any]) -> list[Outcome]:
    stamps = np.unique(channel.stamp[channel.stamp > 0]) * 1e-9
    if stamps.size <= SEVERAL:
        return []
    step = np.diff(stamps)
    period = float(np.median(step))
    off = np.abs(step / period - np.round(step / period))
    if np.mean(off < OFF_PERIOD) < REGULAR:
        # Stamps that jitter: their neighbours say nothing of the period.
        period = float(np.median(stamps[SEVERAL:] - stamps[:-SEVERAL])) / SEVERAL
    figures[f'{name}.rate_hz'] = round(1.0 / period, 3) if period > 0.0 else None
    gaps = step[step > max(LONGEST_GAP, GAP_PERIODS * period)]
    lost = float(np.sum(step[step > 1.7 * period] / period - 1.0))
    missing = min(lost, max((stamps[-1] - stamps[0]) / period + 1.0 - stamps.size, 0.0))
    missing /= stamps.size + missing
    # Cameras lose single readings as a matter of course; the estimator needs neither all the time.
    if not gaps.size and not (name in ('joints', 'imu') and missing > GAP_SHARE):
        return []
    told: dict[str, Any] = {'gaps': gaps.size, 'longest': float(step.max()), 'period': period}
    return [found('drop_outs', channel.topic, 0.99, missing=100.0 * missing, **told)]
