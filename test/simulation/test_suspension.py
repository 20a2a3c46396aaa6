# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Loads against statics done by hand."""

import numpy as np
import pytest
from simulated_ground import rover

from wheel_terra_estimator.simulation.suspension import LEAST_LOAD_SHARE, suspension_of

G = 9.80665


def test_rocker_bogie_statics_on_the_level():
    configuration = rover()
    loads = suspension_of(configuration).normal_loads(
        180.0, np.array([0.0, 0.0, G]), np.zeros(6), np.zeros(6)
    )
    # Front wheel at 0.61 m and bogie at -0.305 m about the centre of gravity: 1 to 2.
    np.testing.assert_allclose(loads, 180.0 * G / 6.0, rtol=1e-9)


def test_moments_balance_for_any_force():
    configuration = rover()
    suspension = suspension_of(configuration)
    x, y = configuration.wheels.x, configuration.wheels.y
    random = np.random.default_rng(1)
    for _ in range(50):
        force = np.array([*random.uniform(-1.5, 1.5, 2), G])
        pull = random.dirichlet(np.ones(6)) * 180.0 * force[0]
        moment = random.uniform(0.0, 5.0, 6)
        loads = suspension.normal_loads(180.0, force, pull, moment)
        assert loads.sum() == pytest.approx(180.0 * G)
        assert (loads * x + moment).sum() == pytest.approx(-180.0 * force[0] * 0.45, abs=1e-6)
        assert (loads * y).sum() == pytest.approx(-180.0 * force[1] * 0.45, abs=1e-6)
        for side in (y > 0, y < 0):
            bogie = side & (x < 0.1)
            about_pivot = loads * (x + 0.305) + moment + pull * 0.25
            assert about_pivot[bogie].sum() == pytest.approx(0.0, abs=1e-6)


def test_no_wheel_pulls_on_the_ground():
    suspension = suspension_of(rover('rover.suspension:=rigid'))
    loads = suspension.normal_loads(180.0, np.array([9.0, 0.0, 4.0]), np.zeros(6), np.zeros(6))
    assert loads.min() >= LEAST_LOAD_SHARE * 180.0 * 4.0 / 6.0 * 0.5
    assert loads.sum() == pytest.approx(720.0)


def test_given_shares():
    configuration = rover(
        'rover.suspension:=shares', 'rover.load_shares:=[0.1, 0.1, 0.2, 0.2, 0.2, 0.2]'
    )
    loads = suspension_of(configuration).normal_loads(
        180.0, np.array([1.0, 0.0, 5.0]), np.zeros(6), np.zeros(6)
    )
    np.testing.assert_allclose(loads, 900.0 * np.array([0.1, 0.1, 0.2, 0.2, 0.2, 0.2]))
