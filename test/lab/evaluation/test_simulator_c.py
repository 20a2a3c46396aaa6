# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Simulator C against physics that does not come from it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad

from wheel_terra_estimator.estimation import measurements
from wheel_terra_estimator.estimation.judgement.entrapment import entrapments
from wheel_terra_lab.evaluation.simulator_c import drive as simulator
from wheel_terra_lab.evaluation.simulator_c import ground as soils
from wheel_terra_lab.evaluation.simulator_c.contact import Contacts, Rims
from wheel_terra_lab.evaluation.simulator_c.dynamics import Command, Motion, drive
from wheel_terra_lab.evaluation.simulator_c.plans import (
    ENTRAPMENTS,
    KINDS,
    Driver,
    Phase,
    slip_ratio,
)
from wheel_terra_lab.evaluation.simulator_c.rover import FAMILIES, draw_rover
from wheel_terra_lab.evaluation.simulator_c.sensors import START

EARTH = 9.80665
PLAIN = replace(
    soils.draw_soil(np.random.default_rng(3)),
    residual=1.0,
    softening=1e-9,
    digging=1e-9,
    heave=1e-9,
    ploughing=1e-9,
)
"""A soil in which stresses depend on place and sliding only, so that they can be written down."""


FIRM = replace(KINDS['firm'], duration=4.0)


def each(ground, count):
    return soils.Ground.from_logarithms(np.repeat(ground.logarithms()[:, None], count, axis=1))


def wheels(count, radius=0.15, width=0.12, lug=0.0):
    full = np.ones(count)
    return Rims(radius * full, width * full, lug * full, (radius + 0.5 * lug) * full, full)


def settled(contacts, ground, load, rate, speed, side, seconds=8.0, step=0.005):
    zero = np.zeros(len(rate))
    for _ in range(round(seconds / step)):
        contacts.travel(ground, step, rate, speed, zero)
        forces, shear = contacts.step(ground, step, rate, speed, side)
        contacts.keep(shear, rate, speed, side)
        contacts.settle(load, forces.normal, 0.0)
    return forces


def written_anew(sinkage, slip):
    """Return normal force, pull and torque of a wheel sunk so far, by adaptive quadrature."""
    radius, width, friction = 0.15, 0.12, PLAIN.friction
    nq = np.exp(np.pi * friction) * np.tan(np.pi / 4 + 0.5 * np.arctan(friction)) ** 2
    weight = PLAIN.density * EARTH
    strip = PLAIN.cohesion * (nq - 1) / friction + 0.5 * weight * width * 2 * (nq + 1) * friction
    entry = np.arccos(1 - sinkage / radius)
    rebound = sinkage / PLAIN.rebound

    def bearing(depth):
        mobilised = strip * (1 - np.exp(-depth / PLAIN.settling))
        subsoil = 1 + (depth / (0.5 * radius)) ** 3
        return subsoil * PLAIN.bearing * (mobilised + weight * nq * depth)

    def sigma(theta):
        raised = radius * (1 - np.cos(theta))
        if theta >= 0:
            return bearing(sinkage - raised)
        return max(bearing(sinkage) * (1 - raised / rebound), 0.0)

    def tau(theta):
        slid = radius * ((entry - theta) - (1 - slip) * (np.sin(entry) - np.sin(theta)))
        touching = sigma(theta) / (sigma(theta) + 100.0)
        strength = PLAIN.cohesion * touching + friction * sigma(theta)
        return strength * (1 - np.exp(-slid / PLAIN.shear_length))

    leaving = -np.arccos(1 - rebound / radius)

    def over_the_contact(stress):
        whole = quad(stress, leaving, 0, limit=200)[0] + quad(stress, 0, entry, limit=200)[0]
        return width * radius * whole

    return (
        over_the_contact(lambda t: sigma(t) * np.cos(t) + tau(t) * np.sin(t)),
        over_the_contact(lambda t: tau(t) * np.cos(t) - sigma(t) * np.sin(t)),
        radius * over_the_contact(tau),
    )


