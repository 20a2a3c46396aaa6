# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A drive of any length takes the same memory, and its figures are those of all its sets."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from estimate_sets import some_estimates as estimate_set

from wheel_terra_estimator.bags.history import HistoryRecorder, ThinnedRows
from wheel_terra_estimator.reporting.drive_summary import summarise


@pytest.mark.parametrize('count', [1, 7, 8, 9, 16, 17, 100, 1000, 1023])
def test_rows_stay_in_order_evenly_spread_and_few(count):
    rows = ThinnedRows(8)
    for stamp in range(count):
        rows.add(stamp, [float(stamp)])
    stamps = rows.stamps()
    assert min(count, 4) <= stamps.size <= 8
    np.testing.assert_array_equal(rows.values(1)[:, 0], stamps)
    steps = np.diff(stamps)
    assert stamps[0] == 0
    assert (steps == steps[:1]).all()
    assert count - stamps[-1] <= max(steps, default=1)


def sets(count: int):
    dice = np.random.default_rng(3)
    first = estimate_set()
    for i in range(count):
        yield replace(
            first,
            stamp=first.stamp + i * 50_000_000,
            slip=dice.uniform(-1.0, 1.0, first.slip.shape),
            sinkage=dice.uniform(0.0, 0.1, first.slip.shape),
            drawbar_pull=dice.uniform(-50.0, 50.0, first.slip.shape),
            slip_class=dice.choice([0, 1, 2, 3, 255], first.slip.shape).astype(np.uint8),
        )


def test_figures_of_a_thinned_drive_are_those_of_all_sets():
    names = tuple(f'w{i}' for i in range(estimate_set().slip.size))
    whole, thinned = HistoryRecorder(names), HistoryRecorder(names, 50)
    everything = list(sets(700))
    for each in everything:
        whole.add(each)
        thinned.add(each)
    long, short = whole.history(), thinned.history()
    assert long.stamp.size == 700
    assert short.stamp.size <= 50
    assert summarise('', long, {}, {}, {}, ()) == summarise('', short, {}, {}, {}, ())
    summary = summarise('', short, {}, {}, {}, ())
    assert summary.sets == 700
    classes = np.array([s.slip_class for s in everything])
    slips = np.abs([s.slip for s in everything])
    sinkages = np.array([s.sinkage for s in everything])
    pulls = np.array([s.drawbar_pull for s in everything])
    for i, wheel in enumerate(summary.wheels):
        known = classes[:, i] != 255
        assert wheel.max_slip == slips[known, i].max()
        assert wheel.max_sinkage == sinkages[:, i].max()
        assert wheel.mean_pull == pytest.approx(pulls[known, i].mean())
        assert wheel.seconds['high'] == pytest.approx(0.05 * (classes[:-1, i] == 2).sum())


def test_memory_of_a_recorder_does_not_grow():
    names = tuple(f'w{i}' for i in range(estimate_set().slip.size))
    recorder = HistoryRecorder(names, 25)
    sizes = []
    tracemalloc.start()
    for number, each in enumerate(sets(600), start=1):
        recorder.add(each)
        if number in (50, 600):
            sizes.append(tracemalloc.get_traced_memory()[0])
    tracemalloc.stop()
    assert sizes[1] < sizes[0] + 50_000
