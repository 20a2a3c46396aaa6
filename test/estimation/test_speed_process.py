# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""How speed goes on between reference velocities."""

import functools
from copy import copy

import numpy as np
import pytest
from parts import SAND, Parts, on_sand

from wheel_terra_estimator.configuration import reader, shipped
from wheel_terra_estimator.estimation.contacts.cycle import RimSpeeds
from wheel_terra_estimator.estimation.contacts.equilibrium_slip import EquilibriumSlip
from wheel_terra_estimator.estimation.filter.speed_process import (
    EQUILIBRIUM_LENGTH,
    SpeedProcess,
    SpeedStep,
)
from wheel_terra_estimator.estimation.filter.state import (
    GRAVITY_BIAS,
    SLIP_PER_DEMAND,
    SPEED,
    Prediction,
)
from wheel_terra_estimator.estimation.inputs.inertial import InertialWindow
from wheel_terra_estimator.estimation.inputs.noise import StatedNoise

NAN = float('nan')


@functools.cache
def driven(ratio):
    """Return a process and a filter after a drive at speed, of which this ratio is remembered."""
    parts = on_sand()
    made = SpeedProcess(parts.configuration, parts.rover, parts.sensors)
    ekf = filter_at(ratio, 1e-2)
    made.end_cycle(0.0, ekf, RimSpeeds((1.0,) * 6, 1.0, 1.0), settled=True)
    return made, ekf


def process(rims, ratio=0.8):
    """Return a process after a cycle at 0 s in which all wheels had these rim speeds."""
    found, ekf = driven(ratio)
    made = copy(found)
    made.end_cycle(0.0, ekf, speeds(rims), settled=False)
    made.state = made.state._replace(settled=True)
    return made


def speeds(rims):
    known = [r for r in rims if r == r] or [NAN]
    return RimSpeeds(tuple(rims), float(np.median(known)), float(np.median(np.abs(known))))


def step(speed, before=0.05, now=0.05, inflation=0.0, window=None, inflated=True):
    made = process([before] * 6)
    made.inflate(inflation)
    found = made.step(0.1, speeds([now] * 6), window or InertialWindow(), inflated=inflated)
    return found.speed_gain * speed + found.constant, found.variance


def noise():
    return process([0.0] * 6).acceleration_noise(StatedNoise())[0] ** 0.5


def filter_at(speed, std=1e-3):
    ekf = on_sand().filter()
    ekf.set(SPEED, speed, std**2)
    return ekf


@pytest.mark.parametrize(
    ('speed', 'rims', 'felt', 'expected'),
    [
        (0.04, (0.05, 0.075), None, 0.06),  # slow, through a ramp
        (0.0, (0.0, 0.02), None, 0.016),  # a restart: the remembered ratio
        (1.0, (1.2, 2.4), 0.05, 1.05),  # fast, wheels spin up: by the accelerometer
    ],
)
def test_a_rover_follows_its_wheels_or_its_accelerometer(speed, rims, felt, expected):
    window = None if felt is None else InertialWindow(speed_change=felt, duration=0.1)
    found, _ = step(speed, *rims, window=window)
    assert found == pytest.approx(expected, abs=1e-9 if felt is None else 0.02)


def test_the_speed_between_two_cycles_is_what_the_step_makes_of_the_last_one():
    """Mean and variance of a linear function of speed and bias, by drawing them."""
    made, window = process([0.05] * 6), InertialWindow(speed_change=0.003, duration=0.1)
    ekf, rims = filter_at(0.04), speeds([0.06] * 6)
    ekf.P[SPEED, GRAVITY_BIAS] = ekf.P[GRAVITY_BIAS, SPEED] = 3e-6
    ekf.x[GRAVITY_BIAS], ekf.P[GRAVITY_BIAS, GRAVITY_BIAS] = 0.1, 1e-4
    assert made.present(ekf, 0.0, rims, window, inflated=True) == (0.04, pytest.approx(1e-6))
    entries = [SPEED, GRAVITY_BIAS]
    drawn = np.random.default_rng(1).multivariate_normal(
        ekf.x[entries], ekf.P[np.ix_(entries, entries)], 50_000
    )
    a, b, constant, noise, _ = made.step(0.1, rims, window, inflated=True)
    mean, variance = made.present(ekf, 0.1, rims, window, inflated=True)
    assert b != 0.0 and mean == pytest.approx(drawn[:, 0].mean() * a + 0.1 * b + constant, rel=1e-3)
    assert variance - noise == pytest.approx(np.var(drawn @ [a, b]), rel=0.02)


