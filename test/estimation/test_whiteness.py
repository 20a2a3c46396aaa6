# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Mean and correlation of innovations against series of which both are known."""

import numpy as np
import pytest

from wheel_terra_estimator.estimation.filter.whiteness import Whiteness


def first_order(rng, hold, count):
    """Return a series of variance 1 whose correlation with the next is `hold`."""
    values = [rng.standard_normal()]
    for _ in range(count - 1):
        values.append(hold * values[-1] + np.sqrt(1.0 - hold**2) * rng.standard_normal())
    return np.array(values)


@pytest.mark.parametrize('hold', [0.0, 0.7, -0.5])
@pytest.mark.parametrize('offset', [0.0, 1.5])
def test_mean_and_lag_one_of_known_series(hold, offset):
    rng, means, lags = np.random.default_rng(3), [], []
    for _ in range(40):
        followed = Whiteness()
        for i, score in enumerate(offset + first_order(rng, hold, 300)):
            followed.follow(0.1 * i, np.array([score]), torque=1)
        report = followed.report()
        means.append(report['innovation_mean_torque'])
        lags.append(report['innovation_lag_one_torque'])
        assert set(report) == {'innovation_mean_torque', 'innovation_lag_one_torque'}
    assert np.mean(means) == pytest.approx(offset, abs=0.12)
    assert np.mean(lags) == pytest.approx(hold, abs=0.08)


def test_channels_stay_apart_and_few_innovations_tell_nothing():
    followed = Whiteness()
    for i in range(10):
        # Two wheels that are off by 1 deviation each are off by 1.4 together.
        scores = np.array([1.0, 1.0, -2.0])
        followed.follow(0.1 * i, scores, sinkage=2, torque=0, balance=1)
        if i == 8:
            assert followed.report() == {}
    followed.follow(1.0, np.array([0.5]), reference=1)
    report = followed.report()
    assert report['innovation_mean_sinkage'] == pytest.approx(1.41)
    assert report['innovation_mean_balance'] == -2.0
    assert not any('reference' in key or 'torque' in key for key in report)
