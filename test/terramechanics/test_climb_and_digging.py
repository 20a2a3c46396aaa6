# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Climbing, digging in, and how the sinkage grows with the slip."""

import math
from dataclasses import replace

import numpy as np
import pytest
from terra_tools import SAND, WHEEL, points, state

from wheel_terra_estimator.terramechanics.entrapment import (
    digging_per_turn,
    digging_rate,
    digging_share,
)
from wheel_terra_estimator.terramechanics.model import WheelSoilModel
from wheel_terra_estimator.terramechanics.slope_locomotion import rover_climb

SMOOTH = replace(WHEEL, lug_height=0.0)


def climb(slopes, effects=None):
    """One wheel of 80 N that climbs by itself."""
    return rover_climb(WheelSoilModel(SAND, effects), WHEEL, [80.0], slopes)


def test_the_climb_balances():
    slopes = np.radians([-10.0, 0.0, 5.0, 12.0])
    steady = climb(slopes)
    assert steady.drawbar_pull[:, 0] == pytest.approx(80.0 * np.sin(slopes), abs=1e-6)
    again = state(steady.slip, 80.0 * np.cos(slopes))
    assert steady.sinkage[:, 0] == pytest.approx(again.sinkage)
    assert np.all(np.diff(steady.slip) > 0.0)


def test_the_climb_is_the_effect_slope_gravity_at_zero_hitch_pull():
    hitch = state(climb([0.15]).slip, slope=0.15, effects={'slope_gravity': {}}).drawbar_pull
    assert hitch == pytest.approx(0.0, abs=1e-6)
    with pytest.raises(ValueError, match='slope_gravity is on'):
        climb([0.15], {'slope_gravity': {}})


def test_a_rover_of_equal_wheels_climbs_like_one_of_them():
    slopes = np.radians([-5.0, 0.0, 8.0, 14.0])
    one = climb(slopes)
    rover = rover_climb(WheelSoilModel(SAND), WHEEL, [80.0] * 4, slopes)
    assert rover.slip == pytest.approx(one.slip, abs=1e-9)
    assert rover.sinkage == pytest.approx(np.tile(one.sinkage, 4))


def test_too_steep_is_nan():
    slips = np.linspace(0.0, 0.98, 50)
    loads = np.full_like(slips, 80.0 * math.cos(0.3))
    steepest = math.asin(state(slips, loads).drawbar_pull.max() / 80.0)
    assert 0.2 < steepest < 0.4, 'near the slope whose load was taken'
    flat, steep = climb([steepest - 0.02, steepest + 0.02]).slip
    assert np.isfinite(flat) and np.isnan(steep)


def test_a_rover_s_wheels_pull_the_weight_together():
    """Unequal loads and wheels that run in ruts: the sum is W sin a, none of them by itself."""
    slopes = np.radians([0.0, 10.0])
    level = np.array([60.0, 90.0, 90.0])
    model = WheelSoilModel(SAND, {'multipass': {'stiffening': 0.6}})
    loads = level * np.cos(slopes)[:, None] + np.outer(np.tan(slopes), [-30.0, 0.0, 30.0])
    rover = rover_climb(model, WHEEL, loads, slopes, [1, 2, 3])
    assert rover.drawbar_pull.sum(axis=1) == pytest.approx(240.0 * np.sin(slopes), abs=1e-6)
    assert np.ptp(rover.drawbar_pull[1]) > 2.0
    again = model.steady_state(
        points([rover.slip[1]] * 3, loads[1], slope=slopes[1], pass_number=[1, 2, 3])
    )
    assert rover.drawbar_pull[1] == pytest.approx(again.drawbar_pull)
    virgin, compacted = (rover_climb(model, WHEEL, level, slopes, n).sinkage for n in (1, 3))
    assert (compacted < virgin).all()


def test_digging_starts_near_stuck_and_grows_with_the_lugs():
    assert digging_share(0.85) == 0.0 and digging_share(1.0) == 1.0
    assert digging_share(0.925) == pytest.approx(0.5)
    assert digging_rate(-0.98, WHEEL, 1.0) == 0.0
    low, high = (digging_rate(0.98, replace(WHEEL, lug_height=h), 1.0) for h in (0.005, 0.015))
    assert high == pytest.approx(3.0 * low)
    assert digging_rate(0.98, SMOOTH, 1.0) > 0.0
    assert digging_rate(0.98, WHEEL, -2.0) == pytest.approx(2.0 * digging_rate(0.98, WHEEL, 1.0))


def test_a_spinning_wheel_throws_out_the_layer_of_its_lugs_once_per_lug():
    """Thirty lugs of 10 mm pass in a turn; with all of it thrown out it is 300 mm deeper."""
    assert digging_per_turn(WHEEL, efficiency=1.0) == pytest.approx(0.300)
    assert digging_rate(1.0, WHEEL, 2.0 * math.pi) == pytest.approx(digging_per_turn(WHEEL))