def test_wheels_that_are_first_heard_roll_or_spin_or_stand(parts):
    for rim, std in ((0.5, 0.3 * 0.5), (-0.5, 0.3 * 0.5), (0.0, parts.rover.rest_speed)):
        made, ekf = SpeedProcess(parts.configuration, parts.rover, parts.sensors), parts.filter()
        made.begin(ekf, speeds([NAN] * 6))
        made.begin(ekf, speeds([rim] * 6))
        assert ekf.x[SPEED] == pytest.approx(made.state.ratio * rim) and made.state.ratio > 0.5
        assert ekf.P[SPEED, SPEED] == pytest.approx(std**2)
        made.end_cycle(0.0, ekf, speeds([rim] * 6), settled=False)
        ekf.set(SPEED, 0.01, 1e-6)
        made.begin(ekf, speeds([rim] * 6))  # no more than once
        assert ekf.x[SPEED] == 0.01


def test_contacts_under_change_open_the_speed_and_the_accelerometer_bounds_it():
    calm, narrow = step(0.04)
    mean, variance = step(0.04, inflation=0.02)
    assert mean == pytest.approx(calm)
    assert variance == pytest.approx(narrow + 2.0 * 0.02**2 * 0.1)
    window = InertialWindow(speed_change=0.0, duration=0.1)
    assert step(0.04, inflation=0.5, window=window)[1] <= noise() ** 2 * 0.1
    # Without a reference nothing opens it.
    opened, held = (step(0.04, inflation=0.5, inflated=each)[1] for each in (True, False))
    assert held < 1e-3 * opened


def test_wheels_that_disagree_leave_the_speed_to_the_accelerometer():
    """Two wheels spin up, two stand: the mean rim speed says nothing of the body."""
    shaken = 1e-3
    window = InertialWindow(speed_change=0.0, duration=0.1, noise_density=shaken)
    made = process([0.25] * 4)
    together = made.step(0.1, speeds([0.30] * 4), window, inflated=True)
    apart = made.step(0.1, speeds([0.25, 0.25, 0.35, 0.35]), window, inflated=True)
    assert together.speed_gain * 0.1 + together.constant > 0.103
    assert apart.speed_gain * 0.1 + apart.constant == pytest.approx(0.1, abs=0.001)
    assert apart.variance <= shaken * 0.1


@pytest.mark.parametrize(
    ('changes', 'expected'),
    [
        ([0.0, 0.0, 0.0, 0.0, 0.0, 0.3], 0.0),  # one wheel apart
        ([0.2, 0.0, 0.0, 0.2], 0.1),  # two spin up beside two that stand
        ([0.1, 0.1, 0.1, 0.1], 0.0),  # a ramp
        ([NAN, 0.0, 0.2], 0.0),  # too few to tell
    ],
)
def test_disagreement_of_the_wheels(changes, expected, parts):
    made = process([0.3] * len(changes))
    least = 3.0 * parts.sensors.wheel_rate_std * max(parts.rover.slip_radius)
    found = made.disagreement(speeds([0.3 + change for change in changes]))
    assert found == pytest.approx(max(expected - least, 0.0))


