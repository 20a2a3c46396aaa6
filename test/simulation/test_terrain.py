# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Ground: height is the integral of the slope, soil changes where the patches say."""

import numpy as np
import pytest
from simulated_ground import ground

from wheel_terra_estimator.simulation.terrain import GRID, Patch, smooth_noise


def test_height_is_the_integral_of_the_slope():
    hill = ground(
        slope_position=np.array([0.0, 5.0]), slope_angle=np.radians([0.0, 10.0]), undulation=0.02
    )
    x = np.linspace(-5.0, 15.0, 2001)
    height = hill.height(x, np.zeros_like(x))
    slope = np.gradient(height, x)
    np.testing.assert_allclose(slope[5:-5], hill.sine_of_slope(x)[5:-5], atol=4e-3)
    assert hill.height(np.array([0.0]), np.array([0.0])) == pytest.approx(0.0, abs=1e-9)


def test_beyond_its_extent_the_slope_goes_on():
    hill = ground(slope_deg=10.0)
    far = np.array([19.0, 25.0, -15.0])
    np.testing.assert_allclose(
        hill.height(far, np.zeros(3)), far * np.sin(np.radians(10.0)), atol=2 * GRID
    )


def test_patch_has_its_factor_inside_and_a_smooth_border():
    patch = Patch(2.0, 4.0, -9.0, 0.0, {'stiffness': 0.25, 'cohesion': 3.0})
    soft = ground(patches=[patch], base_factors={'stiffness': 1.2})
    x = np.array([1.0, 2.0, 3.0, 3.0, 5.0])
    y = np.array([-0.5, -0.5, -0.5, 0.5, -0.5])
    factors = soft.soil_factors(x, y)
    np.testing.assert_allclose(factors['stiffness'], 1.2 * np.array([1, 0.5, 0.25, 1, 1]))
    np.testing.assert_allclose(factors['cohesion'][[0, 2, 3]], [1.0, 3.0, 1.0])
    line = soft.soil_factors(np.linspace(1.5, 2.5, 200), np.full(200, -0.5))['stiffness']
    assert (np.diff(line) <= 1e-12).all()
    assert np.abs(np.diff(line)).max() < 0.03


def test_noise_has_the_stated_spread_and_length():
    noise = smooth_noise(np.random.default_rng(2), 200_000, 0.5)
    assert noise.std() == pytest.approx(1.0, rel=0.1)
    lag = round(0.5 / GRID)
    correlation = np.corrcoef(noise[:-lag], noise[lag:])[0, 1]
    # Gaussian kernel of width L: correlation exp(-1/4) at distance L.
    assert correlation == pytest.approx(np.exp(-0.25), abs=0.05)
