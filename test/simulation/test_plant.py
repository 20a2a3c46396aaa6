# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The rover obeys mechanics: balances, limits, symmetry, and the steady state of the reference."""

from typing import Any

import numpy as np
import pytest
from simulated_ground import SOIL, drives, ground, rover

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.simulation import plant as plant_module
from wheel_terra_estimator.simulation.drives import Command
from wheel_terra_estimator.simulation.plant import RoverPlant
from wheel_terra_estimator.simulation.suspension import LEAST_LOAD_SHARE, Suspension
from wheel_terra_estimator.simulation.terrain import GRID, Patch, smooth_noise
from wheel_terra_estimator.simulation.truth import Truth
from wheel_terra_estimator.terramechanics.model import WheelSoilModel
from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints

G = 9.80665


@pytest.fixture
def plant():
    def make(configuration: Configuration | None = None, **terrain: Any) -> RoverPlant:
        configuration = configuration or rover()
        return RoverPlant(configuration, ground(**terrain), drives(configuration))

    return make


def drive(plant: RoverPlant, seconds: float, forward: float = 0.05, turn: float = 0.0) -> Truth:
    for _ in range(round(seconds / 0.1)):
        truth = plant.step(Command(forward, turn), 0.1)
    return truth


@pytest.mark.parametrize('slope', [-8.0, pytest.param(7.0, marks=pytest.mark.slow), 13.0])
def test_steady_climb_is_the_steady_state_of_the_reference(plant, slope):
    configuration = rover()
    truth = drive(plant(configuration, slope_deg=slope), 11.0, forward=0.16)
    wheels, mass = configuration.wheels, configuration.rover.mass
    steady = WheelSoilModel(configuration.soil, configuration.effects).steady_state(
        OperatingPoints(
            truth.slip,
            truth.normal_load,
            wheels.wheel,
            pass_number=truth.pass_number,
            angular_velocity=truth.wheel_rate,
        )
    )
    np.testing.assert_allclose(truth.sinkage, steady.sinkage, atol=3e-4)
    load = truth.normal_load
    np.testing.assert_allclose(truth.drawbar_pull / load, steady.drawbar_pull / load, atol=3e-3)
    arm = load * wheels.radius
    np.testing.assert_allclose(truth.torque / arm, steady.torque / arm, atol=3e-3)
    weight = mass * G
    assert truth.drawbar_pull.sum() == pytest.approx(weight * np.sin(np.radians(slope)), abs=1.0)
    assert load.sum() == pytest.approx(weight * np.cos(np.radians(slope)), rel=1e-6)


def test_energy_and_force_balance_over_a_climb(plant):
    rover_plant, mass = plant(slope_deg=9.0), rover().rover.mass
    pulled = driven = dissipated = 0.0
    for _ in range(200):
        truth = rover_plant.step(Command(0.08), 0.05)
        rim = truth.wheel_rate * 0.12
        pulled += float(truth.drawbar_pull.sum() * truth.forward_velocity) * 0.05
        driven += float((truth.torque * truth.wheel_rate).sum()) * 0.05
        loss = truth.torque * truth.wheel_rate - truth.drawbar_pull * truth.forward_velocity
        assert (loss > -1e-3 - 0.02 * np.abs(truth.torque * rim)).all()
        dissipated += float(loss.sum()) * 0.05
        tilt = truth.pitch - np.radians(9.0)
        felt = truth.drawbar_pull.sum() / mass + G * tilt
        assert truth.specific_force[0] == pytest.approx(felt, abs=0.01)
    height = truth.position[0] * np.sin(np.radians(9.0))
    energy = mass * (G * height + 0.5 * truth.forward_velocity**2)
    assert pulled == pytest.approx(energy, rel=0.01)
    assert driven == pytest.approx(pulled + dissipated, rel=1e-9)
    assert dissipated > 0.3 * pulled


def test_a_parked_rover_stays_where_it_is_and_feels_the_attitude_of_its_chassis(plant):
    truth = drive(plant(slope_deg=12.0, side_deg=5.0), 5.0, forward=0.0)
    assert np.abs(truth.position[:2]).max() < 1e-4
    assert np.isnan(truth.slip).all()
    expected = rover().rover.mass * G * np.sin(np.radians(12.0))
    assert truth.drawbar_pull.sum() == pytest.approx(expected, rel=2e-3)
    assert np.linalg.norm(truth.specific_force) == pytest.approx(G, rel=1e-3)
    assert truth.specific_force[0] == pytest.approx(G * np.sin(truth.pitch), abs=5e-3)
    assert truth.specific_force[1] == pytest.approx(G * np.sin(truth.roll), abs=5e-3)
    # The lower wheels carry more and are deeper: the chassis leans further than the ground.
    assert truth.pitch > np.radians(12.0)
    assert truth.roll > np.radians(5.0)


