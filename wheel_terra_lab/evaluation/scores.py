# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Scores of a record against the truth, and their sums over drives.

Scored at 10 Hz at most, where rim or ground speed exceeds 5 mm/s, after the first 10 s. The truth
has no hysteresis; class accuracy within 0.05 of a border is listed apart.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.arrays import BoolArray, FloatArray, IntArray
from wheel_terra_estimator.estimation.judgement.entrapment import (
    Outcome,
    Span,
    entrapments,
    lead_of,
    verdicts,
)
from wheel_terra_lab.evaluation.bench_drive import Truth
from wheel_terra_lab.evaluation.runner import Record
from wheel_terra_lab.evaluation.two_state_filters import SlipCourse

LEAST_SPEED, FIRST_SECONDS, NEAR_BORDER = 0.005, 10.0, 0.05
SCORING_PERIOD = 0.1
"""Of a denser truth one row per period [s] is scored, so that drives count by their length."""

WITHIN = 1.96
"""Deviations that hold 95 % of a Gaussian."""

SLOW_TIME = 20.0
"""The slow part of an error is its mean over blocks of this length [s]."""

START_TIME = 30.0
"""A drive counts as started for so long after its wheels last stood [s]."""

LEAST_LOAD = 0.1
"""Pull is scored on wheels that carry at least this share of the mean load."""


@dataclass(frozen=True)
class Samples:
    """Scored samples, one entry per wheel and stamp, of one or more drives."""

    true_slip: FloatArray
    slip_error: FloatArray
    slip_std: FloatArray
    sinkage_error: FloatArray
    sinkage_std: FloatArray
    pull_error: FloatArray  # over the load
    pull_std: FloatArray
    true_class: NDArray[np.uint8]
    said_class: NDArray[np.uint8]
    slow_slip_error: FloatArray  # mean of slip_error over its block of 20 s
    since_start: FloatArray  # time since the wheels last stood [s]
    held_error: FloatArray  # slip, baselines
    dead_reckoned_error: FloatArray
    torque_filter_error: FloatArray
    torque_filter_std: FloatArray
    pitch_filter_error: FloatArray
    pitch_filter_std: FloatArray
    curve_filter_error: FloatArray
    curve_filter_std: FloatArray
    shared_pull_error: FloatArray  # over the load, baseline: m f_x shared by load

    @classmethod
    def joined(cls, parts: Iterable[Samples]) -> Samples:
        """Return the samples of several drives."""
        parts = list(parts)
        return cls(*(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(cls)))

    def where(self, mask: BoolArray) -> Samples:
        """Return a part of the samples."""
        return Samples(*(getattr(self, f.name)[mask] for f in fields(self)))

    def __len__(self) -> int:
        return len(self.true_slip)


@dataclass(frozen=True)
class Warnings:
    """Stuck warnings of one drive; times in seconds from its start."""

    entrapped: float | None  # when the rover was entrapped first
    raised: tuple[float, ...]
    lead_time: float | None  # of the warning that stood then
    lead_travel: float | None  # rim travel [m]
    near_misses: int  # warnings after which it almost came
    false_alarms: int
    duration: float
    distance: float  # rim travel [m]


@dataclass(frozen=True)
class BaselineSlips:
    """Slips (k, n) of the baselines on the stamps of the truth."""

    held: FloatArray  # last reference velocity
    dead_reckoned: FloatArray
    torque_filter: SlipCourse
    pitch_filter: SlipCourse
    curve_filter: SlipCourse


def samples(
    truth: Truth, record: Record, baselines: BaselineSlips, slip_radius: FloatArray
) -> Samples:
    """Return the scored samples of a drive."""
    position, scored = scored_rows(truth, record, slip_radius)
    rim = np.abs(truth.wheel_rate) * slip_radius
    load = truth.normal_load
    carried = load > LEAST_LOAD * load.mean()
    total = truth.drawbar_pull.sum(axis=1, keepdims=True)
    shared = total * load / load.sum(axis=1, keepdims=True)

    def take(values: FloatArray) -> FloatArray:
        return np.asarray(values[scored], dtype=np.float64)

    def over_load(values: FloatArray) -> FloatArray:
        return take(np.where(carried, values / np.maximum(load, 1e-3), np.nan))

    slip_error = record.slip[position] - truth.slip
    torque, pitch = baselines.torque_filter, baselines.pitch_filter
    curve = baselines.curve_filter
    return Samples(
        true_slip=take(truth.slip),
        slip_error=take(slip_error),
        slip_std=take(record.slip_std[position]),
        sinkage_error=take(record.sinkage[position] - truth.sinkage),
        sinkage_std=take(record.sinkage_std[position]),
        pull_error=over_load(record.drawbar_pull[position] - truth.drawbar_pull),
        pull_std=over_load(record.drawbar_pull_std[position]),
        true_class=truth.slip_class[scored],
        said_class=record.slip_class[position][scored],
        slow_slip_error=take(_block_means(truth.stamp, slip_error, scored)),
        since_start=take(np.broadcast_to(_since_start(truth.stamp, rim)[:, None], rim.shape)),
        held_error=take(baselines.held - truth.slip),
        dead_reckoned_error=take(baselines.dead_reckoned - truth.slip),
        torque_filter_error=take(torque.slip - truth.slip),
        torque_filter_std=take(torque.std),
        pitch_filter_error=take(pitch.slip - truth.slip),
        pitch_filter_std=take(pitch.std),
        curve_filter_error=take(curve.slip - truth.slip),
        curve_filter_std=take(curve.std),
        shared_pull_error=over_load(shared - truth.drawbar_pull),
    )


