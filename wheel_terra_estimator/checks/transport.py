# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Stamps and arrival: drop-outs, order, clocks that differ."""

from __future__ import annotations

from typing import Any

import numpy as np

from wheel_terra_estimator.checks.faults import found
from wheel_terra_estimator.checks.finding import Outcome
from wheel_terra_estimator.checks.series import Channel, Recording
from wheel_terra_estimator.checks.statistics import robust_std
from wheel_terra_estimator.configuration.configuration import Configuration

LONGEST_GAP = 0.5
"""A gap of the wheel odometry or the IMU longer than this [s] leaves the estimator blind."""
GAP_PERIODS = 6.0
"""A gap also has to be longer than so many periods."""
GAP_SHARE = 0.05
"""Share of missing messages of a stuttering channel."""
BACKWARD_SHARE = 0.05
"""Share of messages whose stamp lies before that of an earlier arrival by more than a period."""
FAR_BACK = 1.0
"""A stamp that goes back by more than this [s] is out of order by itself."""
CLOCK_DIFFERENCE = 1.0
"""Greatest difference between the clocks (log time minus stamp) of two topics [s]."""


def check_transport(
    recording: Recording, configuration: Configuration | None, figures: dict[str, Any]
) -> tuple[list[Outcome], float]:
    """Return what is wrong with the stamps, and how late those of the IMU are by log time [s]."""
    outcomes: list[Outcome] = []
    offset_left = 0.0
    delays = {}
    channels = (recording.joints, recording.imu, recording.sinkage, recording.reference)
    for name, channel in zip(
        ('joint_states', 'imu', 'sinkage', 'reference'), channels, strict=True
    ):
        if channel is None or channel.stamp.size < 3:
            continue
        disorder = _order(channel)
        gaps = _drop_outs(name, channel, figures)
        outcomes += disorder or gaps
        delays[name] = float(np.median(channel.log_time - channel.stamp)) * 1e-9
        figures[f'{name}.log_minus_stamp_s'] = round(delays[name], 4)
    if 'joint_states' in delays and 'imu' in delays and recording.imu is not None:
        difference = delays['imu'] - delays['joint_states']
        if abs(difference) > CLOCK_DIFFERENCE:
            stated = 0.0
            if configuration is not None:
                stated = float(configuration.sensors.imu_stamp_offset)
            offset = stated - difference
            outcomes.append(
                found(
                    'imu_offset',
                    recording.imu.topic,
                    0.999,
                    value=round(offset, 3),
                    std=_jitter(recording.imu, recording.joints),
                    channel='imu',
                    offset=offset,
                    offset_left=-difference,
                    against='log time: two clocks',
                )
            )
            offset_left = -difference
    return outcomes, offset_left


def _jitter(*channels: Channel | None) -> float:
    """Return the deviation of the usual time from stamp to log time of some channels [s]."""
    parts = [
        robust_std(np.asarray((c.log_time - c.stamp) * 1e-9, dtype=np.float64))
        for c in channels
        if c is not None
    ]
    return round(float(np.hypot.reduce(parts)), 4)


def _order(channel: Channel) -> list[Outcome]:
    zero = float(np.mean(channel.stamp <= 0))
    stamps = channel.stamp[channel.stamp > 0]
    step = np.diff(stamps) * 1e-9
    forward = step[step > 0]
    period = float(np.median(forward)) if forward.size else 0.0
    back = float(np.mean(step < -period)) if step.size else 0.0
    repeated = float(np.mean(step == 0.0)) if step.size else 0.0
    far = int(np.sum(step < -FAR_BACK))
    words = []
    if zero > 0.01:
        words.append(f'{100 * zero:.0f} % of the stamps are 0')
    if far or back > BACKWARD_SHARE:
        words.append(
            f'{100 * back:.1f} % of the stamps go back, by up to {-min(step.min(), 0.0):.2g} s'
        )
    if repeated > BACKWARD_SHARE:
        words.append(f'{100 * repeated:.0f} % of the stamps repeat the one before')
    if not words:
        return []
    return [found('order', channel.topic, 0.99, how='; '.join(words))]


def _drop_outs(name: str, channel: Channel, figures: dict[str, Any]) -> list[Outcome]:
    stamps = np.unique(channel.stamp[channel.stamp > 0]) * 1e-9
    if stamps.size < 10:
        return []
    step = np.diff(stamps)
    period = float(np.median(step))
    figures[f'{name}.rate_hz'] = round(1.0 / period, 3) if period > 0.0 else None
    gaps = step[step > max(LONGEST_GAP, GAP_PERIODS * period)]
    missing = float(np.sum(step[step > 1.7 * period] / period - 1.0) / stamps.size)
    figures[f'{name}.longest_gap_s'] = round(float(step.max()), 3)
    figures[f'{name}.missing_share'] = round(missing, 4)
    # Cameras lose single readings as a matter of course; the estimator needs neither all the time.
    needed = name in ('joint_states', 'imu')
    if not gaps.size and not (needed and missing > GAP_SHARE):
        return []
    return [
        found(
            'drop_outs',
            channel.topic,
            0.99,
            gaps=gaps.size,
            longest=float(step.max()),
            period=period,
            missing=100.0 * missing,
        )
    ]
