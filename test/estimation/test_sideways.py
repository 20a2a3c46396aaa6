# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Slip angle, lateral force and lateral speed: rigid bodies, balances and simulated drives."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from wheel_terra_estimator.estimation.core import EstimatorCore
from wheel_terra_estimator.estimation.sideways import (
    UNKNOWN_ANGLE_STD,
    SidewaysInputs,
    SidewaysMotion,
    _angle_std,
)
from wheel_terra_estimator.simulation import scenario as scenarios
from wheel_terra_estimator.simulation.drive import START, Drive
from wheel_terra_estimator.simulation.drives import Command

X, Y = (0.4, 0.4, -0.4, -0.4), (0.3, -0.3, 0.3, -0.3)
ROVER = SimpleNamespace(
    longitudinal=X,
    lateral=Y,
    rim_radius=(0.12,) * 4,
    width=(0.12,) * 4,
    mass=40.0,
    rest_speed=0.002,
)
STRAIGHT = SidewaysInputs(
    speed=0.08,
    speed_std=0.002,
    yaw_rate=0.0,
    yaw_rate_std=1e-3,
    rims=(0.1,) * 4,
    steering=(0.0,) * 4,
    loads=(98.0,) * 4,
    pulls=(10.0,) * 4,
    sinkage=(0.015,) * 4,
    lateral_force=0.0,
    lateral_force_std=0.02,
    cohesion=500.0,
    tan_friction=0.6,
    shear_modulus=0.015,
)


def arrays(found):
    return SimpleNamespace(**{name: np.array(value) for name, value in vars(found).items()})


def told(**changes):
    return arrays(SidewaysMotion(ROVER).update(0.0, STRAIGHT._replace(**changes)))


def test_straight_on_level_ground_nothing_slides():
    found = told()
    assert found.angle == pytest.approx(0.0, abs=1e-3)
    assert found.force == pytest.approx(0.0, abs=0.1)
    assert found.velocity == pytest.approx(0.0, abs=1e-4)
    assert (found.angle_std > 0.0).all() and found.velocity_variance > 0.0


def test_wheels_carry_the_weight_across_the_slope_and_slide_down():
    uphill_left = 9.8 * math.sin(0.15)  # specific force along y: the left side is higher
    found = told(lateral_force=uphill_left)
    assert found.force.sum() == pytest.approx(40.0 * uphill_left, rel=1e-3)
    assert found.velocity < 0.0 and (found.angle < 0.0).all()
    other = told(lateral_force=-uphill_left)
    assert other.velocity == pytest.approx(-found.velocity, rel=1e-3)
    steeper = told(lateral_force=1.5 * uphill_left)
    assert steeper.velocity < 1.5 * found.velocity  # the soil gives way
    assert steeper.velocity_variance > found.velocity_variance
    beyond = told(lateral_force=9.0)  # more than friction
    assert math.sqrt(beyond.velocity_variance) > 0.09


def test_angles_are_those_of_a_rigid_body():
    # A front axle that steers left in a turn about a point on the rear axle's line (Ackermann).
    rate, speed = 0.05, 0.08
    point = speed / rate
    steering = (math.atan2(0.8, point - 0.3), math.atan2(0.8, point + 0.3), 0.0, 0.0)
    # The axles that roll without sliding are the rear ones: v_y = 0.4 w at the middle of the body.
    hubs = [(speed - rate * y, 0.4 * rate + rate * x) for x, y in zip(X, Y, strict=True)]
    rims = tuple(math.hypot(*hub) for hub in hubs)
    found = told(yaw_rate=rate, steering=steering, rims=rims, pulls=(0.0,) * 4)
    assert found.velocity == pytest.approx(0.4 * rate, abs=1e-4)
    assert found.angle == pytest.approx(0.0, abs=0.01)
    # A wheel turned across while the body drives straight slides by that angle.
    held = told(steering=(0.5, -0.5, 0.0, 0.0))
    assert held.angle == pytest.approx([-0.5, 0.5, 0.0, 0.0], abs=0.01)
    assert held.force[0] > 0.0 > held.force[1]
    backward = told(speed=-0.08, rims=(-0.1,) * 4)  # atan2 of the hub's own speeds
    assert np.abs(backward.angle) == pytest.approx(math.pi, abs=0.01)


def test_a_lateral_reference_corrects_the_model_and_fades():
    motion, truth = SidewaysMotion(ROVER), -0.012
    given = STRAIGHT._replace(lateral_force=1.0)
    alone = motion.update(0.0, given)
    for k in range(1, 30):
        motion.correct(truth, 0.002**2)
        near = motion.update(0.1 * k, given)
    assert near.velocity == pytest.approx(truth, abs=1e-3)
    assert near.velocity_variance < 0.1 * alone.velocity_variance
    between = SidewaysMotion(ROVER)
    between.update(0.0, given)
    between.correct(truth, alone.velocity_variance)  # no better than the model: half way
    half = between.update(0.0, given)
    assert half.velocity == pytest.approx(0.5 * (alone.velocity + truth), rel=1e-3)
    late = motion.update(1e4, given)
    assert late.velocity == pytest.approx(alone.velocity, abs=1e-4)
    assert late.velocity_variance == pytest.approx(alone.velocity_variance, rel=1e-3)