def test_forces_are_those_of_scipy_quad():
    contacts, slips = Contacts(wheels(3), EARTH), np.array([0.1, 0.3, 0.7])
    rate, load = np.full(3, 0.6), np.full(3, 80.0)
    forces = settled(
        contacts, each(PLAIN, 3), load, rate, (1 - slips) * 0.15 * rate, 0.0 * rate, 5.0
    )
    assert forces.normal == pytest.approx(load, rel=1e-3)
    for i, slip in enumerate(slips):
        normal, pull, torque = written_anew(contacts.sinkage[i], slip)
        assert forces.normal[i] == pytest.approx(normal, rel=0.02)
        assert forces.torque[i] == pytest.approx(torque, rel=0.02)
        assert forces.pull[i] == pytest.approx(pull, abs=0.02 * 80.0)


@pytest.mark.slow
def test_the_friction_circle_bounds_pull_and_side_force():
    ground, count = each(replace(PLAIN, cohesion=1e-3), 4), 4
    contacts = Contacts(wheels(count), EARTH)
    rate, load = np.full(count, 0.6), np.full(count, 80.0)
    side = np.array([0.0, 0.02, 0.05, 0.2])
    forces = settled(contacts, ground, load, rate, 0.6 * 0.15 * rate, side)
    assert np.all(np.diff(forces.torque) < 0.0)  # lateral sliding takes from the thrust
    assert np.all(np.diff(forces.side) < 0.0)  # and points against the motion
    most = PLAIN.friction * 1.05 * 80.0
    assert np.all(np.hypot(forces.torque / 0.15, forces.side) < most)


@pytest.mark.slow
def test_a_spinning_wheel_digs_itself_in_and_loses_its_pull():
    soil = soils.draw_soil(np.random.default_rng(1))
    contacts = Contacts(wheels(3, lug=0.01), EARTH)
    rate, slip = np.full(3, 1.0), np.array([0.1, 0.5, 0.95])
    forces = settled(contacts, each(soil, 3), np.full(3, 90.0), rate, (1 - slip) * 0.16, 0 * rate)
    assert np.all(np.diff(contacts.sinkage) > 0.001)
    assert forces.pull[2] < 0.8 * forces.pull[1]


def rover_on(family, land_settings, seed=5):
    rng = np.random.default_rng(seed)
    rover = draw_rover(rng, FAMILIES[family], EARTH)
    soil = soils.draw_soil(np.random.default_rng(3))
    land = soils.Land(
        soil,
        soil,
        rng,
        **{'roughness': 0.0, 'variation': 1e-9, 'cell': 0.4 * rover.rims.width[0], **land_settings},
    )
    return rover, Motion(rover, land)


def straight(rover, share=1.0):
    rate = share * rover.speed / rover.rims.shear_radius

    def command(state):
        ramp = min(state.time, 1.0)
        return Command(ramp * rate, np.zeros(rover.count), np.zeros(rover.count, dtype=bool))

    return command


@pytest.mark.slow
@pytest.mark.parametrize('family', ['six_rocker', 'eight_skid'])
def test_loads_at_rest_carry_the_weight_where_its_centre_is(family):
    rover, motion = rover_on(family, {})
    course = drive(motion, straight(rover, 0.0), 2.0)
    loads = course.normal[-1]
    weight = rover.mass * EARTH
    assert loads.sum() == pytest.approx(weight, rel=0.005)
    lever = rover.centre[2] * np.sin([course.pitch[-1], course.roll[-1]])
    # The soil holds the wheels by loads ahead of their hubs.
    ahead = (course.torque[-1] - course.pull[-1] * rover.rims.radius).sum() / weight
    assert loads @ rover.x / weight == pytest.approx(rover.centre[0] - lever[0] - ahead, abs=0.01)
    assert loads @ rover.y / weight == pytest.approx(rover.centre[1] - lever[1], abs=0.01)


