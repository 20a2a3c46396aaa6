# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Simulator B obeys its own mechanics; common laws agree with the package."""

from dataclasses import replace

import numpy as np
import pytest

from wheel_terra_estimator.estimation.contacts.load_distribution import load_distribution
from wheel_terra_estimator.estimation.measurements import (
    InertialReading,
    ReferenceVelocity,
    SinkageReading,
    WheelOdometry,
)
from wheel_terra_estimator.terramechanics.model import WheelSoilModel
from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints
from wheel_terra_estimator.terramechanics.soil import Soil
from wheel_terra_estimator.terramechanics.wheel import Wheel
from wheel_terra_lab.evaluation.simulator_b import drive as drive_b
from wheel_terra_lab.evaluation.simulator_b import rovers, sensing, vehicle, wheel_soil

SLIPS = np.array([-0.6, -0.2, 0.05, 0.1, 0.2, 0.4, 0.6, 0.8, 0.95])
SHAPE = wheel_soil.WheelShape(*(np.full(9, v) for v in (0.157, 0.165, 0.01, 24.0)))
SOIL = wheel_soil.SoilHere(
    *map(np.asarray, (15600.0 / 0.165 + 2407400.0, 1.1, 250.0, np.tan(0.557), 0.0114, 15700.0))
)


def rolling(slip, rate=0.3, sideways=0.0):
    ratio = np.where(slip >= 0.0, 1.0 - slip, 1.0 / (1.0 + slip))
    rates = np.full(len(slip), rate)
    return wheel_soil.Motion(ratio * rates * SHAPE.tip_radius, np.full(len(slip), sideways), rates)


@pytest.mark.parametrize('load', [20.0, 80.0, 300.0])
def test_common_law_agrees_with_the_quadrature_of_the_package(load):
    laws = wheel_soil.ContactLaws(peak_ratio=0.4, leaving_ratio=-0.1)
    depth, forces = wheel_soil.settled_depth(SHAPE, SOIL, laws, rolling(SLIPS), np.full(9, load))
    soil = Soil(15600.0, 2407400.0, 1.1, 250.0, 0.557, 0.0114, 0.4, -0.1)
    wheel = Wheel(radius=0.157, width=0.165, lug_height=0.01, lug_count=24, lug_thickness=0.0)
    points = OperatingPoints(slip=SLIPS, normal_load=np.full(9, load), wheel=wheel)
    state = WheelSoilModel(soil, {}, method='quadrature').steady_state(points)
    np.testing.assert_allclose(depth, state.sinkage, rtol=0.005)
    np.testing.assert_allclose(forces.pull, state.drawbar_pull, atol=0.003 * load)
    np.testing.assert_allclose(forces.torque, state.torque, atol=0.003 * load * 0.157)


def test_reverse_mirrors_forward_and_sideways_motion_takes_from_the_pull():
    laws = wheel_soil.ContactLaws(
        peak_shift=0.1, leaving_ratio=-0.1, bulldozing=0.3, lug_thrust=0.1
    )
    depth, load = np.full(9, 0.012), np.full(9, 80.0)
    forth, back = (
        wheel_soil.soil_forces(
            SHAPE,
            SOIL,
            laws,
            wheel_soil.Motion(sign * m.forward, m.sideways, sign * m.rate),
            depth,
            depth,
            load,
        )
        for sign in (1.0, -1.0)
        for m in (rolling(SLIPS, sideways=0.01),)
    )
    np.testing.assert_allclose(back.pull, -forth.pull)
    np.testing.assert_allclose(back.torque, -forth.torque)
    np.testing.assert_allclose(back.side, forth.side)
    assert np.all(forth.side < 0.0)  # it opposes the motion to the left
    straight = wheel_soil.soil_forces(SHAPE, SOIL, laws, rolling(SLIPS), depth, depth, load)
    driving = SLIPS > 0.0
    assert np.all(np.abs(forth.torque[driving]) < np.abs(straight.torque[driving]))


def test_loads_balance_weight_and_moments_whatever_carries_them():
    """By sums over all wheels, and part by part as the estimator's, which another hand derived."""
    x, y = np.array([0.6, 0.6, 0.0, 0.0, -0.6, -0.6]), np.array([0.5, -0.5] * 3)
    shape = wheel_soil.WheelShape(*(np.full(6, v) for v in (0.12, 0.16, 0.005, 24.0)))
    pivots = vehicle.RockerBogie((0.0, 0.35), (-0.3, 0.22))
    rover = vehicle.Vehicle(180.0, 9.81, (0.02, 0.01, 0.45), shape, x, y, pivots, 30.0)
    force = vehicle.ChassisForce(2.0, 0.7, 9.5)
    pull = 180.0 * 2.0 * np.array([0.1, 0.2, 0.15, 0.2, 0.05, 0.3])
    lead = np.array([3.0, 5.0, 2.0, 4.0, 1.0, 6.0])  # the soil holds the wheels: T - F r
    for suspension in (pivots, None):
        loads = vehicle.wheel_loads(replace(rover, suspension=suspension), force, pull, lead)
        assert loads.sum() == pytest.approx(180.0 * 9.5)
        assert loads @ x + lead.sum() == pytest.approx(180.0 * (9.5 * 0.02 - 2.0 * 0.45))
        assert loads @ y == pytest.approx(180.0 * (9.5 * 0.01 - 0.7 * 0.45))
        ours = load_distribution(
            mass=180.0,
            position=np.column_stack([x, y]),
            centre_of_gravity=(0.02, 0.01, 0.45),
            contact_height=0.0,
            suspension='rocker_bogie' if suspension else 'rigid',
            shares=np.ones(6),
            rocker_pivot=pivots.rocker,
            bogie_pivot=pivots.bogie,
            bogie_wheels='rear',
        )
        assert loads == pytest.approx(ours.loads((2.0, 0.7, 9.5), pull, lead))