def test_a_rover_that_must_pull_more_slips_more_at_once(parts):
    """At a slip per demand of 2, a demand that grows by 0.05 takes a tenth of the rim speed."""
    made, mean = process([0.05] * 6), parts.filter().x.copy()
    mean[[SPEED, SLIP_PER_DEMAND]] = 0.04, 2.0
    ahead, astern = (parts.cycle([rim] * 6, demand_change=0.05) for rim in (0.05, -0.05))
    climbing = Prediction.unchanged(mean)
    made.predict(climbing, SpeedStep(1.0, 0.0, 0.0, 1e-9), ahead)
    assert climbing.mean[SPEED] == pytest.approx(0.04 - 0.1 * 0.05)
    assert climbing.F[SPEED, SLIP_PER_DEMAND] == pytest.approx(-0.05 * 0.05)
    # Backwards the speed is negative, and loses as much of its size.
    mean[SPEED] = -0.04
    back = Prediction.unchanged(mean)
    made.predict(back, SpeedStep(1.0, 0.0, 0.0, 1e-9), astern)
    assert back.mean[SPEED] == pytest.approx(-0.035)
    # A speed that rests on the accelerometer alone is not changed by it.
    alone = Prediction.unchanged(mean)
    made.predict(alone, SpeedStep(1.0, 0.0, 0.0, 1e-9, wheel_weight=0.0), astern)
    assert alone.mean[SPEED] == -0.04


def test_a_reversal_carries_the_slip_over_by_what_is_asked_less():
    """Up a slope of 0.1 the slip is 0.2; down it, at a slip per demand of 1.5, it is -0.1.

    It begins with half of that: ruts and shear form anew.
    """
    made, ekf = process([0.05] * 6, ratio=0.8), on_sand().filter()
    ekf.set(SLIP_PER_DEMAND, 1.5, 0.5**2)
    made.reverse_direction(ekf, before=0.1, now=-0.1)
    assert made.state.ratio == pytest.approx(1.05)
    assert made.state.ratio_std == pytest.approx(np.hypot(0.1, 0.5 * 0.2))
    # Up again, on a steeper slope: as on the way up before, and slip for what is asked more.
    made.reverse_direction(ekf, before=-0.1, now=0.14)
    assert made.state.ratio == pytest.approx(1.0 - 0.5 * (0.2 + 1.5 * 0.04))


def test_a_start_goes_by_the_remembered_ratio_and_not_by_that_of_its_first_moment():
    """Wheels at 10 mm/s and a speed of 3 mm/s, half of it noise: at 50 mm/s the slip is 0.2."""
    made = process([0.01] * 6, ratio=0.8)
    made.end_cycle(0.0, on_sand().filter(), speeds([0.01] * 6), settled=False)
    found = made.step(0.1, speeds([0.05] * 6), InertialWindow(), inflated=True)
    assert found.speed_gain * 0.003 + found.constant == pytest.approx(0.003 + 0.8 * 0.04)


def test_a_rover_that_ends_a_turn_opens_its_speed(parts):
    """Left wheels slow down and right ones speed up over two seconds, each cycle within noise."""
    turning = process([0.07, 0.03] * 3)
    straight = process([0.05, 0.05] * 3)
    for i in range(20):
        sides = [0.07 - 0.001 * i, 0.03 + 0.001 * i] * 3
        turning.follow_sides(speeds(sides), 0.1)
        straight.follow_sides(speeds([0.05 + 0.001 * i] * 6), 0.1)
    # A mean over a second lags a ramp of 10 mm/s^2 by 10 mm/s (1 - exp(-2)) after two of them;
    # what noise may make of it is taken off.
    noise = 3.0 * parts.sensors.wheel_rate_std * max(parts.rover.slip_radius)
    lag = 0.01 * (1.0 - np.exp(-2.0))
    assert turning.state.inflation == pytest.approx(lag - noise, rel=0.1)
    assert straight.state.inflation == 0.0


