# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Slip that goes with a resistance that rises: wheels that dig themselves in."""

import math

import pytest

from wheel_terra_estimator.estimation.contacts.measured_wheels import SlipOfTorque, slip_of_torque
from wheel_terra_estimator.estimation.contacts.resistance import Resistance, slip_of_rise

STEP = 0.01  # rim travel of a cycle [m]


def driven(*stretches):
    """Return what follows resistances over rim travels [m] that come one after the other."""
    followed = Resistance()
    for resistance, travel in stretches:
        for _ in range(round(travel / STEP)):
            followed.update(resistance, STEP)
    return followed


def test_no_rise_is_no_slip_and_half_of_the_load_is_standing():
    assert slip_of_rise(0.0) == (0.0, 0.0)
    assert slip_of_rise(0.5).slip == pytest.approx(1.0, abs=1e-9)


def test_deviation_is_that_of_a_third_in_the_rise():
    """By the difference of the curve at rises a little apart, in the logarithm."""
    for rise in (0.05, 0.12, 0.2):
        apart = slip_of_rise(rise * math.exp(0.01)).slip - slip_of_rise(rise * math.exp(-0.01)).slip
        assert slip_of_rise(rise).std == pytest.approx(0.35 * apart / 0.02, rel=1e-3)


@pytest.mark.parametrize('resistance', [0.03, 0.3])
def test_ground_that_stays_as_it_is_tells_of_no_digging_however_soft(resistance):
    assert driven((resistance, 5.0)).digging.slip == 0.0


def test_a_sudden_rise_is_digging_and_the_same_for_ten_metres_is_the_soil():
    assert driven((0.1, 5.0), (0.4, 0.5)).digging.slip > 0.9
    assert driven((0.1, 5.0), (0.4, 20.0)).digging.slip < 0.1


def test_harder_ground_counts_at_once():
    """Sand for a metre after rock is as sand after sand: what rises is against the last metres."""
    soft_to_hard = driven((0.4, 10.0), (0.1, 3.0), (0.4, 0.5)).digging.slip
    assert soft_to_hard == pytest.approx(driven((0.1, 5.0), (0.4, 0.5)).digging.slip, abs=0.05)


def test_unknown_resistance_or_travel_changes_nothing():
    followed = driven((0.1, 2.0), (0.3, 0.2))
    before = followed.state
    followed.update(math.nan, STEP)
    followed.update(0.3, math.nan)
    assert followed.state == before


def test_wheels_that_dig_move_by_the_product_of_both_shares():
    rolling, digging = slip_of_torque(0.3), slip_of_rise(0.12)
    both = slip_of_torque(0.3, digging)
    assert 1.0 - both.slip == pytest.approx((1.0 - rolling.slip) * (1.0 - digging.slip))
    assert both.std > (1.0 - digging.slip) * rolling.std


def test_beyond_the_greatest_torque_only_digging_tells_the_slip():
    assert math.isnan(slip_of_torque(0.6, slip_of_rise(0.1)).slip)
    assert slip_of_torque(0.6, slip_of_rise(0.25)).slip > 0.9
    assert math.isnan(slip_of_torque(math.nan, SlipOfTorque(1.0, 0.0)).slip)
