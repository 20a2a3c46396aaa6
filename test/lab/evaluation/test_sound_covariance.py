# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The whole estimator on a drive with faulty sensors: sound covariance, finite sets."""

import numpy as np
from estimate_sets import assert_sound

from wheel_terra_estimator.estimation.filter.ekf import GatedFilter
from wheel_terra_lab.evaluation.runner import inputs_of_mode, run_estimator
from wheel_terra_lab.evaluation.simulators import SIMULATORS

LENGTH = 7.0  # [s]
RATE = 10.0  # sets a second


def test_covariance_and_sets_stay_sound_through_faults(monkeypatch):
    """Random faults, wild readings and late references: nothing asymmetric, indefinite or nan."""
    looked, update = [], GatedFilter.update

    def watched(self, *arguments, **options):
        update(self, *arguments, **options)
        looked.append(None if len(looked) % 50 else self.P.copy())

    monkeypatch.setattr(GatedFilter, 'update', watched)
    drive = SIMULATORS['A'].simulate('sensor_faults', 77, LENGTH, None)
    sets, health = run_estimator(drive.configuration, inputs_of_mode(drive.arrivals, 'reference'))
    # A random fault may silence the wheel odometry for some seconds.
    assert len(sets) > 0.8 * LENGTH * RATE
    assert len(looked) > 5.0 * LENGTH
    assert health['reruns'] > 0.5 * LENGTH  # the reference is late, once a second
    assert health['filter_restarts'] == 0
    for covariance in (matrix for matrix in looked if matrix is not None):
        assert (covariance == covariance.T).all()
        deviation = np.sqrt(np.diag(covariance))
        correlation = covariance / np.outer(deviation, deviation)
        assert np.linalg.eigvalsh(correlation).min() > 0.0
    for estimates in sets:
        assert_sound(estimates)
