# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Forces at a given depth against the reference model, which solves for the depth."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from wheel_terra_estimator.simulation.contact import (
    ContactModel,
    SoilForces,
    SunkWheels,
    contact_of,
)
from wheel_terra_estimator.simulation.contact_memory import digging_rate
from wheel_terra_estimator.simulation.terrain import SOIL_QUANTITIES
from wheel_terra_estimator.terramechanics.contact_law import LAWS, contact_law
from wheel_terra_estimator.terramechanics.model import WheelSoilModel
from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints
from wheel_terra_estimator.terramechanics.soil import Soil
from wheel_terra_estimator.terramechanics.wheel import Wheel

SOIL = Soil(15.6e3, 2407.4e3, 1.1, 250.0, np.radians(31.9), 0.0114, 0.4, -0.2)
EFFECTS = ('slip_sinkage_exponent', 'lug_shear_radius', 'lug_digging', 'soil_mound', 'multipass',
           'bulldozing')  # fmt: skip


def wheels(random: np.random.Generator, count: int) -> Wheel:
    radius = random.uniform(0.08, 0.25, count)
    return Wheel(
        radius=radius,
        width=radius * random.uniform(0.6, 1.4, count),
        lug_height=radius * random.uniform(0.0, 0.1, count),
        lug_count=np.full(count, 20),
    )


def answer(model, depth, slip, load, side_slip=0.0, passes=1.0, **factors: float) -> SoilForces:
    one = np.ones_like(depth)
    given = {name: one * factors.get(name, 1.0) for name in SOIL_QUANTITIES}
    side_slip, passes = side_slip + 0.0 * one, passes + 0.0 * one
    sunk = SunkWheels(given, depth, slip, side_slip, load, 0.05 * one, 0.0 * one, passes)
    return model.forces(sunk)


@pytest.mark.parametrize('effects', [{}, {name: {} for name in EFFECTS}], ids=['plain', 'effects'])
def test_at_the_steady_depth_it_is_the_reference_model(effects):
    random = np.random.default_rng(3)
    count = 200
    wheel = wheels(random, count)
    slip = random.uniform(-0.4, 0.9, count)
    load = 8e3 * wheel.radius * wheel.width * random.uniform(0.5, 1.5, count)
    passes = random.integers(1, 4, count)
    steady = WheelSoilModel(SOIL, effects).steady_state(
        OperatingPoints(slip, load, wheel, pass_number=passes, angular_velocity=0.3)
    )
    depth = wheel.radius * (1.0 - np.cos(steady.entrance_angle))
    model = ContactModel(wheel, SOIL, wheel.tip_radius, effects, 9.80665)
    forces = answer(model, depth, slip, load, passes=passes)
    np.testing.assert_allclose(forces.support_ratio, 1.0, atol=2e-3)
    np.testing.assert_allclose(forces.pull / load, steady.drawbar_pull / load, atol=2e-3)
    arm = load * wheel.radius
    np.testing.assert_allclose(forces.torque / arm, steady.torque / arm, atol=2e-3)
    np.testing.assert_allclose(depth + forces.lug_sinkage, steady.sinkage, atol=1e-9)


@pytest.fixture
def twenty():
    """Wheels and a function of their forces, by depth over radius and slip."""
    wheel = wheels(np.random.default_rng(4), 20)
    load = 5e3 * wheel.radius * wheel.width
    model = ContactModel(wheel, SOIL, wheel.tip_radius, {}, 9.80665)

    def forces(share: float, slip: float, **more: float) -> SoilForces:
        return answer(model, share * wheel.radius, np.full(20, slip), load, **more)

    return wheel, load, forces


def test_stiffness_changes_the_support_and_nothing_else(twenty):
    *_, forces = twenty
    soft, firm = forces(0.1, 0.3, stiffness=0.3), forces(0.1, 0.3)
    np.testing.assert_allclose(0.3 * soft.support_ratio, firm.support_ratio, rtol=1e-9)
    np.testing.assert_allclose(soft.pull, firm.pull, rtol=1e-9)


