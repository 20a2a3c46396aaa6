# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Reliability and Brier score against hand-made outcomes."""

from types import SimpleNamespace

import numpy as np
import pytest

from wheel_terra_estimator.estimation.judgement.stuck.forecast import StuckSettings
from wheel_terra_lab.evaluation.foresight import (
    Foresight,
    brier_interval,
    foresight,
    reliability,
    reliability_error,
)
from wheel_terra_lab.evaluation.tables import _foresight

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