@pytest.mark.parametrize(
    ('travel', 'digging', 'reference_known', 'walk'),
    [
        (0.0, NAN, True, 0.4),  # a start
        (0.1, NAN, True, 0.4 * np.exp(-0.5)),
        (10.0, NAN, True, 0.1),
        (10.0, 0.0, True, 0.05),
        (10.0, 0.02, True, np.hypot(0.05, 0.24)),
        (10.0, 0.02, False, np.hypot(0.1, 0.24)),
        (10.0, -0.02, True, 0.05),
        (10.0, 0.2, True, np.hypot(0.05, 0.6)),
    ],
)
def test_the_slip_walks_farther_at_a_start_and_where_most_wheels_sink(
    travel, digging, reference_known, walk
):
    made = process([0.05] * 6)
    made.follow_contacts(travel, digging, contradiction=1.0, reference_known=reference_known)
    assert made.state.ratio_walk == pytest.approx(walk)
    made.follow_contacts(travel, digging, contradiction=4.0, reference_known=reference_known)
    assert made.state.ratio_walk == pytest.approx(max(walk, min(2.0 * walk, 0.6)))


def test_in_a_turn_on_the_spot_the_speed_does_not_follow_what_two_sides_leave():
    """They leave 5 mm/s, then 1 mm/s: no reason for the body to slow down to a fifth."""
    made = process([0.105, -0.095] * 3)
    found = made.by_wheels(0.1, speeds([0.101, -0.099] * 3), 0.0)
    assert found.speed_gain == 1.0
    assert found.constant == pytest.approx(-0.8 * 0.004)
    made.end_cycle(0.2, filter_at(0.02), speeds([0.14, -0.06] * 3), settled=True)
    assert made.state.ratio == 0.8


def test_in_a_turn_on_the_spot_the_sides_slip_apart():
    """The slip of each side walks by 0.6 per root metre: the body, their mean, by 0.6 / sqrt(2)."""
    spin, rim, dt = process([0.1, -0.1] * 3), 0.1, 0.2
    variance = spin.by_wheels(dt, speeds([rim, -rim] * 3), 0.0).variance
    assert variance == pytest.approx((0.6 * rim) ** 2 * rim * dt / 2.0, rel=1e-3)


def test_without_a_reference_the_rover_does_not_move_against_its_wheels():
    spin = [0.05, -0.05] * 3
    for rims, speed, kept in (
        ([0.05] * 6, -0.02, 0.0),
        ([0.05] * 6, 0.02, 0.02),
        (spin, -0.02, -0.02),
    ):
        ekf = filter_at(speed)
        process(rims).keep_with_rims(ekf, speeds(rims))
        assert ekf.x[SPEED] == kept


@pytest.mark.parametrize('way', [1.0, -1.0])
def test_without_a_reference_the_rover_is_no_faster_than_a_wheel_that_drives_it(way, parts):
    rims = way * np.array([0.05] * 5 + [0.004])
    drives = 0.5 * np.array(parts.cycle().loads.load) * np.array(parts.rover.slip_radius)
    for torque, std, kept in (
        (drives, 1e-3, 0.004),
        (np.where(np.arange(6) < 5, drives, -drives), 1e-3, 0.04),  # the soil drags it
        (drives, 0.02, 0.04),  # it may stand
        (np.where(np.arange(6) < 5, drives, NAN), 1e-3, 0.04),
    ):
        made, ekf = process(rims), filter_at(way * 0.04, std)
        made.keep_behind_driving_wheels(ekf, parts.cycle(tuple(rims), torque=tuple(way * torque)))
        assert ekf.x[SPEED] == pytest.approx(way * kept)
        assert ekf.P[SPEED, SPEED] == pytest.approx(std**2 if kept == 0.04 else 0.015**2)


def test_without_a_reference_the_ratio_returns_to_the_usual_one_over_travel():
    """As a first-order process in travel: a share of exp(-1) is left after its length."""
    made, rim = process([0.05] * 6), 0.05
    free = SpeedStep(1.0, 0.0, 0.0, 0.0)
    length = EQUILIBRIUM_LENGTH

    def after(travel, buried=False):
        cycle = on_sand().cycle([rim] * 6, dt=travel / rim)
        return made.reversion(cycle, 1.0, length, buried=buried).of(free)

    assert after(length).speed_gain == pytest.approx(np.exp(-1.0))
    usual = after(1e3 * length).constant
    assert 0.5 * rim < usual < rim
    assert after(1e3 * length, buried=True).constant == pytest.approx(0.2 * rim)
    twice = after(0.5 * length)
    gain, constant = twice.speed_gain, twice.constant
    assert gain * constant + constant == pytest.approx(after(length).constant), 'two halves'
    assert (gain**2 + 1.0) * twice.variance == pytest.approx(after(length).variance)