def test_forces_that_an_unknown_yaw_rate_would_change_are_that_uncertain():
    """A gyro as noisy as that of a shaken rover, on wheels that hardly turn: forces are drawn."""
    slow = {'speed': 0.01, 'rims': (0.01,) * 4, 'shear_modulus': 0.002}
    noise = 0.01  # [rad/s]
    drawn = np.random.default_rng(3).normal(0.0, noise, 300)
    forces = [told(**slow, yaw_rate=rate, yaw_rate_std=noise).force for rate in drawn]
    scatter = np.std(forces, axis=0)
    assert (scatter > 5.0).all()  # [N], so that it is the noise that counts
    found = told(**slow, yaw_rate_std=noise)
    assert (found.force_std > 0.7 * scatter).all()
    known = told(**slow, yaw_rate_std=1e-6)
    assert (known.force_std < 0.5 * scatter).all()


@pytest.mark.parametrize('std', [0.006, 0.0005])  # of the speed; aside it is the model's
def test_deviations_of_slip_angles_are_those_of_speeds_that_are_drawn(std):
    steering, rng, draws = (0.9, -0.6, 0.0, 0.0), np.random.default_rng(6), 20_000
    found = told(speed_std=std, yaw_rate_std=0.01, steering=steering)
    speed, yaw_rate = rng.normal(0.08, std, draws), rng.normal(0.0, 0.01, draws)
    aside = rng.normal(found.velocity, math.sqrt(found.velocity_variance), draws)
    for i, (x, y) in enumerate(zip(X, Y, strict=True)):
        angle = np.arctan2(aside + yaw_rate * x, speed - yaw_rate * y) - steering[i]
        assert found.angle[i] == pytest.approx(angle.mean(), abs=0.02)
        assert found.angle_std[i] == pytest.approx(angle.std(), rel=0.05)


def test_at_rest_angles_are_held_and_not_known():
    motion = SidewaysMotion(ROVER)
    before = motion.update(0.0, STRAIGHT._replace(lateral_force=1.0))
    standing = STRAIGHT._replace(speed=0.0, rims=(0.0,) * 4, lateral_force=1.0)
    found = arrays(motion.update(0.1, standing))
    assert found.angle.tolist() == list(before.angle)
    assert found.angle_std == pytest.approx(UNKNOWN_ANGLE_STD)
    assert found.velocity == 0.0
    assert found.force.sum() == pytest.approx(40.0, rel=0.3)


@pytest.mark.parametrize('missing', ['rims', 'force', 'loads', 'reversed'])
def test_it_is_never_nan(missing):
    changes = {
        'rims': {'rims': (math.nan,) * 4},
        'force': {'lateral_force': math.nan},
        'loads': {'loads': (0.0,) * 4},
        'reversed': {'speed': -0.05, 'rims': (0.1, -0.1, 0.1, -0.1)},
    }[missing]
    for value in vars(told(**changes)).values():
        assert np.isfinite(value).all()


@pytest.mark.slow
@pytest.mark.parametrize(('name', 'side'), [('firm_drive', 8.0), ('turns', None)])
def test_slip_angles_of_simulated_drives_lie_within_their_deviations(name, side):
    """Against hubs of the simulated rigid body; no reference velocity at all."""
    scenario = scenarios.load(name)
    drive = Drive(scenario, 3)
    if side is not None:
        drive.plant._terrain._sin_side = math.sin(math.radians(side))
    core, wheels = EstimatorCore(scenario.configuration), scenario.configuration.wheels
    arrivals, truths = [], {}
    for _ in range(round(15.0 / drive.step_length)):
        command = scenario.profile.at(drive.plant.time)
        arrivals += drive.step(Command(command.forward, command.turn_rate))
        truths[START + round(drive.plant.time * 1e9)] = drive.last_truth
    stamps, table = np.array(list(truths)), list(truths.values())
    errors, forces = [], []
    kept = [a for a in arrivals if type(a.measurement).__name__ != 'ReferenceVelocity']
    for arrival in sorted(kept, key=lambda a: a.arrival):
        for e in core.add(arrival.measurement):
            truth = table[int(np.argmin(np.abs(stamps - e.stamp)))]
            forward = truth.forward_velocity - truth.yaw_rate * wheels.y
            aside = truth.lateral_velocity + truth.yaw_rate * wheels.x
            if truth.time > 4.0 and np.hypot(forward, aside).min() > 0.02:
                error = e.sideways.angle - np.arctan2(aside, forward) + truth.steering
                errors.append(np.array([error, e.sideways.angle_std]))
                forces.append([e.sideways.force - truth.lateral_force, e.sideways.force_std])
    (error, std), (off, off_std) = (np.swapaxes(np.array(x), 0, 1) for x in (errors, forces))
    assert len(error) > 100
    assert np.sqrt(np.mean(error**2)) < math.radians(5.0)
    assert np.mean(np.abs(error) < 2.0 * std) > 0.9
    assert np.mean(np.abs(off) < 2.0 * off_std) > 0.9


def test_a_direction_of_speeds_known_no_better_than_their_size_may_be_any():
    """Against draws: the spread of the direction of two Gaussian speeds."""
    draws = np.random.default_rng(1).normal(size=(2, 20000))
    for along, across, std in ((0.05, 0.01, 0.003), (0.12, 0.27, 0.27), (0.12, 0.1, 0.1)):
        angle = np.arctan2(across + std * draws[1], along + 0.01 * draws[0])
        middle = np.arctan2(across, along)
        spread = np.sqrt(np.mean((angle - middle) ** 2))
        errors = np.array([[0.01], [0.0]]), np.array([[0.0], [std]])  # each in one of the two
        found = _angle_std(np.array([along]), np.array([across]), *errors)
        assert found[0] == pytest.approx(spread, rel=0.3)