def test_side_slip_acts_against_the_motion_and_costs_pull(twenty):
    wheel, load, forces = twenty
    straight = forces(0.1, 0.4)
    left, right = (forces(0.1, 0.4, side_slip=side) for side in (0.5, -0.5))
    np.testing.assert_allclose(straight.side_force, 0.0, atol=1e-9)
    np.testing.assert_allclose(left.side_force, -right.side_force)
    np.testing.assert_allclose(left.pull, right.pull)
    assert (left.side_force > 0.1 * load).all()
    assert (left.pull < straight.pull).all()
    # No direction of slip gives more than the strength of the soil.
    shear = np.hypot(left.torque / wheel.radius, left.side_force)
    cohesion = 250.0 * wheel.radius * wheel.width * left.contact_angle
    assert (shear < 1.2 * (np.tan(np.radians(31.9)) * load + cohesion)).all()


@pytest.mark.parametrize('law', LAWS)
def test_the_ground_of_each_contact_law_is_that_law(law):
    random = np.random.default_rng(9)
    count = 60
    radius = random.uniform(0.08, 0.25, count)
    wheel = Wheel(radius=radius, width=np.full(count, 0.12))
    slip = random.uniform(-0.4, 0.9, count)
    load = 6e3 * radius * 0.12 * random.uniform(0.5, 1.5, count)
    steady = contact_law(law, SOIL, {}, 0.12).steady_state(OperatingPoints(slip, load, wheel))
    rover = SimpleNamespace(contact_law=law, gravity=9.80665)
    wheels = SimpleNamespace(wheel=wheel, width=wheel.width, slip_radius=radius)
    ground = contact_of(SimpleNamespace(wheels=wheels, soil=SOIL, effects={}, rover=rover))
    forces = answer(ground, steady.sinkage, slip, load)
    # The closed form of the default law is within 1 % of the load.
    tolerance = 0.01 if law == LAWS[0] else 2e-3
    np.testing.assert_allclose(forces.support_ratio, 1.0, atol=2.0 * tolerance)
    np.testing.assert_allclose(forces.pull / load, steady.drawbar_pull / load, atol=tolerance)
    arm = load * radius
    np.testing.assert_allclose(forces.torque / arm, steady.torque / arm, atol=tolerance)
    sideways = answer(ground, steady.sinkage, slip, load, side_slip=0.2)
    assert (sideways.side_force > 0.0).all()
    firm = answer(ground, steady.sinkage, slip, load, stiffness=2.0)
    np.testing.assert_allclose(firm.support_ratio, 0.5 * forces.support_ratio, rtol=0.05)


LUGGED = Wheel(0.1574, 0.165, 0.010, 30)


def test_digging_starts_near_stuck_and_grows_with_the_lugs():
    whole = digging_rate(1.0, LUGGED, 1.0, 0.05)
    assert digging_rate(0.85, LUGGED, 1.0, 0.05) == 0.0
    assert digging_rate(0.925, LUGGED, 1.0, 0.05) == pytest.approx(0.5 * whole)
    assert digging_rate(-0.98, LUGGED, 1.0, 0.05) == 0.0
    smooth, low, high = (
        digging_rate(0.98, replace(LUGGED, lug_height=h), 1.0, 0.05) for h in (0.0, 0.005, 0.015)
    )
    assert high == pytest.approx(3.0 * low)
    assert smooth > 0.0
    assert digging_rate(1.0, LUGGED, -2.0, 0.05) == pytest.approx(2.0 * whole)


def test_a_spinning_wheel_throws_out_the_layer_of_its_lugs_once_per_lug():
    """Thirty lugs of 10 mm pass in a turn; with all of it thrown out it is 300 mm deeper."""
    a_turn_a_second = 2.0 * np.pi
    assert digging_rate(1.0, LUGGED, a_turn_a_second, 1.0) == pytest.approx(0.300)
    assert digging_rate(1.0, LUGGED, a_turn_a_second, 0.05) == pytest.approx(0.05 * 0.300)
