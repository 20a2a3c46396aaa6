# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Wheel loads against statics done by hand and against the simulator's own suspension."""

import numpy as np
import pytest

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.estimation.contacts.load_distribution import load_distribution
from wheel_terra_estimator.estimation.rover import Rover
from wheel_terra_estimator.simulation.suspension import Suspension

THREE = np.array([[1.0, 0.5], [1.0, -0.5], [-1.0, 0.0]])


def distribution(position=THREE, height=0.4, contact_height=0.0, suspension='rigid', shares=()):
    return load_distribution(
        mass=10.0,
        position=position,
        centre_of_gravity=[0.0, 0.0, height],
        contact_height=contact_height,
        suspension=suspension,
        shares=shares,
        rocker_pivot=(0.0, 0.0),
        bogie_pivot=(0.0, 0.0),
        bogie_wheels='rear',
    )


FOUR = np.array([[1.0, 0.5], [1.0, -0.5], [-1.0, 0.5], [-1.0, -0.5]])


@pytest.mark.parametrize(
    ('position', 'height', 'contact_height', 'force', 'loads'),
    [
        # Uphill, moment about the rear contact: 2 W_front * 2 = m (f_z * 1 - f_x * 0.5).
        (THREE, 0.4, -0.1, (2.0, 0.0, 9.0), (20.0, 20.0, 50.0)),
        # Left up: the right wheels carry m f_y h more in all, on a track of 1 m.
        (FOUR, 0.5, 0.0, (0.0, 1.0, 9.0), (20.0, 25.0, 20.0, 25.0)),
        # A wheel that is lifted never pulls on the ground.
        (THREE, 1.0, 0.0, (-12.0, 0.0, 9.0), (45.0, 45.0, 0.0)),
    ],
)
def test_loads_of_a_rigid_chassis_are_those_of_statics(
    position, height, contact_height, force, loads
):
    found = distribution(position, height, contact_height).loads(list(force))
    assert found == pytest.approx(loads)


def test_shares_are_kept():
    model = distribution(height=1.0, suspension='shares', shares=[1.0, 1.0, 2.0])
    assert model.loads([5.0, 0.0, 9.0]) == pytest.approx([22.5, 22.5, 45.0])


def test_rocker_bogie_agrees_with_the_simulators_statics():
    configuration = reader.load(['generic_six_wheel'])
    ours = Rover.from_configuration(configuration).load
    theirs = Suspension(configuration)
    rng = np.random.default_rng(0)
    mass = configuration.rover.mass
    for _ in range(50):
        force = np.array([rng.uniform(-2, 2), rng.uniform(-1, 1), 9.6])
        pull = rng.uniform(-30, 60, 6)
        # The balance of forces holds: the sum of pulls is m f_x.
        pull += (mass * force[0] - pull.sum()) / 6
        moment = rng.uniform(0, 20, 6)
        expected = theirs.normal_loads(mass, force, pull, moment)
        assert ours.loads(force, pull, moment) == pytest.approx(expected, rel=1e-6)