def test_a_rover_with_one_axle_feels_the_slope_that_its_caster_runs_on(plant):
    two = [
        'wheels.names:=[left, right]', 'wheels.radius:=[0.1, 0.1]', 'wheels.width:=[0.1, 0.1]',
        'wheels.x:=[0.0, 0.0]', 'wheels.y:=[0.2, -0.2]', 'rover.mass:=20.0',
        'wheels.torque_limit:=[20.0, 20.0]',
    ]  # fmt: skip
    truth = drive(plant(reader.load([], [*SOIL, *two]), slope_deg=7.0), 5.0)
    assert truth.specific_force[0] == pytest.approx(G * np.sin(np.radians(7.0)), abs=0.02)
    assert truth.pitch == pytest.approx(np.radians(7.0), abs=1e-3)
    assert truth.drawbar_pull.sum() == pytest.approx(20.0 * truth.specific_force[0], rel=0.02)


def test_a_rover_parked_on_a_kink_is_held_against_the_slope_under_each_wheel(plant):
    kink = {'slope_position': np.array([0.1, 0.3]), 'slope_angle': np.radians([0.0, 12.0])}
    truth = drive(plant(**kink), 5.0, forward=0.0)
    under_front = truth.normal_load[:2].sum()  # hubs at 0.61, 0 and -0.61 m
    expected = under_front * np.sin(np.radians(12.0))
    assert truth.drawbar_pull.sum() == pytest.approx(expected, rel=0.03)


def test_too_steep_a_slope_entraps(plant):
    rover_plant = plant(slope_deg=24.0)
    truth = drive(rover_plant, 4.5, forward=0.1)
    assert truth.forward_velocity < 0.002
    assert np.nanmin(truth.slip) > 0.9
    deeper = drive(rover_plant, 1.5, forward=0.1)
    assert (deeper.sinkage > truth.sinkage).all()


def test_weak_drives_stall(plant):
    configuration = rover(f'wheels.torque_limit:={[6.0] * 6}')
    truth = drive(plant(configuration, slope_deg=10.0), 5.5)
    np.testing.assert_allclose(np.abs(truth.torque).max(), 6.0, rtol=0.05)
    assert abs(truth.forward_velocity) < 0.01


def test_descent_skids_and_a_locked_wheel_is_dragged(plant):
    rover_plant = plant(slope_deg=-16.0)
    truth = drive(rover_plant, 6.0, forward=0.1)
    assert (truth.slip < -0.03).all()
    assert (truth.drawbar_pull < 0.0).all()
    rover_plant.faults.rate_factor[0] = 0.0
    truth = drive(rover_plant, 1.5)  # before the locked wheel has dug in so far that it holds all
    assert truth.slip[0] == -1.0
    assert truth.torque[0] < 0.0
    assert truth.drawbar_pull[0] < truth.drawbar_pull[1:].min()


def test_reverse_mirrors_forward(plant):
    # A rover that looks the same from both ends.
    ends = [
        'rover.suspension:=rigid',
        'rover.centre_of_gravity:=[0.0, 0.0, 0.2]',
        'wheels.passes:=[1, 1, 2, 2, 3, 3]',
    ]
    ahead = drive(plant(rover(*ends)), 4.0, forward=0.1)
    back = drive(plant(rover(*ends)), 4.0, forward=-0.1)
    mirror = [4, 5, 2, 3, 0, 1]
    np.testing.assert_allclose(back.forward_velocity, -ahead.forward_velocity, rtol=1e-6)
    np.testing.assert_allclose(back.slip[mirror], ahead.slip, atol=1e-6)
    np.testing.assert_allclose(back.torque[mirror], -ahead.torque, rtol=1e-4)
    np.testing.assert_allclose(back.sinkage[mirror], ahead.sinkage, rtol=1e-4)


def test_left_mirrors_right_and_scrub_slows_the_turn(plant):
    left = drive(plant(), 4.0, 0.1, turn=0.1)
    right = drive(plant(), 4.0, 0.1, turn=-0.1)
    mirror = [1, 0, 3, 2, 5, 4]
    np.testing.assert_allclose(left.slip[mirror], right.slip, atol=1e-5)
    np.testing.assert_allclose(left.lateral_force[mirror], -right.lateral_force, atol=1e-2)
    assert 0.0 < left.yaw_rate < 0.1
    # The outer wheels pull, the inner ones hold back: that turns against the scrub.
    assert left.drawbar_pull[1] > left.drawbar_pull[0]


def test_the_path_closes_on_a_turn_in_place(plant):
    truth = drive(plant(), 5.0, forward=0.0, turn=0.1)
    assert truth.yaw_rate > 0.01
    assert np.abs(truth.position[:2]).max() < 0.1
    outward = np.sign(truth.slip_velocity)
    assert (outward[[1, 3, 5]] > 0).all()
    assert (outward[[0, 2, 4]] < 0).all()