def scored_rows(
    truth: Truth, record: Record, slip_radius: FloatArray
) -> tuple[IntArray, BoolArray]:
    """Return (k,) the set of each row of the truth, and (k, n) which wheels of it are scored."""
    position = np.clip(np.searchsorted(record.stamp, truth.stamp), 0, len(record.stamp) - 1)
    matched = record.stamp[position] == truth.stamp
    rim = np.abs(truth.wheel_rate) * slip_radius
    ground = np.abs(truth.wheel_rate * slip_radius - truth.slip_velocity)
    late = (truth.stamp - truth.stamp[0]) * 1e-9 > FIRST_SECONDS
    scored = (np.maximum(rim, ground) > LEAST_SPEED) & ~np.isnan(truth.slip)
    scored &= (late & matched & _one_per_period(truth.stamp, matched))[:, None]
    return position, scored


def _since_start(stamp: IntArray, rim: FloatArray) -> FloatArray:
    """Return (k,) the time since the wheels last stood, or since the first row [s]."""
    time = (stamp - stamp[0]) * 1e-9
    standing = np.where((rim < LEAST_SPEED).all(axis=1), time, 0.0)
    return np.asarray(time - np.maximum.accumulate(standing))


def after_start(data: Samples) -> Samples:
    """Return the samples of the first 30 s after a start."""
    return data.where(data.since_start < START_TIME)


def _one_per_period(stamp: IntArray, matched: BoolArray) -> BoolArray:
    """Return the first matched row of each scoring period (k,)."""
    # Half a period off, so that stamps at 10 Hz with some jitter all count.
    period = np.floor((stamp - stamp[0]) * 1e-9 / SCORING_PERIOD + 0.5)
    rows = np.flatnonzero(matched)
    first = rows[np.unique(period[rows], return_index=True)[1]]
    found = np.zeros(len(stamp), dtype=bool)
    found[first] = True
    return found


def _block_means(stamp: IntArray, error: FloatArray, scored: BoolArray) -> FloatArray:
    """Return (k, n) the mean of the scored errors over the block of time of each row."""
    block = np.floor((stamp - stamp[0]) * 1e-9 / SLOW_TIME).astype(int)
    count, total = (np.zeros((block[-1] + 1, error.shape[1])) for _ in range(2))
    np.add.at(count, block, scored.astype(float))
    np.add.at(total, block, np.where(scored, error, 0.0))
    return np.asarray((total / np.maximum(count, 1.0))[block])


def warnings(truth: Truth, record: Record, slip_radius: FloatArray) -> Warnings:
    """Return how the stuck warning did in a drive."""
    time = (truth.stamp - truth.stamp[0]) * 1e-9
    position = np.clip(np.searchsorted(record.stamp, truth.stamp), 0, len(record.stamp) - 1)
    warned = np.diff(np.concatenate([[0], record.stuck[position].astype(int), [0]]))
    starts, ends = time[np.flatnonzero(warned == 1)], np.append(time, np.inf)[warned == -1]
    spans = [Span(*pair) for pair in zip(starts.tolist(), ends.tolist(), strict=True)]
    outcomes = [v.outcome for v in verdicts(time, truth.slip, spans)]
    rim = np.abs(truth.wheel_rate * slip_radius).mean(axis=1)
    travel = np.concatenate([[0.0], np.cumsum(rim[1:] * np.diff(time))])
    rows = entrapments(time, truth.slip).entrapped
    entrapped = float(time[rows[0]]) if rows.size else None
    lead = None if entrapped is None else lead_of(entrapped, spans)
    lead_travel = None
    if entrapped is not None and lead is not None:
        lead_travel = float(np.diff(np.interp([entrapped - lead, entrapped], time, travel))[0])
    return Warnings(
        entrapped,
        tuple(starts.tolist()),
        lead,
        lead_travel,
        outcomes.count(Outcome.NEAR_MISS),
        outcomes.count(Outcome.FALSE),
        float(time[-1]),
        float(travel[-1]),
    )


