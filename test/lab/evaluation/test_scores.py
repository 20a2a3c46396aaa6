# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Scores on made-up records whose right answers are known."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from wheel_terra_estimator.estimation.judgement.stuck.forecast import StuckSettings
from wheel_terra_estimator.simulation.truth import TruthTable, entrapped, slip_classes
from wheel_terra_lab.evaluation import scores, tables
from wheel_terra_lab.evaluation.bench import DriveScore, Results
from wheel_terra_lab.evaluation.foresight import (
    Foresight,
    brier_interval,
    foresight,
    reliability,
    reliability_error,
)
from wheel_terra_lab.evaluation.runner import Record
from wheel_terra_lab.evaluation.tables import _foresight
from wheel_terra_lab.evaluation.two_state_filters import SlipCourse

RADIUS = np.full(4, 0.1)


def truth(slip, rim=0.05, dt=0.1):
    rows = len(slip)
    full = np.repeat(np.asarray(slip, float)[:, None], 4, axis=1)
    stamp = 10**9 + (np.arange(rows) * dt * 1e9).astype(np.int64)
    same = np.full((rows, 4), 10.0)
    return TruthTable(
        stamp=stamp,
        slip=full,
        slip_velocity=full * rim,
        drawbar_pull=same.copy(),
        normal_load=np.full((rows, 4), 100.0),
        sinkage=np.full((rows, 4), 0.02),
        sinkage_rate=np.zeros((rows, 4)),
        torque=same,
        wheel_rate=np.full((rows, 4), rim / 0.1),
        slip_angle=np.zeros((rows, 4)),
        lateral_force=np.zeros((rows, 4)),
        slip_class=slip_classes(full, np.array([0.3, 0.6, 0.9])),
        stuck=entrapped(stamp, full),
        forward_velocity=rim * (1 - np.asarray(slip, float)),
        lateral_velocity=np.zeros(rows),
        yaw_rate=np.zeros(rows),
        slope=np.zeros(rows),
        position=np.zeros((rows, 3)),
    )


def said(true, error=0.0, std=0.05, stuck=None):
    return Record(
        stamp=true.stamp,
        slip=true.slip + error,
        slip_std=np.full_like(true.slip, std),
        sinkage=true.sinkage + 0.001,
        sinkage_std=np.full_like(true.slip, 0.001),
        drawbar_pull=true.drawbar_pull + 2.0,
        drawbar_pull_std=np.full_like(true.slip, 0.5),
        normal_load=true.normal_load,
        slip_class=true.slip_class,
        stuck=np.zeros(len(true.stamp), bool) if stuck is None else stuck,
        rim_travel_left=np.full_like(true.slip, 10.0),
        stuck_probability=np.zeros_like(true.slip),
        speed=true.forward_velocity,
        speed_std=np.full(len(true.stamp), 0.01),
        health={'nis_reference': 1.0},
    )


def take(true, record):
    std = np.full_like(true.slip, 0.05)
    baselines = scores.BaselineSlips(
        true.slip + 0.1,
        true.slip - 0.2,
        SlipCourse(true.slip + 0.06, std),
        SlipCourse(true.slip - 0.04, std),
        SlipCourse(true.slip + 0.07, std),
    )
    return scores.samples(true, record, baselines, RADIUS)


def test_errors_and_coverage_are_what_was_put_in():
    true = truth(np.full(300, 0.4))
    data = take(true, said(true, error=0.03))
    assert len(data) == (300 - 101) * 4
    assert scores.rms(data.slip_error) == pytest.approx(0.03)
    assert scores.coverage(data.slip_error, data.slip_std) == 1.0
    assert scores.rms(data.sinkage_error) == pytest.approx(0.001)
    assert scores.rms(data.pull_error) == pytest.approx(0.02)
    assert scores.coverage(data.pull_error, data.pull_std) == 0.0
    assert scores.rms(data.held_error) == pytest.approx(0.1)
    assert scores.rms(data.dead_reckoned_error) == pytest.approx(0.2)


def test_slow_part_is_what_stays_over_twenty_seconds():
    true = truth(np.full(800, 0.4))
    time = np.arange(800)[:, None] * 0.1
    wave = 0.03 + 0.05 * np.sin(2.0 * np.pi * time / 2.0)  # whole periods in each block
    data = take(true, said(true, error=wave))
    assert scores.rms(data.slip_error) == pytest.approx(np.hypot(0.03, 0.05 / np.sqrt(2)), rel=0.02)
    assert scores.rms(data.slow_slip_error) == pytest.approx(0.03, rel=0.02)


