# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The probability of an entrapment against what came: reliability and Brier score.

The event: an entrapment begins within ``filter.stuck_horizon`` or ``filter.stuck_travel`` of rim
travel. It is judged while it is not
yet under way, once in `SPACING`. The probability of the rover is the median of those of its wheels;
the warning is a probability of 0 or 1.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.estimation.judgement.entrapment import entrapments
from wheel_terra_estimator.estimation.judgement.stuck.forecast import StuckSettings
from wheel_terra_lab.evaluation.bench_drive import Truth
from wheel_terra_lab.evaluation.runner import Record

SPACING = 0.5
"""Between two rows that are scored [s]."""
FIRST_SECONDS = 10.0
LEAST_SPEED = 0.005
"""Mean rim speed below which a rover does not drive [m/s]."""
BINS = 10
"""Of the reliability diagram."""
_RESAMPLES = 1000


@dataclass(frozen=True)
class Foresight:
    """Rows of one or more drives, (k,) each."""

    probability: FloatArray
    warned: FloatArray  # 0 or 1
    came: FloatArray  # 0 or 1

    @classmethod
    def joined(cls, parts: Iterable[Foresight]) -> Foresight:
        """Return the rows of several drives."""
        parts = list(parts)
        return cls(
            np.concatenate([p.probability for p in parts]),
            np.concatenate([p.warned for p in parts]),
            np.concatenate([p.came for p in parts]),
        )


def foresight(
    truth: Truth, record: Record, slip_radius: FloatArray, settings: StuckSettings
) -> Foresight:
    """Return probability, warning and outcome of the rows of a drive."""
    time = (truth.stamp - truth.stamp[0]) * 1e-9
    rim = np.abs(truth.wheel_rate * slip_radius).mean(axis=1)
    travel = np.concatenate([[0.0], np.cumsum(rim[1:] * np.diff(time))])
    begins, _, under_way = entrapments(time, truth.slip)
    # The first beginning behind each row, by time and by travel.
    ahead = np.searchsorted(begins, np.arange(time.size))
    there = ahead < len(begins)
    row = np.array([*begins, 0])[np.minimum(ahead, len(begins))]
    came = there & (
        (time[row] - time <= settings.horizon) | (travel[row] - travel <= settings.travel)
    )
    position = np.clip(np.searchsorted(record.stamp, truth.stamp), 0, len(record.stamp) - 1)
    matched = record.stamp[position] == truth.stamp
    scored = matched & ~under_way & (time > FIRST_SECONDS) & (rim > LEAST_SPEED)
    # An outcome that lies behind the end of the drive is not known.
    scored &= came | (time + settings.horizon <= time[-1])
    rows = np.flatnonzero(scored)
    rows = rows[np.unique(np.floor(time[rows] / SPACING), return_index=True)[1]]
    return Foresight(
        np.median(record.stuck_probability, axis=1)[position][rows],
        record.stuck[position][rows].astype(float),
        came[rows].astype(float),
    )


def brier_interval(parts: Sequence[Foresight]) -> dict[str, tuple[float, float, float]]:
    """Return value and 95 % interval of the Brier scores, over drives drawn anew.

    ``probability``, ``warning``, and ``difference``: the first less the second, drawn in pairs.
    """
    sums = np.array(
        [
            [
                np.sum((p.probability - p.came) ** 2),
                np.sum((p.warned - p.came) ** 2),
                p.came.size,
            ]
            for p in parts
        ]
    )
    draws = np.random.default_rng(0).integers(0, len(sums), (_RESAMPLES, len(sums)))
    drawn = sums[draws].sum(axis=1)
    shares = drawn[:, :2] / np.maximum(drawn[:, 2:], 1.0)
    whole = sums.sum(axis=0)
    values = whole[:2] / max(whole[2], 1.0)
    columns = {
        'probability': (values[0], shares[:, 0]),
        'warning': (values[1], shares[:, 1]),
        'difference': (values[0] - values[1], shares[:, 0] - shares[:, 1]),
    }
    return {
        name: (float(value), *np.quantile(spread, [0.025, 0.975]).tolist())
        for name, (value, spread) in columns.items()
    }


def reliability(data: Foresight) -> list[tuple[int, float, float]]:
    """Return count, mean probability and share of events of each bin that holds rows."""
    bins = np.minimum((data.probability * BINS).astype(int), BINS - 1)
    return [
        (int(mine.sum()), float(data.probability[mine].mean()), float(data.came[mine].mean()))
        for mine in (bins == b for b in range(BINS))
        if mine.any()
    ]


def reliability_error(data: Foresight) -> float:
    """Return the mean distance of probability and share of events, by rows [-]."""
    rows = reliability(data)
    total = sum(count for count, _, _ in rows)
    if not total:
        return float('nan')
    return sum(count * abs(said - came) for count, said, came in rows) / total
