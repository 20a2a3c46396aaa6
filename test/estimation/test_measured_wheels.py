# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The slip that goes with a torque, beside wheels that were measured; two estimates as one."""

import math

import numpy as np
import pytest

from wheel_terra_estimator.estimation.contacts.measured_wheels import (
    SpeedAndVariance,
    intersected,
    slip_of_torque,
)

HIT_SMOOTH = ((0.1, 0.238), (0.2, 0.334), (0.3, 0.381))  # Ding et al. 2011, figure 9
HIT_LUGS = ((0.1, 0.278), (0.2, 0.397), (0.3, 0.461))
KLS1_SMOOTH = ((0.1, 0.26), (0.2, 0.31), (0.3, 0.38))  # Wang and Han 2016
"""Slip and torque over load times radius, as digitised in shared/measured."""


@pytest.mark.parametrize('wheel', [HIT_SMOOTH, HIT_LUGS, KLS1_SMOOTH])
def test_measured_wheels_lie_within_the_stated_interval(wheel):
    for slip, coefficient in wheel:
        usual = slip_of_torque(coefficient)
        assert abs(usual.slip - slip) < 1.96 * usual.std


def test_half_of_the_greatest_torque_takes_the_scale_times_ln_2():
    usual = slip_of_torque(0.275)
    assert usual.slip == pytest.approx(0.17 * math.log(2.0))


def test_braking_wheels_skid_as_driving_ones_slip():
    driving, braking = slip_of_torque(0.3), slip_of_torque(-0.3)
    assert braking.slip == -driving.slip
    assert braking.std == driving.std


def test_torque_tells_nothing_on_the_plateau_or_where_there_is_none():
    """HIT's lugged wheel has the torque of 0.5 at a slip of 0.4 and of 0.57 at 0.6."""
    assert math.isnan(slip_of_torque(0.5).slip)
    assert math.isnan(slip_of_torque(math.nan).slip)


@pytest.mark.parametrize('correlation', [-0.9, 0.0, 0.9, 1.0])
def test_intersected_variance_covers_any_correlation(correlation):
    """By Monte Carlo: the stated variance is never below that of the error."""
    rng = np.random.default_rng(5)
    first, second = rng.standard_normal((2, 20_000))
    one = 0.1 * first
    other = 0.3 * (correlation * first + math.sqrt(1.0 - correlation**2) * second)
    # The mean is linear in both: its weights from two calls.
    weight = intersected(SpeedAndVariance(1.0, 0.01), SpeedAndVariance(0.0, 0.09)).speed
    error = weight * one + (1.0 - weight) * other
    stated = intersected(SpeedAndVariance(0.0, 0.01), SpeedAndVariance(0.0, 0.09)).variance
    assert np.mean(error**2) <= 1.02 * stated
    # The mean is that of inverse variances, as if the errors were apart.
    both = intersected(SpeedAndVariance(0.2, 0.01), SpeedAndVariance(0.6, 0.09))
    assert both.speed == pytest.approx((0.2 / 0.01 + 0.6 / 0.09) / (1 / 0.01 + 1 / 0.09))