def test_dense_truth_counts_at_ten_hertz():
    dense, sparse = truth(np.full(2000, 0.4), dt=0.01), truth(np.full(200, 0.4))
    assert len(take(dense, said(dense))) == pytest.approx(len(take(sparse, said(sparse))), abs=8)


def test_error_over_variance():
    mean, median = scores.squared_over_variance(np.array([0.1, 0.1, 0.1, 0.5]), np.full(4, 0.1))
    assert mean == pytest.approx(7.0)
    assert median == pytest.approx(1.0)


def test_ratio_is_over_the_better_filter_with_an_interval_from_paired_drives():
    def drive(error):
        true = truth(np.full(300, 0.4))
        return take(true, said(true, error=error))

    # The pitch filter is off by 0.04, the torque filter by 0.06: the first counts.
    same = scores.ratio_to_better_baseline([drive(0.02)] * 6)
    assert same.value == pytest.approx(0.5)
    assert same.error == pytest.approx(0.0, abs=1e-12)
    assert same.keeps_the_rule
    worse = scores.ratio_to_better_baseline([drive(0.06)] * 6)
    assert worse.value == pytest.approx(1.5)
    assert not worse.keeps_the_rule
    mixed = scores.ratio_to_better_baseline([drive(e) for e in (0.01, 0.02, 0.04, 0.06)])
    assert mixed.low < mixed.value < mixed.high
    assert scores.ratio_to_better_baseline([drive(0.06)]).keeps_the_rule is None
    assert mixed.value == pytest.approx(np.sqrt(np.mean(np.square([1, 2, 4, 6]))) / 4.0)


def test_rest_and_the_first_seconds_are_not_scored():
    slip = np.full(300, 0.4)
    slip[200:] = np.nan
    assert len(take(truth(slip), said(truth(slip)))) == (200 - 101) * 4


def test_class_accuracy_counts_away_from_borders():
    true = truth(np.concatenate([np.full(200, 0.1), np.full(100, 0.58), np.full(100, 0.8)]))
    record = said(true)
    wrong = record.slip_class.copy()
    wrong[200:300] = 2  # wrong, but 0.02 from the border
    wrong[350:] = 1  # wrong and away from it
    data = take(true, Record(**{**vars(record), 'slip_class': wrong}))
    assert scores.accuracy(data) == pytest.approx(149 / 199, abs=0.01)
    assert scores.accuracy(data, near_border=True) == 0.0
    counts = scores.confusion(data)
    assert counts[0, 0] == 99 * 4
    assert counts[2, 1] == 50 * 4


def test_lead_is_that_of_the_warning_in_force():
    slip = np.concatenate([np.linspace(0.2, 1.0, 300), np.ones(100)])
    true = truth(slip)
    trapped = true.first_stuck()
    stuck = np.zeros(400, bool)
    stuck[20:40] = True  # gone before: no lead from it, and false
    raised = int(trapped * 10) - 50
    stuck[raised:] = True
    found = scores.warnings(true, said(true, stuck=stuck), RADIUS)
    assert found.lead_time == pytest.approx(5.0, abs=0.11)
    assert found.lead_travel == pytest.approx(0.25, abs=0.01)
    assert found.false_alarms == 0 or found.false_alarms == 1
    assert len(found.raised) == 2
    # A warning that nothing follows is false.
    true = truth(np.full(400, 0.4))
    stuck = np.zeros(400, bool)
    stuck[100:200] = True
    assert scores.warnings(true, said(true, stuck=stuck), RADIUS).false_alarms == 1


def test_tables_hold_every_kind():
    true = truth(np.concatenate([np.full(200, 0.1), np.full(200, 0.7)]))
    record = said(true)
    drive = DriveScore(
        'climb', 1, 'reference', take(true, record), scores.warnings(true, record, RADIUS), {}
    )
    text = tables.report(Results([drive]), ['reference', 'no_torque'])
    assert '| climb |' in text
    assert 'not judged' in text
    text = tables.report(Results([replace(drive, seed=i) for i in range(3)]), ['reference'])
    assert 'kept in every kind' in text
    better = replace(drive, mode='smoothed', samples=take(true, said(true, error=0.02)))
    worse = replace(drive, samples=take(true, said(true, error=0.04)))
    text = tables.report(Results([worse, better]), ['reference', 'smoothed'])
    assert '| With reference at 1 Hz, simulator A | 0.500 | 100.0% |' in text
    assert '## Smoother with reference at 1 Hz' in text
    both = Results([drive, replace(drive, simulator='B', kind='spin')])
    text = tables.report(both, ['reference'])
    assert 'side by side' in text
    assert '| climb |' in text and '| spin |' in text
    assert '**pooled**' in text
    assert 'Without torque' not in text