@pytest.mark.slow
@pytest.mark.parametrize('family', ['four_skid', 'six_rocker'])
def test_the_pull_in_a_steady_climb_is_the_weight_along_the_slope(family):
    tangent = 0.15
    rover, motion = rover_on(family, {'slope': tangent, 'slope_start': -50.0})
    course = drive(motion, straight(rover), 11.0)
    late = course.time > 8.0
    needed = rover.mass * EARTH * np.sin(np.arctan(tangent))
    assert course.velocity[late, 0].min() > 0.3 * rover.speed
    assert course.pull[late].sum(axis=1).mean() == pytest.approx(needed, rel=0.04)
    # What the drives put in is more than what lifts the rover; each wheel loses some.
    rim_power = course.torque * course.rate
    assert np.all((rim_power - course.pull * course.speed)[late].mean(axis=0) > 0.0)
    assert rim_power[late].sum(axis=1).mean() > needed * course.velocity[late, 0].mean()


@pytest.mark.slow
def test_free_rolling_on_hard_ground_has_no_slip():
    rover, motion = rover_on('four_tyres', {'hard': True})
    course = drive(motion, straight(rover), 8.0)
    slip = slip_ratio(course.rate * rover.rims.radius, course.speed)[course.time > 3.0]
    assert np.abs(slip).max() < 0.005


def test_a_border_at_an_angle_is_met_by_one_wheel_after_the_other():
    rover, _ = rover_on('six_rocker', {})
    patch = soils.Patch(start=1.0, length=50.0, angle=0.5)
    way = np.arange(0.0, 6.0, 0.001)
    first = [
        way[np.argmax(patch.share(way + x, np.full_like(way, y)) > 0.5)]
        for x, y in zip(rover.x, rover.y, strict=True)
    ]
    expected = (1.0 + 0.015) / np.cos(0.5) - rover.x - rover.y * np.tan(0.5)
    assert first == pytest.approx(expected, abs=0.002)
    assert np.diff(np.sort(first)).min() > 0.01


@pytest.mark.slow
def test_a_later_wheel_runs_in_the_rut_of_the_first():
    rover, motion = rover_on('six_rocker', {})
    drive(motion, straight(rover), 8.0)
    contacts = motion.contacts
    assert np.all(contacts.rut[:2] < 1e-6)
    assert np.all(contacts.rut[2:] > 0.3 * contacts.bottom[:2].mean())


BEND, SPIN = Phase(6.5, 1.0, 0.3), Phase(6.5, 0.0, 0.0, 0.8)


@pytest.mark.slow
@pytest.mark.parametrize(
    ('family', 'turn'),
    [
        *((family, BEND) for family in ('four_front', 'four_skid', 'four_all', 'six_rocker')),
        *((family, SPIN) for family in ('four_skid', 'four_all', 'six_rocker')),
    ],
)
def test_positive_turns_go_to_the_left(family, turn):
    rover, motion = rover_on(family, {})
    course = drive(motion, Driver(rover, (Phase(1.0, 0.0), turn), 0.0), 7.5)
    assert course.yaw[-1] > 0.1
    if turn.turn and rover.steered.any():
        ahead = rover.steered & (rover.x > 0.0)
        assert np.all(course.steering[-1][ahead] > 0.05)
        wanted = turn.turn / (rover.x.max() - rover.x.min())
        assert course.velocity[-1, 2] / course.velocity[-1, 0] == pytest.approx(wanted, rel=0.35)


def test_slip_is_that_of_the_interface():
    #               driving, spinning, skidding, locked, sliding back, reverse, fast reverse skid
    rim = np.array([0.10, 0.10, 0.05, 0.0, 0.10, -0.10, -0.05])
    speed = np.array([0.08, 0.0, 0.10, 0.1, -0.01, -0.08, -0.10])
    assert slip_ratio(rim, speed) == pytest.approx([0.2, 1.0, -0.5, -1.0, 1.0, 0.2, -0.5])


@pytest.fixture(scope='module')
def firm():
    with pytest.MonkeyPatch.context() as shorter:
        shorter.setitem(simulator.KINDS, 'firm', FIRM)
        return simulator.simulate('firm', 1)