def test_wheel_rates_without_any_slope_leave_the_slip_class_unknown():
    """However far the rover rolls: on an unknown slope any slip may be the usual one."""
    configuration, rim = reader.load(SAND), 0.05
    cycle = Parts(configuration).cycle([rim] * 6, dt=1e4)
    for slope_known in (True, False):
        seen = cycle._replace(loads=cycle.loads._replace(force_known=slope_known))
        reversion = process([rim] * 6).reversion(seen, 1.0, EQUILIBRIUM_LENGTH, buried=False)
        step = reversion.of(SpeedStep(1.0, 0.0, 0.0, 0.0))
        slip_std = np.sqrt(step.variance) / rim
        assert (slip_std < configuration.filter.class_std) == slope_known


def test_without_a_stated_soil_the_usual_slip_is_as_uncertain_as_soils_differ():
    """Beside the slips of the shipped soils at the pull of a slope."""
    rover, rim, demand = 'generic_six_wheel', 0.05, 0.15
    parts = Parts(reader.load([rover]))
    cycle = parts.cycle([rim] * 6, dt=1e4)
    cycle = cycle._replace(loads=cycle.loads._replace(force=(demand, 0.0, 1.0)))
    made = SpeedProcess(parts.configuration, parts.rover, parts.sensors)
    reversion = made.reversion(cycle, 1.0, EQUILIBRIUM_LENGTH, buried=False)
    slips = [
        EquilibriumSlip(reader.load([rover, soil]), parts.rover).at(demand, beyond=0.8)
        for soil in shipped.files()
        if soil.startswith('soils/')
    ]
    assert np.sqrt(reversion.variance) / rim == pytest.approx(np.std(slips), rel=0.15)


def test_wheels_alone_say_nothing_of_the_accelerometers_zero():
    for before in (0.0, 0.05):
        assert process([before] * 6).by_wheels(0.1, speeds([0.06] * 6), 0.0).bias_gain == 0.0


def test_at_rest_the_accelerometer_tells_its_zero(parts):
    """Twenty readings of one constant beside a prior: weighted least squares."""
    zero, cycles, dt = 0.03, 20, 0.1
    made, ekf = process([0.0] * 6), filter_at(0.0, 1e-4)
    prior = float(ekf.P[GRAVITY_BIAS, GRAVITY_BIAS])
    window = InertialWindow(readings=1, speed_change=zero * dt, duration=dt)
    at_rest = parts.cycle((0.0,) * 6, still=True, window=window)
    for _ in range(cycles):
        wheels = made.by_wheels(dt, at_rest.yaw_compensated, 0.0)
        made.learn_bias(ekf, at_rest, wheels, wheels)
    precision = cycles * dt**2 / (noise() ** 2 * dt)
    assert ekf.x[GRAVITY_BIAS] == pytest.approx(zero * precision / (precision + 1 / prior), 1e-3)
    assert ekf.P[GRAVITY_BIAS, GRAVITY_BIAS] == pytest.approx(1 / (precision + 1 / prior), 1e-3)
    assert abs(ekf.x[SPEED]) < 1e-6