def rms(values: FloatArray) -> float:
    """Return the root mean square of the values that are there."""
    values = values[~np.isnan(values)]
    return float(np.sqrt(np.mean(values**2))) if len(values) else float('nan')


def coverage(error: FloatArray, std: FloatArray) -> float:
    """Return the share of errors within the 95 % interval."""
    there = ~np.isnan(error) & ~np.isnan(std)
    return (
        float((np.abs(error[there]) <= WITHIN * std[there]).mean()) if there.any() else float('nan')
    )


def squared_over_variance(error: FloatArray, std: FloatArray) -> tuple[float, float]:
    """Return mean and median of the squared error over the stated variance (0.45 of a Gaussian)."""
    there = ~np.isnan(error) & ~np.isnan(std)
    if not there.any():
        return float('nan'), float('nan')
    ratio = (error[there] / np.maximum(std[there], 1e-6)) ** 2
    return float(ratio.mean()), float(np.median(ratio))


def better_baseline(data: Samples) -> tuple[str, FloatArray]:
    """Return which baseline filter has the smallest slip error here, and its errors."""
    found = (
        ('torque', data.torque_filter_error),
        ('pitch', data.pitch_filter_error),
        ('curve', data.curve_filter_error),
    )
    return min(found, key=lambda pair: rms(pair[1]))


@dataclass(frozen=True)
class Ratio:
    """Slip RMSE over that of the best baseline filter; from drives drawn anew in pairs."""

    value: float
    low: float  # of the 95 % interval
    high: float
    error: float  # standard error; nan where there are too few drives

    @property
    def keeps_the_rule(self) -> bool | None:
        """The rule of the bench: not above 1.05 by more than two standard errors; None: too few."""
        if np.isnan(self.error):
            return None
        return self.value <= ALLOWED_RATIO + 2.0 * self.error


ALLOWED_RATIO = 1.05
FEWEST_DRIVES = 3
"""With fewer drives their scatter is not known."""
_RESAMPLES = 2000


def ratio_to_better_baseline(drives: Sequence[Samples]) -> Ratio:
    """Return the ratio over some drives with its interval (bootstrap over whole drives).

    The better filter is chosen once, over all these drives; estimator and baseline of a drive stay
    together in each draw.
    """
    name, _ = better_baseline(Samples.joined(drives))
    sums = np.array(
        [
            [np.nansum(d.slip_error**2), np.nansum(getattr(d, f'{name}_filter_error') ** 2)]
            for d in drives
            if len(d)
        ]
    )
    if not len(sums):
        return Ratio(*(float('nan'),) * 4)
    value = float(np.sqrt(sums[:, 0].sum() / sums[:, 1].sum()))
    if len(sums) < FEWEST_DRIVES:
        return Ratio(value, *(float('nan'),) * 3)
    draws = np.random.default_rng(0).integers(0, len(sums), (_RESAMPLES, len(sums)))
    drawn = sums[draws].sum(axis=1)
    ratios = np.sqrt(drawn[:, 0] / drawn[:, 1])
    low, high = np.quantile(ratios, [0.025, 0.975])
    return Ratio(value, float(low), float(high), float(np.std(ratios)))


THREE_CLASSES, TWO_CLASSES = (0.3, 0.6), (0.6,)
"""Borders of slip between low, moderate, and high or above."""


def accuracy(
    data: Samples, borders: Sequence[float] = THREE_CLASSES, near_border: bool = False
) -> float:
    """Return the share of right classes where the truth is near a border, or where it is not."""
    magnitude = np.abs(data.true_slip)
    distance = np.min(np.abs(magnitude[:, None] - np.array(borders)), axis=1)
    chosen = (distance <= NEAR_BORDER) == near_border
    if not chosen.any():
        return float('nan')
    upper = (0, 1, 2) if len(borders) == 2 else (0, 0, 1)
    level = np.array([*upper, upper[-1]])
    known = data.said_class != 255
    said = level[np.where(known, np.minimum(data.said_class, 3), 0)]
    right = known & (said == level[data.true_class])
    return float(right[chosen].mean())


def confusion(data: Samples) -> IntArray:
    """Return counts (4, 5): true class low .. stuck against said class low .. stuck, unknown."""
    counts = np.zeros((4, 5), dtype=np.int64)
    said = np.where(data.said_class == 255, 4, data.said_class)
    np.add.at(counts, (data.true_class, said), 1)
    return counts
