# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""From rows of a study to the paper's metrics (tables 6 and 7), with spread over the beds."""

from __future__ import annotations

import csv
import math
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

DATA = Path(__file__).parent / 'data'
TABLE6 = (
    'slope_at_20_percent_deg',
    'power_number_self_propelled',
    'power_number_15_deg',
    'power_number_20_percent',
)
TABLE7 = ('slip', 'gross_traction', 'motion_resistance', 'sinkage_average')
WIDEST = 10.0  # [deg] between two slopes that a figure may be interpolated from
Row = Mapping[str, str]


def published(table: str) -> dict[int, dict[str, float]]:
    """Return the paper's table 6 or 7 by wheel."""
    with (DATA / f'nakashima2010_{table}.csv').open(newline='') as file:
        return {
            int(row['wheel']): {k: float(v) for k, v in row.items() if k != 'wheel'}
            for row in csv.DictReader(file)
        }


def number(row: Row, name: str) -> float:
    """Return a cell as a number, nan where it is empty or missing."""
    text = row.get(name) or 'nan'
    return float(text)


def by_slope(rows: Iterable[Row], name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the slopes [deg] and the mean of a figure over the rows of each."""
    groups: dict[float, list[float]] = defaultdict(list)
    for row in rows:
        value = number(row, name)
        if math.isfinite(value):
            groups[number(row, 'slope_deg')].append(value)
    slopes = np.array(sorted(groups))
    return slopes, np.array([np.mean(groups[slope]) for slope in slopes])


def crossing(x: np.ndarray, y: np.ndarray, level: float) -> float:
    """Return the slope [deg] where y first rises through the level, linear between points.

    Points more than ``WIDEST`` apart are not joined. Below the level ground the first two points
    are prolonged, so that a wheel that slips more there still has a (negative) slope. nan where
    the level is not reached between points that were run.
    """
    if x.size < 2:
        return math.nan
    for k in range(1, x.size):
        if x[k] - x[k - 1] > WIDEST:
            continue
        if y[k] >= level > y[k - 1] or (k == 1 and x[0] == 0 and y[0] >= level):
            rise = y[k] - y[k - 1]
            if rise <= 0:
                continue
            return float(x[k - 1] + (level - y[k - 1]) * (x[k] - x[k - 1]) / rise)
    return math.nan


def table6_metrics(rows: Sequence[Row]) -> dict[str, float]:
    """Return the four metrics of one wheel from its rows over the slopes."""
    slopes, slip = by_slope(rows, 'slip')
    number_slopes, power = by_slope(rows, 'power_number')
    at_20 = crossing(slopes, slip, 0.2)

    def power_at(slope: float) -> float:
        above = int(np.searchsorted(number_slopes, slope))
        if above < number_slopes.size and number_slopes[above] == slope:
            return float(power[above])
        if above in (0, number_slopes.size):
            return math.nan
        if number_slopes[above] - number_slopes[above - 1] > WIDEST:
            return math.nan
        return float(np.interp(slope, number_slopes, power))

    return {
        'slope_at_20_percent_deg': at_20,
        'power_number_self_propelled': power_at(0.0),
        'power_number_15_deg': power_at(15.0),
        'power_number_20_percent': power_at(max(0.0, at_20)) if math.isfinite(at_20) else math.nan,
    }


def per_seed(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Return the rows of each seed."""
    groups: dict[str, list[Row]] = defaultdict(list)
    for row in rows:
        groups[row['seed']].append(row)
    return dict(groups)


def spread(values: Iterable[float]) -> tuple[float, float]:
    """Return mean and standard deviation (nan for a single value)."""
    array = np.array([value for value in values if math.isfinite(value)])
    if array.size == 0:
        return math.nan, math.nan
    return float(array.mean()), float(array.std(ddof=1)) if array.size > 1 else math.nan


def table6_spread(rows: Sequence[Row]) -> dict[str, tuple[float, float]]:
    """Return each metric from the means over the seeds, with its deviation between seeds."""
    overall = table6_metrics(rows)
    single = [table6_metrics(group) for group in per_seed(rows).values()]
    return {name: (overall[name], spread(one[name] for one in single)[1]) for name in TABLE6}


def table7_spread(rows: Sequence[Row]) -> dict[str, tuple[float, float]]:
    """Return slip, H, R_r and z_a with their deviation between seeds."""
    return {name: spread(number(row, name) for row in rows) for name in TABLE7}


def rank_sums(metrics: Mapping[int, Mapping[str, float]]) -> dict[int, int]:
    """Return the sum of ranks of table 6: a steep slope at 20 % slip and small power numbers win.

    Equal values share a rank and the next one follows on, as in the paper, whose slope at 20 %
    slip ends at 10 deg. (Table 6 itself swaps the ranks of wheels 2 and 5 in its last metric: 0.414
    is given rank 4 and 0.396 rank 5; its sums differ from these by one for those two wheels.)
    """
    total = dict.fromkeys(metrics, 0)
    for name in TABLE6:
        cost = {}
        for wheel, values in metrics.items():
            value = values[name]
            if name == TABLE6[0]:
                value = -min(value, 10.0) if math.isfinite(value) else -10.0
            cost[wheel] = value if math.isfinite(value) else math.inf
        for wheel, value in cost.items():
            total[wheel] += 1 + len({other for other in cost.values() if other < value})
    return total


def rank_correlation(ours: Sequence[float], theirs: Sequence[float]) -> float:
    """Return Spearman's rank correlation."""
    from scipy.stats import spearmanr

    return float(spearmanr(ours, theirs).statistic)