def test_the_first_seconds_after_a_start_are_scored_apart():
    """Standing from 40 to 45 s of 100 s at 10 Hz; the estimate is off after the start alone."""
    slip = np.full(1000, 0.4)
    slip[400:450] = np.nan
    true = truth(slip)
    true.wheel_rate[400:450] = 0.0
    record = said(true)
    record.slip[450:750] += 0.2
    data = take(true, record)
    part = scores.after_start(data)
    # 10 to 30 s after the first start, 0 to 30 s after the second.
    assert len(part) == pytest.approx(4 * (200 + 300), abs=20)
    assert scores.coverage(part.slip_error, part.slip_std) == pytest.approx(0.4, abs=0.01)
    assert scores.rms(data.slip_error) < scores.rms(part.slip_error)


STEP = 0.1

SETTINGS = StuckSettings(horizon=15.0, travel=0.3, threshold=0.5, clear_slip=0.6, clear_time=3.0)


def drive(slips, rim=0.1, probability=0.0):
    """A drive of two wheels with the same slip, one row in a tenth of a second."""
    slips = np.asarray(slips, dtype=float)
    stamp = 10**9 + np.arange(slips.size) * round(STEP * 1e9)
    truth = SimpleNamespace(
        stamp=stamp,
        slip=np.column_stack([slips, slips]),
        wheel_rate=np.full((slips.size, 2), rim / 0.1),
    )
    record = SimpleNamespace(
        stamp=stamp,
        stuck=np.zeros(slips.size, dtype=bool),
        stuck_probability=np.full((slips.size, 2), probability),
    )
    return foresight(truth, record, np.full(2, 0.1), SETTINGS)


def test_the_event_lies_within_the_horizon():
    slips = np.full(600, 0.2)
    slips[500:] = 0.95
    found = drive(slips)
    # From 10 s to the entrapment at 50 s, twice a second; the last 15 s of it see it come.
    assert found.came.size == pytest.approx(80, abs=1)
    assert found.came.sum() == pytest.approx(30, abs=1)
    # A crawling rover: 0.3 m of rim travel last 30 s.
    assert drive(slips, rim=0.01).came.sum() == pytest.approx(60, abs=1)
    # Rows whose outcome nobody saw are not scored.
    found = drive(np.full(600, 0.2))
    assert found.came.size == pytest.approx(70, abs=1)  # 10 s to 45 s of 60 s
    assert not found.came.any()


def test_a_calibrated_probability_is_reliable_and_beats_a_warning():
    rng = np.random.default_rng(3)
    said = rng.uniform(size=20_000)
    came = (rng.uniform(size=said.size) < said).astype(float)
    data = Foresight(said, (said > 0.5).astype(float), came)
    assert reliability_error(data) < 0.015
    assert len(reliability(data)) == 10
    # E[p (1 - p)] of a uniform p is 1/6; of the warning E[min(p, 1 - p)] = 1/4.
    parts = [
        Foresight(*(a[i::10] for a in (data.probability, data.warned, came))) for i in range(10)
    ]
    found = brier_interval(parts)
    assert found['probability'][0] == pytest.approx(1.0 / 6.0, abs=5e-3)
    assert found['warning'][0] == pytest.approx(0.25, abs=0.01)
    assert found['difference'][2] < 0.0
    low = Foresight(np.full(100, 0.1), np.zeros(100), np.ones(100))
    assert reliability_error(low) == pytest.approx(0.9)


def test_the_report_sets_the_probability_over_the_share_of_events():
    """Half of the rows come; said with 0.8 and 0.2: 0.04 over 0.25."""
    came = np.array([1.0, 0.0] * 50)
    data = Foresight(np.where(came > 0.0, 0.8, 0.2), came, came)
    said = '\n'.join(_foresight([SimpleNamespace(foresight=data)]))
    assert '| probability over that | 0.16 |' in said
    data = Foresight(data.probability, came, np.zeros(came.size))
    assert 'over that' not in '\n'.join(_foresight([SimpleNamespace(foresight=data)]))