@pytest.mark.slow
def test_a_drive_is_the_same_for_the_same_seed(firm, monkeypatch):
    driven = simulator._driven('firm', FIRM, 1)
    assert np.array_equal(firm.course.rate, driven[2].rate)
    monkeypatch.setattr(simulator, '_driven', lambda *arguments: driven)
    again = simulator.simulate('firm', 1)
    assert np.array_equal(firm.truth.slip, again.truth.slip, equal_nan=True)
    assert [a.arrival for a in firm.arrivals] == [a.arrival for a in again.arrivals]
    assert firm.configuration.flat() == again.configuration.flat()
    assert firm.configuration.rover.mass == pytest.approx(firm.rover.mass, rel=0.1)
    shorter = simulator.simulate('firm', 1, 3.0)
    assert shorter.course.time[-1] == pytest.approx(3.0, abs=0.02)


def check(found):
    """Check what every drive must be."""
    truth, count = found.truth, found.rover.count
    assert found.configuration.wheels.count == count
    heard = {type(a.measurement) for a in found.arrivals}
    assert {measurements.WheelOdometry, measurements.InertialReading} <= heard
    arrivals = np.array([a.arrival for a in found.arrivals])
    assert np.all(np.diff(arrivals) >= 0)
    assert all(a.arrival >= a.measurement.stamp for a in found.arrivals)
    assert truth.slip.shape == (len(truth.stamp), count)
    assert np.all(np.diff(truth.stamp) > 0)
    assert np.nanmax(np.abs(truth.slip)) <= 1.0
    assert np.array_equal(truth.slip_class == 255, np.isnan(truth.slip))
    gravity = found.rover.gravity * np.cos(found.course.pitch) * np.cos(found.course.roll)
    carried = found.course.normal.sum(axis=1) / (found.rover.mass * gravity)
    assert np.median(carried) == pytest.approx(1.0, abs=0.03)
    for name in ('drawbar_pull', 'normal_load', 'sinkage', 'wheel_rate', 'yaw_rate'):
        assert np.all(np.isfinite(getattr(truth, name)))


def entrapments_of(drive):
    return entrapments(drive.truth.stamp * 1e-9, drive.truth.slip)


@pytest.fixture(scope='module')
def trap():
    return simulator.simulate('entrapment_fast', 6)


@pytest.mark.slow
def test_sensors_read_the_truth_with_their_errors(trap):
    found, course, gravity = trap, trap.course, trap.rover.gravity
    inertial = [a.measurement for a in found.arrivals if hasattr(a.measurement, 'specific_force')]
    resting = [m for m in inertial if m.stamp - START < 1_500_000_000]
    felt = np.mean([m.specific_force for m in resting], axis=0)
    pitch, roll = course.pitch[:150].mean(), course.roll[:150].mean()
    up = np.array([np.sin(pitch), np.sin(roll), 1.0])
    assert felt / gravity == pytest.approx(up, abs=0.25 / gravity)
    if inertial[0].orientation is not None:
        x, y, z, w = np.array([m.orientation for m in inertial]).T
        nose_up = np.interp([(m.stamp - START) * 1e-9 for m in inertial], course.time, course.pitch)
        assert np.arcsin(2 * (z * x - w * y)) == pytest.approx(nose_up, abs=0.03)
    odometry = [a.measurement for a in found.arrivals if hasattr(a.measurement, 'rate')]
    measured = np.array([m.rate for m in odometry])
    assert measured.mean(axis=0) == pytest.approx(found.truth.wheel_rate.mean(axis=0), rel=0.02)
    torque = np.array([m.torque for m in odometry]).mean(axis=0)
    usual = found.rover.mean_load * found.rover.rims.radius
    assert torque == pytest.approx(course.torque.mean(axis=0), abs=0.25 * usual.max())


@pytest.mark.slow
@pytest.mark.parametrize('kind', KINDS)
def test_every_kind_is_what_its_name_says(kind):
    found = simulator.simulate(kind, 7)
    check(found)
    assert bool(entrapments_of(found).entrapped.size) == (kind in ENTRAPMENTS)
    heard = {type(a.measurement) for a in found.arrivals}
    plan = KINDS[kind]
    if plan.reference_period == 0.0:
        assert measurements.ReferenceVelocity not in heard
    if not plan.sinkage:
        assert measurements.SinkageReading not in heard
    if plan.file == 'lines':
        assert not found.configuration.soil_stated
