# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Slip ratio and the shear displacement that follows from it."""

import math

import numpy as np
import pytest

from wheel_terra_estimator.terramechanics.kinematics import (
    shear_displacement,
    slip_of_speed_ratio,
    slip_ratio,
    speed_ratio,
)


@pytest.mark.parametrize(
    ('speed', 'rim', 'slip'),
    [
        (0.10, 0.10, 0.0),
        (0.07, 0.10, 0.3),
        (0.0, 0.10, 1.0),
        (0.10, 0.05, -0.5),
        (-0.07, -0.10, 0.3),  # reverse is symmetric
        (-0.10, -0.05, -0.5),
        (-0.02, 0.10, 1.0),  # slides back while driving
        (0.10, 0.0, -1.0),  # held still, dragged along
        (0.10, -0.001, -1.0),  # below rest speed counts as held
        (-0.001, 0.10, 1.0),
    ],
)
def test_slip_ratio_of_driving_and_braking(speed, rim, slip):
    assert slip_ratio(speed, rim) == pytest.approx(slip)


def test_slip_is_not_known_at_rest_and_always_in_range():
    assert np.isnan(slip_ratio(0.001, -0.001))
    speeds = np.linspace(-0.3, 0.3, 61)
    grid = slip_ratio(speeds[:, None], speeds[None, :])
    known = grid[np.isfinite(grid)]
    assert known.min() >= -1.0 and known.max() <= 1.0


def test_speed_ratio_is_the_inverse():
    slip = np.linspace(-0.99, 1.0, 50)
    assert slip_of_speed_ratio(speed_ratio(slip)) == pytest.approx(slip)
    # Opposed, standing, driving, rolling, braking.
    found = slip_of_speed_ratio(np.array([-1.0, -0.0, 0.3, 1.0, 2.5]))
    assert found == pytest.approx([1.0, 1.0, 0.7, 0.0, -0.6])


def test_shear_displacement_starts_at_zero_and_has_its_slope():
    assert shear_displacement(0.5, 0.5, 0.16, 0.1) == 0.0
    # d j/dt = -(R - (v/w) cos t), from the rim's speed against the soil.
    t, step = 0.2, 1e-6
    slope = (
        shear_displacement(t + step, 0.5, 0.16, 0.1) - shear_displacement(t - step, 0.5, 0.16, 0.1)
    ) / (2 * step)
    assert slope == pytest.approx(-(0.16 - 0.1 * math.cos(t)))