@pytest.fixture(scope='module')
def climb():
    return drive_b.simulate('climb', 1001, 15.0)


@pytest.mark.slow
def test_forces_close_and_no_wheel_gives_energy(climb):
    t, rover = climb.truth, climb.draw.vehicle
    time = (t.stamp - sensing.START) * 1e-9
    force = climb.course.at('specific_force', time)[:, 0]
    gap = t.drawbar_pull.sum(axis=1) - rover.mass * force
    assert np.quantile(np.abs(gap), 0.99) < 1e-3 * rover.weight
    # The motor gives more than the chassis takes; the soil keeps the difference.
    ground = t.wheel_rate * rover.shape.tip_radius - t.slip_velocity
    lost = t.torque * t.wheel_rate - t.drawbar_pull * ground
    assert lost.min() > -1e-3 * rover.weight * climb.draw.speed
    # What the chassis takes is lift and speed: sum of F v dt = m g dh + m v^2/2.
    c = climb.course
    taken = np.sum((t.drawbar_pull * ground).sum(axis=1)[1:] * np.diff(time))
    height = np.sum((c.speed[:, 0] * np.sin(c.slopes[:, 0]))[1:] * np.diff(c.time))
    assert taken == pytest.approx(rover.weight * height, rel=0.03)


def test_steady_slip_grows_with_the_slope():
    draw = drive_b.simulate('cruise', 1003, 1.0).draw
    slopes = [
        rovers.slope_for_slip(draw.vehicle, draw.soil, s) for s in (-0.3, -0.15, 0.2, 0.35, 0.5)
    ]
    assert np.all(np.diff(slopes) > 0.0)


@pytest.mark.slow
def test_drive_is_the_same_for_the_same_seed_and_measurements_are_of_the_rover(climb):
    again = drive_b.simulate('climb', 1001, 15.0)
    assert [a.arrival for a in again.arrivals] == [a.arrival for a in climb.arrivals]
    np.testing.assert_array_equal(again.truth.slip, climb.truth.slip)
    by_type = {}
    for arrival in climb.arrivals:
        assert arrival.arrival >= arrival.measurement.stamp
        by_type.setdefault(type(arrival.measurement), []).append(arrival.measurement)
    assert set(by_type) == {WheelOdometry, InertialReading, SinkageReading, ReferenceVelocity}
    t = climb.truth
    rate = np.array([m.rate for m in by_type[WheelOdometry]])
    assert np.abs(rate - t.wheel_rate).mean() < 0.05 * np.abs(t.wheel_rate).mean()
    gravity = climb.draw.vehicle.gravity
    force = np.array([m.specific_force for m in by_type[InertialReading]])
    assert np.linalg.norm(force, axis=1).mean() == pytest.approx(gravity, rel=0.02)


@pytest.mark.slow
def test_orientation_is_nose_up_on_a_climb(climb):
    last = [m for _, m in climb.arrivals if isinstance(m, InertialReading)][-1]
    x, y, z, w = last.orientation
    nose = -np.arcsin(2.0 * (w * y - z * x))  # REP 103: nose-up is negative pitch
    assert np.linalg.norm(last.orientation) == pytest.approx(1.0)
    assert nose == pytest.approx(climb.course.slopes[-1, 0], abs=0.04)
    assert last.specific_force[0] > 0.5 * climb.draw.vehicle.gravity * np.sin(nose)


def test_truth_knows_rest_and_classes():
    time = np.arange(0.0, 10.0, 0.1)
    rim = np.where(time < 5.0, 0.05, 0.0)[:, None]
    rest = drive_b.resting(time, rim, 0.5 * rim)
    assert not rest[:54].any() and rest[56:].all()
    np.testing.assert_array_equal(
        drive_b.slip_classes(np.array([-0.3, 0.31, 0.6, 0.95, np.nan])), [0, 1, 1, 3, 255]
    )


@pytest.mark.slow
def test_steered_wheels_roll_round_where_they_are_told():
    drive = drive_b.simulate('steered', 1002, 30.0)
    rover, t, c = drive.draw.vehicle, drive.truth, drive.course
    front = np.abs(rover.x) == np.abs(rover.x).max()
    time = (t.stamp - sensing.START) * 1e-9
    spin = (time > 0.6 * 30.0) & (time < 0.65 * 30.0)
    # On the spot a hub goes round the middle: across the line to it.
    angle = c.at('steering', time)[spin][-1]
    np.testing.assert_allclose(np.tan(angle[front]), -(rover.x / rover.y)[front], rtol=0.05)
    # Wheels that need not skid turn the rover as their rims say, less their slip.
    outer = np.hypot(rover.x, rover.y)[front]
    rim = np.abs(t.wheel_rate[spin])[:, front] * rover.shape.tip_radius[front]
    yaw = np.abs(t.yaw_rate[spin]).mean()
    assert 0.75 < yaw / (rim / outer).mean() < 1.02
    # What is read: angles of the wheels that steer, as the file names them.
    read = [a.measurement for a in drive.arrivals if isinstance(a.measurement, WheelOdometry)]
    last = read[-1].steering
    np.testing.assert_array_equal(~np.isnan(last), drive.configuration.wheels.steered)
    np.testing.assert_allclose(last[front], c.steering[-1][front], atol=0.05)
    ground = t.wheel_rate * rover.shape.tip_radius - t.slip_velocity
    lost = t.torque * t.wheel_rate - t.drawbar_pull * ground
    assert lost.min() > -2e-3 * rover.weight * drive.draw.speed