def test_noise_of_the_wheel_rates_does_not_stop_a_rover_in_the_filter():
    """Its wheels seem to change speed each cycle, its accelerometer feels nothing."""
    parts, dt = on_sand(), 0.1
    ekf, rng, noise = filter_at(0.045, 0.01), np.random.default_rng(3), 0.005
    window = InertialWindow(readings=1, speed_change=0.0, duration=dt)
    for rims in 0.05 + noise * np.clip(rng.standard_normal((200, 2)), -1.4, 1.4):
        made = process([rims[0]] * 6)
        cycle = parts.cycle((rims[1],) * 6, window=window, rim_noise=(noise,) * 6)
        wheels = made.by_wheels(dt, cycle.yaw_compensated, 0.0)
        made.learn_bias(ekf, cycle, wheels, wheels)
    assert ekf.x[SPEED] == pytest.approx(0.045, abs=0.002)
    assert ekf.P[SPEED, SPEED] == pytest.approx(0.01**2, rel=0.1)
    # Wheels that spin up beyond their noise, and nothing felt: they are not followed.
    made, cycle = process([0.05] * 6), parts.cycle((0.1,) * 6, window=window)
    wheels = made.by_wheels(dt, cycle.yaw_compensated, 0.0)
    made.learn_bias(ekf, cycle, wheels, wheels)
    assert ekf.x[SPEED] < 0.044


def test_wheels_do_not_drive_a_rover_that_moves_against_them():
    made = process([0.05] * 6)
    made.state = made.state._replace(ratio=0.0)
    speed_gain, _, constant, *_ = made.by_wheels(0.1, speeds([0.1] * 6), 0.0)
    assert (speed_gain, constant) == (1.0, 0.0)


def test_a_jolt_is_felt_at_once_and_an_accelerometer_that_jolts_for_long_is_doubted(parts):
    made, ekf, dt = process([0.05] * 6), filter_at(0.04), 0.1

    def weight_of_wheels(change):
        window = InertialWindow(readings=1, speed_change=change, duration=dt)
        cycle = parts.cycle((0.05,) * 6, window=window)
        wheels = made.by_wheels(dt, cycle.yaw_compensated, 0.0)
        lacking = made.learn_bias(ekf, cycle, wheels, wheels)
        wheels = wheels._replace(variance=wheels.variance + lacking)
        return made.combined(wheels, dt, window, lacking).wheel_weight

    assert weight_of_wheels(0.0) > 0.9
    assert weight_of_wheels(0.05) == pytest.approx(0.5, abs=0.02)  # soil or stone: either's fault
    weights = [weight_of_wheels(0.05 * (-1) ** i) for i in range(40)]
    assert min(weights[-10:]) > 0.5


@pytest.mark.parametrize(('turning', 'ratio'), [(False, 0.2), (True, 0.8)])
def test_the_slip_of_a_sharp_turn_is_none_to_start_with(turning, ratio):
    made = process([0.0] * 6)
    made.end_cycle(0.1, filter_at(0.2), speeds([1.0] * 6), settled=True, turning=turning)
    assert made.state.ratio == pytest.approx(ratio)


@pytest.mark.parametrize(
    ('speed', 'kept'),
    [(0.0, False), (0.8 * 0.06 * 0.95, True), (0.8 * 0.06 * 1.05, True), (0.4, True)],
)
def test_a_start_up_transient_is_removed_and_nothing_else(speed, kept):
    """Far from the wheels, by less than the accelerometer's noise: a start-up transient."""
    made, ekf = process([0.06] * 6), filter_at(speed)
    made.remove_start_transient(ekf, on_sand().cycle([0.06] * 6))
    expected = speed if kept else 0.8 * 0.06
    assert ekf.x[SPEED] == pytest.approx(expected)


def test_a_speed_is_known_no_better_than_a_set_of_soil_models():
    ekf = filter_at(0.05, 1e-6)
    process([0.06] * 6).keep_least_variance(ekf, (0.06,) * 6)
    assert np.sqrt(ekf.P[SPEED, SPEED]) == pytest.approx(0.06 * 0.02)


@pytest.mark.parametrize(
    ('rims', 'speed', 'expected'),
    [
        ((0.05, 0.04, NAN), -0.01, True),  # slides back
        ((-0.05, -0.04, -0.05), 0.01, True),
        ((0.05, 0.04, 0.05), 0.01, False),
        ((0.05, -0.05, 0.05), -0.01, False),  # a spin on the spot
        ((NAN, NAN, NAN), -0.01, False),
    ],
)
def test_a_speed_opposes_the_wheels_where_it_opposes_all(rims, speed, expected):
    assert speeds(rims).oppose(speed) is expected