def test_a_shorter_step_gives_the_same_drive(monkeypatch):
    configuration = rover()
    ends = []
    for step in (0.05, 0.025):
        monkeypatch.setattr(plant_module, 'LONGEST_STEP', step)
        hill = ground(
            slope_position=np.array([0.0, 0.2, 0.4]), slope_angle=np.radians([0.0, 0.0, 12.0])
        )
        ends.append(drive(RoverPlant(configuration, hill, drives(configuration)), 3.5, 0.1))
    np.testing.assert_allclose(ends[0].slip, ends[1].slip, atol=3e-3)
    np.testing.assert_allclose(ends[0].sinkage, ends[1].sinkage, atol=3e-4)
    np.testing.assert_allclose(ends[0].position, ends[1].position, atol=5e-3)


def test_wheels_sink_one_after_the_other_in_a_patch(plant):
    patch = Patch(1.0, 9.0, -9.0, 9.0, {'stiffness': 0.3})
    rover_plant = plant(patches=[patch])
    before = drive(rover_plant, 2.0).sinkage
    entered = np.full(6, np.nan)
    for _ in range(300):
        truth = rover_plant.step(Command(0.18), 0.1)
        new = np.isnan(entered) & (truth.sinkage > before + 5e-3)
        entered[new] = truth.position[0]
        if not np.isnan(entered).any():
            break
    # Hubs at 0.61, 0 and -0.61 m: the border at 1 m comes after 0.39, 1.0, 1.61 m.
    np.testing.assert_allclose(entered[[0, 2, 4]], [0.39, 1.0, 1.61], atol=0.25)
    assert entered[0] < entered[2] < entered[4]


CORNERS = "[front_left_steer, front_right_steer, '', '', rear_left_steer, rear_right_steer]"


def test_a_steered_rover_turns_about_its_middle_axle_without_scrub(plant):
    """Ackermann: radius v / w, wheels on their circles, no lateral motion of the middle axle."""
    steered = plant(rover(f'wheels.steering_joints:={CORNERS}'))
    drive(steered, 1.5, 0.1)
    truth, skids = drive(steered, 5.0, 0.1, 0.1), drive(plant(), 4.0, 0.1, 0.1)
    wheels, mass = rover().wheels, rover().rover.mass
    expected = np.arctan2(0.1 * wheels.x, 0.1 - 0.1 * wheels.y)
    inner = np.abs(expected) < 1.2  # the others are at their limit
    assert truth.steering[inner] == pytest.approx(expected[inner], abs=1e-6)
    assert truth.yaw_rate > 0.8 * 0.1
    assert truth.yaw_rate > 1.2 * skids.yaw_rate
    # Slip is that of each wheel along its heading, from the motion of a rigid body.
    hub = np.stack(
        [
            truth.forward_velocity - truth.yaw_rate * wheels.y,
            truth.lateral_velocity + truth.yaw_rate * wheels.x,
        ]
    )
    cosine, sine = np.cos(truth.steering), np.sin(truth.steering)
    along = cosine * hub[0] + sine * hub[1]
    np.testing.assert_allclose(truth.slip_velocity, truth.wheel_rate * wheels.slip_radius - along)
    # A steady circle: the soil turns the speed, and holds nothing else.
    along = (truth.drawbar_pull * cosine - truth.lateral_force * sine).sum()
    across = (truth.drawbar_pull * sine + truth.lateral_force * cosine).sum()
    assert across == pytest.approx(mass * truth.yaw_rate * truth.forward_velocity, abs=1.0)
    assert along == pytest.approx(0.0, abs=1.0)


# Ground: height is the integral of the slope, soil changes where the patches say.


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


# Loads against statics done by hand.


def test_moments_balance_for_any_force():
    configuration = rover()
    suspension = Suspension(configuration)
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


def test_no_wheel_pulls_on_the_ground_and_given_shares_are_kept():
    rigid = Suspension(rover('rover.suspension:=rigid'))
    loads = rigid.normal_loads(180.0, np.array([9.0, 0.0, 4.0]), np.zeros(6), np.zeros(6))
    assert loads.min() >= LEAST_LOAD_SHARE * 180.0 * 4.0 / 6.0 * 0.5
    assert loads.sum() == pytest.approx(720.0)
    configuration = rover(
        'rover.suspension:=shares', 'rover.load_shares:=[0.1, 0.1, 0.2, 0.2, 0.2, 0.2]'
    )
    loads = Suspension(configuration).normal_loads(
        180.0, np.array([1.0, 0.0, 5.0]), np.zeros(6), np.zeros(6)
    )
    np.testing.assert_allclose(loads, 900.0 * np.array([0.1, 0.1, 0.2, 0.2, 0.2, 0.2]))
